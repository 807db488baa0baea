import struct
import tracemalloc
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from vnca.colour import linear_to_srgb, luminance, srgb_to_linear
from vnca.errors import (
    FileFormatError,
    OptionError,
    OutputError,
    ShapeError,
)
from vnca.io.image import fit, kind_of, read_image, read_style, resize, to_srgb8, write_image

DATA = Path(__file__).parents[1] / "data"
GREY = float(srgb_to_linear(128 / 255))


def gradient(rows=12, columns=20) -> np.ndarray:
    y, x = np.mgrid[0 : 1 : rows * 1j, 0 : 1 : columns * 1j]
    return np.stack([x, y, 1 - x], axis=-1).astype(np.float32)


@pytest.mark.parametrize(
    ("name", "error"), [("a.png", 0.5), ("a.PNG", 0.5), ("a.jpg", 2), ("a.jpeg", 2), ("a.webp", 3)]
)
def test_a_written_picture_reads_back_the_same(tmp_path, name, error) -> None:
    image = gradient(64, 80)
    write_image(tmp_path / name, image)
    found = read_image(tmp_path / name)
    assert found.dtype == np.float32
    difference = linear_to_srgb(found) - linear_to_srgb(image)
    assert np.abs(difference).mean() * 255 < error


def test_alpha_is_stored_straight_and_read_over_white(tmp_path) -> None:
    image = np.zeros((2, 2, 4), np.float32)
    image[0] = [0.25, 0, 0, 0.5]  # half-transparent red of 0.5
    write_image(tmp_path / "a.png", image)
    stored = np.asarray(Image.open(tmp_path / "a.png"))
    assert stored[0, 0].tolist() == [to_srgb8(0.5), 0, 0, 128]
    assert stored[1, 1].tolist() == [0, 0, 0, 0]
    found = read_image(tmp_path / "a.png")
    assert found[0, 0].tolist() == pytest.approx([0.75, 0.5, 0.5], abs=0.01)
    assert found[1, 1].tolist() == [1, 1, 1]


def test_jpeg_shows_transparent_parts_over_white(tmp_path) -> None:
    write_image(tmp_path / "a.jpg", np.zeros((8, 8, 4), np.float32))
    assert read_image(tmp_path / "a.jpg").min() > 0.99


@pytest.mark.parametrize(
    ("mode", "value", "expected"),
    [
        ("L", 128, [GREY] * 3),
        ("LA", (128, 255), [GREY] * 3),
        ("1", 1, [1, 1, 1]),
        ("RGBA", (255, 0, 0, 0), [1, 1, 1]),
        ("I;16", 128 * 257, [GREY] * 3),
        ("CMYK", (0, 255, 255, 0), [1, 0, 0]),
        ("F", 0.25, [0.25] * 3),
    ],
)
def test_every_kind_of_pixel_becomes_linear_rgb(tmp_path, mode, value, expected) -> None:
    path = tmp_path / ("a.tif" if mode in ("CMYK", "F") else "a.png")
    Image.new(mode, (5, 3), value).save(path)
    image = read_image(path)
    assert image.shape == (3, 5, 3)
    assert image.dtype == np.float32
    assert image[1, 2].tolist() == pytest.approx(expected, abs=1e-3)


def test_palettes_with_a_transparent_entry_are_understood(tmp_path) -> None:
    image = Image.new("P", (2, 1))
    image.putpalette([0, 0, 255, 0, 255, 0])
    image.putpixel((1, 0), 1)
    image.save(tmp_path / "a.gif", transparency=1)
    assert read_image(tmp_path / "a.gif")[0].tolist() == [[0, 0, 1], [1, 1, 1]]


def test_photographs_taken_on_their_side_stand_upright(tmp_path) -> None:
    image = Image.new("RGB", (6, 4))
    image.putpixel((0, 0), (255, 255, 255))
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned a quarter clockwise
    image.save(tmp_path / "a.png", exif=exif)
    upright = read_image(tmp_path / "a.png")
    assert upright.shape == (6, 4, 3)
    assert luminance(upright).argmax() == 3


