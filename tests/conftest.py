"""What all tests share: one thread, a cache of their own, checked shapes, a little smoke."""

import os
from collections.abc import Iterator

# Before torch is imported. On a busy machine more threads wait for each other.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pytest
import torch
from jaxtyping import config, install_import_hook

from vnca.core.volume import Volume

# Before Triton is imported. Without an NVIDIA GPU its kernels run in its interpreter, on the CPU.
if not torch.cuda.is_available():
    os.environ.setdefault("TRITON_INTERPRET", "1")

# Shapes written in signatures are checked in tests, and only there.
install_import_hook(["vnca.rendering", "vnca.losses", "vnca.features"], "beartype.beartype")


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """One cache of network weights for all tests: not the user's, and filled only once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VNCA_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def unchecked_shapes() -> Iterator[None]:
    """As a user runs it: what is wrong must be refused by the code itself."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.fixture(scope="session")
def tiny_smoke() -> Volume:
    """A ball of smoke in 12³ cells that rises and turns; treat it as read-only."""
    at = np.stack(np.meshgrid(*[np.arange(12) - 5.5] * 3, indexing="ij"), axis=-1)
    distance = np.linalg.norm(at, axis=-1)
    density = np.clip(5.5 - distance, 0, 1).astype(np.float32)
    turning = np.stack([-at[..., 1], at[..., 0], np.full_like(distance, 5)], axis=-1)
    velocity = (0.1 * turning * (density > 0)[..., None]).astype(np.float32)
    index_to_world = np.diag([0.1, 0.1, 0.1, 1.0])
    return Volume(density, velocity, (-3, 4, 7), index_to_world, frame=1)
