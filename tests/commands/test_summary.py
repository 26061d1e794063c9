"""The printed summary of a run gives the reason of a failure, and what a success hides."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
from rich.console import Console

from mathnavi.commands.summary import summary_table, verdict
from mathnavi.interfaces.signals import Event
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.planning import NEVER_ANSWERED
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL
from mathnavi.sim.scenarios.closed_loop import RunData


def recording(requests: int = 1) -> Recording:
    agent = AgentRecorder("vehicle", [], np.zeros((1, 3)), {}, requests=requests)
    return Recording(np.zeros(1), {"vehicle": np.zeros((1, 6))}, {"vehicle": agent}, [], {})


def test_a_run_that_failed_says_why_in_the_same_line() -> None:
    summary = {"min_clearance_m": 45.1, SHORTFALL: "min clearance 45.1 m < 50 m allowed"}
    failed = RunData(recording(requests=1), summary, {}, success=False)
    assert verdict(failed) == f"mission FAILED: {summary[SHORTFALL]}"
    assert verdict(dataclasses.replace(failed, summary={}, success=False)).endswith("FAILED")
    assert verdict(dataclasses.replace(failed, summary={}, success=True)) == "mission succeeded"


def test_a_planner_without_a_part_stands_in_the_verdict_of_a_good_end_and_of_a_bad_one() -> None:
    summary = {PLANNER_STATUS: NEVER_ANSWERED}
    good = RunData(recording(), summary, {}, success=True)
    assert verdict(good) == f"mission succeeded; BUT THE PLANNER {NEVER_ANSWERED}"
    failed = dataclasses.replace(good, summary={**summary, SHORTFALL: "late"}, success=False)
    assert verdict(failed).endswith(f": late; BUT THE PLANNER {NEVER_ANSWERED}")


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
