"""The library as a user of Python meets it: five lines, arrays in and out, cancelling, mistakes."""

from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import vnca
from vnca.core.volume import Volume
from vnca.io.picture import read_image
from vnca.rule.library import load_style
from vnca.rule.model import MODEL_NAME
from vnca.training.checkpoint import CHECKPOINT_NAME

TINY: dict[str, Any] = {
    "iterations": 2,
    "rule": {"channels": 6, "hidden": 8, "position_prior": False},
    "view": {"size": 32},
    "shortest_rollout": 2,
    "longest_rollout": 3,
    "appearance": {"samples": 64, "layers": ("stem", "block1")},
    "device": "cpu",
}
"""A training that takes a moment."""


@pytest.fixture(autouse=True)
def small_previews(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of the time, and nothing here is about how they look."""
    monkeypatch.setattr("vnca.training.run.PREVIEW_SIZE", 32)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "style.png"
    with Image.open(str(files("vnca.data") / "vangogh_cafe_terrace.webp")) as image:
        image.convert("RGB").resize((40, 50)).save(path)
    return path


@pytest.fixture
def cache(tiny_smoke: Volume, tmp_path: Path) -> Path:
    x, y, z = tiny_smoke.origin
    for number in (1, 2):
        moved = replace(tiny_smoke, origin=(x, y, z + number), frame=number)
        vnca.write_smoke(str(tmp_path / "cache" / f"ball_{number:04d}.vdb"), moved)
    return tmp_path / "cache"


@pytest.fixture
def longer_cache(tiny_smoke: Volume, cache: Path) -> Path:
    """Two frames more."""
    x, y, z = tiny_smoke.origin
    for number in (3, 4):
        moved = replace(tiny_smoke, origin=(x, y, z + number), frame=number)
        vnca.write_smoke(str(cache / f"ball_{number:04d}.vdb"), moved)
    return cache


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The folder of a run whose model was made up."""
    config = vnca.RuleConfig(channels=6, hidden=8, position_prior=False)
    rule = vnca.Rule.initial(config, vnca.Scales(density=0.9, velocity=0.4, gamma=0.7), seed=3)
    output = np.random.default_rng(4).normal(0, 0.02, rule.output.shape).astype(np.float32)
    vnca.Model(replace(rule, output=output)).save(str(tmp_path / "run" / MODEL_NAME))
    return tmp_path / "run"


class Listener:
    """Keeps what it is told; ends work that has come so far."""

    def __init__(self, until: int | None = None) -> None:
        self.until = until
        self.told: list[tuple[str, int, int]] = []
        self.lines: list[str] = []

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        del unit, note
        self.told.append((what, done, total))
        if done == self.until:
            raise vnca.Cancelled

    def note(self, line: str) -> None:
        self.lines.append(line)

    def made(self, what: str, path: Path) -> None:
        self.lines.append(f"{what}: {path}")


# Takes as long as all others together: it trains, paints, films and measures.
def test_the_whole_job_in_five_lines(
    cache: Path, picture: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    frame, painted, film = str(cache / "ball_0002.vdb"), str(tmp_path / "out"), tmp_path / "a.gif"
    model = vnca.train(frame, str(picture), texture=0.5, velocity_units="cells/frame", **TINY)
    paths = [f.path for f in vnca.stylize(model, str(cache), out=painted, refine=2, warmup=2)]
    vnca.render(painted, out=film, film={"rows": 32, "columns": 32})
    found = vnca.evaluate(model, str(cache), frames="2", size=96, warmup=2)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")  # a library prints nothing
    assert paths == [Path(painted) / f"ball_000{number}.vdb" for number in (1, 2)]
    assert all(path.exists() for path in paths if path)
    assert film.stat().st_size > 100
    assert model.training["iterations"] == 2
    header, *rows = str(found).splitlines()
    assert header.split() == ["painted", "unstylized", "better"]
    assert {row.split()[0] for row in rows} == {measure.name for measure in found.measures}
    assert found["style.score"] is not None
    assert not [*tmp_path.glob("**/" + MODEL_NAME)]


def test_a_style_of_the_library_goes_on_learning_by_its_name(cache: Path, picture: Path) -> None:
    shape_of_the_library = {"rule": {}, "iterations": 1}
    model = vnca.train(
        cache / "ball_0002.vdb", picture, init="frost", **(TINY | shape_of_the_library)
    )
    before, after = load_style("frost").rule, model.rule
    assert before.config == after.config
    assert (before.hidden != after.hidden).any()
    # One iteration moves a weight by no more than the rate.
    np.testing.assert_allclose(after.hidden, before.hidden, atol=0.01)


def test_memory_and_files_give_the_same(cache: Path, picture: Path, tmp_path: Path) -> None:
    frame = cache / "ball_0002.vdb"
    in_files = vnca.train(frame, picture, out=tmp_path / "run", texture=1, **TINY)
    volume, array = vnca.read_smoke(frame), read_image(picture)
    in_memory = vnca.train(volume, array, texture=1, **TINY)
    for name in ("hidden", "bias", "output"):
        one, other = (getattr(model.rule, name) for model in (in_files, in_memory))
        np.testing.assert_array_equal(one, other)
    written = [*vnca.stylize(tmp_path / "run", cache, out=tmp_path / "out", warmup=2)]
    kept = [*vnca.stylize(in_memory, cache, warmup=2)]
    volumes = [
        vnca.read_smoke(path, frame=at) for at, path in enumerate(sorted(cache.iterdir()), 1)
    ]
    given = [*vnca.stylize(in_memory, volumes, warmup=2)]
    assert [f.number for f in written] == [f.number for f in kept] == [f.number for f in given]
    for file, one, other in zip(written, kept, given, strict=True):
        assert one.path is None
        np.testing.assert_array_equal(one.density, other.density)
        np.testing.assert_array_equal(one.colour, other.colour)
        assert file.volume.box == one.volume.box
        np.testing.assert_allclose(file.density, one.density, rtol=1e-6)
        smoky = one.density > 0  # files hold a colour of no other cells
        np.testing.assert_allclose(file.colour[smoky], one.colour[smoky], atol=1e-6)
        assert file.shown.extinction == pytest.approx(one.shown.extinction)
    view = {"rows": 32, "columns": 32}
    vnca.render(tmp_path / "out", tmp_path / "a_####.png", film=view)
    vnca.render(kept, tmp_path / "b_####.png", film=view)
    for idle in ({"gamma": 2.0}, {"strip": 1}, {"colour_grid": "color"}, {"up_axis": "y"}):
        with pytest.raises(vnca.VncaError, match=f"`{next(iter(idle))}`: needs a sequence"):
            vnca.render(kept, tmp_path / "c_####.png", **idle)
    for number in (1, 2):
        one, other = (read_image(tmp_path / f"{kind}_000{number}.png") for kind in "ab")
        np.testing.assert_allclose(one, other, atol=2 / 255)


def test_a_training_is_cancelled_and_resumed(cache: Path, picture: Path, tmp_path: Path) -> None:
    frame, run = cache / "ball_0002.vdb", tmp_path / "run"
    whole = vnca.train(frame, picture, out=tmp_path / "whole", texture=0, **TINY)
    stopping = Listener(until=1)
    with pytest.raises(vnca.Cancelled):
        vnca.train(frame, picture, out=run, texture=0, watch=stopping, **TINY)
    assert stopping.told == [("training", 0, 2), ("training", 1, 2)]
    assert "stopped at iteration 1" in stopping.lines[-1]
    assert (run / CHECKPOINT_NAME).exists()
    listener = Listener()
    # From memory this time: the inputs are the same, wherever they come from.
    inputs = vnca.read_smoke(frame), read_image(picture)
    resumed = vnca.train(*inputs, out=run, resume=True, watch=listener)
    assert listener.told == [("training", 1, 2), ("training", 2, 2)]
    np.testing.assert_array_equal(resumed.rule.output, whole.rule.output)
    assert not (run / CHECKPOINT_NAME).exists()


def test_a_painting_is_cancelled_and_resumed(
    longer_cache: Path, model: Path, tmp_path: Path
) -> None:
    """The frame that is being written as it is cancelled is finished."""
    cache, watch = longer_cache, Listener(until=1)
    whole = [f.path for f in vnca.stylize(model, cache, out=tmp_path / "whole", warmup=2)]
    with pytest.raises(vnca.Cancelled):
        list(vnca.stylize(model, cache, out=tmp_path / "out", warmup=2, watch=watch))
    assert len([*(tmp_path / "out").glob("*.vdb")]) == 2
    resumed = vnca.stylize(model, cache, out=tmp_path / "out", warmup=2, resume=True)
    for one, other in zip(whole, [f.path for f in resumed], strict=True):
        assert one is not None
        assert other is not None
        assert one.read_bytes() == other.read_bytes()


def test_who_stops_asking_can_resume_too(longer_cache: Path, model: Path, tmp_path: Path) -> None:
    cache = longer_cache
    painting = vnca.stylize(model, cache, out=tmp_path / "out", warmup=2)
    first = next(painting)
    assert first.number == 1
    painting.close()  # type: ignore[attr-defined]
    listener = Listener()
    list(vnca.stylize(model, cache, out=tmp_path / "out", warmup=2, resume=True, watch=listener))
    assert listener.told == [("painting", done, 4) for done in (2, 3, 4)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"velocity_unit": "mantaflow"},
            "`velocity_unit`: no such .*did you mean `velocity_units`",
        ),
        ({"view": {"siz": 32}}, "`view.siz`: no such .*`view.size`"),
        ({"view": {"size": 3}}, "`view.size` 3"),
        ({"preset": "best"}, "`preset` best: expected one of draft, authors, paper, standard"),
        ({"resume": True}, "`resume`: needs the folder"),
        ({"texture": -1}, "`texture` -1"),
        ({"iterations": "many"}, "`iterations` 'many'"),
    ],
)
def test_mistakes_name_arguments(
    cache: Path, picture: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(vnca.VncaError, match=message):
        vnca.train(cache / "ball_0002.vdb", picture, **options)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((64, 64)), r"expected an array \[r, c, 3\]"),
        (np.full((64, 64, 3), 200, np.uint8), "from 0 to 1"),
        (np.full((64, 64, 3), np.nan), "from 0 to 1"),
        (np.full((64, 64, 3), 0.5), "a single colour"),
    ],
)
def test_arrays_that_are_no_picture_are_refused(
    tiny_smoke: Volume, array: Any, message: str
) -> None:
    with pytest.raises(vnca.VncaError, match=message):
        vnca.train(tiny_smoke, array)