def test_colour_profiles_are_converted(tmp_path) -> None:
    image = Image.new("RGB", (4, 4), (200, 30, 30))
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    # Exchange the names of two primaries in the table of tags: red is shown by blue.
    foreign = srgb.replace(b"rXYZ", b"????", 1).replace(b"bXYZ", b"rXYZ", 1)
    foreign = foreign.replace(b"????", b"bXYZ", 1)
    for name, profile in [("srgb", srgb), ("foreign", foreign), ("broken", b"no profile")]:
        image.save(tmp_path / f"{name}.png", icc_profile=profile)
    image.save(tmp_path / "plain.png")
    plain = read_image(tmp_path / "plain.png")
    np.testing.assert_allclose(read_image(tmp_path / "srgb.png"), plain, atol=0.01)
    np.testing.assert_allclose(read_image(tmp_path / "foreign.png"), plain[..., ::-1], atol=0.01)
    np.testing.assert_array_equal(read_image(tmp_path / "broken.png"), plain)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "empty"),
        (b"this is a letter, not a painting", "expected a picture"),
    ],
)
def test_what_is_not_a_picture_is_refused_in_one_line(tmp_path, content, message) -> None:
    path = tmp_path / "style.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_image(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_chunk_that_claims_gigabytes_gets_none(tmp_path) -> None:
    Image.new("RGB", (7, 5)).save(tmp_path / "a.png")
    data = bytearray((tmp_path / "a.png").read_bytes())
    struct.pack_into(">I", data, data.index(b"IDAT") - 4, 2**31 - 1)
    (tmp_path / "a.png").write_bytes(data)
    tracemalloc.start()
    assert read_image(tmp_path / "a.png").shape == (5, 7, 3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5e6


def test_formats_that_other_programs_decode_are_refused(tmp_path) -> None:
    Image.new("RGB", (7, 5)).save(tmp_path / "a.eps")
    with pytest.raises(FileFormatError, match="expected a picture"):
        read_image(tmp_path / "a.eps")


def saved(pixels: np.ndarray, format: str, **options: object) -> bytes:
    stream = BytesIO()
    Image.fromarray(pixels).save(stream, format, **options)
    return stream.getvalue()


PIXELS = np.random.default_rng(3).integers(0, 256, (9, 14, 3), dtype=np.uint8)


@pytest.mark.parametrize("format", ["PNG", "TIFF", "BMP", "PPM", "WEBP", "AVIF", "JPEG2000"])
@pytest.mark.parametrize("name", ["a.png", "a.dat"])
def test_the_content_decides_and_not_the_name(tmp_path: Path, format: str, name: str) -> None:
    lossless = {"WEBP": {"lossless": True}, "AVIF": {"quality": 100, "subsampling": "4:4:4"}}
    (tmp_path / name).write_bytes(saved(PIXELS, format, **lossless.get(format, {})))
    found = to_srgb8(read_image(tmp_path / name)).astype(int)
    assert np.abs(found - PIXELS).max() <= (4 if format == "AVIF" else 0)


@pytest.mark.parametrize("rle", [None, "tga_rle"])
def test_targa_pictures_are_known_by_their_end_or_their_name(tmp_path: Path, rle: str) -> None:
    data = saved(PIXELS, "TGA", compression=rle)
    assert data.endswith(b"TRUEVISION-XFILE.\0")
    (tmp_path / "a.png").write_bytes(data)
    (tmp_path / "a.tga").write_bytes(data[:-26])
    (tmp_path / "b.png").write_bytes(data[:-26])
    for name in ("a.png", "a.tga"):
        np.testing.assert_array_equal(to_srgb8(read_image(tmp_path / name)), PIXELS)
    with pytest.raises(FileFormatError, match="found something else"):
        read_image(tmp_path / "b.png")


def test_the_avif_of_the_field_is_read() -> None:
    image = read_image(DATA / "a.avif")
    assert image.shape == (64, 96, 3)
    assert image.std() > 0.1


@pytest.mark.parametrize(
    ("start", "kind"),
    [
        (b"8BPS\0\1", "Photoshop"),
        (b"\0\0\0\x18ftypheic\0\0", "HEIC"),
        (b"\0\0\0\x18ftypavif\0\0", "AVIF"),
        (b"\0\0\0\x20ftypisom", "film"),
        (b"\xff\x0a\xfa", "JPEG XL"),
        (b"PK\3\4\0", "archive"),
        (b"%PDF-1.7", "PDF"),
        (b"<?xml version='1.0'?><svg>", "SVG"),
        (b"\n<!DOCTYPE HTML>", "web page"),
        (b"II*\0", "TIFF"),
        (b"glTF\2\0", "mesh"),
        (b" BDV\0\0", "OpenVDB"),
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "damaged"),
        (b"what", "something else"),
    ],
)
def test_what_was_found_instead_is_named(tmp_path: Path, start: bytes, kind: str) -> None:
    assert kind in kind_of(start)
    (tmp_path / "a.png").write_bytes(start + bytes(40))
    with pytest.raises(FileFormatError, match=f"a.png: .*OpenEXR.*found .*{kind}"):
        read_image(tmp_path / "a.png")


