"""What the tests of the page are given: sites, hostile ones too, and what vnca itself paints.

python web/tests/material.py build/browser
"""

import json
import struct
import sys
import zlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vnca.core.volume import Volume
from vnca.painting import Painting, StylizeConfig, stylize
from vnca.recipe import SILENT
from vnca.recipe.film import FilmConfig, Shown, behind, picture
from vnca.recipe.sequence import region_bounds
from vnca.recipe.simulation import simulate
from vnca.recipe.viewing import ViewRun, run
from vnca.rule.model import load_style
from vnca.viewer import SMOKE_NAME
from vnca.viewer.smoke_file import MAGIC, SmokeFile

STYLES = ("ink", "church")
"""With γ and density scales that are not each other's."""
FRAMES, RESOLUTION, SIZE = 4, 24, 96
CONFIG = StylizeConfig(warmup=8, steps_per_frame=4, seed=5)
REFINEMENTS = (1, 2)


def main(out: Path) -> None:
    """Make all of it in a folder."""
    smoke = out / "smoke"
    for _ in simulate("plume", out=smoke, resolution=RESOLUTION, frames=12 + FRAMES):
        pass
    frames = f"13-{12 + FRAMES}"
    site = out / "site"
    asked = ViewRun(model=STYLES[0], sequence=str(smoke), frames=frames, export=site)
    run(asked, SILENT, lambda _: None)
    file = SmokeFile(site / SMOKE_NAME)
    told = {"size": SIZE, "styles": {}, "config": vars(CONFIG)}
    for style in STYLES:
        told["styles"][style] = {}
        for refine in REFINEMENTS:
            name = f"{style}_{refine}"
            told["styles"][style][refine] = _painted(out, file, style, refine, name)
    (out / "reference.json").write_text(json.dumps(told))
    _hostile(site, out / "hostile")


def _painted(out: Path, file: SmokeFile, style: str, refine: int, name: str) -> dict[str, object]:
    rule = load_style(style).rule
    volumes = [*file.volumes()]
    box = volumes[0].box
    paintings = [*stylize(volumes, rule, CONFIG, box=box, refine=refine)]
    states = [painting.state for painting in paintings]
    np.concatenate([s.values[:-1].reshape(-1) for s in states]).tofile(out / f"{name}.state")
    np.concatenate([_pictures(p, refine, rule.scales) for p in paintings]).tofile(
        out / f"{name}.pictures"
    )
    return {"cells": [len(state.cells) for state in states], "channels": rule.config.channels}


def _pictures(painting: Painting, refine: int, scales: object) -> np.ndarray:
    """Premultiplied linear RGB and opacity; then RGB in front of the background."""
    coarse = painting.coarse
    assert coarse is not None
    extinction = scales.extinction(coarse.cell_length)  # pyright: ignore
    shown = Shown(
        Volume(
            painting.density,
            None,
            painting.smoke.origin,
            painting.smoke.index_to_world,
            painting.smoke.frame,
        ),
        painting.colour,
        extinction,
    )
    film = FilmConfig(rows=SIZE, columns=SIZE)
    bounds = region_bounds(coarse.box, coarse.index_to_world)
    view = picture(shown, film, bounds=bounds, turned=0.0)
    over = view.over(behind(film)).numpy()
    return np.concatenate([view.rgba.numpy().reshape(-1), over.reshape(-1)]).astype(np.float32)


def _hostile(site: Path, out: Path) -> None:
    """Sites with a file of each that is not what it should be."""
    good = {path.relative_to(site): path.read_bytes() for path in site.rglob("*") if path.is_file()}
    model, smoke = Path("rules/0.safetensors"), Path(SMOKE_NAME)
    length = struct.unpack("<Q", good[model][:8])[0]
    header = json.loads(good[model][8 : 8 + length])
    rest = good[model][8 + length :]

    def with_header(changed: dict[str, object]) -> bytes:
        written = json.dumps({**header, **changed}).encode()
        return struct.pack("<Q", len(written)) + written + rest

    def described(**changed: object) -> bytes:
        about = {**json.loads(header["__metadata__"]["vnca"]), **changed}
        return with_header({"__metadata__": {"vnca": json.dumps(about)}})

    huge = {**header["hidden"], "data_offsets": [0, 2**40]}
    start = len(MAGIC) + 4 + struct.unpack("<I", good[smoke][8:12])[0]
    told = json.loads(good[smoke][12:start])

    def sequence(**changed: object) -> bytes:
        written = json.dumps({**told, **changed}).encode()
        return MAGIC + struct.pack("<I", len(written)) + written + good[smoke][start:]

    bomb = zlib.compress(bytes(2**26), 9)
    first = {**told["frames"][0], "offset": 0, "length": len(bomb)}
    cases: dict[str, tuple[Path, bytes]] = {
        "model_no_model": (model, b"not a model at all"),
        "model_cut": (model, good[model][: len(good[model]) // 2]),
        "model_newer": (model, described(format_version=99)),
        "model_beyond_its_file": (model, with_header({"hidden": huge})),
        "model_conditioned": (model, described(conditioning=[["temperature", 1, 300.0]])),
        "model_metadata": (model, described(rule="<script>alert(1)</script>")),
        "smoke_no_smoke": (smoke, b"<html>not found</html>"),
        "smoke_cut": (smoke, good[smoke][: start + 100]),
        "smoke_box": (smoke, sequence(box=[[0, 0, 0], [10**6, 10**6, 10**6]])),
        "smoke_bomb": (
            smoke,
            sequence(frames=[first]).partition(good[smoke][start:])[0] + bomb,
        ),
        "smoke_damaged": (smoke, good[smoke][:start] + bytes(len(good[smoke]) - start)),
        "show_no_json": (Path("show.json"), b"{"),
    }
    for name, (path, content) in cases.items():
        _write(out / name, {**good, path: content}.items())
    (out / "cases.json").write_text(json.dumps([*cases]))


def _write(folder: Path, files: Iterable[tuple[Path, bytes]]) -> None:
    for path, content in files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
