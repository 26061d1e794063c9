"""Outcomes of plan requests, the times of their optimisation, and the share of a run flown on the resulting plans."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from mathnavi.interfaces.signals import OPTIMISED, Event, Plan
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording

FAILURES = ("solver-failed", "infeasible", "raised", "not-finite", "malformed")
_GUARANTEE = "guarantee-"  # begins the kind of an event that announces a state
NEVER_ANSWERED = "never answered with a plan"
ANSWERED_ONCE = "answered the first request only"
ONLY_FALLBACK = "not one of its plans was flown"
REJECTIONS = ("low-clearance", "off-map", "bounds", "not-trackable", "deadline", "no-arrival", "wrong-start")


def planner_share(begin: float, end: float, plans: Sequence[tuple[float, Plan]]) -> float:
    """Share, 0 to 1, of the time from ``begin`` to ``end`` [s] in which parts of plans chosen by the planner were
    flown.

    ``plans`` are (adopted at [s], plan), in order. If a plan has arcs marked ``OPTIMISED`` only these count, otherwise
    all arcs; the arcs after them, for instance a safety manoeuvre and the completion after it, are flown only if no
    later plan was received. Plans of a fallback planner do not count.
    """
    followed_at = [*(adopted for adopted, _ in plans), math.inf][1:]
    flown = 0.0
    for (adopted, plan), following in zip(plans, followed_at, strict=False):
        if plan.by_fallback:
            continue
        chosen = plan.phase == OPTIMISED if (plan.phase == OPTIMISED).any() else np.ones(len(plan.phase), dtype=bool)
        first, last = max(begin, adopted), min(end, following)
        flown += float(np.diff(np.clip(plan.t, first, max(first, last)))[chosen].sum())
    if not end > begin:
        return 0.0
    return flown / (end - begin) if flown < end - begin - TIME_TOLERANCE else 1.0  # which rounding has kept it from


def planner_status(recording: Recording) -> str:
    """Reason why a planner had no part in a run after its start, "" if all planners had.

    It never answered with a plan, answered the first of three requests or more and no other, or only plans of the
    fallback planner were flown. Each such vehicle of a fleet is named.
    """
    found = []
    for name, agent in recording.agents.items():
        if not agent.requests:
            continue
        if not agent.answers:
            found.append((name, NEVER_ANSWERED))
        elif agent.answers == 1 < agent.requests - 1:
            found.append((name, ANSWERED_ONCE))
        elif all(plan.by_fallback for _, plan in agent.plans):
            found.append((name, ONLY_FALLBACK))
    return "; ".join(words if len(recording.agents) == 1 else f"{name}: {words}" for name, words in found)


def guarantee_losses(events: Sequence[Event], names: Iterable[str]) -> int | None:
    """Number of times that the guarantee of the vehicles ``names`` was lost; one that never began is a loss too.

    None if one of them has announced no state of its guarantee: it has none that could be lost.
    """
    states: dict[str, list[str]] = {name: [] for name in names}
    for event in events:
        if event.agent in states and event.kind.startswith(_GUARANTEE):
            states[event.agent].append(event.kind.removeprefix(_GUARANTEE))
    if not all(states.values()):
        return None
    return sum(max(named.count("lost"), {*named} == {"not-yet"}) for named in states.values())


def solve_times(solve_ms: Sequence[float]) -> dict[str, float]:
    """Figures of the summary on the times of the optimisations [ms]; NaN without any."""
    times = np.array(solve_ms) if solve_ms else np.array([np.nan])
    return {
        "solve_ms_mean": float(times.mean()),
        "solve_ms_p50": float(np.percentile(times, 50)),
        "solve_ms_p99": float(np.percentile(times, 99)),
        "solve_ms_max": float(times.max()),
    }
