"""What the tests of the page are given: sites, hostile ones too, and what vnca itself paints.

python web/tests/material.py build/browser
"""

import json
import struct
import sys
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vnca.core.volume import Volume
from vnca.painting import Painting, StylizeConfig, stylize
from vnca.recipe import SILENT
from vnca.recipe.film import FilmConfig, Shown, behind, picture
from vnca.recipe.sequence import region_bounds, region_of
from vnca.recipe.simulation import simulate
from vnca.recipe.viewing import ViewRun, run
from vnca.rule.conditioning import Conditioning, register_conditioning
from vnca.rule.library import load_style
from vnca.rule.model import CONFIG_NAME, MODEL_NAME, Model
from vnca.training.run import Curves
from vnca.viewer import SMOKE_NAME
from vnca.viewer.smoke_file import MAGIC, SmokeFile, write_smoke_file

STYLES = ("ink", "church")
"""With γ and density scales that are not each other's."""
FRAMES, RESOLUTION, SIZE = 4, 24, 96
CARRIED, STANDING = "carried", "standing"
"""The first of them, taught and not taught that the velocity carries the state along."""
CONFIG = StylizeConfig(warmup=8, steps_per_frame=4, seed=5)
REFINEMENTS = (1, 2)
UNITS = 16
"""Hidden units of rules that take less room than the smoke."""
FIELDS = {"temperature": (1, 300.0), "wind": (3, 2.0)}
"""Of the smoke that has some: components, and the value that counts as 1."""
LEAPS = (0, 2, 3)
"""Frames that are shown, by their place in the sequence, where one is skipped."""
LEAPS_SPEED = 1.5


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
    models = {style: load_style(style) for style in STYLES}
    for name in (CARRIED, STANDING):
        models[name] = _taught(models[STYLES[0]], transport=name == CARRIED)
    _added(site, {name: models[name] for name in (CARRIED, STANDING)})
    told = {"size": SIZE, "styles": {}, "config": {}}
    for name in ("warmup", "steps_per_frame", "seed"):
        told["config"][name] = getattr(CONFIG, name)
    volumes = [*file.volumes()]
    for style, model in models.items():
        told["styles"][style] = {}
        for refine in REFINEMENTS:
            paintings = [*stylize(volumes, model.rule, CONFIG, box=volumes[0].box, refine=refine)]
            told["styles"][style][refine] = _written(out / f"{style}_{refine}", paintings)
            pictures = [_pictures(each, refine, model.rule.scales) for each in paintings]
            np.concatenate(pictures).tofile(out / f"{style}_{refine}.pictures")
    leaps = replace(CONFIG, pattern_speed=LEAPS_SPEED)
    shown = [volumes[at] for at in LEAPS]
    paintings = [*stylize(shown, models[STANDING].rule, leaps, box=volumes[0].box)]
    told["leaps"] = {"at": LEAPS, "speed": LEAPS_SPEED, **_written(out / "leaps", paintings)}
    _wide(site, {name: _smaller(models[name]) for name in (CARRIED, STYLES[1])}, out / "wide")
    _training(models, smoke, out)
    told["fields"] = _with_fields(site, volumes, models[STYLES[0]], out)
    (out / "reference.json").write_text(json.dumps(told))
    _hostile(site, out / "hostile")


def _taught(model: Model, *, transport: bool) -> Model:
    config = replace(model.rule.config, transport=transport)
    return replace(model, rule=replace(model.rule, config=config))


def _added(site: Path, models: dict[str, Model]) -> None:
    """Have a site show more rules, after its own."""
    show = json.loads((site / "show.json").read_text())
    for name, model in models.items():
        model.save(site / "rules" / f"{name}.safetensors")
        show["rules"].append({"name": name, "title": name, "model": f"rules/{name}.safetensors"})
    (site / "show.json").write_text(json.dumps(show))


