from itertools import pairwise

import numpy as np
import pytest

from vnca.simulation import Forces, Smoke, advance, apply_forces, project

STILL = Forces(buoyancy=0, confinement=0, dissipation=0, erosion=0, drag=0)


def stirred(shape: tuple[int, int, int] = (12, 9, 15), seed: int = 0) -> Smoke:
    random = np.random.default_rng(seed)
    smoke = Smoke.at_rest(shape)
    smoke.faces = [random.standard_normal(face.shape, np.float32) for face in smoke.faces]
    smoke.density = random.random(shape, np.float32)
    return smoke


def test_projected_air_neither_swells_nor_shrinks() -> None:
    smoke = stirred()
    assert np.abs(smoke.divergence).max() > 1
    project(smoke)
    assert np.abs(smoke.divergence).max() < 1e-5


def test_projection_leaves_a_flow_without_divergence_alone() -> None:
    smoke = stirred()
    project(smoke)
    before = [face.copy() for face in smoke.faces]
    project(smoke)
    for face, expected in zip(smoke.faces, before, strict=True):
        np.testing.assert_allclose(face, expected, atol=1e-5)


def test_nothing_flows_through_floor_and_walls_but_the_ceiling_is_open() -> None:
    smoke = stirred()
    project(smoke)
    for face, axis in ((smoke.faces[0], 0), (smoke.faces[1], 1)):
        assert not np.take(face, [0, -1], axis).any()
    assert not smoke.faces[2][..., 0].any()
    assert smoke.faces[2][..., -1].any()


def test_uniform_flow_carries_a_blob_by_its_velocity_and_keeps_its_mass() -> None:
    smoke = Smoke.at_rest((24, 16, 16))
    x, y, z = np.indices(smoke.density.shape, dtype=np.float32)
    smoke.density = np.exp(-((x - 8) ** 2 + (y - 8) ** 2 + (z - 8) ** 2) / 12).astype(np.float32)
    smoke.faces[0][:] = 0.75
    mass = smoke.density.sum()
    for _ in range(8):
        advance(smoke, STILL)
    assert (x * smoke.density).sum() / smoke.density.sum() == pytest.approx(14, abs=0.1)
    assert (z * smoke.density).sum() / smoke.density.sum() == pytest.approx(8, abs=0.02)
    assert smoke.density.sum() == pytest.approx(mass, rel=5e-3)
    # Semi-Lagrangian advection alone leaves 0.894 of the peak.
    assert smoke.density.max() > 0.93


def test_advection_invents_no_new_extremes() -> None:
    smoke = stirred(seed=1)
    low, high = smoke.density.min(), smoke.density.max()
    for _ in range(3):
        advance(smoke, STILL)
    assert low <= smoke.density.min()
    assert smoke.density.max() <= high


def test_smoke_rises_and_fades() -> None:
    smoke = Smoke.at_rest((12, 12, 18))
    smoke.density[4:8, 4:8, 3:7] = 1
    height = np.arange(18) * smoke.density
    start = height.sum() / smoke.density.sum()
    masses = [smoke.density.sum()]
    forces = Forces(buoyancy=0.1, confinement=0.1, dissipation=0.02)
    for _ in range(8):
        apply_forces(smoke, forces)
        project(smoke)
        advance(smoke, forces)
        masses.append(smoke.density.sum())
    assert (np.arange(18) * smoke.density).sum() / smoke.density.sum() > start + 1
    assert all(later < earlier for earlier, later in pairwise(masses))
    assert masses[-1] > 0.4 * masses[0]


def test_confinement_pushes_around_a_vortex_and_not_in_still_air() -> None:
    smoke = Smoke.at_rest((12, 12, 12))
    apply_forces(smoke, Forces(buoyancy=0, confinement=1))
    assert not any(face.any() for face in smoke.faces)
    centre = np.arange(12, dtype=np.float32) - 5.5
    falloff = np.exp(-(centre[:, None] ** 2 + centre**2) / 8)[..., None]
    spin = np.zeros((12, 12, 12, 3), np.float32)
    spin[..., 0] = -centre[None, :, None] * falloff
    spin[..., 1] = centre[:, None, None] * falloff
    smoke.accelerate(spin)
    before = (smoke.velocity * spin).sum()
    apply_forces(smoke, Forces(buoyancy=0, confinement=0.2))
    assert (smoke.velocity * spin).sum() > 1.01 * before
