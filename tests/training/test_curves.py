import re
from pathlib import Path

import pytest

from vnca.core.errors import OutputError
from vnca.training.run import PATTERN, Curves

accumulating = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")


def curve(folder: Path) -> list[tuple[int, float]]:
    events = accumulating.EventAccumulator(str(folder)).Reload()
    return [(point.step, point.value) for point in events.Scalars("loss")]


def test_a_point_can_be_read_as_soon_as_it_was_added(tmp_path: Path) -> None:
    curves = Curves(tmp_path)
    curves.add(1, {"loss": 4.0, "rate": 0.5})
    assert curve(tmp_path) == [(1, 4.0)]
    curves.close()


def test_points_after_where_training_went_on_from_are_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.time", lambda: 1_700_000_000.5)  # all within one second
    for after, value in ((0, 3.0), (2, 2.0), (3, 1.0)):
        curves = Curves(tmp_path, after=after)
        for iteration in range(after + 1, 5):
            curves.add(iteration, {"loss": value})
        curves.close()
    assert len(list(tmp_path.glob(PATTERN))) == 3
    assert curve(tmp_path) == [(1, 3.0), (2, 3.0), (3, 2.0), (4, 1.0)]


def test_a_torn_last_point_does_not_hide_what_comes_later(tmp_path: Path) -> None:
    curves = Curves(tmp_path)
    for iteration in (1, 2, 3):
        curves.add(iteration, {"loss": float(iteration)})
    curves.close()
    (path,) = tmp_path.glob(PATTERN)
    path.write_bytes(path.read_bytes()[:-5])
    curves = Curves(tmp_path, after=2)
    curves.add(3, {"loss": 3.0})
    curves.close()
    assert curve(tmp_path) == [(1, 1.0), (2, 2.0), (3, 3.0)]


def test_files_of_other_names_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "events.out.tfevents.mine").write_bytes(b"")
    Curves(tmp_path).close()
    names = [path.name for path in tmp_path.iterdir()]
    assert any(re.fullmatch(r"events\.out\.tfevents\.\d{10}\..+\.0", name) for name in names)


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"tfevents.*cannot be written"):
        Curves(tmp_path / "nowhere")
