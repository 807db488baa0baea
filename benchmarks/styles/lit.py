"""Whether a style is still seen in thin smoke, lit, in Cycles.

    python benchmarks/styles/lit.py PYTHON_WITH_BPY SMOKE PICTURES OUT [OPTIONS] STYLE [STYLE ...]

Paints the last of some frames, renders it in Cycles from several sides at γ and at γ/16, lit by a
sun to the left of the camera, with the material of the extension for Blender; and prints the
normalised style score of both, where the smoke is opaque in both. 0 is the same smoke in grey,
rendered alike. Beside them the score of our own view without light, on the same pixels. OUT has
the sheet: our view, Cycles at γ and at γ/16, from each side.

Pictures of Cycles are exposed so that they are as bright on average as our view. "One exposure":
those at γ/16 as those at γ.
"""

import argparse
import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from measure import add_models, add_smoke, picture, read_as, trained

import vnca
from vnca.core import AnyArray, BoolArray
from vnca.core.camera import view_axes
from vnca.core.colour import luminance
from vnca.core.volume import Volume
from vnca.io import SmokeFormat, read_smoke
from vnca.io.painted import read_colour
from vnca.io.picture import read_image
from vnca.io.provenance import read_provenance
from vnca.io.smoke_format import NO_VELOCITY
from vnca.metrics.setup import OPAQUE, Coloured, Pair, Seen, Setup, Viewpoint
from vnca.metrics.style import StyleMetric
from vnca.metrics.style_score import score_style
from vnca.rule.model import Model
from vnca.training.scenes.smoke import smoke_bounds

CYCLES = Path(__file__).with_name("in_cycles.py")
THIN = 1 / 16
"""Of γ."""
SUN, AMBIENT = (-55.0, 40.0), 0.15
"""Degrees to the right of the camera and above its horizon; share of light from everywhere."""
PLAIN = SmokeFormat(velocity_grid=NO_VELOCITY)


@dataclass(frozen=True, eq=False)
class Scene:
    """A painted frame, and from where it is seen.

    Attributes:
        path: Its file.
        smoke: Its density.
        colour: Linear RGB `[x, y, z, 3]`.
        extinction: Of density 1, per length of the world.
        setup: How it is looked at.
        sides: From where.
    """

    path: Path
    smoke: Volume
    colour: AnyArray
    extinction: float
    setup: Setup
    sides: list[Viewpoint]

    @classmethod
    def of(cls, path: Path, model: Model, sides: list[Viewpoint]) -> "Scene":
        """That of a painted file."""
        smoke, told = read_smoke(path, PLAIN), read_provenance(path)
        colour = read_colour(path, PLAIN, grid="Cd", box=smoke.box)
        assert told is not None, f"{path} was painted"
        assert colour is not None, f"{path} was painted"
        box = smoke_bounds(smoke, model.rule.scales.density)
        setup = Setup(box, told.extinction * smoke.cell_length)
        return cls(path, smoke, colour, told.extinction, setup, sides)

    def ours(self) -> list[Pair]:
        """Our views, painted and plain."""
        painted = Coloured(self.smoke.density, self.colour, self.smoke.origin)
        plain = Coloured.plain(self.smoke)
        return [self.setup.look_twice(painted, plain, side) for side in self.sides]

    def cycles(self, python: str, samples: int) -> dict[tuple[bool, float], list[AnyArray]]:
        """What Cycles renders, linear RGBA, by whether it is grey and by the part of γ."""
        files, views = {}, []
        for grey in (False, True):
            for part in (1.0, THIN):
                files[grey, part] = []
                for side in self.sides:
                    out = self.path.with_name(f"{self.path.stem}_{len(views)}.npy")
                    files[grey, part].append(out)
                    views.append(self._view(side, part) | {"grey": grey, "out": str(out)})
        request = self.path.with_suffix(".json")
        request.write_text(
            json.dumps(
                {
                    "volume": str(self.path),
                    "views": views,
                    "size": self.setup.size,
                    "samples": samples,
                    "towards_sun": SUN,
                    "ambient": AMBIENT,
                }
            )
        )
        subprocess.run([python, str(CYCLES), str(request)], check=True, stdout=subprocess.DEVNULL)
        return {key: [np.load(path) for path in paths] for key, paths in files.items()}

    def _view(self, side: Viewpoint, part: float) -> dict[str, Any]:
        camera = self.setup.camera(side)
        middle = self.smoke.index_to_world @ [*camera.target, 1]
        return {
            "axes": [axis.tolist() for axis in view_axes(*side)],
            "middle": middle[:3].tolist(),
            "height": camera.height * self.smoke.cell_length,
            "extinction": self.extinction * part,
        }


