"""Rows of the table, the table, and the file."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks import __main__ as every
from benchmarks.comparison import WIDTH, Comparison, Machine, Ratio, alone, table

OURS, OTHER = np.array([1.0, 2.0, 4.0]), np.array([2.0, 4.0, 2.0])  # neighbours: 2, 2, 0.5


def row(ratio_of: Ratio = "other / ours", **bounds: float) -> Comparison:
    return Comparison("a walk", "s", OURS, OTHER, "another's legs", ratio_of, **bounds)


class Walks:
    """Findings of one row."""

    title = "walks"

    def comparisons(self) -> list[Comparison]:
        return [row(at_least=1.5)]

    def show(self, console: Console) -> None:
        console.print("It rained.")

    def plain(self) -> dict[str, Any]:
        return {"weather": "rain"}


def test_the_ratio_is_the_median_of_the_ratios_of_neighbours() -> None:
    assert row().ratio == 2.0
    assert row("ours / other").ratio == 0.5
    assert row().plain()["ratio_least"] == 0.5
    assert row().plain()["ratio_greatest"] == 2.0


@pytest.mark.parametrize(
    ("bounds", "wanted", "holds"),
    [
        ({}, "", None),
        ({"at_least": 2.0}, ">= 2", True),
        ({"at_least": 2.1}, ">= 2.1", False),
        ({"at_most": 1.9}, "<= 1.9", False),
        ({"at_most": 2.0}, "<= 2", True),
    ],
)
def test_a_bound_holds_for_the_ratio(bounds: dict[str, float], wanted: str, holds: bool | None) -> None:
    assert (row(**bounds).wanted, row(**bounds).holds) == (wanted, holds)


def test_the_table_shows_every_row_and_the_machine() -> None:
    machine, console = Machine.here().plain(), Console(width=WIDTH)
    with console.capture() as shown:
        console.print(table([Walks()], machine))
    text = shown.get()
    for part in ("walks", "a walk", "2 s", "another's legs", "0.5 .. 2", "other / ours", ">= 1.5 yes"):
        assert part in text
    assert machine["processor"].split()[0] in text


def test_every_part_lands_in_one_table_and_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        every, "parts", lambda quick, before: {"walks": lambda console: Walks(), "more": lambda console: Walks()}
    )
    every.main(every.Arguments(quick=True, out=tmp_path / "new" / "all.json"))
    assert capsys.readouterr().out.count("a walk") == 2
    written = json.loads((tmp_path / "new" / "all.json").read_text(encoding="utf-8"))
    assert [entry["part"] for entry in written["rows"]] == ["walks", "more"]
    assert written["rows"][0]["ratio"] == 2.0
    assert written["parts"]["more"] == {"weather": "rain"}
    assert written["machine"]["cores"] >= 1
    assert written["machine"]["quick"]


def test_a_part_alone_says_all_it_has_to_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone("walks", lambda console: Walks(), tmp_path / "walks.json")
    shown = capsys.readouterr().out
    assert "It rained." in shown
    assert "a walk" in shown
    assert json.loads((tmp_path / "walks.json").read_text(encoding="utf-8"))["rows"][0]["part"] == "walks"


def test_a_part_that_fails_costs_the_others_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(console: Console) -> Walks:
        raise RuntimeError("it snowed")

    monkeypatch.setattr(every, "parts", lambda quick, before: {"runs": fails, "walks": lambda console: Walks()})
    assert every.main(every.Arguments(out=tmp_path / "all.json")) == 1
    shown = capsys.readouterr().out
    assert "runs failed: it snowed" in shown
    assert "a walk" in shown
    assert json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))["machine"]["failed"] == {"runs": "it snowed"}


def test_parts_are_chosen_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walks = {name: lambda console: Walks() for name in ("walks", "more")}
    monkeypatch.setattr(every, "parts", lambda quick, before: walks)
    assert every.main(every.Arguments(only=("more",), out=tmp_path / "all.json")) == 0
    assert list(json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))["parts"]) == ["more"]
    with pytest.raises(ValueError, match="only = 'runs'; allowed: walks, more"):
        every.main(every.Arguments(only=("runs",)))


@pytest.mark.parametrize(
    ("module", "field", "value"),
    [
        *((module, "repetitions", 0) for module in ("flight_solvers", "loop_overhead", "ocp_peers", "start_up")),
        ("flight_solvers", "problems", 0),
        ("sweep_scaling", "workers", 1),
        ("sweep_scaling", "trials", 5),
        ("tests_by_folder", "workers", -1),
    ],
)
def test_too_little_is_no_measurement(module: str, field: str, value: int) -> None:
    with pytest.raises(ValueError, match=f"{field} = {value}; allowed: >= "):
        import_module(f"benchmarks.{module}").Arguments(**{field: value})
