"""Logs come from a folder or from where they were published, with their digests; what is not at hand is said."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mathnavi.studies.real.published import ARMS, FLOORS, UNICYCLES, NotAtHandError, logs_of


def test_logs_of_a_folder_are_all_that_lie_there(tmp_path: Path) -> None:
    (tmp_path / "carmen").mkdir()
    for name in ("a.log", "b.log.gz", "notes.md"):
        (tmp_path / "carmen" / name).touch()
    assert [Path(file).name for file in logs_of(FLOORS, tmp_path)] == ["a.log", "b.log.gz"]
    with pytest.raises(NotAtHandError, match=r"no \*\.csv or \*\.csv\.gz in .*ur10e"):
        logs_of(ARMS, tmp_path)


def test_what_is_fetched_has_its_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, str]] = []

    def retrieve(address: str, known_hash: str, name: str, folder: Path, **more: Any) -> str:
        asked.append((address, known_hash))
        return str(folder / name)

    fake = SimpleNamespace(retrieve=retrieve, HTTPDownloader=lambda timeout: timeout)
    monkeypatch.setitem(sys.modules, "pooch", fake)  # type: ignore[arg-type]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    files = logs_of(FLOORS, None)
    assert {Path(file).parent for file in files} == {tmp_path / "mathnavi" / "logs" / "carmen"}
    assert all(address.startswith("https://") and digest.startswith("sha256:") for address, digest in asked)
    assert len({digest for _, digest in asked}) == len(files) == 4


@pytest.mark.parametrize("fault", [ConnectionError("no network"), ValueError("SHA256 hash does not match")])
def test_the_reason_is_said_where_nothing_can_be_fetched(
    fault: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def retrieve(*given: Any, **more: Any) -> str:
        raise fault

    fake = SimpleNamespace(retrieve=retrieve, HTTPDownloader=lambda timeout: timeout)
    monkeypatch.setitem(sys.modules, "pooch", fake)  # type: ignore[arg-type]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(NotAtHandError, match=str(fault)):
        logs_of(ARMS, None)
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(NotAtHandError, match="pooch is not installed"):
        logs_of(ARMS, None)
    with pytest.raises(NotAtHandError, match="--data FOLDER"):
        logs_of(UNICYCLES, None)
