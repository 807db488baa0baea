"""Values of cells out of memory."""

from pathlib import Path

import numpy as np
import pytest

from vnca.core import Box
from vnca.engine.domain import Domain
from vnca.painting.tiles.halo import likely_halo
from vnca.painting.tiles.kept import Keeping, Kept


def kept_in(folder: Path, alive: np.ndarray, tile: int) -> tuple[Domain, np.ndarray, Kept]:
    domain = Domain.from_mask(alive, (-3, 5, 2))
    values = np.random.default_rng(1).normal(size=(len(domain), 3)).astype(np.float32)
    keeping = Keeping(folder, 3)
    at = domain.cells // tile
    for corner in np.unique(at, axis=0)[::-1]:
        own = (at == corner).all(axis=1)
        keeping.add(domain.cells[own], values[own])
    return domain, values, keeping.kept()


def test_cells_come_back_as_a_domain_has_them(tmp_path: Path) -> None:
    alive = np.random.default_rng(0).random((20, 17, 30)) < 0.2
    domain, values, kept = kept_in(tmp_path, alive, 8)
    assert len(kept) == len(domain)
    for box in (domain.box, Box((0, 6, 3), (9, 9, 30)), Box((90, 90, 90), (99, 99, 99))):
        inside = ((domain.cells >= box.lower) & (domain.cells < box.upper)).all(axis=1)
        cells, found = kept.within(box)
        np.testing.assert_array_equal(cells, domain.cells[inside])
        np.testing.assert_array_equal(found, values[inside])
        assert kept.holds(box) or not inside.any()
    pieces = list(kept.pieces())
    assert sum(len(cells) for cells, _ in pieces) == len(domain)


def test_a_brick_in_two_pieces_is_refused(tmp_path: Path) -> None:
    keeping = Keeping(tmp_path, 1)
    cells = np.array([[0, 0, 0], [0, 0, 1]], np.int32)
    for cell in cells:
        keeping.add(cell[None], np.zeros((1, 1), np.float32))
    with pytest.raises(ValueError, match="lie apart"):
        keeping.kept()


def test_nothing_is_seen_of_scratch_files(tmp_path: Path) -> None:
    kept_in(tmp_path, np.ones((9, 9, 9), bool), 8)
    assert list(tmp_path.iterdir()) == []


def test_the_halo_is_wider_where_more_steps_are_done(tmp_path: Path) -> None:
    _, _, kept = kept_in(tmp_path, np.ones((64, 64, 64), bool), 64)
    tiles = [Box((-64, 0, 0), (0, 64, 64)), Box((0, 0, 0), (64, 128, 128))]
    assert likely_halo(kept, tiles, 1) == 1
    halos = [likely_halo(kept, tiles, steps) for steps in (4, 24, 64)]
    assert halos[0] < halos[1] <= 24
    assert 4 < halos[2] < 64
    alone = [Box((-64, 0, 0), (64, 128, 128))]
    assert likely_halo(kept, alone, 64) == 64
