"""The replay gate: an adaptive solution is taken only where it replays no worse than the uniform one.

Nodes that the optimiser may move are moved where the transcription's error hides; J then looks better than it is. The
gate compares what both do in the true dynamics (see ``mathnavi.controllers.ocp.replay``).
"""

from __future__ import annotations

import dataclasses

from mathnavi.controllers.ocp.solution import Outcome, Solution

LEAST = 1e-8
"""a replay value that is good enough, however good the uniform solution is"""


def gated(adaptive: Solution, uniform: Solution, method: str) -> Solution:
    """Compare replays: the adaptive solution under its method's name, or the uniform one with the status REFUSED.

    The message says why it was refused. Both carry a replay where they are solutions at all. The time of the adaptive
    one is the time of the answer. Where the uniform solve failed there is nothing to compare with: the adaptive
    solution's message says so.
    """
    timing = adaptive.timing
    if not uniform.ok or uniform.replay is None:
        if not adaptive.ok:
            return dataclasses.replace(uniform, method=method, timing=timing)
        message = f"{adaptive.message}; not gated, for the uniform solve failed: {uniform.status.value}"
        return dataclasses.replace(adaptive, message=message, method=method, timing=timing)
    if not adaptive.ok or adaptive.replay is None:
        reason = f"{method}: {adaptive.status.value} ({adaptive.message})"
    elif not adaptive.replay.value <= max(uniform.replay.value, LEAST):
        reason = f"{method}: replays with {adaptive.replay.value:.3g}, uniform with {uniform.replay.value:.3g}"
    else:
        return dataclasses.replace(adaptive, method=method, timing=timing)
    return dataclasses.replace(uniform, status=Outcome.REFUSED, message=reason, method=method, timing=timing)
