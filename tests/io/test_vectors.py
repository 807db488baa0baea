from pathlib import Path

import numpy as np
import pytest

from vnca.core.errors import FileFormatError
from vnca.io.linear_picture import write_exr
from vnca.io.vectors import read_vectors


def flo(path: Path, vectors: np.ndarray, head: float = 202021.25) -> Path:
    rows, columns, _ = vectors.shape
    with path.open("wb") as file:
        np.array([head], "<f4").tofile(file)
        np.array([columns, rows], "<i4").tofile(file)
        vectors.astype("<f4").tofile(file)
    return path


def test_flo_goes_down_and_does_not_know_everything(tmp_path: Path) -> None:
    vectors = np.zeros((3, 5, 2))
    vectors[0, 1] = 1, -2
    vectors[2, 2] = 1e10, 1e10
    found = read_vectors(flo(tmp_path / "a.flo", vectors))
    assert found.shape == (3, 5, 2)
    assert found[0, 1].tolist() == [1, 2]
    assert not found[2].any()


def test_numpy_and_exr_hold_right_and_up(tmp_path: Path) -> None:
    vectors = np.random.default_rng(0).normal(size=(4, 6, 2)).astype(np.float16)
    np.save(tmp_path / "a.npy", vectors)
    write_exr(tmp_path / "a.exr", np.concatenate([vectors, 0 * vectors[..., :1]], -1))
    for name in ("a.npy", "a.exr"):
        np.testing.assert_array_equal(read_vectors(tmp_path / name), vectors)


def test_what_is_no_field_is_refused_by_name(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.zeros((4, 4)))
    np.save(tmp_path / "nan.npy", np.full((4, 4, 2), np.nan))
    (tmp_path / "torn.npy").write_bytes(b"\x93NUMPY")
    flo(tmp_path / "other.flo", np.zeros((4, 4, 2)), head=1.0)
    short = flo(tmp_path / "short.flo", np.zeros((4, 4, 2)))
    short.write_bytes(short.read_bytes()[:-4])
    for name in ("flat.npy", "nan.npy", "torn.npy", "other.flo", "short.flo", "no.npy", "a.txt"):
        with pytest.raises(FileFormatError, match=name):
            read_vectors(tmp_path / name)
