"""Meanings of the kinds of events, which reports open at their names, and which of them are alarms."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from mathnavi.interfaces.signals import Event, Status
from mathnavi.sim.records.documents import LOG_SCENARIO

ALARMS: dict[str, str] = {  # a promise that is broken or in danger, or a fault of a component
    "guarantee-lost": "No certified plan is flown, or what it assumes does not hold any more: nothing is promised.",
    "guarantee-endangered": "The vehicle is off its plan or the map has changed; a certified way to safety is flown.",
    "deadline-lost": "A new plan was needed, and it ends after the deadline.",
    "tracking-breach": "The vehicle is farther from its plan than the tracking bound allows.",
    "plan-endangered": "By what is known now, the plan being flown is not safe.",
    "arrival-lost": "No plan leads to where the target is now.",
    "arrival-unkept": "A vehicle of a fleet will not be there at the time that was agreed.",
    "missed-pass": "The target was passed outside the radius that counts as arrival.",
    "ground-contact": "The vehicle touches the ground, or something else.",
    "ground-impact": "The missile has come down to the ground.",
    "position-jump": "A fault has moved the vehicle aside at once.",
    "separation-unguaranteed": "A plan took over that not every other vehicle had acknowledged.",
    "command-unusable": "A command was missing, no number or too large; the loop's own tracker took its place.",
    "coordinator-raised": "The coordinator ended with an error.",
    "estimate-unusable": "An answer of the estimator was no estimate.",
    "events-unusable": "A component answered with events that are none.",
    "physics-warning": "MuJoCo warns of its own numbers.",
    "diverged": "A number of the simulation has become infinite.",
    "escaped": "The state has left every bound.",
    "blind": "The robot has no reading to estimate its pose from.",
}  # fmt: skip
ROUTINE: dict[str, str] = {  # what the loop is made for: plans that are dropped, messages, changes of state
    "guarantee-held": "A certified plan is flown, within its tracking bound.",
    "message": "The vehicle was told something: an agreed time of arrival, a radar, a target, a new map.",
    "estimator-status": "The estimator says how good its estimate is.",
    "separation-yielded": "The vehicle let another one's plan pass before its own.",
    "separation-refused": "Another vehicle did not admit this plan, for it came too near to its own.",
    "separation-heard": "A vehicle that had been silent was heard again.",
    "separation-silent": "Nothing has been heard from another vehicle for a while.",
    "not-admitted": "Not every other vehicle had acknowledged a plan, so the one before goes on.",
    "arrival-kept": "The vehicle can be there at the time that was agreed.",
    "arrival-deferred": "The vehicle asks for a later time of arrival.",
    "arrival-regained": "A plan leads to the target again.",
    "arrival-unknown": "How late the vehicle can be there is not known yet.",
    "deadline-moved": "The target has moved, and the deadline with it.",
    "sensor-left-out": "The estimator leaves out a sensor that is at fault, or uses one again.",
    "sensor-unused": "The estimator makes no use of readings that there are.",
    "input-clipped": "A command was larger than the actuator allows, and was cut to that.",
    "late": "A plan came after the time at which it was to begin, and was dropped.",
    "wrong-start": "A plan does not begin where the vehicle will be, and was dropped.",
    "not-trackable": "The tracker cannot keep its bound over a plan, which was dropped.",
    "infeasible": "A plan did not keep its constraints, and was dropped; the one before goes on.",
    "not-finite": "A plan has numbers that are not finite, and was dropped.",
    "malformed": "A plan is none by its shape or its times, and was dropped.",
    "solver-failed": "The planner's solver found no plan; the one before goes on.",
    "iteration-limit": "The solver stopped at its most iterations, with a plan that keeps its constraints.",
    "estimate-names": "The names that an estimator declares do not fit its estimates.",
}  # fmt: skip

OF_ESTIMATORS = (
    "estimator-status", "estimate-unusable", "estimate-names", "sensor-left-out", "sensor-unused",
    "estimate-recovered", "estimate-diverged",
)  # fmt: skip
"""kinds that the estimator of a run causes; all others happen to the vehicle, its planner, tracker or coordinator"""


SIGN = "estimator_sign"
"""key in config.json: the name with which the kinds of an estimator that is not mathnavi's own begin"""


def is_alarm(event: Event) -> bool:
    """True for an event that a reader should look at: an alarm of the loop, or an estimate that is lost."""
    if event.kind == "estimator-status":
        return event.message.startswith(Status.LOST.name.lower())
    return event.kind in ALARMS


def of_estimator(event: Event, others: Collection[str] = ()) -> bool:
    """True for an event that the estimator of a run caused.

    The kinds of a plug-in that is not mathnavi's own begin with its name; ``others`` are the names of the planner and
    the tracker.
    """
    name, colon, _ = event.kind.partition(": ")
    return event.kind in OF_ESTIMATORS or bool(colon and name not in others)


def with_origin(events: Sequence[Event], config: Mapping[str, Any]) -> list[tuple[Event, str]]:
    """Return events with what they belong to where the estimator of a run did not fly it, but ran over its readings
    (``config`` names the folder of the flight as "recorded"): "estimate" or "flight", of a recorded log "log"; "" for
    any other run.
    """
    if config.get("recorded") is None:
        return [(event, "") for event in events]
    own = f"{config[SIGN]}: " if config.get(SIGN) else "\n"  # which no kind begins with
    caused = (event.kind in OF_ESTIMATORS or event.kind.startswith(own) for event in events)
    other = "log" if config.get("scenario") == LOG_SCENARIO else "flight"
    return [(event, "estimate" if each else other) for event, each in zip(events, caused, strict=True)]


def event_definition(kind: str) -> str:
    """Meaning of a kind of event; "" for that of a plug-in."""
    return ALARMS.get(kind) or ROUTINE.get(kind, "")
