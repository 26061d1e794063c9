"""Layout of the unknowns of a programme, stage by stage, and the points at which its rows hold (see ``nlp``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, gauss_legendre, weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import Members, alike, point_counts, repeated
from mathnavi.interfaces.signals import Array, Integers

SLOPE = 1e-3
"""weight of a control's slope in its variation"""


@dataclass(frozen=True, eq=False)
class ProgrammeLayout:
    """Layout of the vector of unknowns (size,): the place and the scale of each part, see the module.

    Where intervals have different numbers of points, w_i is that of the largest number, of which an interval of fewer
    points has only its own part in the vector.
    """

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
        """Largest size of w_i = (U_i, X_i, D_i), but for the last stage."""
        p = self.problem
        return self.own_points * p.nu + self.scheme.interior * p.nx + int(self.moving)

    @property
    def last_input_size(self) -> int:
        """Size of w_N in the last stage: its control, if the scheme shares it between intervals."""
        return self.problem.nu if self.scheme.shared else 0

    @property
    def smoothed(self) -> int:
        """Number of controls whose variation within an interval has a weight ρ: all that may jump at nodes."""
        return self.problem.nu if fractions_between(self.scheme) else 0

    @cached_property
    def members(self) -> tuple[Members, ...]:
        """Groups of intervals with the same transcription."""
        return alike(self.scheme, self.nodes - 1)

    @cached_property
    def stage_columns(self) -> Integers:
        """Columns (N - 1, state_size + input_size) of z_i and w_i in the vector; -1 for what an interval lacks."""
        columns = np.full(self._kept.shape, -1, dtype=np.int64)
        columns[self._kept] = np.arange(np.count_nonzero(self._kept))
        return columns

    @cached_property
    def state_columns(self) -> Integers:
        """Columns (N, state_size) of z_i in the vector."""
        last = self.size - self.last_input_size - self.state_size + np.arange(self.state_size, dtype=np.int64)
        return np.vstack([self.stage_columns[:, : self.state_size], last])

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self._kept)) + self.state_size + self.last_input_size

    @cached_property
    def _kept(self) -> NDArray[np.bool_]:
        """(N - 1, state_size + input_size) True for what an interval has in the vector."""
        own, p = np.empty((self.nodes - 1, 1), dtype=np.int64), self.problem
        for scheme, intervals in self.members:
            own[intervals] = len(scheme.points)
        parts = [
            np.ones((self.nodes - 1, self.state_size), dtype=bool),
            np.arange(self.own_points * p.nu) < own * p.nu,
            np.arange(self.scheme.interior * p.nx) < (own - len(self.scheme.points) + self.scheme.interior) * p.nx,
            np.ones((self.nodes - 1, int(self.moving)), dtype=bool),
        ]
        return np.hstack(parts)

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
        return np.concatenate([np.tile(stage, (self.nodes - 1, 1))[self._kept], *last])

    def split(self, unknowns: Array) -> tuple[Array, Array, Array]:
        """Split scaled unknowns (size,) into z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,).

        The parts are in the problem's units, no longer over their scales. Points that an interval lacks repeat
        the values at its last one.
        """
        values = unknowns * self.scale
        body, tail = values[self.stage_columns], values[self.size - self.last_input_size - self.state_size :]
        z, w = np.vstack([body[:, : self.state_size], tail[: self.state_size]]), body[:, self.state_size :]
        if not self._kept.all():
            nu, nx, own = self.problem.nu, self.problem.nx, self.own_points
            u, X = w[:, : own * nu].reshape(len(w), own, nu), w[:, own * nu :].reshape(len(w), -1, nx)
            inside = np.arange(X.shape[1]) < point_counts(self.scheme)[:, None] - 1
            X = np.where(inside[:, :, None], X, z[1:, None, :nx])
            w = np.hstack([repeated(self.scheme, u).reshape(len(w), -1), X.reshape(len(w), -1)])
        return z, w, tail[self.state_size :]

    def join(self, z: Array, w: Array, last: Array) -> Array:
        """Join z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,) to scaled unknowns (size,).

        The inverse of ``split``.
        """
        body = np.hstack([z[:-1], w])[self._kept]
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


def control_variations(scheme: Scheme, u: Array) -> Array:
    """``variation`` (N - 1, nu) of controls (N - 1, k, nu) in each interval."""
    found = np.empty((len(u), u.shape[2]))
    for own, intervals in alike(scheme, len(u)):
        values = u[intervals, : len(own.points)]
        found[intervals] = np.einsum("kl,ikm,ilm->im", variation(own), values, values)
    return found


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
    """Fractions of an interval, other than the scheme's points, where bounds of a control that may jump at nodes hold.

    The start, where the control is extrapolated, and the middles between two points; empty for a control that is held
    or shared between intervals.
    """
    points = scheme.points
    if scheme.shared or len(points) == 1:
        return ()
    ends = (0.0,) if points[-1] == 1.0 else (0.0, 1.0)
    return (*ends, *(0.5 * (a + b) for a, b in pairwise(points)))
