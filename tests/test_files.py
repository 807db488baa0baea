from pathlib import Path

import pytest

from vnca.errors import FileFormatError, OutputError
from vnca.files import existing_file, whole_file


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def interrupted() -> None:
        with whole_file(target) as temporary:
            temporary.write_text("half of the new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_finished_write_replaces_the_file_and_makes_its_folder(tmp_path: Path) -> None:
    target = tmp_path / "new" / "a.txt"
    with whole_file(target) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
    assert target.read_text() == "new"
    assert [p.name for p in target.parent.iterdir()] == ["a.txt"]


def test_a_folder_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"), whole_file(tmp_path / "file" / "x"):
        pass


@pytest.mark.parametrize(
    ("name", "words"), [("none", "no such"), ("empty", "empty"), (".", "folder")]
)
def test_unusable_inputs_are_named(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "empty").write_bytes(b"")
    with pytest.raises(FileFormatError, match=words):
        existing_file(tmp_path / name)