def main() -> None:
    """Print a row for each style, and make a sheet of them."""
    asked = _asked()
    asked.out.mkdir(parents=True, exist_ok=True)
    print("| style | our view | lit, γ | lit, γ/16 | of that at γ | one exposure | pixels |")
    print("|---" * 7 + "|")
    rows = []
    for name in asked.styles:
        row, shown = judged(name, asked)
        print("| " + " | ".join((name.replace("_", " "), *row)) + " |", flush=True)
        rows.append(shown)
        vnca.write_image(asked.out / "sheet.png", np.concatenate(rows))


def judged(name: str, asked: argparse.Namespace) -> tuple[list[str], AnyArray]:
    """Cells of a row, and a row of pictures."""
    model = trained(name, asked.models)
    *_, last = vnca.stylize(
        model,
        asked.smoke,
        out=asked.out / name,
        frames=asked.frames,
        refine=asked.refine,
        overwrite=True,
        **read_as(asked),
    )
    sides = [Viewpoint(360 * at / asked.sides, 10.0) for at in range(asked.sides)]
    scene = Scene.of(last.path, model, sides)
    # A decoder leaves cells, and what is drawn in them, as large as they are.
    cell = asked.refine if model.rule.decoder is not None else 1
    pixels = round(model.training["picture_cells"] * scene.setup.scale * cell)
    file = picture(str(model.training["style"]), asked.pictures)
    metric = StyleMetric(read_image(file), pixels)
    ours, seen = scene.ours(), scene.cycles(asked.bpy, asked.samples)
    where = [
        pair.where & np.logical_and.reduce([some[at][..., 3] > OPAQUE for some in seen.values()])
        for at, pair in enumerate(ours)
    ]

    def score(painted: list[AnyArray], plain: list[AnyArray]) -> float:
        pairs = [
            Pair(side, *(_within(picture, mask) for picture in pictures))
            for side, mask, *pictures in zip(sides, where, painted, plain, strict=True)
        ]
        found = score_style(metric, pairs)
        assert found is not None, f"{name}: opaque nowhere at {THIN:g} of its γ"
        return found.normalised_score

    painted = [pair.painted.over(metric.background) for pair in ours]
    plain = [pair.plain.over(metric.background) for pair in ours]
    exposure = {
        key: _brightness(plain if key[0] else painted, where)
        / _brightness([_over(view, metric.background) for view in some], where)
        for key, some in seen.items()
    }

    def exposed(grey: bool, part: float, exposed_as: float) -> list[AnyArray]:
        factor = exposure[grey, exposed_as]
        return [factor * _over(view, metric.background) for view in seen[grey, part]]

    thick, thin, fixed = (
        score(*(exposed(grey, part, as_at) for grey in (False, True)))
        for part, as_at in ((1.0, 1.0), (THIN, THIN), (THIN, 1.0))
    )
    cells = [score(painted, plain), thick, thin, thin / thick, fixed]
    rows = [[pair.painted.over([0.01] * 3) for pair in ours]]
    for part in (1.0, THIN):
        light = exposure[False, part]
        rows.append([_over(view * [light, light, light, 1], 0.01) for view in seen[False, part]])
    row = [f"{value:.2f}" for value in cells]
    return [*row, str(sum(int(mask.sum()) for mask in where))], np.concatenate(
        [np.concatenate(views, axis=1) for views in rows], axis=1
    )


def _within(view: AnyArray, where: BoolArray) -> Seen:
    """A picture of which just some pixels count."""
    opacity = where.astype(np.float32)
    return Seen(view * opacity[..., None], opacity, np.where(where, 0, np.inf))


def _over(view: AnyArray, background: AnyArray | float) -> AnyArray:
    """Linear RGBA with premultiplied colours before a colour."""
    return (view[..., :3] + (1 - view[..., 3:]) * background).astype(np.float32)


def _brightness(views: list[AnyArray], where: list[BoolArray]) -> float:
    """Mean luminance of the pixels that count."""
    return float(
        np.concatenate([luminance(v)[w] for v, w in zip(views, where, strict=True)]).mean()
    )


def _asked() -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bpy", help="a Python with the package bpy")
    add_smoke(parser, frames="40-45", refine=2)
    parser.add_argument("out", type=Path)
    parser.add_argument("styles", nargs="+")
    add_models(parser)
    parser.add_argument("--sides", type=int, default=4)
    parser.add_argument("--samples", type=int, default=64)
    return parser.parse_args()


if __name__ == "__main__":
    main()
