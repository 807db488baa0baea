"""The styles that come with the package."""

import io

import numpy as np
import pytest
from PIL import Image

from vnca.core.errors import OptionError
from vnca.rule.library import load_style, nearest_style, style_names, style_thumbnail

MOST_BYTES = 100_000


def test_there_are_ten() -> None:
    names = style_names()
    assert len(names) >= 10
    assert names == sorted(names)


@pytest.mark.parametrize("name", style_names())
def test_a_style_can_paint_any_smoke_and_tells_what_it_learned_from(name: str) -> None:
    model = load_style(name)
    assert model.rule.decoder is not None
    assert not model.rule.config.position_prior
    assert model.rule.place is None
    assert model.training["title"]
    assert not {"frame", "smoke", "device"} & model.training.keys()
    assert model.style is not None
    with Image.open(io.BytesIO(style_thumbnail(name))) as painted:
        seen = np.asarray(painted.convert("RGB"))
    assert seen.shape == (160, 160, 3)
    assert seen.std() > 10


def test_a_style_is_small(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("style") / "model.safetensors"
    for name in style_names():
        load_style(name).save(path)
        assert path.stat().st_size < MOST_BYTES


def test_the_nearest_style_to_the_picture_of_one_is_that() -> None:
    for name in ("church", "embers", "stained_glass"):
        style = load_style(name).style
        assert style is not None
        assert nearest_style(style[::2, ::2] / np.float32(255)) == name


def test_other_styles_are_refused() -> None:
    with pytest.raises(OptionError, match="`style` velvet: expected one of cafe, church"):
        load_style("velvet")
