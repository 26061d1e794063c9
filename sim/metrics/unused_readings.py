"""Readings that the estimators of a run were given and did not use, and what an estimator waited for at its end."""

from __future__ import annotations

from collections import Counter
from typing import Any

from mathnavi.interfaces.reading_counts import unused_in, unused_text
from mathnavi.interfaces.signals import Status
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.records.figure_names import UNUSED_READINGS, UNUSED_REASONS, WAITS_FOR


def unused_figures(recording: Recording) -> dict[str, Any]:
    """Figures of a run's summary: the number of readings that all its estimators did not use, with the reasons if there
    are any; what the first estimator that is still INITIALISING in the end waits for. Empty if no estimator counts.
    """
    last = [agent.estimates[-1] for agent in recording.agents.values() if agent.estimates]
    counted = [counts for estimate in last if (counts := unused_in(estimate.extra)) is not None]
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
