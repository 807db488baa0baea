from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from vnca.errors import FileFormatError
from vnca.io.image import read_image

LIGHT = np.random.default_rng(0).random((9, 12, 3)).astype(np.float32)


def hdr(scale: float = 1, head: bytes = b"") -> bytes:
    """LIGHT as a Radiance picture, with more lines in its head."""
    _, data = cv2.imencode(".hdr", scale * LIGHT[..., ::-1])
    start, newline, rest = data.tobytes().partition(b"\n")
    return start + newline + head + rest


def test_light_is_read_as_far_as_the_exponent_lets_it(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(hdr())
    found = read_image(tmp_path / "a.png")
    # Eight bits of the brightest channel are kept.
    assert (np.abs(found - LIGHT) <= LIGHT.max(2, keepdims=True) / 128).all()
    (tmp_path / "a.hdr").write_bytes(hdr(3))
    np.testing.assert_allclose(read_image(tmp_path / "a.hdr"), np.clip(3 * LIGHT, 0, 1), atol=0.03)


def test_exposures_that_the_file_names_are_taken_back(tmp_path: Path) -> None:
    (tmp_path / "a.hdr").write_bytes(hdr(8, b"EXPOSURE=2.0\nEXPOSURE= 4\n"))
    np.testing.assert_allclose(read_image(tmp_path / "a.hdr"), LIGHT, atol=0.02)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (b"-Y 9 +X 12", b"+X 9 +Y 12", "turned"),
        (b"rle_rgbe", b"rle_xyze", "XYZ"),
        (b"-Y 9 +X 12", b"none", "damaged"),
        (b"-Y 9 +X 12", b"-Y 99999 +X 99999", "pixels"),
        (b"-Y 9 +X 12", b"-Y 999 +X 12", "damaged"),
        (b"-Y 9 +X 12", b"-Y 9 +X 13", "damaged"),
        (b"\2\2\0\x0c", b"\2\2\0\x0d", "damaged"),
    ],
)
def test_what_cannot_be_read_is_said(tmp_path: Path, old: bytes, new: bytes, line: str) -> None:
    data = hdr()
    assert old in data
    (tmp_path / "a.hdr").write_bytes(data.replace(old, new))
    with pytest.raises(FileFormatError, match=rf"a\.hdr.*{line}"):
        read_image(tmp_path / "a.hdr")


def test_bombs_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.hdr").write_bytes(hdr())
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 107)
    with pytest.raises(FileFormatError, match="more than 107 pixels"):
        read_image(tmp_path / "a.hdr")


@pytest.mark.parametrize("size", [(3, 5), (2, 700), (40, 8)])
def test_it_reads_what_opencv_writes_as_opencv_does(tmp_path: Path, size: tuple[int, int]) -> None:
    light = np.random.default_rng(1).random((*size, 3)).astype(np.float32)
    light[:, : size[1] // 2] = light[0, 0]  # runs
    light[0] = 0
    cv2.imwrite(str(tmp_path / "a.hdr"), light)
    theirs = cv2.imread(str(tmp_path / "a.hdr"), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    assert theirs is not None
    np.testing.assert_array_equal(read_image(tmp_path / "a.hdr"), theirs[..., ::-1])
