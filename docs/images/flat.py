"""Makes `flat.webp`: a picture, a flat texture learnt from it, and how that moves along fields.

    python docs/images/flat.py OUT PICTURE RUN FIELD [FIELD ...]

RUN is of `vnca texture train PICTURE --dimensions 2 --motion-field …`. OUT is a film: the picture,
at the size at which it was shown to the rule, and the texture in each FIELD. For each
field it tells how far the motion that optical flow sees is from what was asked: of the direction,
the mean cosine distance (0 is right, 1 is any, 2 is opposite), and the speed over that asked.
"""

import sys
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from vnca.core import FloatArray
from vnca.features.flow import FlowNetwork
from vnca.io.film import FilmWriter, contact_sheet
from vnca.io.picture import read_style, resize
from vnca.losses import compare_motion, luma
from vnca.painting.flat import grow_flat, picture
from vnca.rendering.colour import linear_to_srgb
from vnca.rule.model import Model
from vnca.training.motion_field import motion_field

CELLS = 40
"""Columns and rows of the texture."""
PIXELS = 4
"""A cell."""
FRAMES, WARM_UP = 12, 96
"""Pictures of the film, and steps before the first."""


def main(out: str, style: str, run: str, *fields: str) -> None:
    """Grow, tell, and write the film."""
    model = Model.load(Path(run))
    rule, pause = model.rule, model.rule.config.steps_per_frame
    films = []
    for name in fields:
        velocity = motion_field(name).velocity(CELLS, CELLS, rule.scales.velocity)
        layers = grow_flat(rule, CELLS, CELLS, steps=WARM_UP, pause=pause, velocity=velocity)
        films.append([picture(layer, PIXELS) for layer in islice(layers, FRAMES)])
        print(name, *told(films[-1], velocity))
    shown = exemplar(read_style(Path(style)), model)
    with FilmWriter(Path(out), fps=12) as film:
        for at in range(FRAMES):
            film.add(contact_sheet([[shown, *(each[at] for each in films)]]))


def exemplar(style: FloatArray, model: Model) -> FloatArray:
    """The picture as large as the rule was shown it, as much of it as fits."""
    rows, columns = style.shape[:2]
    factor = float(model.training["picture_cells"]) * PIXELS / min(rows, columns)
    larger = resize(style, max(1, round(rows * factor)), max(1, round(columns * factor)))
    return np.clip(larger[: CELLS * PIXELS, : CELLS * PIXELS], 0, 1)


@torch.no_grad()
def told(frames: list[FloatArray], velocity: FloatArray) -> tuple[str, str]:
    """How far the motion seen in a film is from what was asked."""
    network = FlowNetwork.load()
    stack = torch.from_numpy(np.stack(frames)).permute(0, 3, 1, 2)
    grey = luma(linear_to_srgb(stack))[:, 0]
    seen = network(grey[:-1], grey[1:]).mean(0).permute(1, 2, 0)
    asked = np.repeat(np.repeat(velocity[:, 0, ::-1, ::2], PIXELS, 0), PIXELS, 1)
    target = torch.from_numpy(np.ascontiguousarray(asked.transpose(1, 0, 2)))
    target = target * torch.tensor([PIXELS, -PIXELS])
    moving = target.norm(dim=-1) > 0.25 * target.norm(dim=-1).max()
    direction = float(compare_motion(seen, target, moving).direction)
    speed = float(seen[moving].norm(dim=-1).mean() / target[moving].norm(dim=-1).mean())
    return f"direction {direction:.3f}", f"speed {speed:.2f}"


if __name__ == "__main__":
    main(*sys.argv[1:])
