from itertools import pairwise

import numpy as np
import pytest
from scipy import ndimage

from vnca import simulation
from vnca.core.errors import BackendUnavailableError, OptionError
from vnca.core.volume import Volume
from vnca.simulation import simulate

RESOLUTION = 20
FRAMES = 24


WALLED = ("plume", "jets", "ring")
"""Scenes in a room with walls, fed by noise."""


@pytest.fixture(scope="module", params=WALLED)
def frames(request: pytest.FixtureRequest) -> list[Volume]:
    return list(simulate(request.param, resolution=RESOLUTION, frames=FRAMES, seed=3))


def test_frames_are_numbered_from_one_and_sized_by_the_resolution(frames: list[Volume]) -> None:
    assert [volume.frame for volume in frames] == list(range(1, FRAMES + 1))
    for volume in frames:
        assert volume.density.shape in {(20, 20, 30), (30, 20, 20)}
        assert volume.origin == (0, 0, 0)
        assert volume.voxel_size == pytest.approx((0.05, 0.05, 0.05))
        assert volume.density.dtype == np.float32
        assert volume.velocity is not None
        assert volume.velocity.dtype == np.float32


def test_smoke_is_there_from_the_first_frame_and_stays_off_the_walls(frames: list[Volume]) -> None:
    for volume in frames:
        density = volume.density
        assert 0.4 < density.max() <= 1
        assert density.min() >= 0
        walls = [density[0], density[-1], density[:, 0], density[:, -1], density[..., -1]]
        assert max(wall.max() for wall in walls) < 0.05
    assert 0.03 < (frames[-1].density > 0.01).mean() < 0.2


def test_a_frame_is_not_changed_by_the_next_one() -> None:
    volumes = simulate("plume", resolution=12, frames=2, seed=0)
    first = next(volumes)
    kept = first.density.copy()
    next(volumes)
    np.testing.assert_array_equal(first.density, kept)


def test_velocity_says_where_the_smoke_goes_next(frames: list[Volume]) -> None:
    # Not at the sources: what flows out of one is replaced at once.
    wide = frames[0].density.shape[0] == 30
    away = np.s_[6:-6] if wide else np.s_[:, :, 4:]
    for now, later in pairwise(frames[14:]):
        assert now.velocity is not None
        source = np.indices(now.density.shape) - np.moveaxis(now.velocity, -1, 0)
        moved = ndimage.map_coordinates(now.density, source, order=1, mode="nearest")
        after = later.density[away].ravel()
        predicted = np.corrcoef(moved[away].ravel(), after)[0, 1]
        still = np.corrcoef(now.density[away].ravel(), after)[0, 1]
        assert 1 - predicted < 0.4 * (1 - still)


@pytest.mark.parametrize("scene", [*WALLED, "sphere", "billowy"])
def test_a_seed_names_one_simulation(scene: str) -> None:
    def last(seed: int) -> Volume:
        return list(simulate(scene, resolution=10, frames=4, seed=seed))[-1]

    one, again, other = last(1), last(1), last(2)
    assert one.density.tobytes() == again.density.tobytes()
    assert one.velocity is not None
    assert again.velocity is not None
    assert one.velocity.tobytes() == again.velocity.tobytes()
    assert np.abs(one.density - other.density).max() > 0.01


@pytest.mark.parametrize(
    ("scene", "resolution", "frames", "seed", "words"),
    [
        ("fire", 16, 1, 0, "plume, jets, ring"),
        ("plume", 4, 1, 0, "resolution: expected at least 8, got 4"),
        ("plume", 16, 0, 0, "frames: expected at least 1, got 0"),
        ("plume", 16, 1, -1, "seed: expected 0 or more"),
    ],
)
def test_impossible_requests_say_what_is_expected(
    scene: str, resolution: int, frames: int, seed: int, words: str
) -> None:
    with pytest.raises(OptionError, match=words):
        simulate(scene, resolution=resolution, frames=frames, seed=seed)


def test_without_scipy_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "find_spec", lambda name: None)
    with pytest.raises(BackendUnavailableError, match=r"pip install 'vnca\[train\]'"):
        simulate("plume", resolution=16, frames=1, seed=0)
