"""Files that are written together are all there or all as they were, and an error names the one that is at fault."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.interfaces.writing import whole_files, write_bytes, write_text, write_together
from tests.little_room import little_room


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_files_are_written_together(tmp_path: Path) -> None:
    write_together({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    write_text(tmp_path / "a", "3")
    assert contents(tmp_path) == {"a": b"3", "b": b"2"}


def test_a_full_disk_changes_none_of_them_and_names_the_file(tmp_path: Path) -> None:
    write_together({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    before = contents(tmp_path)
    with little_room(10), pytest.raises(OSError, match="File too large") as error:
        write_together({tmp_path / "a": b"small", tmp_path / "b": b"large" * 10})
    assert error.value.filename == str(tmp_path / "b")
    assert contents(tmp_path) == before


def test_what_raises_while_files_are_made_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), whole_files(tmp_path / "a"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_a_folder_in_the_place_of_a_file_is_named_and_the_others_stay(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(IsADirectoryError) as error:
        write_together({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    assert error.value.filename == str(tmp_path / "b")
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def test_the_longest_name_is_written_and_a_longer_one_is_named(tmp_path: Path) -> None:
    longest = tmp_path / ("ä" * 127)
    write_bytes(longest, b"1")
    assert contents(tmp_path) == {longest.name: b"1"}
    with pytest.raises(OSError, match="name too long") as error:
        write_bytes(tmp_path / ("n" * 300), b"1")
    assert error.value.filename == str(tmp_path / ("n" * 300))


def test_a_folder_that_is_not_there_is_named_by_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as error:
        write_bytes(tmp_path / "none" / "a", b"1")
    assert error.value.filename == str(tmp_path / "none" / "a")
