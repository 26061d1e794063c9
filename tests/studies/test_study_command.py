"""``mathnavi study``: what it writes, its exit codes, and bad input."""

from __future__ import annotations

import json
import os
import shlex
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pytest
from matplotlib.figure import Figure

from mathnavi.commands import study
from mathnavi.commands.cli import main
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.study import Setup, StudyError, StudyResult
from tests.commands.signalled import signalled
from tests.sim.sweep.computations import Walk, walked
from tests.sim.sweep.test_jobs import stored

HERE = "tests.studies.test_study_command"


@dataclass(frozen=True)
class TinyConfig:
    """How much is counted."""

    count: int = 3


class Tiny:
    """A study without a flight."""

    Config = TinyConfig
    quick = TinyConfig(count=1)
    title = "Counting"
    kind: ClassVar[Any] = "target"
    holds = True

    @classmethod
    def run(cls, config: TinyConfig, setup: Setup) -> StudyResult:
        figure = Figure()
        figure.add_subplot().plot([0.0, config.count])
        claim = Claim("tiny.count", cls.kind, "It counts.", "nowhere", "some", str(config.count), cls.holds)
        rows = [{"count": config.count}]
        return StudyResult(
            ["It counted."], rows, [Table("Counts", ("count",), [(str(config.count),)])], figure, "", [claim]
        )


class Anywhere(Tiny):
    """A study that needs no terrain."""

    on_terrain = False


class Patient(Anywhere):
    """A study of jobs that take a while; each leaves a file."""

    Config = TinyConfig
    quick = TinyConfig(count=6)

    @classmethod
    def run(cls, config: TinyConfig, setup: Setup) -> StudyResult:
        walks = [Walk(5, seed, marks=os.environ["MARKS"], wait=0.5) for seed in range(config.count)]
        setup.compute(walked, walks)
        return super().run(config, setup)


class Deceived(Anywhere):
    """A study that asks for the terrain that it said it does not need."""

    @classmethod
    def run(cls, config: TinyConfig, setup: Setup) -> StudyResult:
        raise AssertionError(setup.ground.name)


class Missed(Tiny):
    """A target that is missed."""

    holds = False


class Printed(Missed):
    """A claim of the thesis that does not hold."""

    kind = "printed"


class Speechless(Tiny):
    """A study that cannot say anything."""

    @classmethod
    def run(cls, config: TinyConfig, setup: Setup) -> StudyResult:
        raise StudyError("seed 3 crashed")


def run(tmp_path: Path, name: str, *words: str) -> int:
    return main(["study", f"{HERE}:{name}", "--terrain", "jacksboro", "--out", str(tmp_path / "out"), *words])


@pytest.mark.parametrize(("name", "code"), [("Tiny", 0), ("Missed", 1), ("Printed", 0), ("Speechless", 1)])
def test_only_a_target_that_is_missed_fails(name: str, code: int, tmp_path: Path) -> None:
    assert run(tmp_path, name) == code


def test_a_study_that_says_nothing_leaves_no_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(tmp_path, "Speechless")
    assert "seed 3 crashed" in capsys.readouterr().err
    assert not list((tmp_path / "out").glob("*.json"))


@pytest.mark.parametrize(("words", "count"), [((), 3), (("--quick",), 1), (("--count", "7"), 7)])
def test_its_sample_is_the_default_the_quick_one_or_what_is_asked_for(
    words: tuple[str, ...], count: int, tmp_path: Path
) -> None:
    assert run(tmp_path, "Tiny", *words) == 0
    (document,) = (tmp_path / "out").glob("*.json")
    assert json.loads(document.read_text(encoding="utf-8"))["rows"] == [{"count": count}]


@pytest.mark.parametrize(("words", "small"), [((), ""), (("--quick",), "count 1 instead of 3"), (("--count", "9"), "")])
def test_a_study_smaller_than_in_full_says_that_it_is_a_first_look(
    words: tuple[str, ...], small: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, "Printed", *words) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert ("is a first look, too little to judge by" in shown) is bool(small)
    assert small in shown
    (document,) = (tmp_path / "out").glob("*.json")
    assert json.loads(document.read_text(encoding="utf-8"))["first_look"] == small
    page = document.with_suffix(".html").read_text(encoding="utf-8")
    assert ("too little to judge by" in page) is bool(small)
    assert '<p class="good">' not in page  # for a claim that does not hold


