"""Detection of an unbounded problem: a final time at a limit that was not stated, a value that ran away."""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, ProblemFunctions
from mathnavi.interfaces.signals import Array

HUGE = 1e8
"""factor over its scale, or the largest of its guess and its limits, above which a value ran away"""

_AT_LIMIT = 1e-3  # relative distance


def unbounded(problem: ProblemFunctions, x: Array, u: Array, duration: float, *, diverged: bool) -> str:
    """Message with the variables of a last iterate that are unbounded; empty if all are bounded.

    A state follows from controls and T: where these keep within limits, a large state is the problem's own, unless the
    solver ``diverged``.

    Args:
        problem: the problem.
        x: (n, nx) states.
        u: (m, nu) controls.
        duration: [s] T.
        diverged: True if the solver itself found that its iterates run away.
    """
    durations = [("T", duration, problem.duration_bounds, problem.guess_duration)] if problem.free_duration else []
    for i, name in enumerate(problem.states):  # of phases
        if name.endswith(".duration"):
            limits = float(problem.state_bounds.lower[i]), float(problem.state_bounds.upper[i])
            durations.append((name, float(x[0, i]), limits, float(problem.state_scale[i])))
    found = [_duration(*each) for each in durations]
    found += _running_away(problem.controls, u, problem.control_scale, problem.guess_controls, problem.control_bounds)
    if diverged or any(found):
        found += _running_away(problem.states, x, problem.state_scale, problem.guess_states, problem.state_bounds)
    return "; ".join(filter(None, found))


def _duration(label: str, duration: float, limits: tuple[float, float], typical: float) -> str:
    for name, limit, default in zip(("lower", "upper"), limits, DURATION_LIMITS, strict=True):
        if limit == default and abs(duration - limit) <= _AT_LIMIT * limit:
            return f"{label} ends at {limit:g} s, its default {name} limit; state one, or a cost that bounds it"
    if limits[1] == DURATION_LIMITS[1] and duration > HUGE * typical:
        return f"{label} runs to {duration:.2g} s; state an upper limit, or a cost that bounds it"
    return ""


def _running_away(
    names: tuple[str, ...], values: Array, scale: Array, guess: Array, bounds: tuple[Array, Array]
) -> list[str]:
    known = np.vstack([scale, np.abs(guess), *(np.where(np.isfinite(b), np.abs(b), 0.0) for b in bounds)]).max(axis=0)
    largest = np.abs(values).max(axis=0, initial=0.0)
    return [
        f"{name} runs to {values[np.abs(values[:, i]).argmax(), i]:.2g}; state a limit, or a cost that bounds it"
        for i, name in enumerate(names)
        if largest[i] > HUGE * known[i]  # NaN is reported elsewhere
    ]
