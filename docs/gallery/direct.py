"""Makes the pictures of docs/guide/direct.md: each control, before and after.

    python docs/gallery/direct.py WORK

Simulates a plume, paints its last frames as each control asks, and puts them beside what was
painted without. What is in the folder WORK already is not made again.
"""

import sys
from pathlib import Path

import numpy as np
import trimesh
from workshop import HERE, made

from vnca.io.picture import read_image, write_image

PICTURES = HERE.parent / "guide" / "direct"
LAST, SIDE = 24, 176
"""Number of the frame that is shown; rows and columns of a picture."""
SMOKE = ("--resolution", 36, "--frames", LAST)
PAINTED = ("--frames", f"{LAST - 3}-{LAST}", "--refine", 2, "--without-film")
SEEN = ("--rows", SIDE, "--columns", SIDE, "--frames", LAST, "--light", 0.9)
GLASS, FROST, LINES, FUR = "stained_glass", "frost", "engraving", "fur"
TWO = "two_styles"
LONG = ("--frames", f"{LAST - 11}-{LAST}")
DATA = HERE.parents[1] / "src" / "vnca" / "data"
LEARNT = DATA / "vangogh_cafe_terrace.webp", DATA / "rust.webp"
"""The pictures of a rule of two styles."""
CONTROLS: dict[str, tuple[str, tuple[object, ...]]] = {
    "strength": (GLASS, ("--strength", 0.4)),
    "mask": (GLASS, ("--strength", "sphere(0.5,0.2,0.35, 0.2, soft=0.15)")),
    "ramp": (GLASS, ("--strength", "smooth height:0.2..0.6")),
    "speed": (GLASS, ("--strength", "speed:0..0.6")),
    "picture": (GLASS, ("--strength", 'picture("{work}/stripes.png")')),
    "mesh": (GLASS, ("--strength", 'mesh("{work}/ring.obj", soft=0.05)')),
    "advected": (GLASS, ("--strength", "advected(smooth x:0.4..0.6)")),
    "density_strength": (GLASS, ("--density-strength", 0)),
    "steps_per_frame": (GLASS, ("--steps-per-frame", 2)),
    "pattern_speed": (LINES, (*LONG, "--pattern-speed", 0)),
    "style_mix": (TWO, ("--style-mix", "rust=smooth x:0.4..0.6")),
    "style_half": (TWO, ("--style-mix", "rust=0.5")),
    "guide": (LINES, ("--guide", "z")),
    "pattern_size": (LINES, ("--pattern-size", 2)),
    "blend": (FUR, ("--blend", "engraving=0.5")),
    "layers": (GLASS, ("--layers", "frost=smooth x:0.4..0.6")),
    "hue": (GLASS, ("--hue", 140)),
    "saturation": (GLASS, ("--saturation", 0.3)),
    "lightness": (GLASS, ("--lightness", 0.2)),
    "exposure": (GLASS, ("--exposure", 1)),
    "recolour": (FROST, ("--recolour", "1=#b03a2e", "2=#4a1410")),
    "match": (FROST, ("--match", "{here}/smoke/harvest.webp")),
    "silhouette": (GLASS, ("--silhouette", "keep")),
    "edge": (GLASS, ("--edge", -1)),
    "fluff": (GLASS, ("--edge", 1)),
    "fire": (GLASS, ("--fire", "height:0..0.7->2200..900")),
}
"""The style, and the options of each."""
BEFORE: dict[str, tuple[object, ...]] = {"pattern_speed": LONG}
"""Options of both pictures, not of the second alone."""
THIN = ("--gamma", 0.4)
SHOWN: dict[str, tuple[object, ...]] = {"density_strength": THIN, "silhouette": THIN}
"""How both pictures are filmed where not as all others: density is seen in thin smoke."""


def main(folder: str) -> None:
    """Make what is missing."""
    work = Path(folder)
    for sub in (work, PICTURES):
        sub.mkdir(parents=True, exist_ok=True)
    made(
        work / "smoke" / f"plume_{LAST:04d}.vdb", "simulate", "plume", "-o", work / "smoke", *SMOKE
    )
    frame = work / "smoke" / f"plume_{LAST - 4:04d}.vdb"
    made(work / TWO / "model.safetensors", "train", frame, *LEARNT, "--out", work / TWO)
    stripes = np.zeros((64, 64, 3), np.float32)
    stripes[(np.add.outer(np.arange(64), np.arange(64)) // 8) % 2 == 0] = 1
    write_image(work / "stripes.png", stripes)
    ring = trimesh.creation.torus(0.22, 0.09)
    ring.apply_translation([0.5, 0.5, 0.4])
    ring.vertices = ring.vertices[:, [0, 2, 1]] * [1, 1, -1]  # OBJ files have y up
    ring.export(work / "ring.obj")
    for name, (style, options) in CONTROLS.items():
        filled = [str(each).format(work=work, here=HERE) for each in options]
        shown = SHOWN.get(name, ())
        light = ("--colour-grid", "emission", "--light", 0) if name == "fire" else shown
        both = BEFORE.get(name, ())
        before = seen(style, work, f"before_{name}" if both else "plain", *both, shown=shown)
        after = seen(style, work, name, *filled, shown=light)
        gap = np.ones((SIDE, 4, 3), np.float32)
        sides = [read_image(before), gap, read_image(after)]
        write_image(PICTURES / f"{name}.webp", np.concatenate(sides, axis=1))


def seen(
    style: str, work: Path, name: str = "plain", *options: object, shown: tuple[object, ...] = ()
) -> Path:
    """A picture of the last frame as some options have it."""
    out = work / f"{style}_{name}"
    picture = work / f"{out.name}{'_thin' * (shown == THIN)}.png"
    last = out / "painted" / f"plume_{LAST:04d}.vdb"
    rule = (work / TWO,) if style == TWO else ("--style", style)
    made(last, "paint", work / "smoke", *rule, "-o", out, *PAINTED, *options)
    # What is given later wins.
    return made(picture, "render", out / "painted", "-o", picture, *SEEN, *shown)


if __name__ == "__main__":
    main(*sys.argv[1:])
