"""`vnca info PATH`, and `vnca styles`: the library of styles that come with the package."""

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from PIL import Image

from vnca.cli.options import parse, print_json
from vnca.cli.terminal import made
from vnca.core import FloatArray
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import FileFormatError, OptionError, printable
from vnca.core.files import existing_file, writable_file, writable_folder
from vnca.direction.colour.palette import codes, main_colours
from vnca.io.film import contact_sheet
from vnca.io.picture import fit, write_image
from vnca.io.vdb import GridHeader, open_vdb
from vnca.rule import CONDITIONING
from vnca.rule.conditioning import STYLES
from vnca.rule.library import SUFFIX, load_style, style_names, style_thumbnail
from vnca.rule.model import MODEL_NAME, STYLES_TOLD, Model, listed_conditioning
from vnca.rule.styles import alone


@dataclass(frozen=True)
class Info:
    """Describe an OpenVDB file, a model or a training run."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """A .vdb file, a .safetensors model, or the folder of a run."""
    json: bool = False
    """Print an object in JSON instead of lines."""


def run(arguments: Sequence[str]) -> None:
    """Read the options and describe."""
    options = parse("info", Info, arguments)
    if options.json:
        print_json(facts(options.path))
        return
    for line in describe(options.path):
        print(printable(line))


def describe(path: Path) -> list[str]:
    """Lines about a file or a run folder.

    Raises:
        VncaError: If it is missing, damaged, or nothing vnca knows.
    """
    return describe_model(path) if _is_model(path) else describe_vdb(path)


def facts(path: Path) -> dict[str, Any]:
    """What a program may want to know of a file or a run folder, as JSON values.

    Raises:
        VncaError: If it is missing, damaged, or nothing vnca knows.
    """
    return {"path": str(path), **(_model_facts(path) if _is_model(path) else _vdb_facts(path))}


def _is_model(path: Path) -> bool:
    """Whether it is a model rather than a VDB file.

    Raises:
        FileFormatError: If it is neither.
    """
    if path.is_dir():
        if not (path / MODEL_NAME).exists():
            frames = sorted(file.name for file in path.glob("[!.]*.vdb"))
            instead = f"; name one of its frames, such as {frames[0]}" if frames else ""
            raise FileFormatError(f"{path}: this folder holds no {MODEL_NAME}{instead}")
        return True
    existing_file(path)
    suffix = path.suffix.lower()
    if suffix not in (".vdb", ".safetensors"):
        raise FileFormatError(f"{path}: expected a .vdb file, a .safetensors model or a run folder")
    return suffix == ".safetensors"


def _model_facts(path: Path) -> dict[str, Any]:
    model = Model.load(path, to_describe=True)
    return {
        "kind": "model",
        "version": model.version,
        "weights": model.rule.weight_count,
        "rule": asdict(model.rule.config),
        "conditioning": list(map(listed_conditioning, model.rule.config.conditioning)),
        "scales": asdict(model.rule.scales),
        **({} if model.style_names else {"palette": _palette(model)}),
        "styles": [
            {"number": number, **told, "palette": palette}
            for number, told, palette in _styles(model)
        ],
        "training": model.training,
    }


def _vdb_facts(path: Path) -> dict[str, Any]:
    with open_vdb(path) as file:
        return {
            "kind": "vdb",
            "grids": [_grid_facts(header) for header in file.grids.values()],
            "unfound_grids": file.unfound,
            "metadata": {name: entry.value for name, entry in file.metadata.items()},
        }


def _grid_facts(header: GridHeader) -> dict[str, Any]:
    box, transform = header.box, header.linear_transform
    return {
        "name": header.name,
        "type": header.value_type,
        "is_half": header.is_half,
        "class": header.grid_class,
        "box": None if box is None or box.is_empty else [box.lower, box.upper],
        "voxel_size": None if transform is None else list(map(float, transform.voxel_size)),
        "is_readable": header.is_readable,
        "is_copied": header.obstacle_to_copying is None,
        "metadata": {name: entry.value for name, entry in header.metadata.items()},
    }


def describe_model(path: Path) -> list[str]:
    """Lines about a model: its shape, its normalisers and where it comes from."""
    model = Model.load(path, to_describe=True)
    config, scales = model.rule.config, model.rule.scales
    switched_off = [
        name for name in ("position", "density", "velocity") if not getattr(config, f"{name}_prior")
    ]
    return [
        f"model of vnca {model.version}: {model.rule.weight_count} weights",
        f"  rule        {config.channels} channels, {config.hidden} hidden, "
        f"update probability {config.update_probability:g}",
        f"  priors off  {', '.join(switched_off) or 'none'}",
        *(
            f"  conditioned on {_described_input(name)}"
            for name in config.conditioning
            if name not in (*CONDITIONING, *STYLES)
        ),
        f"  scales      density {scales.density:.4g}, velocity {scales.velocity:.4g} cells/frame, "
        f"gamma {scales.gamma:.4g} per cell",
        *(
            f"  style {number}     {told['name']}: {told.get('style', '')}, "
            f"palette {' '.join(palette) or 'not known'}"
            for number, told, palette in _styles(model)
        ),
        *(
            []
            if model.style_names
            else [f"  palette     {' '.join(_palette(model)) or 'not known'}"]
        ),
        *(
            f"  {name:11} {json.dumps(value)}"
            for name, value in model.training.items()
            if name != STYLES_TOLD
        ),
    ]


def _styles(model: Model) -> Iterator[tuple[int, Mapping[str, Any], list[str]]]:
    """Of each of several styles its number, what the model tells of it, and its palette."""
    for number, told in enumerate(model.training.get(STYLES_TOLD, ())):
        yield number + 1, told, _palette(alone(model, number))


def _palette(model: Model) -> list[str]:
    """The main colours of a model's picture, in the order in which `recolour` numbers them."""
    if model.style is None:
        return []
    return codes(main_colours(srgb_to_linear(model.style / np.float32(255))))