def _written(path: Path, paintings: Sequence[Painting]) -> dict[str, object]:
    """States to a file; and how many cells there are in each, and channels."""
    states = [painting.state for painting in paintings]
    values = [state.values[:-1] for state in states]
    np.concatenate([each.reshape(-1) for each in values]).tofile(path.with_suffix(".state"))
    return {"cells": [len(state.cells) for state in states], "channels": values[0].shape[1]}


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
    over = view.over(behind(film))
    return np.concatenate([view.rgba.reshape(-1), over.reshape(-1)]).astype(np.float32)


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

    def weights(value: float) -> bytes:
        begin, _ = header["hidden"]["data_offsets"]
        at = 8 + length + begin
        return good[model][:at] + struct.pack("<f", value) + good[model][at + 4 :]

    def only(text: str) -> bytes:
        return struct.pack("<Q", len(text)) + text.encode()

    shape = json.loads(header["__metadata__"]["vnca"])["rule"]
    flat = [[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    at = told["frames"][0]
    show = json.loads(good[Path("show.json")])
    elsewhere = {**show["rules"][0], "model": "//example.org/a.safetensors"}
    bomb = zlib.compress(bytes(2**26), 9)
    first = {**told["frames"][0], "offset": 0, "length": len(bomb)}
    cases: dict[str, tuple[Path, bytes | None]] = {
        "model_no_model": (model, b"not a model at all"),
        "model_cut": (model, good[model][: len(good[model]) // 2]),
        "model_newer": (model, described(format_version=99)),
        "model_beyond_its_file": (model, with_header({"hidden": huge})),
        "model_conditioned": (model, described(conditioning=[["vorticity", 2]])),
        "model_on_a_field": (model, described(conditioning=[["temperature", 1, 300.0]])),
        "model_metadata": (model, described(rule="<script>alert(1)</script>")),
        "model_not_finite": (model, weights(float("nan"))),
        "model_header_is_null": (model, only("null")),
        "model_about_null": (model, with_header({"__metadata__": {"vnca": "null"}})),
        "model_without_a_rule": (model, described(rule=None)),
        "model_half_a_channel": (model, described(rule={**shape, "channels": 12.5})),
        "model_dilated_far": (model, described(rule={**shape, "dilation": 10**6})),
        "model_scales_of_zero": (
            model,
            described(scales={"density": 0, "velocity": 1, "gamma": 1}),
        ),
        "model_flat_place": (
            model,
            described(place={"lattice_to_world": flat, "box": [[0, 0, 0], [8, 8, 8]]}),
        ),
        "model_length_beyond_numbers": (model, b"\xff" * 8 + good[model][8:]),
        "smoke_missing": (smoke, None),
        "smoke_header_is_null": (smoke, MAGIC + struct.pack("<I", 4) + b"null"),
        "smoke_header_of_gigabytes": (smoke, MAGIC + b"\xff\xff\xff\xff" + b"{}"),
        "smoke_infinite": (
            smoke,
            sequence(density=1).replace(b'"density": 1,', b'"density": 1e999,'),
        ),
        "smoke_flat": (smoke, sequence(lattice_to_world=flat)),
        "smoke_far": (smoke, sequence(box=[[0, 0, 0], [1e300, 8, 8]])),
        "smoke_large_and_empty": (smoke, sequence(box=[[0, 0, 0], [2000, 2000, 2000]])),
        "smoke_of_a_million_bricks": (smoke, sequence(frames=[{**at, "bricks": 10**6}])),
        "smoke_before_its_file": (smoke, sequence(frames=[{**at, "offset": -10}])),
        "smoke_beyond_its_file": (smoke, sequence(frames=[{**at, "offset": 2**52}])),
        "smoke_without_frames": (smoke, sequence(frames=[])),
        "smoke_fields": (smoke, sequence(fields=[{"name": "heat", "width": 10**9, "scale": 1}])),
        "smoke_no_smoke": (smoke, b"<html>not found</html>"),
        "smoke_cut": (smoke, good[smoke][: start + 100]),
        "smoke_box": (smoke, sequence(box=[[0, 0, 0], [10**6, 10**6, 10**6]])),
        "smoke_bomb": (
            smoke,
            sequence(frames=[first]).partition(good[smoke][start:])[0] + bomb,
        ),
        "smoke_damaged": (smoke, good[smoke][:start] + bytes(len(good[smoke]) - start)),
        "show_no_json": (Path("show.json"), b"{"),
        "show_null": (Path("show.json"), b"null"),
        "show_from_elsewhere": (
            Path("show.json"),
            json.dumps({**show, "rules": [elsewhere]}).encode(),
        ),
    }
    for name, (path, content) in cases.items():
        files = {**good, path: content}
        _write(out / name, [(path, given) for path, given in files.items() if given is not None])
    (out / "cases.json").write_text(json.dumps([*cases]))


def _with_fields(
    site: Path, volumes: Sequence[Volume], model: Model, out: Path
) -> dict[str, object]:
    """A site whose smoke has a temperature and a wind, and a rule that is conditioned on both."""
    random = np.random.default_rng(3)
    for name, (width, scale) in FIELDS.items():
        register_conditioning(Conditioning.of_field(name, width=width, scale=scale))
    config = replace(model.rule.config, conditioning=(*model.rule.config.conditioning, *FIELDS))
    more = random.normal(scale=0.2, size=(len(model.rule.hidden), 4)).astype(np.float32)
    hidden = np.concatenate([model.rule.hidden, more], axis=1)
    told = replace(model, rule=replace(model.rule, config=config, hidden=hidden))
    warm = []
    for smoke in volumes:
        density = smoke.density_field
        fields = {
            "temperature": replace(density, values=np.float32(290) + 400 * density.values),
            "wind": replace(
                density, values=random.normal(size=(*density.values.shape, 3)).astype(np.float32)
            ),
        }
        warm.append(replace(smoke, fields=fields))
    good = {path.relative_to(site): path.read_bytes() for path in site.rglob("*") if path.is_file()}
    _write(out / "fields", good.items())
    laid, region = region_of(warm)
    path = out / "fields" / SMOKE_NAME
    write_smoke_file(path, laid, region, name="warm", fps=24)
    _added(out / "fields", {"warm": told})
    _added(site, {"warm": told})
    stored = [*SmokeFile(path).volumes()]
    paintings = [*stylize(stored, told.rule, CONFIG, box=stored[0].box)]
    return _written(out / "fields", paintings)


def _smaller(model: Model) -> Model:
    """A rule with some of the hidden units of another."""
    rule = model.rule
    some = {"hidden": rule.hidden[:UNITS], "bias": rule.bias[:UNITS]}
    config = replace(rule.config, hidden=UNITS)
    output = np.ascontiguousarray(rule.output[:, :UNITS])
    return replace(model, rule=replace(rule, config=config, output=output, **some))


def _wide(site: Path, models: dict[str, Model], out: Path) -> None:
    """The same smoke in a box that is far larger than it, for rules that are smaller than it."""
    good = {path.relative_to(site): path.read_bytes() for path in site.rglob("*") if path.is_file()}
    smoke = good[Path(SMOKE_NAME)]
    begin = len(MAGIC) + 4
    start = begin + struct.unpack("<I", smoke[begin - 4 : begin])[0]
    header = json.loads(smoke[begin:start])
    lower, _ = header["box"]
    header["box"] = [lower, [low + side for low, side in zip(lower, (24, 20, 20), strict=True)]]
    written = json.dumps(header).encode()
    good[Path(SMOKE_NAME)] = MAGIC + struct.pack("<I", len(written)) + written + smoke[start:]
    show = json.loads(good[Path("show.json")])
    good[Path("show.json")] = json.dumps({**show, "rules": []}).encode()
    _write(out, good.items())
    _added(out, models)


def _training(models: dict[str, Model], smoke: Path, out: Path) -> None:
    """The folder of a training, and what it has later: another rule, and more of its curves."""
    for name, style, iterations in (
        ("run", STYLES[0], range(1, 41)),
        ("later", STYLES[1], range(41, 61)),
    ):
        folder = out / name
        folder.mkdir()
        models[style].save(folder / MODEL_NAME)
        curves = Curves(folder)
        for iteration in iterations:
            falling = {"total": 9.0, "appearance": 5.0, "overflow": 0.1}
            losses = {f"loss/{term}": of / iteration**0.3 for term, of in falling.items()}
            curves.add(iteration, losses)
        curves.close()
    frame = sorted(smoke.glob("*.vdb"))[-1]
    told = {"inputs": {"frame": str(frame)}, "config": {"iterations": 80}}
    (out / "run" / CONFIG_NAME).write_text(json.dumps(told))


def _write(folder: Path, files: Iterable[tuple[Path, bytes]]) -> None:
    for path, content in files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