def test_what_needs_files_says_so(tiny_smoke: Volume, model: Path, tmp_path: Path) -> None:
    with pytest.raises(vnca.VncaError, match="`out`: volumes have no files"):
        vnca.stylize(model, tiny_smoke, out=tmp_path)
    with pytest.raises(vnca.VncaError, match="`preview`: needs a folder"):
        vnca.stylize(model, tiny_smoke, preview=tmp_path / "a.gif")
    with pytest.raises(vnca.VncaError, match="no smoke in any"):
        vnca.stylize(model, replace(tiny_smoke, density=0 * tiny_smoke.density))


def test_a_texture_is_trained_in_memory(picture: Path) -> None:
    tiny = {name: value for name, value in TINY.items() if name not in ("view", "rule")}
    rule = {"channels": 6, "hidden": 8}
    model = vnca.texture(read_image(picture), block=16, rule=rule, slice={"size": 32}, **tiny)
    assert model.training["kind"] == "texture"
    assert model.rule.config.hidden == 8


def test_a_simulation_is_written_and_kept(tmp_path: Path) -> None:
    kept = [*vnca.simulate("plume", resolution=12, frames=2)]
    listener = Listener()
    written: Iterator[Volume] = vnca.simulate(
        "plume", out=str(tmp_path), resolution=12, frames=2, watch=listener
    )
    assert [v.frame for v in written] == [1, 2] == [v.frame for v in kept]
    assert listener.told[-1] == ("simulating", 2, 2)
    again = vnca.read_smoke(str(tmp_path / "plume_0002.vdb"))
    assert again.density.sum() == pytest.approx(float(kept[1].density.sum()))


def test_a_model_knows_where_its_inputs_are(cache: Path, picture: Path, tmp_path: Path) -> None:
    vnca.train(cache / "ball_0002.vdb", picture, out=tmp_path / "run", texture=0, **TINY)
    assert vnca.load(str(tmp_path / "run")).inputs == {
        "frame": cache / "ball_0002.vdb",
        "style": picture,
    }
    assert vnca.load(tmp_path / "run" / MODEL_NAME).rule.config.hidden == 8
