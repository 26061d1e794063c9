"""``mathnavi export``: what is refused, in one line, and what is left behind."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mathnavi.commands.cli import main
from tests.little_room import little_room

PACKAGES = {
    "rerun": ("rerun-sdk", "rerun", "--rerun", "a.rrd"),
    "mcap": ("mcap", "mcap", "--mcap", "a.mcap"),
    "mcap_protobuf": ("mcap-protobuf-support", "mcap", "--mcap", "a.mcap"),
    "foxglove_schemas_protobuf": ("foxglove-schemas-protobuf", "mcap", "--mcap", "a.mcap"),
}


@pytest.mark.parametrize("module", PACKAGES)
def test_a_missing_package_is_named_with_the_line_that_installs_it(
    module: str, runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    package, extra, flag, file = PACKAGES[module]
    for other in PACKAGES:  # those that are asked for before it are there, as far as this command can tell
        for name in [name for name in sys.modules if name.partition(".")[0] == other]:
            monkeypatch.delitem(sys.modules, name)
        if other != module and other not in sys.modules and module != "rerun" and other != "rerun":
            for name in (other, f"{other}.writer", f"{other}.schema"):
                monkeypatch.setitem(sys.modules, name, sys)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["export", str(runs / "robot"), flag, str(tmp_path / file)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    said = f"{flag} needs the package {package}, which is not installed; allowed after pip install 'mathnavi[{extra}]'"
    assert line == f"mathnavi: {said}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "--rerun and --mcap are missing; allowed: --rerun FILE.rrd, --mcap FILE.mcap, or both"),
        (("--rerun", "a.mcap"), "--rerun = a.mcap; allowed: a name that ends in .rrd"),
        (("--mcap", "a.rrd"), "--mcap = a.rrd; allowed: a name that ends in .mcap"),
    ],
)
def test_a_file_is_wanted_with_the_ending_of_its_format(
    words: tuple[str, ...], said: str, runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(runs / "robot"), *words]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(("package", "flag"), [("rerun", "--rerun"), ("mcap_protobuf", "--mcap")])
def test_nothing_is_left_where_nothing_can_be_written(
    package: str, flag: str, runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip(package)
    ending = {"--rerun": "rrd", "--mcap": "mcap"}[flag]
    for out in (f"a.{ending}", f"folder/a.{ending}"):
        capsys.readouterr()
        assert main(["export", str(runs / "nowhere"), flag, str(tmp_path / out)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
        assert list(tmp_path.iterdir()) == []
    with little_room(1000):  # as on a disk that is full
        assert main(["export", str(runs / "numbers"), flag, str(tmp_path / f"a.{ending}")]) == 2
    assert f"a.{ending}: " in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("package", "flag"), [("rerun", "--rerun"), ("mcap_protobuf", "--mcap")])
def test_a_folder_that_is_missing_is_made(package: str, flag: str, runs: Path, tmp_path: Path) -> None:
    pytest.importorskip(package)
    file = tmp_path / "new" / "folder" / {"--rerun": "a.rrd", "--mcap": "a.mcap"}[flag]
    assert main(["export", str(runs / "numbers"), flag, str(file)]) == 0
    assert file.stat().st_size > 1000
    assert list(file.parent.iterdir()) == [file]
