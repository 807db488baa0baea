"""Arrays in and out, without a file: smoke of your own solver, a picture you computed.

    python examples/arrays.py [ITERATIONS]

With the draft's 250 iterations it takes minutes on two cores.
"""

import sys

import numpy as np

import vnca


def smoke(number: int) -> vnca.Volume:
    """A ball of smoke that rises by a cell a frame and turns.

    Arrays are `[x, y, z]` with z up, velocity is in cells a frame, and cell `(i, j, k)` of the
    array has the index `origin + (i, j, k)`, which `index_to_world` takes to the world.
    """
    x, y, z = np.meshgrid(*[np.arange(24) - 11.5] * 3, indexing="ij")
    density = np.clip(10 - np.sqrt(x**2 + y**2 + z**2), 0, 1).astype(np.float32)
    velocity = np.stack([-0.1 * y, 0.1 * x, np.ones_like(z)], axis=-1).astype(np.float32)
    index_to_world = np.diag([0.1, 0.1, 0.1, 1.0])
    return vnca.Volume(density, velocity, (0, 0, number), index_to_world, frame=number)


def stripes(size: int = 128) -> np.ndarray:
    """A picture, linear RGB `[r, c, 3]` from 0 to 1."""
    rows, columns = np.mgrid[:size, :size]
    wave = 0.5 + 0.5 * np.sin(0.3 * (rows + 4 * np.sin(columns / 9)))
    warm, cold = np.array([0.8, 0.3, 0.05]), np.array([0.02, 0.1, 0.3])
    return (warm * wave[..., None] + cold * (1 - wave[..., None])).astype(np.float32)


def main(iterations: str = "250") -> None:
    """Train on the first frame, paint all, and say what came out."""
    frames = [smoke(number) for number in range(1, 6)]
    model = vnca.train(frames[0], stripes(), iterations=int(iterations))
    for frame in vnca.stylize(model, frames):
        seen = frame.colour[frame.density > 0.1]
        mean = ", ".join(f"{value:.2f}" for value in seen.mean(axis=0))
        print(f"frame {frame.number}: {frame.density.shape} cells, mean colour {mean}")


if __name__ == "__main__":
    main(*sys.argv[1:])