def _described_input(name: str) -> str:
    """What a rule is conditioned on beside position, density and velocity."""
    _, width, *scale = listed_conditioning(name)
    numbers = f"{width} number{'s' * (width > 1)} a cell"
    known = f"the grid of that name, of which {scale[0]:g} counts as 1" if scale else "computed"
    return f"{name}: {numbers}, {known}"


def describe_vdb(path: Path) -> list[str]:
    """Lines about a VDB file: one a grid, then the metadata of the file."""
    with open_vdb(path) as file:
        count = len(file.grids) + file.unfound
        lines = [f"OpenVDB file, {count} grid{'s' * (count != 1)}"]
        lines += map(_describe_grid, file.grids.values())
        if file.unfound:
            lines.append(
                f"  {file.unfound} more cannot be found: the file has no offsets, and where the "
                "grid before them ends is not known"
            )
        lines += [f"  {name} = {entry.value}" for name, entry in file.metadata.items()]
    return lines


def _describe_grid(header: GridHeader) -> str:
    box = header.box
    extent = "box not in the header"
    if box is not None:
        extent = "empty" if box.is_empty else f"{box.lower} to {box.upper}"
    half = " saved as half" if header.is_half else ""
    place = header.map_type
    if header.linear_transform is not None:
        sizes = ", ".join(f"{size:.6g}" for size in header.linear_transform.voxel_size)
        place = f"voxel {sizes}"
    note = ""
    if not header.is_readable:
        is_copied = header.obstacle_to_copying is None
        note = "; cannot be read, only copied" if is_copied else "; cannot be read or copied"
    kind = f"{header.value_type}{half}, {header.grid_class}"
    return f"  {header.name}: {kind}, {extent}, {place}{note}"


SIZE = 160
"""Rows and columns of a picture on the sheet, pixels."""
COLUMNS = 3
"""Styles in a row of the sheet."""


@dataclass(frozen=True)
class Styles:
    """List the styles that paint without training: vnca paint SMOKE --style NAME --out DIR.

    `vnca styles MODEL` lists those of a model that has learnt several, between which --style-mix
    chooses.
    """

    model: Annotated[tyro.conf.Positional[Path | None], tyro.conf.arg(metavar="[MODEL]")] = None
    """A model of several styles, or the folder of its run."""
    sheet: Path | None = None
    """A picture of all of them to write: each picture, and smoke painted in its style; of a MODEL
    its pictures."""
    save: Path | None = None
    """Folder in which to write each style of the MODEL as a model of its own, which older programs
    and the page of `vnca view` read, too."""
    json: bool = False
    """Print JSON."""


def run_styles(arguments: Sequence[str]) -> None:
    """Read the options and list the styles.

    Raises:
        VncaError: If the sheet cannot be written.
    """
    options = parse("styles", Styles, arguments)
    if options.model is not None:
        _run_styles_of(options.model, options)
        return
    if options.save is not None:
        raise OptionError(f"--save {options.save}: the styles of which model? name it before")
    named = {name: load_style(name) for name in style_names()}
    if options.sheet is not None:
        writable_file(options.sheet)
    if options.json:
        print_json({name: model.training for name, model in named.items()})
    else:
        for name, model in named.items():
            print(f"{name:16}{model.training.get('title', ''):48}{' '.join(_palette(model))}")
    if options.sheet is not None:
        pairs = [(_linear(named[name].style), _painted(name)) for name in named]
        rows = [pairs[start : start + COLUMNS] for start in range(0, len(pairs), COLUMNS)]
        empty = np.ones((SIZE, SIZE, 3), np.float32)
        rows[-1] += [(empty, empty)] * (COLUMNS - len(rows[-1]))
        write_image(
            options.sheet, contact_sheet([[p for pair in row for p in pair] for row in rows])
        )
        made("sheet", options.sheet)


def _run_styles_of(path: Path, options: Styles) -> None:
    """List the styles of a model, and write them as asked.

    Raises:
        VncaError: If it has none to choose between, or an output cannot be written.
    """
    model = Model.load(path)
    if not model.style_names:
        raise OptionError(f"{path}: has learnt a single style, {model.training.get('style', '?')}")
    if options.sheet is not None:
        writable_file(options.sheet)
    if options.save is not None:
        writable_folder(options.save).mkdir(parents=True, exist_ok=True)
    if options.json:
        print_json(_model_facts(path)["styles"])
    else:
        for number, told, palette in _styles(model):
            print(f"{number} {told['name']:22}{told.get('style', ''):40}{' '.join(palette)}")
    if options.sheet is not None:
        write_image(options.sheet, contact_sheet([[_linear(each) for each in model.thumbnails]]))
        made("sheet", options.sheet)
    if options.save is not None:
        for number, name in enumerate(model.style_names):
            alone(model, number).save(options.save / f"{name}{SUFFIX}")
        made("models", options.save)


def _linear(picture: np.ndarray | None) -> FloatArray:
    assert picture is not None, "a style of the library has its picture"
    return fit(srgb_to_linear(picture / np.float32(255)), SIZE, SIZE)


def _painted(name: str) -> FloatArray:
    with Image.open(io.BytesIO(style_thumbnail(name))) as image:
        return _linear(np.asarray(image.convert("RGB")))
