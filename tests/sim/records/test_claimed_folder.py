"""A folder is replaced whole or stays as it was, by one process at a time, and a process that was killed is no bar."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.writing import write_bytes
from mathnavi.sim.records import claimed_folder
from mathnavi.sim.records.claimed_folder import claimed
from tests.little_room import little_room


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def replace(folder: Path, **files: str) -> None:
    with claimed(folder) as claim:
        for name, text in files.items():
            (claim.new / name).write_text(text)
        claim.install(dropped=("video",))


def fill(folder: Path) -> None:
    with claimed(folder) as claim:
        write_bytes(claim.new / "log", b"2")


@pytest.fixture
def former(tmp_path: Path) -> Path:
    """A folder of an earlier run, and nothing beside it."""
    folder = tmp_path / "run"
    replace(folder, log="1", config="1", video="1", notes="mine")
    return folder


@pytest.mark.parametrize("exchange", [True, False])
def test_what_is_new_takes_the_place_of_what_it_replaces_and_other_files_stay(
    exchange: bool, former: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not exchange:
        monkeypatch.setattr(claimed_folder.ctypes, "CDLL", lambda *_, **__: SimpleNamespace())
    former.chmod(0o700)
    (former / "link").symlink_to("notes")
    replace(former, log="2", config="2")
    assert contents(former) == {"log": "2", "config": "2", "notes": "mine", "link": "mine"}
    assert (former / "link").is_symlink()
    assert former.stat().st_mode & 0o777 == 0o700
    assert list(former.parent.iterdir()) == [former]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_what_fails_changes_nothing(error: type[BaseException], former: Path) -> None:
    before = contents(former)
    with pytest.raises(error), claimed(former):
        raise error
    with pytest.raises(error), claimed(former.parent / "deep" / "new"):
        raise error
    assert contents(former) == before
    assert list(former.parent.iterdir()) == [former]


def test_a_full_disk_names_the_file_in_its_place(former: Path) -> None:
    with little_room(), pytest.raises(OSError, match="File too large") as error:
        fill(former)
    assert error.value.filename == str(former / "log")
    assert contents(former)["log"] == "1"


def test_a_folder_that_cannot_be_put_in_its_place_comes_back(former: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claimed_folder.ctypes, "CDLL", lambda *_, **__: SimpleNamespace())
    rename = os.rename

    def failing(one: Path, other: Path) -> None:
        if one.name == ".run.new":
            raise KeyboardInterrupt
        rename(one, other)

    monkeypatch.setattr(claimed_folder.os, "rename", failing)
    before = contents(former)
    with pytest.raises(KeyboardInterrupt):
        replace(former, log="2")
    assert contents(former) == before
    assert list(former.parent.iterdir()) == [former]


def test_a_folder_that_another_process_writes_is_refused(former: Path) -> None:
    with claimed(former) as claim:
        (claim.new / "log").write_text("2")
        with pytest.raises(RunFolderError, match=r"run is in use: another process is writing it; allowed: another"):
            replace(former, log="3")
        claim.install()
        with pytest.raises(RunFolderError, match="in use"):  # its pictures may still be drawn
            replace(former, log="3")
    assert contents(former)["log"] == "2"


CLAIMED = """
import sys, time
from pathlib import Path
from mathnavi.sim.records.claimed_folder import claimed
with claimed(Path(sys.argv[1])) as claim:
    (claim.new / "log").write_text("half")
    print("claimed", flush=True)
    time.sleep(60)
"""


def test_a_process_that_was_killed_is_no_bar(former: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", CLAIMED, str(former)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"claimed\n"
        with pytest.raises(RunFolderError, match="in use"):
            replace(former, log="2")
        process.send_signal(signal.SIGKILL)
    assert contents(former)["log"] == "1"
    replace(former, config="2")
    assert contents(former) == {"config": "2", "log": "1", "notes": "mine"}
    assert list(former.parent.iterdir()) == [former]


def test_a_former_folder_that_was_moved_aside_comes_back(former: Path) -> None:
    former.rename(former.with_name(".run.old"))
    with pytest.raises(RuntimeError), claimed(former):
        raise RuntimeError
    assert contents(former)["log"] == "1"
    assert list(former.parent.iterdir()) == [former]


def test_a_link_stays_and_the_folder_that_it_leads_to_is_replaced(former: Path) -> None:
    link = former.parent / "link"
    link.symlink_to("run")
    replace(link, log="2")
    assert link.is_symlink()
    assert contents(former)["log"] == "2"


def test_what_cannot_be_replaced_whole_is_refused(former: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lost, file = former.parent / "lost", former / "log"
    lost.symlink_to("nowhere")
    with pytest.raises(FileNotFoundError) as error:
        replace(lost, log="2")
    assert error.value.filename == str(lost)
    with pytest.raises(NotADirectoryError) as error:
        replace(file, log="2")
    assert error.value.filename == str(file)
    with pytest.raises(OSError, match="name too long"):
        replace(former.parent / ("n" * 300), log="2")
    with pytest.raises(RunFolderError, match="mount point"):
        replace(Path("/proc"), log="2")
    (former / "inner").mkdir()
    with pytest.raises(RunFolderError, match="holds the folder 'inner'"):
        replace(former, log="2")
    monkeypatch.chdir(former / "inner")
    with pytest.raises(RunFolderError, match="current folder"):
        replace(former, log="2")
    assert {path.name for path in former.parent.iterdir()} == {"run", "lost"}
    assert file.read_text() == "1"


def test_the_longest_name_can_be_claimed(tmp_path: Path) -> None:
    replace(tmp_path / ("n" * 255), log="1")
    replace(tmp_path / ("n" * 255), log="2")
    assert contents(tmp_path / ("n" * 255)) == {"log": "2"}
