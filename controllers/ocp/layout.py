"""Layout of the unknowns of a programme, stage by stage, and the points at which its rows hold (see ``nlp``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, gauss_legendre, weights
from mathnavi.sim.interfaces.signals import Array

SLOPE = 1e-3
"""share of a control's slope in its variation"""


@dataclass(frozen=True, eq=False)
class ProgrammeLayout:
    """Layout of the vector of unknowns (size,): the place and the scale of each part, see the module."""

    problem: ProblemFunctions
    scheme: Scheme
    nodes: int  # N
    moving: bool  # True if the nodes are unknowns
    constants: int  # number of the distribution's constants s
    arcs: int = 1  # A

    @property
    def free_duration(self) -> bool:
        """True if T is an unknown."""
        return self.problem.free_duration

    @property
    def durations(self) -> int:
        """Number of unknown durations: the lengths of several arcs, or T if it is free."""
        return self.arcs if self.arcs > 1 else int(self.free_duration)

    @property
    def state_size(self) -> int:
        """Size of z_i = (x_i, T, s, τ_i)."""
        return self.problem.nx + self.durations + self.constants + int(self.moving)

    @property
    def own_points(self) -> int:
        """Number of an interval's control points that are not those of the next."""
        return len(self.scheme.points) - int(self.scheme.shared)

    @property
    def input_size(self) -> int:
        """Size of w_i = (U_i, X_i, D_i), but for the last stage."""
        p = self.problem
        return self.own_points * p.nu + self.scheme.interior * p.nx + int(self.moving)

    @property
    def last_input_size(self) -> int:
        """Size of w_N in the last stage: its control, if the scheme shares it between intervals."""
        return self.problem.nu if self.scheme.shared else 0

    @property
    def smoothed(self) -> int:
        """Number of controls whose variation within an interval a weight ρ holds down: all that may jump at nodes."""
        return self.problem.nu if fractions_between(self.scheme) else 0

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return (self.nodes - 1) * (self.state_size + self.input_size) + self.state_size + self.last_input_size

    @cached_property
    def state_scale(self) -> Array:
        """Scales (state_size,) of z."""
        duration = np.full(self.durations, self.problem.guess_duration)
        return np.concatenate([self.problem.state_scale, duration, np.ones(self.constants + int(self.moving))])

    @cached_property
    def input_scale(self) -> Array:
        """Scales (input_size,) of w."""
        p = self.problem
        return np.concatenate(
            [
                np.tile(p.control_scale, self.own_points),
                np.tile(p.state_scale, self.scheme.interior),
                np.ones(int(self.moving)),
            ]
        )

    @cached_property
    def scale(self) -> Array:
        """Scales (size,) of the unknowns."""
        stage = np.concatenate([self.state_scale, self.input_scale])
        last = [self.state_scale, self.problem.control_scale if self.scheme.shared else np.empty(0)]
        return np.concatenate([np.tile(stage, self.nodes - 1), *last])

    def split(self, unknowns: Array) -> tuple[Array, Array, Array]:
        """Split scaled unknowns (size,) into z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,).

        The parts are in the problem's units, no longer over their scales.
        """
        values = unknowns * self.scale
        stage = self.state_size + self.input_size
        body = values[: (self.nodes - 1) * stage].reshape(self.nodes - 1, stage)
        tail = values[(self.nodes - 1) * stage :]
        z = np.vstack([body[:, : self.state_size], tail[: self.state_size]])
        return z, body[:, self.state_size :], tail[self.state_size :]

    def join(self, z: Array, w: Array, last: Array) -> Array:
        """Join z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,) to scaled unknowns (size,).

        The inverse of ``split``.
        """
        body = np.hstack([z[:-1], w]).ravel()
        joined: Array = np.concatenate([body, z[-1], last]) / self.scale
        return joined


def variation(scheme: Scheme) -> Array:
    """Matrix (k, k) whose quadratic form is the mean square of a control less its straight line over an interval.

    The line's own slope counts for a thousandth.
    """
    abscissae, share = gauss_legendre(len(scheme.points))
    basis, b = weights(scheme.points, 0.5 * (abscissae + 1.0)), 0.5 * share
    slope = np.outer(abscissae, (b * abscissae) @ basis / (b @ abscissae**2))
    bent = basis - b @ basis - slope
    matrix: Array = bent.T @ (b[:, None] * bent) + SLOPE * slope.T @ (b[:, None] * slope)
    return matrix


def bounded_states(problem: ProblemFunctions) -> list[int]:
    """Indices of the states with a finite bound along the path."""
    lower, upper = problem.state_bounds
    return np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist()


def mixed_constraints(problem: ProblemFunctions) -> list[int]:
    """Indices of the path constraints that depend on a control."""
    return sorted(set(problem.path.jac_sparsity(0, 1).row()))


def bounded_controls(problem: ProblemFunctions) -> list[int]:
    """Indices of the controls with a finite bound."""
    lower, upper = problem.control_bounds
    return np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist()


def fractions_between(scheme: Scheme) -> tuple[float, ...]:
    """Fractions of an interval at which bounds of a control that may jump at nodes hold beside the scheme's points.

    The start, where the control is extrapolated, and the middles between two points; none for a control that is held
    or shared between intervals.
    """
    points = scheme.points
    if scheme.shared or len(points) == 1:
        return ()
    ends = (0.0,) if points[-1] == 1.0 else (0.0, 1.0)
    return (*ends, *(0.5 * (a + b) for a, b in pairwise(points)))
