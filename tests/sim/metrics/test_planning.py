"""How much of a run was flown as the planner chose, and whether anything was."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.interfaces.signals import Event, Plan, Status
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.planning import (
    ANSWERED_ONCE,
    NEVER_ANSWERED,
    ONLY_FALLBACK,
    guarantee_losses,
    planner_share,
    planner_status,
)

CHOSEN, AFTER = FlightPhase.OPTIMISED, FlightPhase.CRUISE


def plan(t_start: float, *arcs: tuple[float, int], notes: tuple[str, ...] = ()) -> Plan:
    """Arcs of (duration [s], phase) from a start [s]."""
    t = t_start + np.concatenate([[0.0], np.cumsum([duration for duration, _ in arcs])])
    zeros = np.zeros((len(t), 6))
    return Plan(t, zeros, zeros[1:, :3], np.array([phase for _, phase in arcs], np.int64), notes=notes)


FIRST = plan(0.0, (4.0, CHOSEN), (16.0, AFTER))


@pytest.mark.parametrize(
    ("plans", "share"),
    [
        ([], 0.0),
        ([(0.0, FIRST)], 0.2),  # asked once: what follows the optimised part is nobody's choice
        ([(0.0, FIRST), (2.0, plan(2.0, (4.0, CHOSEN), (20.0, AFTER)))], 0.3),
        ([(0.0, plan(0.0, (50.0, CHOSEN)))], 1.0),
        ([(0.0, plan(0.0, (5.0, CHOSEN)))], 0.25),  # and then there is no plan
        ([(0.0, plan(0.0, (8.0, FlightPhase.CLIMB), (12.0, AFTER)))], 1.0),  # its planner marks nothing
        ([(0.0, plan(0.0, (20.0, AFTER), notes=("fallback-plan",)))], 0.0),
        ([(0.0, FIRST), (10.0, plan(10.0, (20.0, AFTER), notes=("uncertified-plan", "rebased")))], 0.2),
        ([(0.0, FIRST), (10.0, plan(10.0, (20.0, CHOSEN), notes=("rebased",)))], 0.7),
        ([(5.0, plan(5.0, (30.0, CHOSEN)))], 0.75),  # late in the beginning
    ],
)
def test_the_share_is_that_of_what_the_planner_chose(plans: list[tuple[float, Plan]], share: float) -> None:
    assert planner_share(0.0, 20.0, plans) == pytest.approx(share)


def test_a_run_that_is_flown_as_planned_throughout_has_the_share_of_one() -> None:
    """However the planning periods add up."""
    times = 0.1 + 0.7 * np.arange(200)
    plans = [(t, plan(t, (5.0, CHOSEN))) for t in times]
    assert planner_share(float(times[0]), float(times[-1] + 0.3), plans) == 1.0
    assert planner_share(float(times[0]) - 1e-6, float(times[-1]), plans) < 1.0


def test_a_run_without_duration_has_no_share() -> None:
    assert planner_share(3.0, 3.0, [(3.0, dataclasses.replace(FIRST, t=FIRST.t + 3.0))]) == 0.0


RAISED = Plan.failure(Status.RAISED, "KeyError")
FALLBACK = dataclasses.replace(FIRST, notes=("fallback-plan",))
REBASED = dataclasses.replace(FIRST, notes=("uncertified-plan", "rebased"))


@pytest.mark.parametrize(
    ("answers", "flown", "status"),
    [
        ([FIRST, FIRST, RAISED], [FIRST, FIRST], ""),
        ([FALLBACK, FIRST], [FALLBACK, FIRST], ""),
        ([FALLBACK, RAISED], [FALLBACK], NEVER_ANSWERED),
        ([FALLBACK, REBASED], [FALLBACK, REBASED], NEVER_ANSWERED),
        ([RAISED], [], NEVER_ANSWERED),
        ([RAISED], [FIRST], NEVER_ANSWERED),  # what is flown was there from the start
        ([FIRST, RAISED], [FIRST], ""),  # a short run
        ([FIRST, RAISED, RAISED], [FIRST], ANSWERED_ONCE),
        ([FALLBACK, FIRST], [FALLBACK], ONLY_FALLBACK),  # too late, for one
        ([FIRST], [], ONLY_FALLBACK),
        ([], [FIRST], ""),  # was not asked
    ],
)
def test_a_planner_without_a_part_has_a_status(answers: list[Plan], flown: list[Plan], status: str) -> None:
    agent = AgentRecorder("north", [], np.zeros((1, 3)), {}, plans=[(0.0, plan) for plan in flown])
    for answer in answers:
        agent.asked(answer)
    recording = Recording(np.zeros(1), {}, {"north": agent}, [], {})
    assert planner_status(recording) == status
    silent = AgentRecorder("south", [], np.zeros((1, 3)), {})
    silent.asked(RAISED)
    recording.agents["south"] = silent
    named = [f"north: {status}"] if status else []
    assert planner_status(recording) == "; ".join([*named, f"south: {NEVER_ANSWERED}"])


@pytest.mark.parametrize(
    ("kinds", "losses"),
    [
        (["guarantee-held"], 0),
        (["guarantee-not-yet", "guarantee-held", "guarantee-lost", "guarantee-held", "guarantee-lost"], 2),
        (["guarantee-held", "guarantee-endangered", "guarantee-held"], 0),
        (["guarantee-not-yet"], 1),  # it never began
        ([], None),  # nothing is guaranteed
        (["Mine: guarantee-held"], None),  # what a certifier of a stranger says is no word of the guarantee
    ],
)
def test_a_guarantee_that_nobody_announces_has_no_losses(kinds: list[str], losses: int | None) -> None:
    assert guarantee_losses([Event(0.0, "a", kind) for kind in kinds], ("a",)) == losses
    assert guarantee_losses([Event(0.0, "a", kind) for kind in kinds], ("a", "b")) is None
