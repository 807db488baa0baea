"""A loss term of your own: here, one that keeps the painted colours light.

    python examples/loss_term.py [ITERATIONS]

With the draft's 250 iterations it takes minutes on two cores.
"""

import sys
from importlib.resources import as_file, files

import torch

import vnca


class Lightness(vnca.Term):
    """How far opaque smoke is darker than wanted."""

    name = "lightness"

    def __init__(self, least: float, weight: float) -> None:
        """Want a mean of at least `least`, sRGB from 0 to 1."""
        self.least, self.weight = least, weight

    def __call__(self, seen: vnca.Iteration) -> dict[str, torch.Tensor]:
        """A loss for the curves, and for the gradient."""
        opaque = seen.opacity[:, None] * torch.ones_like(seen.pictures)
        mean = (seen.pictures * opaque).sum() / opaque.sum().clamp_min(1)
        return {"lightness": self.weight * (self.least - mean).clamp_min(0)}


def main(iterations: str = "250", weight: str = "20") -> None:
    """Train on a frame with the term, and say how light its painting is."""
    *_, frame = vnca.simulate("plume", resolution=24, frames=20)
    with as_file(files("vnca.data") / "vangogh_cafe_terrace.webp") as picture:
        model = vnca.train(
            frame,
            picture,
            iterations=int(iterations),
            terms=[Lightness(least=0.7, weight=float(weight))],
        )
    (painted,) = vnca.stylize(model, frame)
    print(f"mean colour: {painted.colour[painted.density > 0.1].mean():.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
