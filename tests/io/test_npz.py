import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.lib import format as npy

from vnca.core import AnyArray, Box
from vnca.core.errors import FileFormatError, GridError
from vnca.io import read_smoke, smoke_box
from vnca.io.npz import occupied_box, read_npz_density, read_npz_smoke
from vnca.io.smoke_format import SmokeFormat

SHAPE = (6, 7, 5)  # x, y, z


def mantaflow(folder: Path, density: AnyArray, velocity: AnyArray | None) -> Path:
    """Write arrays `[x, y, z, ...]` as Mantaflow does and give the density's path."""
    for name, array in (("d", density), ("v", velocity)):
        if array is not None:
            (folder / name).mkdir(parents=True, exist_ok=True)
            turned = array.transpose(2, 1, 0, *range(3, array.ndim))
            np.savez_compressed(folder / name / "007.npz", x=turned)
    return folder / "d" / "007.npz"


def blob() -> AnyArray:
    density = np.zeros(SHAPE, np.float32)
    density[2:4, 3:7, 1:3] = np.random.default_rng(0).random((2, 4, 2)) + 0.1
    return density


def test_frames_arrive_upright_over_their_smoke(tmp_path: Path) -> None:
    density = blob()
    x, y, z = np.indices(SHAPE, dtype=np.float32)
    faces = np.stack([x - 0.5, 10 + 2 * (y - 0.5), 20 + 3 * (z - 0.5)], axis=-1)
    path = mantaflow(tmp_path, density, faces)
    volume = read_smoke(path, SmokeFormat(), frame=7)
    # Ours are (z, x, y) of the file.
    assert volume.box == Box((1, 2, 3), (3, 4, 7)) == smoke_box(path, SmokeFormat())
    np.testing.assert_array_equal(volume.density, density[2:4, 3:7, 1:3].transpose(2, 0, 1))
    assert volume.velocity is not None
    centre = volume.velocity[0, 1, 2]  # cell (1, 3, 5) of ours, (3, 5, 1) of the file
    np.testing.assert_allclose(centre, [20 + 3 * 1, 3, 10 + 2 * 5], atol=1e-5)
    np.testing.assert_array_equal(volume.index_to_world @ (1, 3, 5, 1), (1, 3, 5, 1))
    assert volume.frame == 7
    # The last cell has no upper face in the file.
    assert volume.velocity[0, 0, 3].tolist() == pytest.approx([23, 2, 10 + 2 * (6 - 0.5)])


def test_the_up_axis_and_the_faces_can_be_overridden(tmp_path: Path) -> None:
    density, velocity = blob(), np.random.default_rng(1).random((*SHAPE, 3)).astype(np.float32)
    path = mantaflow(tmp_path, density[..., None], velocity)
    volume = read_smoke(path, SmokeFormat(up_axis="z", staggered=False))
    inside = np.s_[2:4, 3:7, 1:3]
    np.testing.assert_array_equal(volume.density, density[inside])
    np.testing.assert_array_equal(volume.velocity, velocity[inside])


def test_velocity_may_be_absent_or_unwanted(tmp_path: Path) -> None:
    assert read_smoke(mantaflow(tmp_path / "a", blob(), None), SmokeFormat()).velocity is None
    path = mantaflow(tmp_path / "b", blob(), np.ones((*SHAPE, 3), np.float32))
    assert read_smoke(path, SmokeFormat(velocity_grid="none")).velocity is None


def test_a_velocity_file_that_is_missing_or_of_another_size_is_named(tmp_path: Path) -> None:
    path = mantaflow(tmp_path, blob(), np.ones((6, 7, 4, 3), np.float32))
    with pytest.raises(GridError, match=r"v/007.npz: velocity of \(6, 7, 4\) cells .* \(6, 7, 5\)"):
        read_npz_smoke(path, SmokeFormat())
    (tmp_path / "v" / "007.npz").unlink()
    with pytest.raises(FileFormatError, match=r"v/007\.npz: no such file"):
        read_npz_smoke(path, SmokeFormat())


def test_a_frame_without_smoke_has_no_cells(tmp_path: Path) -> None:
    empty = np.zeros(SHAPE, np.float32)
    path = mantaflow(tmp_path, empty, np.ones((*SHAPE, 3), np.float32))
    volume = read_smoke(path, SmokeFormat())
    assert volume.density.shape == (0, 0, 0)
    assert volume.box.is_empty
    assert smoke_box(path, SmokeFormat()).is_empty


