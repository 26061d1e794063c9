"""``mathnavi compare``: two runs, sweeps or studies side by side, and what cannot be compared."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.renders.comparison.report import MARK, compare
from mathnavi.renders.comparison.sweeps import differ, paired
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record, Store
from tests.renders.reading import check_stands_alone

OSCILLATION = ("run", "textbook-observer", "--system", "krener-isidori", "--noise", "0.02", "--duration", "2")
CLAIM = {"id": "X.1", "kind": "printed", "statement": "It falls", "source": "p. 1", "expected": "falls"}

Side = Callable[..., Path]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs that differ in one field: ``one`` and ``other``."""
    folder = tmp_path_factory.mktemp("runs")
    for name, pole in (("one", "-4"), ("other", "-6")):
        poles = ("--estimator", "output_injection", "--estimator.poles", "-3", pole, "--tolerance", "1")
        assert main([*OSCILLATION, *poles, "--out", str(folder / name)]) == 0
    return folder


@pytest.fixture
def sweep(tmp_path: Path) -> Side:
    """A store of trials that land on their heads by chance."""

    def made(name: str, successes: int, trials: int = 40, scenario: str = "coin", first: int = 0) -> Path:
        with Store.open(tmp_path / name) as store:
            store.add(
                *(
                    Record(f"{name}{k}", scenario, {"config": {"bias": successes / trials}}, first + k, "code", "ok",
                           k < successes, {"height_m": 1.0 + k / trials, "landed": k < successes})
                    for k in range(trials)
                )
            )  # fmt: skip
        return tmp_path / name

    return made


@pytest.fixture
def studies(tmp_path: Path) -> Side:
    """A folder with the document of a study."""

    def made(name: str, holds: bool | None, measured: str = "it fell", study: str = "falling") -> Path:
        folder = tmp_path / name
        folder.mkdir()
        claims = [CLAIM | {"holds": holds, "measured": measured}]
        (folder / f"{study}.json").write_text(json.dumps({"study": study, "terrain": None, "claims": claims}))
        return folder

    return made


def rows(left: Path, right: Path, title: str) -> dict[str, Any]:
    """Rows of a table of the comparison, by the first cell that names a row."""
    table = next(table for table in compare(left, right).tables if table.title.startswith(title))
    where = table.columns.index("figure") if "figure" in table.columns else 0
    return {str(row[where]): dict(zip(table.columns, row, strict=True)) for row in table.rows}


def test_runs_show_the_field_that_differs_and_every_figure(runs: Path) -> None:
    left, right = runs / "one", runs / "other"
    fields = rows(left, right, "Fields that differ")
    assert list(fields) == ["estimator.poles"]
    assert fields["estimator.poles"]["other"] == "(-3, -6)"
    summary = rows(left, right, "Summary")
    figures = [json.loads((side / "summary.json").read_text()) for side in (left, right)]
    ratio = figures[1]["error_rms"] / figures[0]["error_rms"]
    assert float(summary["error rms"]["ratio"]) == pytest.approx(ratio, rel=0.01)
    assert summary["error rms"]["difference"].startswith("−" if ratio < 1.0 else "+")


def test_a_run_beside_itself_differs_in_nothing(runs: Path) -> None:
    assert list(rows(runs / "one", runs / "one", "Fields")) == ["every field"]
    for name, row in rows(runs / "one", runs / "one", "Summary").items():
        assert row["difference"] in ("0", "–"), name


