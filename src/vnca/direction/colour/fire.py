"""The light of what is hot: colour and strength of a black body.

Reference: Planck 1901; Wyman, Sloan and Shirley 2013 (the eye's response, multi-lobe fit).
"""

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.colour import luminance

WHITE_HOT = 2000.0
"""Kelvin at which a fire of strength 1 is as bright as white paint in full light."""
COOLEST, HOTTEST = 700.0, 12000.0
"""Kelvin below which nothing is seen to glow, and up to which colours are told apart."""
_SECOND_RADIATION = 1.438777e7  # h c / k, nm K
# Wavelength of the peak, its width below and above, nm; height, of x, y and z.
_LOBES = (
    (
        (442.0, 0.0624**-1, 0.0374**-1, 0.362),
        (599.8, 0.0264**-1, 0.0323**-1, 1.056),
        (501.1, 0.0490**-1, 0.0382**-1, -0.065),
    ),
    ((568.8, 0.0213**-1, 0.0247**-1, 0.821), (530.9, 0.0613**-1, 0.0322**-1, 0.286)),
    ((437.0, 0.0845**-1, 0.0278**-1, 1.217), (459.0, 0.0385**-1, 0.0725**-1, 0.681)),
)
_TO_RGB = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def emission(temperature: FloatArray, strength: AnyArray | float = 1.0) -> FloatArray:
    """The light `[n, 3]`, linear RGB, that places of some temperatures give.

    Its brightness grows with the fourth power of the temperature, as all radiation does: that of
    visible light alone grows so fast that a picture shows either embers or flames.

    Args:
        temperature: `[n]`, Kelvin.
        strength: What it is multiplied by.

    Reference: Stefan 1879.
    """
    known = np.linspace(COOLEST, HOTTEST, 256)
    hues = _hue(known)
    shown = np.stack([np.interp(temperature, known, hues[:, axis]) for axis in range(3)], axis=-1)
    bright = strength * (temperature / WHITE_HOT) ** 4 * (temperature >= COOLEST)
    return (shown * bright[..., None]).astype(np.float32)


def _hue(temperature: AnyArray) -> AnyArray:
    """Linear RGB `[k, 3]` of luminance 1."""
    wave = np.arange(380.0, 781.0, 5.0)
    light = wave**-5.0 / np.expm1(_SECOND_RADIATION / (wave * temperature[:, None]))
    seen = [sum(_lobe(wave, *lobe) for lobe in lobes) for lobes in _LOBES]
    rgb = np.maximum(light @ np.stack(seen, axis=-1) @ _TO_RGB.T, 0)
    return rgb / luminance(rgb)[:, None]


def _lobe(wave: AnyArray, peak: float, below: float, above: float, height: float) -> AnyArray:
    width = np.where(wave < peak, below, above)
    return height * np.exp(-0.5 * ((wave - peak) / width) ** 2)
