"""Who takes part, and what is not painted twice."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from vnca import comparison
from vnca.comparison import COST, PICTURE, CompareRun, contenders
from vnca.core.errors import FileFormatError
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.io.sequence import find_frames
from vnca.recipe import SILENT


@pytest.fixture
def options(tiny_smoke: Volume, tmp_path: Path) -> CompareRun:
    write_smoke(tmp_path / "smoke" / "ball_0001.vdb", tiny_smoke)
    picture = tmp_path / "p.png"
    Image.linear_gradient("L").convert("RGB").save(picture)
    return CompareRun(
        sequence=str(tmp_path / "smoke"),
        picture=picture,
        out=tmp_path / "out",
        methods=("tnst",),
    )


@pytest.fixture
def painted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the methods that were run."""
    run: list[str] = []

    def paint(name: str, home: Path, *_: Any) -> dict[str, Any]:
        run.append(name)
        home.mkdir(exist_ok=True)
        return {"seconds": 2.0, "training": None, "peak_mb": 30.0}

    monkeypatch.setattr(comparison, "_peer", paint)
    return run


def compared(options: CompareRun) -> list[comparison.Contender]:
    return contenders(options, find_frames(options.sequence, None), SILENT)


def test_what_is_painted_is_not_painted_again_unless_something_changed(
    options: CompareRun, painted: list[str]
) -> None:
    (first,) = compared(options)
    (again,) = compared(dataclasses.replace(options, size=128, study=True))
    assert first == again
    assert (again.seconds, again.peak_mb, again.grey_is_density) == (2.0, 30.0, True)
    assert painted == ["tnst"]
    with Image.open(options.out / PICTURE) as picture:
        red, green, blue = picture.convert("RGB").split()
    assert red.tobytes() == green.tobytes() == blue.tobytes()
    compared(dataclasses.replace(options, seed=1))
    assert painted == ["tnst"] * 2
    frame = Path(options.sequence) / "ball_0001.vdb"
    frame.write_bytes(frame.read_bytes() + b" ")
    compared(dataclasses.replace(options, seed=1))
    assert painted == ["tnst"] * 3


def test_a_damaged_record_is_named(options: CompareRun, painted: list[str]) -> None:
    compared(options)
    path = options.out / "tnst" / COST
    for text in ("[]", "{", "{}"):
        path.write_text(text)
        with pytest.raises(FileFormatError, match=COST):
            compared(options)
    assert painted == ["tnst"]
