"""The library of styles: models that come with the package."""

from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from vnca.core import AnyArray, FloatArray
from vnca.core.errors import OptionError
from vnca.rule.model import Model

SUFFIX = ".safetensors"
THUMBNAIL = ".webp"
"""Of the picture, beside each model, of smoke painted with it."""
_FOLDER = files("vnca.data").joinpath("styles")


def style_names() -> list[str]:
    """The styles that there are, in alphabetical order."""
    names = (file.name for file in _FOLDER.iterdir())
    return sorted(name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX))


def require_style(name: str) -> None:
    """Raise `OptionError` unless there is a style of that name."""
    names = style_names()
    if name not in names:
        raise OptionError(f"`style` {name}: expected one of {', '.join(names)}")


def load_style(name: str) -> Model:
    """A style of the library.

    Raises:
        OptionError: If there is none of that name.
    """
    require_style(name)
    with as_file(_FOLDER.joinpath(name + SUFFIX)) as path:
        return Model.load(path)


def style_or_model(name: str, option: str) -> Model:
    """A style of the library by its name, or else a model by its path.

    Args:
        name: Of the style, the model file or the folder of its run.
        option: Where it is asked for, to say so if there is no such thing.

    Raises:
        OptionError: If there is neither a style nor a file of that name.
        ModelError: If the file is no model.
    """
    styles = style_names()
    if name in styles:
        return load_style(name)
    if not Path(name).exists():
        raise OptionError(
            f"`{option}` {name}: no such file, nor a style of the library ({', '.join(styles)})"
        )
    return Model.load(name)


def style_bytes(name: str) -> bytes:
    """The model file of a style."""
    return _FOLDER.joinpath(name + SUFFIX).read_bytes()


def style_thumbnail(name: str) -> bytes:
    """A picture of smoke painted in a style, the bytes of a WebP file."""
    return _FOLDER.joinpath(name + THUMBNAIL).read_bytes()


def nearest_style(picture: FloatArray) -> str:
    """The style whose picture has the palette most like that of another.

    By the Fréchet distance between the colours of both as normal distributions.

    Args:
        picture: sRGB from 0 to 1, `[r, c, 3]`.
    """
    ours = _palette(picture)
    distances = {}
    for name in style_names():
        style = load_style(name).style
        assert style is not None, "a style of the library has its picture"
        distances[name] = _distance(ours, _palette(style / 255))
    return min(distances, key=lambda name: distances[name])


def _palette(picture: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Mean and covariance of the colours."""
    colours = picture.reshape(-1, 3).astype(np.float64)
    return colours.mean(0), np.cov(colours.T)


def _distance(one: tuple[AnyArray, AnyArray], other: tuple[AnyArray, AnyArray]) -> float:
    """The squared Fréchet distance (Dowson and Landau 1982)."""
    (mean, covariance), (other_mean, other_covariance) = one, other
    # The eigenvalues of a product of two such matrices are real and not negative.
    product = np.linalg.eigvals(covariance @ other_covariance).real.clip(0)
    spread = np.trace(covariance) + np.trace(other_covariance) - 2 * np.sqrt(product).sum()
    return float(((mean - other_mean) ** 2).sum() + spread)
