"""Pictures of scene-linear light, as others write them and as we do."""

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from vnca.core import AnyArray
from vnca.core.errors import BackendUnavailableError, FileFormatError
from vnca.io.picture import read_image, read_style, write_image

DATA = Path(__file__).parents[1] / "data"
LIGHT = np.random.default_rng(0).random((6, 9, 3)).astype(np.float32)
HEADER = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
HDR_LIGHT = np.random.default_rng(0).random((9, 12, 3)).astype(np.float32)


def saved(path: Path, channels: dict[str, AnyArray], **header: Any) -> Path:
    planes = {name: np.ascontiguousarray(plane) for name, plane in channels.items()}
    OpenEXR.File({**HEADER, **header}, planes).write(str(path))
    return path


def layer(before: str = "", light: AnyArray = LIGHT) -> dict[str, AnyArray]:
    return {before + name: light[..., channel] for channel, name in enumerate("RGB")}


def test_the_exr_of_the_field_is_read_as_the_light_it_is() -> None:
    found = read_style(DATA / "paint.exr")
    with OpenEXR.File(str(DATA / "paint.exr")) as file:
        np.testing.assert_array_equal(found, file.channels()["RGB"].pixels)


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("storage", [OpenEXR.scanlineimage, OpenEXR.tiledimage])
@pytest.mark.parametrize("compression", [OpenEXR.NO_COMPRESSION, OpenEXR.PIZ_COMPRESSION])
def test_light_is_neither_encoded_nor_scaled(
    tmp_path: Path, kind: Any, storage: Any, compression: Any
) -> None:
    header: dict[str, Any] = {"type": storage, "compression": compression}
    if storage == OpenEXR.tiledimage:
        header["tiles"] = OpenEXR.TileDescription()
        header["tiles"].xSize = header["tiles"].ySize = 4
    # The content decides, not the name.
    path = saved(tmp_path / "a.png", layer(light=LIGHT.astype(kind)), **header)
    found = read_image(path)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, LIGHT.astype(kind).astype(np.float32))


def test_what_is_brighter_than_white_or_no_number_is_clipped(tmp_path: Path) -> None:
    light = LIGHT.copy()
    light[0, :5, 0] = [7, -1, np.nan, np.inf, -np.inf]
    found = read_image(saved(tmp_path / "a.exr", layer(light=light)))
    assert found[0, :5, 0].tolist() == [1, 0, 0, 1, 0]
    np.testing.assert_array_equal(found[1:], LIGHT[1:])


def test_a_picture_that_is_mostly_glare_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"a\.exr: 100% .* exposure"):
        read_image(saved(tmp_path / "a.exr", layer(light=100 * (LIGHT + 0.1))))


def test_opacity_lets_white_through(tmp_path: Path) -> None:
    alpha = np.linspace(0, 1, 9, dtype=np.float32) * np.ones((6, 1), np.float32)
    path = saved(tmp_path / "a.exr", {**layer(light=LIGHT * alpha[..., None]), "A": alpha})
    np.testing.assert_allclose(
        read_image(path), LIGHT * alpha[..., None] + 1 - alpha[..., None], atol=1e-6
    )
    path = saved(tmp_path / "b.exr", {**layer(light=0 * LIGHT), "A": 0 * alpha})
    with pytest.raises(FileFormatError, match="fully transparent"):
        read_style(path)


def test_grey_is_grey(tmp_path: Path) -> None:
    found = read_image(saved(tmp_path / "a.exr", {"Y": LIGHT[..., 0]}))
    np.testing.assert_array_equal(found, LIGHT[..., :1] * np.ones(3, np.float32))


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        (("", "ViewLayer.Combined."), ""),
        (("ViewLayer.Combined.", "ViewLayer.Emit."), "ViewLayer.Combined."),
        (("beauty.", "diffuse."), "beauty."),
        (("diffuse.",), "diffuse."),
    ],
)
def test_of_several_layers_the_picture_is_read(
    tmp_path: Path, others: tuple[str, ...], expected: str
) -> None:
    channels: dict[str, AnyArray] = {"depth.Z": LIGHT[..., 0], "N.X": LIGHT[..., 0]}
    for before in others:
        channels |= layer(before, LIGHT if before == expected else 0.1 * LIGHT)
    np.testing.assert_array_equal(read_image(saved(tmp_path / "a.exr", channels)), LIGHT)


@pytest.mark.parametrize(
    ("channels", "line"),
    [
        ({**layer("diffuse."), **layer("glossy.")}, r"\(diffuse, glossy\)"),
        ({"Z": LIGHT[..., 0]}, "no flat picture"),
        ({name: np.ones((6, 9), np.uint32) for name in "RGB"}, "no floating-point value"),
    ],
    ids=range(3),
)
def test_a_file_without_a_picture_is_refused(
    tmp_path: Path, channels: dict[str, AnyArray], line: str
) -> None:
    with pytest.raises(FileFormatError, match=line) as refused:
        read_image(saved(tmp_path / "a.exr", channels))
    assert "a.exr" in str(refused.value)