def test_the_occupied_box_is_tight() -> None:
    density = np.zeros(SHAPE, np.float32)
    density[1, 2, 3] = density[4, 2, 0] = 1
    assert occupied_box(density) == Box((1, 2, 0), (5, 3, 4))


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((3, 3), np.float32), r"expected floats \[z, y, x\].* found float32 \[3, 3\]"),
        (np.zeros((3, 3, 3, 3), np.float32), r"found float32 \[3, 3, 3, 3\]"),
        (np.zeros((3, 3, 3), np.int32), "found int32"),
        (np.zeros((0, 3, 3), np.float32), "empty or too large"),
        (np.array([[[{}]]], dtype=object), "found object"),
    ],
)
def test_other_arrays_are_refused_before_they_are_loaded(
    tmp_path: Path, array: AnyArray, words: str
) -> None:
    path = tmp_path / "007.npz"
    np.savez(path, x=array)
    with pytest.raises(FileFormatError, match=words):
        read_npz_density(path)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((4, 4, 9), "truncated or corrupt: the header promises 576 bytes, there are 256"),
        ((4, 4, 2), "truncated or corrupt"),
        ((4000, 4000, 4000), "64000000000 values is empty or too large"),
        ((2**40, 2**40, 2**40), "too large"),
        ((-4, 4, -4), "empty or too large"),
    ],
)
def test_a_header_that_promises_other_data_allocates_nothing(
    tmp_path: Path, shape: tuple[int, ...], words: str
) -> None:
    member = io.BytesIO()
    header = {"descr": "<f4", "fortran_order": False, "shape": shape}
    npy.write_array_header_1_0(member, header)
    member.write(bytes(4 * 64))
    with zipfile.ZipFile(tmp_path / "007.npz", "w") as archive:
        archive.writestr("x.npy", member.getvalue())
    with pytest.raises(FileFormatError, match=words):
        read_npz_density(tmp_path / "007.npz")


def archive(path: Path, member: bytes, method: int = zipfile.ZIP_DEFLATED) -> None:
    with zipfile.ZipFile(path, "w", method) as file:
        file.writestr("x.npy", member)


@pytest.mark.parametrize(
    "member",
    [
        b"\x93NUMPY\2\0" + b"\xff\xff\xff\x7f" + bytes(100_000_000),  # a header of 2 GB
        b"\x93NUMPY\1\0" + b"\xe8\3" + b"-" * 1000,  # Python's parser runs out of memory
        b"\x93NUMPY\1\0" + b"\x80\0" + b"(" * 128,  # or raises errors of its own
        b"\x93NUMPY\1\0" + b"\x80\0" + b"{'sh\x84ape': (2, 2, 2), }".ljust(128),
        b"\x93NUMPY\3\0" + b"\x80\0\0\0" + bytes(128),
        b"no array",
        b"",
    ],
    ids=range(7),
)
def test_a_header_that_is_none_is_one_clear_error(tmp_path: Path, member: bytes) -> None:
    archive(tmp_path / "007.npz", member)
    tracemalloc.start()
    with pytest.raises(FileFormatError, match=r"007\.npz: not a readable npz file"):
        read_npz_density(tmp_path / "007.npz")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5e6


def test_an_array_that_no_file_so_small_can_hold_is_refused(tmp_path: Path) -> None:
    member = io.BytesIO()
    npy.write_array_header_1_0(
        member, {"descr": "<f4", "fortran_order": False, "shape": (1000, 1000, 1000)}
    )
    told = len(member.getvalue()) + 4 * 10**9
    archive(tmp_path / "007.npz", member.getvalue() + bytes(100))
    data = bytearray((tmp_path / "007.npz").read_bytes())
    struct.pack_into("<I", data, data.index(b"PK\1\2") + 24, told % 2**32)
    (tmp_path / "007.npz").write_bytes(data)
    with pytest.raises(FileFormatError, match="cannot come from a file this small"):
        read_npz_density(tmp_path / "007.npz")


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_packings_that_numpy_does_not_use_are_refused(tmp_path: Path, method: int) -> None:
    archive(tmp_path / "007.npz", b"x", method)
    with pytest.raises(FileFormatError, match="packed otherwise"):
        read_npz_density(tmp_path / "007.npz")


def test_of_very_many_keys_a_few_are_listed(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "007.npz", "w") as file:
        for number in range(100):
            file.writestr(f"{number}.npy", b"")
    with pytest.raises(FileFormatError, match="the file holds 0, 1, 2, 3, 4, 5, 6, 7 and 92 more"):
        read_npz_density(tmp_path / "007.npz")


@pytest.mark.parametrize("cut", [10, 120, 400])
def test_a_truncated_file_is_one_clear_error(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "007.npz"
    np.savez_compressed(path, x=np.random.default_rng(0).random((5, 5, 5)))
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(FileFormatError, match="not a readable npz file"):
        read_npz_density(path)


def test_a_flipped_byte_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "007.npz"
    np.savez_compressed(path, x=np.random.default_rng(0).random((5, 5, 5)))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match="not a readable npz file"):
        read_npz_density(path)


def test_other_keys_are_listed(tmp_path: Path) -> None:
    path = tmp_path / "007.npz"
    np.savez(path, rho=np.zeros(3), vel=np.zeros(3))
    with pytest.raises(FileFormatError, match="no array 'x'; the file holds rho, vel"):
        read_npz_density(path)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e60])
def test_values_that_are_no_numbers_are_counted(tmp_path: Path, bad: float) -> None:
    density = np.ones((3, 3, 3))
    density[1, 1, 1] = bad
    np.savez(tmp_path / "007.npz", x=density)
    with pytest.raises(GridError, match=r"007\.npz: array 'x': 1 of 27 values are NaN, infinite"):
        read_npz_density(tmp_path / "007.npz")
