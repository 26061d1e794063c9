"""Replay gate: an adaptive solution is accepted only if it replays as well as the uniform one, or within tolerance.

Nodes that the optimiser may move are moved where the transcription's error hides; J then looks better than it is. The
gate compares what both do in the true dynamics (see ``mathnavi.controllers.ocp.replay``), figure by figure: one that is
large on both grids, as a path violation where a constraint begins to hold, does not hide another.
"""

from __future__ import annotations

import dataclasses

from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome

WORSE = 3.0
"""factor over the uniform solution's figure beyond which one is worse: a third fewer nodes cost that at order four"""


def gated(adaptive: Solution, uniform: Solution, method: str, tolerance: float) -> Solution:
    """Compare replays: the adaptive solution under its method's name, or the uniform one with the status REFUSED.

    A figure of the adaptive solution's replay is refused if it is larger than the tolerance and than ``WORSE`` times
    the uniform one's. The message says which. Both carry a replay where they are solutions at all. The time of the
    adaptive one is the time of the answer. Where the uniform solve failed there is nothing to compare with: the
    adaptive solution's message says so.
    """
    timing = adaptive.timing
    if not uniform.solved or uniform.replay is None:
        if not adaptive.solved:
            return dataclasses.replace(uniform, method=method, timing=timing)
        message = f"{adaptive.message}; not gated, for the uniform solve failed: {uniform.status.value}"
        return dataclasses.replace(adaptive, message=message, method=method, timing=timing)
    if not adaptive.solved or adaptive.replay is None:
        reason = f"{method}: {adaptive.status.value} ({adaptive.message})"
    elif worse := worse_figures(adaptive.replay, uniform.replay, tolerance):
        reason = f"{method}: replays with a {'; a '.join(worse)}"
    else:
        return dataclasses.replace(adaptive, method=method, timing=timing)
    return dataclasses.replace(uniform, status=SolverOutcome.REFUSED, message=reason, method=method, timing=timing)


def worse_figures(adaptive: ReplayResult, uniform: ReplayResult, tolerance: float) -> list[str]:
    """The figures by which an adaptive solution replays worse, with both values."""
    found = []
    for (name, own), other in zip(adaptive.figures.items(), uniform.figures.values(), strict=True):
        if not own <= max(tolerance, WORSE * other):
            found.append(f"{name} of {own:.3g}, uniform with {other:.3g}")
    return found
