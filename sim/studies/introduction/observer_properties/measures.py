"""Measures of the properties that observers declare (thesis Table 2.1), of a run of any scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from mathnavi.estimators.observability.region import exact_run
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.sim.interfaces.fields import instance, with_fields
from mathnavi.sim.interfaces.signals import Array, Status
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.scenarios.sphere_observer import SphereObserverConfig, config_mission
from mathnavi.sim.scenarios.textbook import TextbookConfig
from mathnavi.sim.studies.ranging.observability_measures import STANDARD, MapCase, drawn_start, driving

MEASURE = "mathnavi.sim.studies.introduction.observer_properties.measures:property_figures"

DECAYED = 0.1  # of the error at the start, below which an error has decayed
UNSURE = (0.3, 0.3, 0.3)  # [m, m, rad]
_LATE = 0.9  # of a run, from which on its last tenth lasts
_SOON = 1.0  # [s] in which what does not stay on the truth has left it, and round-off has not grown to be seen
_FALLEN = 1e-2  # of the error at the start: what falls to it may be exponential
_FLOOR = 2e-3  # likewise: below it, and below
_SMALL = 1e-3  # in the units of the state, what an observer's sampling and steps cost is seen, not its dynamics
_STEADY = 0.25  # of the first half's rate of decay, that of the second half of an exponential is at least
_FALLING = 0.9  # of the second third's largest error, that the last third's is at most where it still falls
_EXACT = 1e-9


class Decay(IntEnum):
    """Ways in which an error falls, ordered by the strength of the claim; the names are those of ``Rate``."""

    NONE = 0
    ASYMPTOTIC = 1
    EXPONENTIAL = 2
    FINITE_TIME = 3


def property_figures(outcome: RunResult) -> dict[str, Any]:
    """Measure the length of the error, from the first estimate that is not initialising on, in the units of the state.

    ``start`` is that of the start that the estimator was given, or that of its first estimate if it was given none;
    ``late`` that of the last tenth of the run, ``largest`` the largest, ``drift`` the largest of the first second.
    ``found`` says that a tenth of the start's is left at the end; without a start, what the scenario says.
    """
    given = _given_error(outcome)
    t, error = errors(outcome)
    if len(t) < 3:
        lost = dict.fromkeys(("start", "late", "largest", "drift"), math.inf)
        return {**lost, "decay": int(Decay.NONE), "found": False}
    late = float(np.sqrt(np.mean(np.square(error[t >= _LATE * t[-1]]))))
    start = float(error[0]) if given is None else given
    return {
        "start": start,
        "late": late,
        "largest": float(error.max()),
        "drift": float(error[t <= t[0] + _SOON].max()),
        "decay": int(decay(error, start)),
        "found": bool(outcome.summary["converged"] if given is None else late <= DECAYED * given),
    }


@dataclass(frozen=True)
class OnTruth:
    """A ranging estimator that is given its true start, with standard deviations ``UNSURE``."""

    estimator: str
    fields: Mapping[str, Any]
    seed: int


def ranging_drift(started: OnTruth) -> float:
    """The largest error [m, rad] within a second; what a scenario gives exactly it also declares certain."""
    case = MapCase("ellipse", 0.0, STANDARD, "2s")
    start = drawn_start(STANDARD, np.random.default_rng(started.seed))
    known = KnownStart((float(start[0]), float(start[1]), float(start[2])), UNSURE)
    mission = RangingMission(STANDARD, case.outputs.angles, start=known)
    run = exact_run(mission, start, driving, _SOON)
    plugin = load("estimators", started.estimator)
    estimator = plugin.build(with_fields(plugin.Config(), started.fields), mission)
    found = [estimator.update(*each) for each in zip(run.t, run.readings, run.commands, strict=True)]
    return max(math.hypot(*mission.error(one.x, truth)) for one, truth in zip(found, run.truth, strict=True))


def errors(outcome: RunResult) -> tuple[Array, Array]:
    """Times (k,) [s] and lengths of the error (k,), of the estimates that are not initialising, up to an escape."""
    recording = outcome.recording
    ((name, agent),) = recording.agents.items()
    ready = [estimate for estimate in agent.estimates if estimate.status is not Status.INITIALISING]
    escape = outcome.summary.get("escape_time_s")
    ready = [estimate for estimate in ready if escape is None or estimate.t <= escape]
    if not ready:
        return np.empty(0), np.empty(0)
    t, x = np.array([estimate.t for estimate in ready]), np.array([estimate.x for estimate in ready])
    truth = recording.truths[name][np.searchsorted(recording.t, t - 1e-9)]
    return t, lengths(outcome, x, truth)


def lengths(outcome: RunResult, x: Array, truth: Array) -> Array:
    """(k,) of the errors of estimates (k, nx) to truths (k, nx), as the scenario compares them."""
    scenario = load("scenarios", outcome.config["scenario"])
    config = instance(scenario.Config, outcome.config["fields"], "fields")
    length: Array = np.linalg.norm(np.array(list(scenario.errors(config, x, truth).values())), axis=0)
    return length


def decay(error: Array, start: float) -> Decay:
    """Classify how errors (k,) at equal intervals fall that were ``start`` at first.

    Exact from the second estimate on is finite time. An exponential falls to a hundredth, and in the second half of the
    time until it meets its floor not much slower than in the first; what falls by less, or ever more slowly, and is
    still less in the last third than in the second, is asymptotic.
    """
    if float(error[1:].max()) <= _EXACT * max(start, 1.0):
        return Decay.FINITE_TIME
    floor = max(_FLOOR * start, _SMALL)
    below = np.flatnonzero(error <= floor)
    end = int(below[0]) if len(below) else len(error)
    last = float(np.sqrt(np.mean(np.square(error[int(_LATE * len(error)) :]))))
    if end >= 4 and last <= max(_FALLEN * start, floor):
        middle = (end - 1) // 2
        fall = [math.log(start / error[middle]), math.log(error[middle] / error[end - 1])]
        if fall[1] >= _STEADY * fall[0]:
            return Decay.EXPONENTIAL
    thirds = np.array_split(error, 3)
    falling = last <= floor or float(thirds[2].max()) < _FALLING * float(thirds[1].max())
    return Decay.ASYMPTOTIC if last <= DECAYED * start and falling else Decay.NONE


def _given_error(outcome: RunResult) -> float | None:
    """Length of the error of the start that the estimator was given; None if it was given none."""
    if outcome.config["scenario"] == "textbook-observer":
        config = instance(TextbookConfig, outcome.config["fields"], "fields")
        believed, true = config.mission.start_state, config.start_state
    elif outcome.config["scenario"] == "sphere-observer":  # from a reading without error, and taken to be at rest
        moving = instance(SphereObserverConfig, outcome.config["fields"], "fields")
        size = config_mission(moving).system.manifold.size
        ((true, *_),) = outcome.recording.truths.values()
        believed = np.where(np.arange(len(true)) < size, true, 0.0)
    else:
        known, true = outcome.config["mission"]["known_start"], np.array(outcome.config["mission"]["start"])
        if known is None:
            return None
        believed = np.array(known["pose"])
    return float(lengths(outcome, believed[np.newaxis], true[np.newaxis])[0])
