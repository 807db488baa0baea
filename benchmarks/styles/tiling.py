"""A picture divided into cells around points, which are [count, 2] in fractions of the side."""

import numpy as np
from fields import Field
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial import KDTree


def nearest(points: Field, where: Field, count: int) -> tuple[Field, NDArray[np.intp]]:
    """Distances and numbers of the points nearest to each place, nearest first: [..., count]."""
    distance, owner = KDTree(points, boxsize=1).query(where, k=count)
    shape = (*where.shape[:-1], count)
    return np.reshape(distance, shape), np.reshape(owner, shape)


def scattered(rng: Generator, count: int, evenness: int = 6) -> Field:
    """Places that keep their distance: [count, 2]."""
    points = rng.random((count, 2))
    samples = rng.random((60 * count, 2))
    for _ in range(evenness):
        points = centred(points, samples, nearest(points, samples, 1)[1][:, 0])
    return points


def centred(points: Field, samples: Field, owner: NDArray[np.intp]) -> Field:
    """Each point moved to the centre of the samples that it owns."""
    away = (samples - points[owner] + 0.5) % 1 - 0.5
    count = np.maximum(np.bincount(owner, minlength=len(points)), 1)
    mean = [np.bincount(owner, away[:, i], len(points)) / count for i in (0, 1)]
    return (points + np.stack(mean, -1)) % 1


def cells(points: Field, x: Field, y: Field) -> tuple[NDArray[np.intp], Field]:
    """The cell of the nearest point, and about how far its border is."""
    distance, owner = nearest(points, np.stack([x % 1, y % 1], -1) % 1, 2)
    a, b = points[owner[..., 0]], points[owner[..., 1]]
    between = np.linalg.norm((a - b + 0.5) % 1 - 0.5, axis=-1)
    border = (distance[..., 1] ** 2 - distance[..., 0] ** 2) / (2 * np.maximum(between, 1e-6))
    return owner[..., 0], border.astype(np.float32)


def squares(points: Field, turn: Field, where: Field) -> tuple[NDArray[np.intp], Field]:
    """Numbers and distances of the nearest two of turned squares, the nearest first: [..., 2]."""
    near = nearest(points, where, 8)[1]
    away = (where[..., None, :] - points[near] + 0.5) % 1 - 0.5
    c, s = np.cos(turn[near]), np.sin(turn[near])
    u, v = c * away[..., 0] + s * away[..., 1], c * away[..., 1] - s * away[..., 0]
    far = np.maximum(np.abs(u), np.abs(v))
    order = np.argsort(far, -1)[..., :2]
    return np.take_along_axis(near, order, -1), np.take_along_axis(far, order, -1)
