"""The styles of the library, on smoke that stays for long."""

from dataclasses import replace

import numpy as np
import pytest

from vnca.core.volume import Volume
from vnca.painting import StylizeConfig, stylize
from vnca.rule.library import load_style, style_names

SIDE, FRAMES = 16, 40
BLACK, WHITE = 1e-4, 0.999
"""Linear colours that count as clamped."""
DARK, BRIGHT = 8, 247
"""Where so much of a picture is as dark, or as bright, 0 or 1 are among its colours: in bytes."""


def ball(density: float, speed: float) -> Volume:
    """Smoke that rises through a ball."""
    at = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), -1) - (SIDE - 1) / 2
    inside = np.clip(SIDE / 2 - 1 - np.linalg.norm(at, axis=-1), 0, 1).astype(np.float32)
    velocity = np.zeros((*inside.shape, 3), np.float32)
    velocity[..., 2] = speed
    return Volume(
        inside * np.float32(density),
        velocity=velocity,
        origin=(0, 0, 0),
        index_to_world=np.eye(4),
        frame=1,
    )


@pytest.mark.parametrize("name", style_names())
def test_a_style_keeps_its_colours_where_smoke_stays(name: str) -> None:
    """A rule that drifts ends up in colours that its picture has not: channels that are 0 or 1."""
    model = load_style(name)
    assert model.style is not None
    darkest, brightest = np.percentile(model.style.reshape(-1, 3), (5, 95), axis=0)
    rule = model.rule
    for denser, faster in ((1, 0), (1, 1), (2, 2)):
        smoke = ball(denser * rule.scales.density, faster * rule.scales.velocity)
        frames = (replace(smoke, frame=at) for at in range(FRAMES))
        *_, last = stylize(frames, rule, StylizeConfig(), box=smoke.box)
        colour = last.colour[smoke.density > rule.scales.density / 2]
        clamped = ((colour <= BLACK) & (darkest > DARK)) | (
            (colour >= WHITE) & (brightest < BRIGHT)
        )
        assert clamped.mean() < 0.1
        assert colour.std(axis=0).max() > 0.01
