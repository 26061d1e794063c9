"""The printed summary of a run gives the reason of a failure, and what a success hides."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console

from mathnavi.sim.commands.summary import summary_table, verdict, warnings
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.interfaces.signals import Event, Plan, Status
from mathnavi.sim.records.figure_names import SHORTFALL
from mathnavi.sim.scenarios.closed_loop import RunResult

OWN = Plan.failure(Status.OK)
FALLBACK = dataclasses.replace(OWN, notes=("fallback-plan",))


def recording(*plans: Plan, requests: int) -> Recording:
    agent = AgentRecorder("vehicle", [], np.zeros((1, 3)), {}, plans=[(0.0, plan) for plan in plans], requests=requests)
    return Recording(np.zeros(1), {"vehicle": np.zeros((1, 6))}, {"vehicle": agent}, [], {})


def test_a_run_that_failed_says_why_in_the_same_line() -> None:
    summary = {"min_clearance_m": 45.1, SHORTFALL: "min clearance 45.1 m < 50 m allowed"}
    failed = RunResult(recording(requests=1), summary, {}, success=False)
    assert verdict(failed) == f"the mission did NOT do what it should: {summary[SHORTFALL]}"
    assert verdict(dataclasses.replace(failed, summary={}, success=False)).endswith("what it should")
    assert verdict(dataclasses.replace(failed, summary={}, success=True)) == "the mission did what it should"


@pytest.mark.parametrize(
    ("plans", "requests", "warned"),
    [((OWN,), 3, False), ((FALLBACK, OWN), 3, False), ((FALLBACK,), 15, True), ((), 4, True), ((), 0, False)],
)
def test_it_is_warned_where_nothing_of_the_controllers_was_flown(
    plans: tuple[Plan, ...], requests: int, warned: bool
) -> None:
    found = warnings(recording(*plans, requests=requests))
    assert len(found) == warned
    assert all(f"{requests} answers" in words for words in found)


def test_each_kind_of_event_is_counted_and_has_the_message_of_its_first() -> None:
    events = [Event(float(k), "vehicle", "raised", f"TypeError: [{k}] returned NoneType") for k in range(15)]
    events.append(Event(99.0, "vehicle", "low-clearance", "1.2 m"))
    screen = io.StringIO()
    Console(file=screen, width=100).print(summary_table({"arrived": True, SHORTFALL: "late"}, events))
    shown = screen.getvalue()
    (raised,) = [line for line in shown.splitlines() if "raised" in line]
    assert raised.split()[-10:-1] == ["15", "first", "at", "0.0", "s,", "vehicle:", "TypeError:", "[0]", "returned"]
    assert "at 99.0 s, vehicle: 1.2 m" in shown
    assert "low clearance" in shown
    assert "late" not in shown  # stands in the verdict
