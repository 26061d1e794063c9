"""Whether a mesh can follow the guess of a problem.

A spiral of eight turns on twelve intervals of three points is another curve: the solver leaves the guess for what the
mesh can follow, and does not come back.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.scheme import weights

_FOLLOWED = 0.02  # of a state's scale
_BETWEEN = np.linspace(0.05, 0.95, 10)  # fractions of an interval


def follows_guess(problem: ProblemFunctions, grid: Grid, count: int) -> bool:
    """True if the polynomials of a mesh with ``count`` points an interval pass within 0.02 of a scale of the guess."""
    points = np.concatenate([[0.0], RadauIIA(count).points])
    starts, widths = grid.nodes[:-1, None], grid.widths[:, None]
    shape = len(widths), -1, problem.nx
    at_points, between = (
        problem.guess.states_at((starts + fractions * widths).ravel()).reshape(shape)
        for fractions in (points, _BETWEEN)
    )
    followed = np.einsum("gk,nkm->ngm", weights(tuple(points.tolist()), _BETWEEN), at_points)
    return bool((np.abs(followed - between) <= _FOLLOWED * problem.state_scale).all())
