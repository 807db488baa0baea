import numpy as np

from vnca.core import Box
from vnca.metrics.setup import Coloured, Setup, Viewpoint


def test_cells_finer_than_pixels_are_averaged() -> None:
    """A wall of random grey cells, each of which should count in the pixel that shows it."""
    random = np.random.default_rng(0)
    wall = np.ones((64, 3, 64), np.float32)
    colour = np.repeat(random.random((*wall.shape, 1), np.float32), 3, axis=-1)
    smoke, front = Coloured(wall, colour, (0, 0, 0)), Viewpoint(0.0, 0.0)

    def seen(size: int) -> np.ndarray:
        return Setup(Box((0, 0, 0), wall.shape), 9.0, size).look(smoke, front).colour[..., 0]

    exact = seen(120).reshape(24, 5, 24, 5).mean((1, 3))
    single = seen(120)[2::5, 2::5]
    inside = slice(4, -4)
    apart = [np.abs(some - exact)[inside, inside].mean() for some in (seen(24), single)]
    assert apart[0] < 0.25 * apart[1]
