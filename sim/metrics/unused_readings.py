"""Readings that the estimators of a run were given and did not use, and what an estimator waited for at its end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from typing import Any

from mathnavi.interfaces.reading_counts import Unused, unused_in, unused_text
from mathnavi.interfaces.signals import Status
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.records.figure_names import UNUSED_READINGS, UNUSED_REASONS, WAITS_FOR


def unused_figures(recording: Recording, asked: Mapping[str, Collection[str]]) -> dict[str, Any]:
    """Figures of a run's summary: the number of readings that all its estimators did not use, with the reasons if there
    are any; what the first estimator that is still INITIALISING in the end waits for. Empty if no estimator counts.

    ``asked`` are the names of the sensors that the estimator of each vehicle requires. Those that a vehicle carries for
    others are of no sensor that its estimator should know, and not counted.
    """
    last, counted = [], []
    for name, agent in recording.agents.items():
        if agent.estimates:
            last.append(agent.estimates[-1])
            counts = unused_in(last[-1].extra)
            if counts is not None and agent.readings.keys() - set(asked.get(name, ())):
                counts.pop(Unused.UNKNOWN_SENSOR.value, None)
            counted += [] if counts is None else [counts]
    figures: dict[str, Any] = {}
    if counted:
        total: Counter[str] = Counter()
        for counts in counted:
            total.update(counts)
        figures[UNUSED_READINGS] = total.total()
        if total:
            figures[UNUSED_REASONS] = unused_text(total)
    waiting = [estimate.message for estimate in last if estimate.status is Status.INITIALISING and estimate.message]
    return figures | ({WAITS_FOR: waiting[0]} if waiting else {})
