"""Files are refused in one line before they take memory or time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.reading import files
from mathnavi.interfaces.reading.files import read_bytes, read_json, read_lines, read_text
from mathnavi.interfaces.signals import Event


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not JSON"),
        (b"{", "is not JSON"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"a": ' * 100_000, "is nested too deeply"),
        (b"1" * 5000, "is not JSON"),
        (b'"\xff"', "is not text in UTF-8: byte 1 is 0xff"),
        (b"\xef\xbb\xbf{}", "is not JSON"),
        (rb'{"a": "\ud83d\ude00 \ud800"}', r"is not JSON: '\\ud800' is half a character"),
        (rb'{"\uDC00": 0}', r"is not JSON: '\\udc00' is half a character"),
        (b"[]", r"\$ = \[\]; allowed: an object"),
    ],
)
def test_a_document_that_is_none_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "config.json"
    path.write_bytes(content)
    with pytest.raises(RunFolderError, match=message) as refused:
        read_json(path, dict[str, Any], RunFolderError)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "huge"
    with path.open("wb") as file:
        file.truncate(2**40)  # a hole: it takes no room
    with pytest.raises(RunFolderError, match="has 1099511627776 bytes; allowed: at most 67108864"):
        read_text(path, RunFolderError)


def test_what_is_no_regular_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # nobody writes into it: to wait for that would be without end
    for path, message in (("pipe", "not a regular file"), (".", "is a folder"), ("a\0b", "not the name of a file")):
        with pytest.raises(RunFolderError, match=message):
            read_bytes(tmp_path / path, RunFolderError, 100)
    with pytest.raises(RunFolderError, match="not a regular file"):
        read_bytes(Path("/dev/zero"), RunFolderError, 100)
    with pytest.raises(FileNotFoundError):
        read_bytes(tmp_path / "nowhere", RunFolderError, 100)


def test_a_line_that_is_no_event_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "events.jsonl"
    good = '{"t": 0.0, "agent": "", "kind": "start", "message": ""}\n'
    for bad, message in (
        ('{"t": "0"}\n', r"line 2: \$\.t = '0'; allowed: float"),
        ('{"t": 0.0}\n', r"line 2: \$\.agent is missing"),
        ("no event\n", "line 2 is not JSON"),
    ):
        path.write_text(good + bad)
        with pytest.raises(RunFolderError, match=message):
            list(read_lines(path, Event, RunFolderError))
    monkeypatch.setattr(files, "MOST_OF_A_LINE", 40)
    path.write_text(good)
    with pytest.raises(RunFolderError, match="line 1 is longer than 40 bytes"):
        list(read_lines(path, Event, RunFolderError))