def test_parts_of_a_file_are_layers_too(tmp_path: Path) -> None:
    def part(name: str, channels: dict[str, AnyArray]) -> OpenEXR.Part:
        planes = {each: np.ascontiguousarray(plane) for each, plane in channels.items()}
        return OpenEXR.Part({**HEADER, "name": name}, planes)

    parts = [part("depth", {"Z": LIGHT[..., 0]}), part("colour", layer())]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), LIGHT)


def test_other_primaries_are_converted(tmp_path: Path) -> None:
    acescg = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
    light = np.full((4, 4, 3), 0.5, np.float32)
    light[0] = [0.3, 0.2, 0.1]
    found = read_image(saved(tmp_path / "a.exr", layer(light=light), chromaticities=acescg))
    np.testing.assert_allclose(found[1:], 0.5, atol=1e-5)
    np.testing.assert_allclose(found[0, 0], [0.3788, 0.1880, 0.0823], atol=2e-4)
    with pytest.raises(FileFormatError, match="primaries"):
        read_image(saved(tmp_path / "b.exr", layer(light=light), chromaticities=(0.0,) * 8))


@pytest.mark.parametrize(
    ("display", "rows", "columns"),
    [
        (((0, 0), (8, 5)), slice(0, 6), slice(0, 9)),
        (((2, 1), (5, 3)), slice(1, 4), slice(2, 6)),
        (((-9, -9), (3, 99)), slice(0, 6), slice(0, 4)),
        (((50, 50), (60, 60)), slice(0, 6), slice(0, 9)),
    ],
)
def test_what_lies_outside_the_display_window_is_cut_off(
    tmp_path: Path, display: Any, rows: slice, columns: slice
) -> None:
    window = tuple(np.array(corner, np.int32) for corner in display)
    found = read_image(saved(tmp_path / "a.exr", layer(), displayWindow=window))
    np.testing.assert_array_equal(found, LIGHT[rows, columns])


def test_pixels_that_are_not_square_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="not square"):
        read_image(saved(tmp_path / "a.exr", layer(), pixelAspectRatio=2.0))


def test_bombs_are_refused_before_they_are_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = saved(tmp_path / "a.exr", {**layer(), **layer("b."), **layer("c.")})
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 6 * 9 * 3)
    assert read_image(path).shape == LIGHT.shape
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 6 * 9 * 2)
    with pytest.raises(FileFormatError, match="more than 432; scale it down"):
        read_image(path)
    data = bytearray(path.read_bytes())
    at = data.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    data[at : at + 16] = np.array([0, 0, 2**31 - 2, 2**31 - 2], "<i4").tobytes()
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match=r"a\.exr"):
        read_image(path)


def test_damaged_files_are_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = saved(tmp_path / "a.exr", layer())
    data = path.read_bytes()
    for length in (4, 8, 100, len(data) - 40):
        path.write_bytes(data[:length])
        with pytest.raises(FileFormatError, match=r"a\.exr.*damaged"):
            read_image(path)
    print("still heard")
    assert capfd.readouterr() == ("still heard\n", "")


@pytest.mark.parametrize("channels", [3, 4])
def test_exr_keeps_linear_light_beyond_white(tmp_path: Path, channels: int) -> None:
    image = np.random.default_rng(0).random((6, 9, channels)).astype(np.float32)
    image[0, 0] = 5.0
    image[0, 1, 0] = 1e6
    write_image(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        found = file.channels()["RGBA"[:channels]].pixels
    assert found.shape == image.shape
    image[0, 1, 0] = 65504
    np.testing.assert_allclose(found, image, rtol=1e-3, atol=1e-6)


def test_without_openexr_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(BackendUnavailableError, match=r"vnca\[train\]"):
        write_image(tmp_path / "a.exr", LIGHT)
    with pytest.raises(BackendUnavailableError, match=r"reading .*vnca\[train\]"):
        read_image(DATA / "paint.exr")


def hdr(scale: float = 1, head: bytes = b"") -> bytes:
    """HDR_LIGHT as a Radiance picture, with more lines in its head."""
    _, data = cv2.imencode(".hdr", scale * HDR_LIGHT[..., ::-1])
    start, newline, rest = data.tobytes().partition(b"\n")
    return start + newline + head + rest


def test_light_is_read_as_far_as_the_exponent_lets_it(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(hdr())
    found = read_image(tmp_path / "a.png")
    # Eight bits of the brightest channel are kept.
    assert (np.abs(found - HDR_LIGHT) <= HDR_LIGHT.max(2, keepdims=True) / 128).all()
    (tmp_path / "a.hdr").write_bytes(hdr(3))
    np.testing.assert_allclose(
        read_image(tmp_path / "a.hdr"), np.clip(3 * HDR_LIGHT, 0, 1), atol=0.03
    )


def test_exposures_that_the_file_names_are_taken_back(tmp_path: Path) -> None:
    (tmp_path / "a.hdr").write_bytes(hdr(8, b"EXPOSURE=2.0\nEXPOSURE= 4\n"))
    np.testing.assert_allclose(read_image(tmp_path / "a.hdr"), HDR_LIGHT, atol=0.02)


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