def test_all_of_them_write_the_ledger_over_every_terrain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = (f"{HERE}:Tiny", f"{HERE}:Printed")
    monkeypatch.setattr(study, "names", lambda kind: names)
    out = tmp_path / "out"
    assert main(["study", "all", "--terrain", "jacksboro", "--terrain", "tian_shan", "--out", str(out)]) == 0
    ledger = (out / "CLAIMS.md").read_text(encoding="utf-8")
    assert all(word in ledger for word in ("jacksboro", "tian_shan", "tiny.count"))
    for terrain in ("jacksboro", "tian_shan"):
        assert {path.suffix for path in (out / terrain).iterdir()} == {".csv", ".png", ".json", ".html", ".db"}


def test_a_study_without_terrain_is_done_once_beside_the_folders_of_the_terrains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    over, anywhere = f"{HERE}:Tiny", f"{HERE}:Anywhere"
    monkeypatch.setattr(study, "names", lambda kind: (over, anywhere))
    out = tmp_path / "out"
    words = ["--quick", "--terrain", "jacksboro", "--terrain=tian_shan", "--out", str(out)]
    assert main(["study", "all", *words]) == 0
    document = json.loads((out / f"{anywhere.replace(':', '.')}.json").read_text(encoding="utf-8"))
    assert document["terrain"] is None
    assert document["command"] == f"mathnavi study {anywhere} --quick --out {out}"  # as it can be given
    assert not list(out.rglob(f"*/{anywhere.replace(':', '.')}.json"))
    page = (out / f"{anywhere.replace(':', '.')}.html").read_text(encoding="utf-8")
    assert "Over the terrain" not in page
    ledger = (out / "CLAIMS.md").read_text(encoding="utf-8")
    first, second = ledger.split("## Without terrain")
    assert "measured on tian_shan" in first
    assert second.count("tiny.count") == 1
    assert "tian_shan" not in second


def test_a_study_without_terrain_needs_none(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["study", f"{HERE}:Anywhere", "--out", str(out)]) == 0
    assert {path.suffix for path in out.iterdir()} == {".csv", ".png", ".json", ".html", ".db"}


def test_a_study_that_is_interrupted_keeps_what_has_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, marks = tmp_path / "out", tmp_path / "marks"
    marks.mkdir()
    monkeypatch.setenv("MARKS", str(marks))
    words = ["study", f"{HERE}:Patient", "--quick", "--workers", "2", "--out", str(out)]
    study = signalled(signal.SIGINT, "after", 2, *words)
    assert study.returncode == 130, study.stderr
    ended, begun = stored(out / "trials.db"), len(list(marks.iterdir()))
    assert 2 <= ended < 6
    command = shlex.join(["mathnavi", *words])
    assert (
        f"mathnavi: interrupted, {ended} results stored in {out / 'trials.db'}; to go on: {command}\n" in study.stderr
    )
    assert not list(out.glob("*.json"))
    assert main(words) == 0
    assert len(list(marks.iterdir())) - begun == 6 - ended


def test_a_study_that_asks_for_a_terrain_it_declared_it_does_not_need_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", f"{HERE}:Deceived", "--out", str(tmp_path / "out")]) == 1
    assert "on_terrain" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), ("NAME", "horizon", "all")),
        (("nonsense",), ("nonsense", "horizon")),
        (("horizon", "--terrain", "atlantis"), ("atlantis", "allowed")),
        (("horizon", "--terrain", "jacksboro", "--terrain", "jacksboro"), ("terrain", "once")),
        (("horizon", "--workers", "0"), ("--workers = 0", "allowed")),
        (("horizon", "--cluster", "nonsense"), ("cluster = 'nonsense'", "allowed")),
        (("horizon", "--seeds", "nan"), ("--seeds = nan", "allowed")),
        (("horizon", "--seeds", "0"), ("--seeds = 0", "allowed")),
        (("horizon", "--sead", "2"), ("--sead", "--seeds")),
        (("horizon", "--quick", "--no-quick"), ("--quick", "--no-quick", "one of both")),
        (("all", "--seeds", "2"), ("--seeds", "not a field")),
        ((f"{HERE}:Anywhere", "--terrain", "jacksboro"), ("--terrain jacksboro", "not done on a terrain", "allowed")),
        (("ocp-problems", "--problems", "0"), ("--problems = 0", "allowed")),
        (("ocp-problems", "--nodes", "1"), ("--nodes = 1", "allowed")),
        (("monitors", "--reference-nodes", "30"), ("--reference-nodes = 30", "allowed")),
        (("horizon", "--out", "/dev/null/x"), ("/dev/null", "allowed")),
    ],
)
def test_bad_input_is_one_line_with_exit_code_2(
    words: tuple[str, ...], expected: tuple[str, ...], capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["study", *words]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1, error
    assert all(word in error for word in expected), error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", study.names("studies"))
def test_a_studys_fields_are_no_options_of_the_command(name: str) -> None:
    _, studies = study.read_studies([name])
    assert list(studies) == [name]