def test_runs_of_other_code_or_files_differ(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = json.loads((shutil.copytree(runs / "one", tmp_path / "changed") / "config.json").read_text())
    config |= {"code": f"{config['code']}+rover-4a876c28", "inputs": {"config.model": "f00d"}}
    (tmp_path / "changed/config.json").write_text(json.dumps(config))
    assert main(["compare", str(runs / "one"), str(tmp_path / "changed")]) == 0
    printed = capsys.readouterr().out
    assert "code" in printed
    assert "digest of config.model" in printed
    assert "the same in both" not in printed


def test_the_page_has_the_states_and_errors_of_both_runs(runs: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    for _ in range(2):  # an earlier comparison is replaced
        assert main(["compare", str(runs / "one"), str(runs / "other"), "--out", str(page)]) == 0
    shown = page.read_text()
    assert MARK in shown
    assert shown.count("<figure") == 2
    check_stands_alone(shown)


def test_rates_differ_if_their_limits_are_apart(sweep: Side) -> None:
    left, near, far = sweep("a.db", 20), sweep("b.db", 22, first=100), sweep("c.db", 38, first=100)
    assert rows(left, near, "Rates")["success"]["differ"].startswith("not shown")
    success = rows(left, far, "Rates")["success"]
    assert success["a"] == rate(20, 40).text()
    assert success["differ"].startswith("yes")
    assert rows(left, far, "Fields")["bias"]["a"] == "0.5"
    assert rows(left, near, "Medians")["height [m]"]["bands"] == "overlap"


def test_trials_of_the_same_seeds_are_paired(sweep: Side) -> None:
    sides = [sweep("a.db", 20), sweep("b.db", 28)]
    difference = rows(*sides, "Rates")["success"]["differ"]
    assert difference == "yes: 0 only in a, 8 only in b"  # though the limits of 20 and 28 of 40 overlap
    records = []
    for side in sides:
        with Store.existing(side) as store:
            records.append(store.records())
    assert len(paired(*records)) == 40
    assert not paired([*records[0], replace(records[0][0], key="again")], records[1])
    happened = lambda record: record.success  # noqa: E731
    assert differ((rate(20, 40), rate(28, 40)), (), happened, ("a", "b")).startswith("not shown")


def test_claims_that_changed_their_verdict_are_reported(studies: Side) -> None:
    held, fell = studies("held", True), studies("fell", False, "it rose")
    comparison = compare(held, fell)
    assert comparison.verdict == "1 of 1 claims changed verdict: 1 yes → no."
    assert rows(held, fell, "Claims with another verdict")["falling"]["fell"] == "no: it rose"
    same = studies("same", True, "it fell fast")
    assert compare(held, same).verdict.startswith("0 of 1")
    assert "falling" in rows(held, same, "Claims with the same verdict")
    assert main(["compare", str(held / "falling.json"), str(fell), "--out", str(held / "page.html")]) == 0


def test_what_cannot_be_compared_is_refused_in_one_line(
    runs: Path, sweep: Side, studies: Side, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other_scenario, broken = runs / "one", tmp_path / "scenario", tmp_path / "broken"
    for copy in (other_scenario, broken):
        shutil.copytree(one, copy)
    config = json.loads((one / "config.json").read_text()) | {"scenario": "arm-velocity"}
    (other_scenario / "config.json").write_text(json.dumps(config))
    (broken / "log.npz").write_bytes(b"nothing")
    coin, dice, study = sweep("coin.db", 3), sweep("dice.db", 3, scenario="dice"), studies("study", True)
    text, empty = tmp_path / "text.txt", tmp_path / "empty"
    text.write_text("words")
    empty.mkdir()
    capsys.readouterr()
    for left, right, message in (
        (one, other_scenario, "arm-velocity"),
        (one, coin, "two of one kind"),
        (coin, dice, "dice"),
        (study, one, "two of one kind"),
        (study, studies("unlike", True, study="rising"), "a study in common"),
        (one, broken, "log.npz"),
        (coin, text, "text.txt"),
        (one, empty, "empty"),
        (one, tmp_path / "absent", "absent"),
    ):
        assert main(["compare", str(left), str(right), "--out", str(tmp_path / "page.html")]) == 2
        said = capsys.readouterr().err
        assert message in said
        assert said.count("\n") == 1
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize("out", ["notes.html", "notes.txt"])
def test_no_file_of_another_kind_is_overwritten(
    runs: Path, out: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / out
    page.write_text("mine")
    assert main(["compare", str(runs / "one"), str(runs / "other"), "--out", str(page)]) == 2
    assert "--out" in capsys.readouterr().err
    assert page.read_text() == "mine"


def test_runs_of_different_lengths_are_drawn_over_each_other(runs: Path, tmp_path: Path) -> None:
    short = tmp_path / "short"
    shutil.copytree(runs / "one", short)
    with np.load(short / "log.npz") as log:
        arrays = {name: rows[: len(rows) // 2] for name, rows in log.items() if not name.startswith("plan")}
    np.savez(short / "log.npz", **arrays)
    assert [name for name, _, _ in compare(short, runs / "other").draw()] == ["states", "errors"]
