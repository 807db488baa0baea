"""Paintings by a direction: layers, outlines, light, steps; going on after an end."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vnca
from vnca.core.colour import srgb_to_linear
from vnca.core.errors import GridError, OptionError
from vnca.io import read_smoke
from vnca.io.provenance import read_provenance
from vnca.io.vdb import open_vdb
from vnca.rule.library import load_style
from vnca.rule.model import Model

Painted = Callable[..., list[dict[str, Any]]]
RIGHT = "x:2.6..4"


def test_a_share_of_a_layer_is_that_much_of_its_colour(painted: Painted, model: Path) -> None:
    ink, density = load_style("ink"), Model.load(model).rule.scales.density
    below, above = painted(), painted(replace(ink, rule=ink.rule.rescaled(density=density)))
    mixed = painted(layers={"ink": 0.25})
    for one, other, both in zip(below, above, mixed, strict=True):
        np.testing.assert_allclose(both["Cd"], 0.75 * one["Cd"] + 0.25 * other["Cd"], atol=2e-3)
    for one, whole in zip(above, painted(layers={"ink": 1}), strict=True):
        np.testing.assert_array_equal(one["Cd"], whole["Cd"])
    twice = painted(layers={"ink": 1, str(model): "1:0 3:1"})
    np.testing.assert_array_equal(twice[0]["Cd"], above[0]["Cd"])
    np.testing.assert_array_equal(twice[2]["Cd"], below[2]["Cd"])


def test_masks_say_where(painted: Painted, smoke: Path) -> None:
    (plain, *_), (half, *_) = painted(), painted(strength=f"hold {RIGHT}", hue="0")
    volume = read_smoke(smoke / "ball_0001.vdb")
    x = np.argwhere(volume.density > 0)[:, 0] * 0.5 + 0.5 * volume.origin[0]
    assert len(x) == len(plain["Cd"])
    np.testing.assert_array_equal(half["Cd"][x < 4], 1)
    np.testing.assert_array_equal(half["Cd"][x > 4], plain["Cd"][x > 4])
    np.testing.assert_array_equal(half["density"], plain["density"])


def test_cells_of_fewer_steps_rest_while_others_go_on(painted: Painted, smoke: Path) -> None:
    volume = read_smoke(smoke / "ball_0001.vdb")
    x = np.argwhere(volume.density > 0)[:, 0] * 0.5 + 0.5 * volume.origin[0]
    many, both = (
        painted(warmup=0, steps_per_frame=steps)[0]["Cd"] for steps in (3, "hold x:2..4->0..3")
    )
    grey = srgb_to_linear(np.float32(0.5))
    np.testing.assert_allclose(both[x < 4], grey, rtol=1e-6)
    # A step sees one cell far: three cells from those that rest nothing is known of them.
    np.testing.assert_array_equal(both[x > 5.5], many[x > 5.5])
    assert np.ptp(many[x > 5.5]) > 0.01
    assert np.ptp(many[x < 4]) > 0.01


def test_outline_is_kept_and_inside_is_painted(painted: Painted, read: Any, smoke: Path) -> None:
    source = [read(path)["density"] for path in sorted(smoke.glob("*.vdb"))]
    changes = {}
    for silhouette in ("free", "soft", "keep"):
        for before, frame in zip(source, painted(silhouette=silhouette), strict=True):
            rim = before < 0.8
            change = np.abs(frame["density"] / before - 1)
            changes.setdefault(silhouette, []).append((change[rim].mean(), change[~rim].mean()))
    free, soft, keep = (np.mean(each, axis=0) for each in changes.values())
    assert free[0] > soft[0] > keep[0]
    assert keep[0] < 0.2 * free[0]
    assert keep[1] > 0.2 * free[1]


def test_an_edge_moved_inwards_removes_smoke_and_mass_is_kept_where_asked(
    painted: Painted, read: Any, smoke: Path
) -> None:
    before = read(smoke / "ball_0001.vdb")["density"]
    (thin, *_), (kept, *_) = painted(edge=-1), painted(edge=-1, keep_mass=True)
    assert (thin["density"] == 0).sum() > 50
    assert thin["density"].sum() < 0.9 * before.sum()
    assert kept["density"].sum() == pytest.approx(before.sum(), rel=1e-5)
    np.testing.assert_array_equal(kept["density"] == 0, thin["density"] == 0)


@pytest.mark.parametrize("refine", [1, 2])
def test_an_edge_moved_outwards_adds_smoke_no_farther_than_that(
    painted: Painted, smoke: Path, tmp_path: Path, refine: int
) -> None:
    painted(edge=1, density_strength=0, refine=refine)
    source = read_smoke(smoke / "ball_0002.vdb")
    fluff = read_smoke(next(tmp_path.glob("painted*/ball_0002.vdb")))
    centre = (np.array(source.box.lower) + np.array(source.box.upper) - 1) / 2

    def away(volume: Any) -> Any:
        cells = np.argwhere(volume.density > 0.02) + volume.origin
        cells = (cells + 0.5) / round(0.5 / volume.voxel_size[0]) - 0.5
        return np.linalg.norm(cells - centre, axis=1)

    before, after = away(source), away(fluff)
    # In between cells there is smoke up to the next one.
    assert before.max() + 0.6 < after.max() < before.max() + 2
    inner = away(fluff) < 4
    assert inner.sum() >= (before < 4).sum()
    # It has a colour there, as all smoke has.
    with open_vdb(next(tmp_path.glob("painted*/ball_0002.vdb"))) as file:
        box = file.read("density").active_box()
        density, colour = (file.read(name).to_dense(box)[0] for name in ("density", "Cd"))
    assert (colour[density > 0] > 0).any(axis=-1).all()


def test_fire_is_written_beside_the_colour(painted: Painted) -> None:
    plain, (lit, *_) = painted(), painted(fire="density:0..1->300..1800")
    np.testing.assert_array_equal(plain[0]["Cd"], lit["Cd"])
    assert "emission" not in plain[0]
    light = lit["emission"]
    assert light.shape == lit["Cd"].shape
    assert (light[:, 0] >= light[:, 2]).all()
    assert light[:, 0].max() > 0.5
    assert not light[lit["density"] < 0.02].any()


@pytest.mark.parametrize("refine", [1, 2])
def test_going_on_gives_the_same_files(
    smoke: Path, model: Path, tmp_path: Path, refine: int
) -> None:
    options: dict[str, Any] = {
        "backend": "numpy",
        "warmup": 3,
        "steps_per_frame": "1:2 3:3",
        "refine": refine,
        "layers": {str(model): "advected(z:0..6)"},
        "strength": "age:0..4->1..0.5",
    }
    whole = [*vnca.stylize(model, smoke, out=tmp_path / "whole", **options)]
    begun = vnca.stylize(model, smoke, out=tmp_path / "parts", **options)
    next(begun)
    begun.close()  # type: ignore[attr-defined]
    rest = [*vnca.stylize(model, smoke, out=tmp_path / "parts", resume=True, **options)]
    for one, other in zip(whole, rest, strict=True):
        assert one.path is not None
        assert other.path is not None
        assert one.path.read_bytes() == other.path.read_bytes()


@pytest.mark.parametrize(
    ("change", "named"),
    [({"strength": "1:0 3:1"}, "`strength`"), ({"layers": {}}, "`layers`")],
)
def test_going_on_with_something_else_asked_is_refused(
    smoke: Path, model: Path, tmp_path: Path, change: dict[str, Any], named: str
) -> None:
    options: dict[str, Any] = {"backend": "numpy", "warmup": 1, "steps_per_frame": 1}
    options |= {"layers": {str(model): 0.5}, "strength": "1:0 3:0.5"}
    begun = vnca.stylize(model, smoke, out=tmp_path / "out", **options)
    next(begun)
    begun.close()  # type: ignore[attr-defined]
    with pytest.raises(OptionError, match=f"cannot go on, since {named} is another"):
        [*vnca.stylize(model, smoke, out=tmp_path / "out", resume=True, **{**options, **change})]


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"strength": "@none"}, "ball_0001.vdb: no grid 'none'"),
        ({"strength": "density * 3"}, "goes from .* to 3, expected 0 to 1; give it a range"),
        ({"strength": 'picture("none.png")'}, "none.png: no such file"),
        ({"strength": 'mesh("none.obj")'}, "none.obj: no such file"),
        ({"strength": 'grid("none_####.vdb")'}, "none_####.vdb"),
        ({"layers": {"none": 1}}, "`layers` none: no such file, nor a style of the library"),
        ({"layers": {"ink": 2}}, "`layers.ink` 2: 2: must be from 0 to 1"),
        ({"masks": {"a b": 1}}, "'a b' is no name"),
        ({"masks": ["a"]}, "expected a name, an equals sign and a value"),
        ({"recolour": ["1=red"]}, "expected OLD=NEW"),
        ({"recolour": ["1=#ff0000"]}, "`recolour`: the model has no picture"),
        ({"edge": 4}, "`edge` 4: must be from -8 to 3"),
        ({"strength": float("nan")}, "`strength` nan: must be from 0 to 1"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_painted(
    painted: Painted, tmp_path: Path, options: dict[str, Any], why: str
) -> None:
    with pytest.raises(vnca.VncaError, match=why):
        painted(**options)
    assert not list(tmp_path.glob("painted*/*.vdb"))


def test_volumes_in_memory_are_directed_too(model: Path, smoke: Path) -> None:
    volumes = [read_smoke(path, frame=n) for n, path in enumerate(sorted(smoke.glob("*.vdb")), 1)]
    options: dict[str, Any] = {"backend": "numpy", "warmup": 2, "steps_per_frame": 1}
    plain = [frame.colour for frame in vnca.stylize(model, volumes, **options)]
    faded = [frame.colour for frame in vnca.stylize(model, volumes, strength="1:0 3:1", **options)]
    np.testing.assert_array_equal(faded[0], 1)
    np.testing.assert_array_equal(faded[2], plain[2])
    with pytest.raises(GridError, match="no grid 'm'"):
        [*vnca.stylize(model, volumes, strength="@m", **options)]


def test_files_tell_what_was_asked_and_keep_what_they_had(painted: Painted, tmp_path: Path) -> None:
    painted(fire=1500, refine=2, strength="1:0 3:1", masks={"low": "height:1..0"})
    path = next(tmp_path.glob("painted*/ball_0001.vdb"))
    told = read_provenance(path)
    assert told is not None
    assert told.facts["strength"] == "1:0 3:1"
    further = json.loads(str(told.facts["direction"]))
    assert further == {"fire": 1500, "masks": ["low=height:1..0"]}
    with open_vdb(path) as file:
        assert file.names == ("density", "velocity", "Cd", "emission")
        assert file.read("emission").active_box() == file.read("Cd").active_box()
