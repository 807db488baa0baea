"""A custom conditioning field: cells are told how hot the smoke is, and paint by it.

    python examples/conditioning_field.py [ITERATIONS]

With the draft's 250 iterations it takes minutes on two cores. For files there is no array to make:
`fields=("temperature",)` reads the grid of that name beside density and velocity.
"""

import sys
from importlib.resources import as_file, files

import numpy as np

import vnca

TEMPERATURE = vnca.Conditioning.of_field("temperature", scale=1000.0)
"""One number a cell; 1,000 kelvin count as 1."""


def smoke(number: int, hottest: float) -> vnca.Volume:
    """A ball of smoke that rises by a cell a frame, hot in the middle; arrays are `[x, y, z]`."""
    x, y, z = np.meshgrid(*[np.arange(24) - 11.5] * 3, indexing="ij")
    distance = np.sqrt(x**2 + y**2 + z**2)
    density = np.clip(10 - distance, 0, 1).astype(np.float32)
    velocity = np.stack([-0.1 * y, 0.1 * x, np.ones_like(z)], axis=-1).astype(np.float32)
    kelvin = (hottest * np.exp(-((distance / 8) ** 2)) * (density > 0)).astype(np.float32)
    return vnca.Volume(
        density,
        velocity,
        origin=(0, 0, number),
        index_to_world=np.diag([0.1, 0.1, 0.1, 1.0]),
        frame=number,
        fields={"temperature": kelvin},
    )


def main(iterations: str = "250") -> None:
    """Train on hot smoke, then paint it hot and cold."""
    vnca.register_conditioning(TEMPERATURE)
    with as_file(files("vnca.data") / "rust.webp") as picture:
        model = vnca.train(
            smoke(1, hottest=1500.0),
            picture,
            iterations=int(iterations),
            rule={"conditioning": ("density", "velocity", "temperature")},
        )
    for hottest in (1500.0, 0.0):
        frames = [smoke(number, hottest) for number in range(1, 4)]
        for frame in vnca.stylize(model, frames):
            seen = frame.colour[frame.density > 0.1]
            mean = ", ".join(f"{value:.2f}" for value in seen.mean(axis=0))
            print(f"at {hottest:.0f} K, frame {frame.number}: mean colour {mean}")


if __name__ == "__main__":
    main(*sys.argv[1:])