@pytest.mark.parametrize("grey", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("noise", [0, 1])
def test_a_picture_of_a_single_colour_is_no_style(tmp_path: Path, grey: float, noise: int) -> None:
    pixels = np.full((40, 30, 3), int(254 * grey), np.uint8)
    pixels[3, 4] += noise
    Image.fromarray(pixels).save(tmp_path / "a.png")
    assert read_image(tmp_path / "a.png").shape == (40, 30, 3)
    with pytest.raises(FileFormatError, match=r"a\.png.* single colour"):
        read_style(tmp_path / "a.png")
    pixels[3, 4] += 3
    Image.fromarray(pixels).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_style(tmp_path / "a.png"), read_image(tmp_path / "a.png"))


def test_a_transparent_picture_is_no_style(tmp_path: Path) -> None:
    for name in ("alpha0.png", "hidden.png"):
        path = DATA / name
        if name == "hidden.png":  # Colours that nobody sees.
            path = tmp_path / name
            Image.fromarray(np.insert(PIXELS, 3, 0, axis=2)).save(path)
        with pytest.raises(FileFormatError, match=f"{name}.* fully transparent"):
            read_style(path)


@pytest.mark.parametrize("size", [(1, 1), (1, 500), (7, 7)])
def test_a_tiny_picture_is_no_style(tmp_path: Path, size: tuple[int, int]) -> None:
    Image.effect_noise(size, 90).save(tmp_path / "a.png")
    with pytest.raises(FileFormatError, match=f"a.png.* {size[0]}×{size[1]} pixels.* 8×8"):
        read_style(tmp_path / "a.png")


def test_numbers_of_32_bits_stay_in_range(tmp_path: Path) -> None:
    Image.fromarray(np.full((3, 3), 2**20, np.int32)).save(tmp_path / "a.tif")
    assert read_image(tmp_path / "a.tif").max() == 1


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp"])
def test_damaged_pictures_are_refused(tmp_path, name) -> None:
    noise = np.random.default_rng(0).random((64, 64, 3))
    write_image(tmp_path / name, noise)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError, match=r"a\."):
        read_image(tmp_path / name)


def test_decoders_do_not_speak_for_themselves(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(saved(PIXELS, "TIFF", compression="tiff_lzw"))
    with Image.open(BytesIO(data)) as picture:
        (start,), (length,) = picture.tag_v2[273], picture.tag_v2[279]
    data[start : start + length] = b"\xff" * length
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(FileFormatError, match=r"a\.tif"):
        read_image(tmp_path / "a.tif")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("limit", [300, 150])
def test_decompression_bombs_are_refused(tmp_path, monkeypatch, limit) -> None:
    write_image(tmp_path / "a.png", np.zeros((20, 20, 3)))
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", limit)
    with pytest.raises(FileFormatError, match="pixels"):
        read_image(tmp_path / "a.png")


def test_unknown_suffixes_and_arrays_that_are_no_pictures_are_refused(tmp_path) -> None:
    with pytest.raises(OptionError, match=r"\.png"):
        write_image(tmp_path / "a.bmp", gradient())
    for shape in [(4, 4), (4, 4, 2), (0, 4, 3)]:
        with pytest.raises(ShapeError, match="picture"):
            write_image(tmp_path / "a.png", np.zeros(shape))
    assert not list(tmp_path.iterdir())


def test_a_picture_that_cannot_be_written_says_so(tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        write_image(tmp_path / "file" / "a.png", gradient())


def test_light_out_of_range_is_clipped_and_nan_is_black() -> None:
    assert to_srgb8([-1.0, 0, 1, 7, np.nan, np.inf, -np.inf]).tolist() == [
        0, 0, 255, 255, 0, 255, 0,
    ]  # fmt: skip


def test_resizing_averages_light_and_not_codes() -> None:
    stripes = np.zeros((64, 64, 3), np.float32)
    stripes[:, ::2] = 1
    np.testing.assert_allclose(resize(stripes, 8, 8)[2:-2, 2:-2], 0.5, atol=0.02)


def test_resizing_keeps_a_gradient_and_its_range() -> None:
    image = gradient(30, 50)
    np.testing.assert_allclose(resize(image, 60, 100)[::2, ::2], image, atol=0.02)
    edge = np.zeros((16, 16, 3), np.float32)
    edge[:, 8:] = 1
    enlarged = resize(edge, 64, 64)
    assert enlarged.min() == 0
    assert enlarged.max() == 1
    with pytest.raises(OptionError, match="size"):
        resize(image, 0, 4)


@pytest.mark.parametrize(("shape", "fitted"), [((30, 60), (16, 32)), ((60, 30), (32, 16))])
def test_fitting_keeps_proportions(shape, fitted) -> None:
    assert fit(np.zeros((*shape, 3), np.float32), 32, 32).shape == (*fitted, 3)
