from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import FileFormatError, OptionError
from vnca.io.film import FilmWriter
from vnca.training.config import TextureConfig
from vnca.training.motion_field import motion_asked, motion_field, motion_of_film, with_motion


def film(path: Path, shift: int, count: int = 4) -> Path:
    """Smooth noise that moves up by so many pixels a picture."""
    noise = np.random.default_rng(0).uniform(size=(64, 64))
    spectrum = np.fft.fft2(noise)
    far = np.hypot(*np.meshgrid(np.fft.fftfreq(64), np.fft.fftfreq(64)))
    smooth = np.fft.ifft2(spectrum * np.exp(-((far / 0.08) ** 2))).real
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    with FilmWriter(path, fps=10) as writer:
        for number in range(count):
            grey = np.roll(smooth, -shift * number, 0)
            writer.add(np.repeat(grey[..., None], 3, 2).astype(np.float32))
    return path


@pytest.mark.parametrize("suffix", ["webp", "gif", "mp4"])
def test_the_motion_of_a_film_is_seen(tmp_path: Path, suffix: str) -> None:
    right, up = motion_of_film(film(tmp_path / f"a.{suffix}", 2))[16:-16, 16:-16].mean((0, 1))
    assert up == pytest.approx(2, abs=0.5)
    assert right == pytest.approx(0, abs=0.4)


def test_a_film_without_motion_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"one\.webp: at least two pictures"):
        motion_of_film(film(tmp_path / "one.webp", 0, count=1))
    (tmp_path / "torn.webp").write_bytes(b"RIFF")
    (tmp_path / "torn.mp4").write_bytes(b"no film")
    for name in ("torn.webp", "torn.mp4"):
        with pytest.raises(FileFormatError, match=name):
            motion_of_film(tmp_path / name)


def test_a_field_is_asked_for_by_name_or_file(tmp_path: Path) -> None:
    assert motion_field("circular").vectors is None
    np.save(tmp_path / "wind.npy", np.ones((4, 4, 2)))
    wind = motion_field(str(tmp_path / "wind.npy"))
    assert wind.name == "wind.npy"
    assert wind.vectors is not None
    with pytest.raises(OptionError, match=r"`motion_field` sideways: .*circular.*\.flo.*\.mp4"):
        motion_field("sideways")


def test_only_a_flat_texture_that_learns_to_move_has_a_field() -> None:
    flat = TextureConfig(dimensions=2)
    assert motion_asked(flat, None) is None
    asked = motion_asked(flat, "up")
    assert asked is not None
    assert with_motion(flat, asked).rule.velocity_prior
    with pytest.raises(OptionError, match="add `dimensions` 2"):
        motion_asked(TextureConfig(), "up")
    carried = replace(flat, rule=replace(flat.rule, transport=True))
    with pytest.raises(OptionError, match="leave out `transport`"):
        motion_asked(carried, "up")
    told = replace(flat, rule=replace(flat.rule, velocity_prior=True))
    with pytest.raises(OptionError, match="needs a `motion_field`"):
        motion_asked(told, None)
