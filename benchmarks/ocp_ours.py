"""A problem of ``mathnavi.controllers.ocp`` solved by ``solve()`` with the method that it chooses.

Witnesses of the status, whatever ``solve()`` looks for before it calls a solution optimal, are in its time.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.ocp_trajectory import Trajectory
from mathnavi.controllers.ocp.methods.by_name import solve_by
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.variable_radau import own_points


def solved(problem: ProblemFunctions, tolerance: float) -> Trajectory | None:
    """Return the solution for a ``tolerance`` of its replay, whether it meets it or not; None if the solver failed."""
    unknown = dataclasses.replace(problem)  # the same problem as one that no cache has seen
    solution = solve_by(
        unknown, None, "auto", None, guess=None, parameters=problem.nominal, tolerance=tolerance, progress=False
    )
    if not solution.solved:
        return None
    points = tuple(np.array(own_points(solution.scheme, i)) for i in range(solution.nodes - 1))
    controls = tuple(u[: len(own)] for u, own in zip(solution.u, points, strict=True))
    return Trajectory(problem, solution.duration, solution.grid.nodes, solution.x, points, controls, solution.cost)
