"""Node distributions: the places of the nodes as part of the optimisation.

(B.1): minimise I(p) subject to m(p) <= 0, augmented to the programme. Equidistribution and functional minimisation are
special cases. Everything is stated interval by interval, in relative node distances D_i = d_i (N - 1) / T, whose mean
is 1, and scaled states.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.grid import Mesh
from mathnavi.controllers.ocp.monitors import ARCLENGTH, Monitor
from mathnavi.interfaces.bounds import Positive, Probability, configuration
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array


class NodeDistribution(Hashable, Protocol):
    """A distribution of the nodes: functional I and constraints m of (B.1), interval by interval."""

    @property
    def moving(self) -> bool:
        """True if the nodes are unknowns."""
        ...

    @property
    def constants(self) -> int:
        """Number of unknown constants s in the constraints."""
        ...

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """Constraints m that vanish on every interval, of an interval's mesh and the constants s (constants,)."""
        ...

    def functional(self, mesh: Mesh) -> ca.SX:
        """Share () of an interval in I, added to J."""
        ...

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Lower and upper limits (N,) of τ at each of N nodes."""
        ...


def _anywhere(nodes: int) -> tuple[Array, Array]:
    lower, upper = np.zeros(nodes), np.ones(nodes)
    upper[0], lower[-1] = 0.0, 1.0
    return lower, upper


@dataclass(frozen=True)
class _Unconstrained:
    """Nodes without an equation in the programme."""

    moving: bool
    constants: int = 0

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """No constraint, (0,)."""
        return ca.SX(0, 1)

    def functional(self, mesh: Mesh) -> ca.SX:
        """Zero: nothing is added to J."""
        return ca.SX(0)

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Limits (N,), (N,) of τ: 0 at the first node, 1 at the last, [0, 1] in between."""
        return _anywhere(nodes)


@dataclass(frozen=True)
class Fixed(_Unconstrained):
    """Fixed nodes, given when the programme is solved."""

    moving: bool = False


@dataclass(frozen=True)
class Free(_Unconstrained):
    """Free nodes: unconstrained unknowns, so that the optimiser places them where they hide the error."""

    moving: bool = True


@configuration
class Equidistributed:
    """Equidistribution, EP of B.3: every interval holds the same share s of the monitor function.

    N - 1 equations with the unknown s are the second printed form's N - 2; the first, with the mean written out, is
    rank-deficient. ``epsilon`` is ε of the monitor's measure.

    Raises ProblemError for a monitor without a measure, FieldError for ε <= 0.
    """

    monitor: Monitor = ARCLENGTH
    epsilon: Positive = 0.01
    moving: bool = True
    constants: int = 1

    def __post_init__(self) -> None:
        self.monitor.check_measure()

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """Share of the interval less the common one: m_i - s = 0, m_i = (N - 1) ∫ w dτ."""
        return self.monitor.measured(mesh, self.epsilon) - s

    def functional(self, mesh: Mesh) -> ca.SX:
        """Zero: nothing is added to J."""
        return ca.SX(0)

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Limits (N,), (N,) of τ: 0 at the first node, 1 at the last, [0, 1] in between."""
        return _anywhere(nodes)


@configuration
class FunctionalMinimised:
    """Functional minimisation, FM of B.3: ``weight`` / (N - 1) Σ m_i^2 is added to J, m_i = (N - 1) ∫ w dτ.

    With a constant sum the least sum of squares is the equidistribution; J pulls away from it, and is itself biased.

    Raises ProblemError for a monitor without a measure, FieldError for a weight or ε that is not positive.
    """

    monitor: Monitor = ARCLENGTH
    weight: Positive = 3e-3
    epsilon: Positive = 0.01
    moving: bool = True
    constants: int = 0

    def __post_init__(self) -> None:
        self.monitor.check_measure()

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """No constraint, (0,)."""
        return ca.SX(0, 1)

    def functional(self, mesh: Mesh) -> ca.SX:
        """Weighted square of the interval's share, ``weight`` m_i^2 / (N - 1)."""
        return self.weight / mesh.count * self.monitor.measured(mesh, self.epsilon) ** 2

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Limits (N,), (N,) of τ: 0 at the first node, 1 at the last, [0, 1] in between."""
        return _anywhere(nodes)


@configuration
class EquidistantHorizon:
    """Equidistant receding horizon, Example B.1: I = Σ d_i - ε ln d_i, Σ d_i at most the longest final time.

    The minimum is the equidistant receding horizon with steps d_i = ε, or T / (N - 1) where (N - 1) ε > T. It is a
    distribution of time only where J leaves the final time free.
    """

    epsilon: Positive  # [s]
    moving: bool = True
    constants: int = 0

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """No constraint, (0,)."""
        return ca.SX(0, 1)

    def functional(self, mesh: Mesh) -> ca.SX:
        """Share d_i - ε ln d_i of an interval, d_i [s]."""
        d = mesh.relative_width * mesh.duration / mesh.count
        return d - self.epsilon * ca.log(d)

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Limits (N,), (N,) of τ: 0 at the first node, 1 at the last, [0, 1] in between."""
        return _anywhere(nodes)


