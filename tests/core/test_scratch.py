"""Numbers out of memory, and files of arrays that are nowhere whole."""

import io
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load

from vnca.core.errors import OutputError
from vnca.core.memory import free_memory, memory_budget, used_memory
from vnca.core.scratch import Scratch
from vnca.core.streamed import Streamed, write_tensors


def test_rows_come_back_in_any_order(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).normal(size=(50, 2, 3)).astype(np.float32)
    scratch = Scratch(tmp_path, (2, 3))
    assert [scratch.append(rows[:20]), scratch.append(rows[20:20]), scratch.append(rows[20:])] == [
        *(0, 20, 20)
    ]
    assert scratch.shape == rows.shape
    for wanted in ([], [3], [0, 1, 2, 48, 49, 7, 6], range(50)):
        np.testing.assert_array_equal(scratch[np.array(wanted, int)], rows[list(wanted)])
    assert list(tmp_path.iterdir()) == []


def test_threads_read_and_add_at_once(tmp_path: Path) -> None:
    """As where a painting's state is kept beside the painting of the next frame."""
    rows = np.arange(4000, dtype=np.float32).reshape(2000, 2)
    scratch = Scratch(tmp_path, (2,))
    scratch.append(rows)

    def work(seed: int) -> None:
        wanted = np.random.default_rng(seed).permutation(len(rows))
        np.testing.assert_array_equal(scratch[wanted], rows[wanted])
        first = scratch.append(rows[wanted])
        np.testing.assert_array_equal(scratch[first + np.arange(len(rows))], rows[wanted])

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(work, range(4)))
    assert len(scratch) == 5 * len(rows)


def test_a_folder_that_cannot_be_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="no room for scratch files"):
        Scratch(tmp_path / "file", (1,))


def test_safetensors_reads_what_comes_in_pieces() -> None:
    values = np.random.default_rng(0).normal(size=(7, 3)).astype(np.float32)
    cells = np.arange(12, dtype=np.int32).reshape(4, 3)
    file = io.BytesIO()
    write_tensors(
        file,
        {
            "values": Streamed(values.dtype, values.shape, iter([values[:2], values[2:]])),
            "cells": Streamed(cells.dtype, cells.shape, iter([cells])),
            "nothing": Streamed(values.dtype, (0, 3), iter([])),
        },
        {"told": "ünïcode"},
    )
    found = load(file.getvalue())
    np.testing.assert_array_equal(found["values"], values)
    np.testing.assert_array_equal(found["cells"], cells)
    assert found["nothing"].shape == (0, 3)


def test_memory_is_told_in_bytes() -> None:
    assert memory_budget("auto") is None
    assert memory_budget("4GB") == 4 * 10**9
    assert used_memory() >= 0
    assert free_memory() > 0
