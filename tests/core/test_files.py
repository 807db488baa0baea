import errno
import os
import stat
from pathlib import Path

import pytest

from vnca.core.errors import FileFormatError, OutputError
from vnca.core.files import existing_file, remove_leftovers, whole_file


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


def test_what_a_killed_program_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    kept = {
        ".a_1.vdb",
        ".a_1.old.vdb",
        ".a_1.unfinished-mine.vdb",
        ".a_2.unfinished-0123abc_.vdb",
        ".b_1.unfinished-0123abc_.vdb",
        "a_1.unfinished-0123abc_.vdb",
        "a_1.vdb",
    }
    for name in kept:
        (tmp_path / name).write_text("")
    with whole_file(tmp_path / "a_1.vdb") as temporary:
        copies = [temporary.with_name(temporary.name), tmp_path / ".readme.unfinished-abcdefgh"]
        copies[1].write_text("")
        remove_leftovers(tmp_path, ["a_1.vdb", "readme"])
        assert not any(copy.exists() for copy in copies)
        temporary.write_text("new")
    assert {path.name for path in tmp_path.iterdir()} == kept
    remove_leftovers(tmp_path / "none", ["a_1.vdb"])


def test_a_full_disk_while_writing_is_one_clear_error_and_leaves_nothing(tmp_path: Path) -> None:
    def full() -> None:
        with whole_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("as much as there was room for")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OutputError, match=r"a.txt: cannot be written.*No space left"):
        full()
    assert not list(tmp_path.iterdir())


def test_a_file_and_its_name_reach_the_disk_before_the_write_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[str] = []
    sync, rename = os.fsync, Path.replace

    def noted_sync(handle: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(handle).st_mode)
        events.append("sync folder" if is_folder else "sync file")
        sync(handle)

    def noted_rename(self: Path, target: Path) -> Path:
        events.append("rename")
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", noted_sync)
    monkeypatch.setattr(Path, "replace", noted_rename)
    with whole_file(tmp_path / "a.txt") as temporary:
        temporary.write_text("new")
    folder = ["sync folder"] if hasattr(os, "O_DIRECTORY") else []
    assert events == ["sync file", "rename", *folder]


@pytest.mark.parametrize(
    ("name", "words"),
    [("none", "no such file$"), ("empty", "empty"), (".", "folder"), ("link", "a link to gone$")],
)
def test_unusable_inputs_are_named(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "link").symlink_to("gone")
    with pytest.raises(FileFormatError, match=words):
        existing_file(tmp_path / name)