@configuration
class FrontLoaded:
    """Nodes dense at the start, Example B.2: a share ε_1 of the intervals in the first share ε_2 of the time.

    The printed inequality alone leaves the nodes free within both parts, where the optimiser abuses them; with
    ``equal_steps`` the steps within each part are equal, s = (D of the first part, D of the second).
    """

    share_of_nodes: Probability = 0.5  # ε_1
    share_of_time: Probability = 0.3  # ε_2
    equal_steps: bool = True
    moving: bool = True

    @property
    def constants(self) -> int:
        """Number of unknown constants: D of either part, or none."""
        return 2 if self.equal_steps else 0

    def constraints(self, mesh: Mesh, s: ca.SX) -> ca.SX:
        """Relative width of the interval less that of its part, D_i - s_1 or D_i - s_2; none without equal steps."""
        if not self.equal_steps:
            return ca.SX(0, 1)
        return mesh.relative_width - ca.if_else(mesh.index < self._first(mesh.count), s[0], s[1])

    def functional(self, mesh: Mesh) -> ca.SX:
        """Zero: nothing is added to J."""
        return ca.SX(0)

    def node_bounds(self, nodes: int) -> tuple[Array, Array]:
        """Limits (N,), (N,) of τ: the first part ends by ε_2; ProblemError for fewer than three nodes."""
        if nodes < 3:
            raise ProblemError(f"nodes = {nodes!r} cannot be front-loaded; allowed: 3 or more")
        lower, upper = _anywhere(nodes)
        upper[self._first(nodes - 1)] = self.share_of_time
        return lower, upper

    def _first(self, count: int) -> int:
        """Intervals of the first part, at least one and not all."""
        return min(max(1, round(self.share_of_nodes * count)), max(1, count - 1))


def constants_guess(
    distribution: NodeDistribution, relative_widths: Array, duration: float, chords: Array, second_derivatives: Array
) -> Array:
    """Values (constants,) of s that meet a distribution's constraints best on a guess, by linear least squares.

    Args:
        distribution: one whose constraints are linear in s.
        relative_widths: (N - 1,) D_i of the guess.
        duration: [s] T of the guess.
        chords: (N - 1, nx) S^-1 (x_{i+1} - x_i).
        second_derivatives: (N - 1, nx) S^-1 T^2 (f_{i+1} - f_i) / d_i.
    """
    count, nx = chords.shape
    if not distribution.constants:
        return np.empty(0)
    D, index, chord, second = ca.SX.sym("D"), ca.SX.sym("i"), ca.SX.sym("chord", nx), ca.SX.sym("second", nx)
    s = ca.SX.sym("s", distribution.constants)
    residual = distribution.constraints(Mesh(count, index, D, ca.SX(duration), chord, second), s)
    at_zero = ca.substitute(residual, s, ca.SX.zeros(distribution.constants))
    function = ca.Function("c", [D, index, chord, second], [at_zero, ca.jacobian(residual, s)])
    pairs = [
        function(D_i, i, c, k)
        for i, (D_i, c, k) in enumerate(zip(relative_widths, chords, second_derivatives, strict=True))
    ]
    c_0, slopes = np.vstack([c.full() for c, _ in pairs])[:, 0], np.vstack([slope.full() for _, slope in pairs])
    return np.array(np.linalg.lstsq(slopes, -c_0, rcond=None)[0])
