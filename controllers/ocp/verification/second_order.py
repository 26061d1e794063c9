"""Second-order condition of a solved programme: the inertia of its KKT matrix, and a direction of negative curvature.

    minimise f(x)    subject to    lower <= g(x) <= upper,  x_lower <= x <= x_upper

with the Lagrangian f + μ'g, its Hessian H, and A = ∂g/∂x of the constraints that are held. x is a local minimum only if
d'Hd >= 0 wherever A d = 0. Held are equations, and limits at which x rests with a multiplier; a limit that is touched
without one is let go, which asks for more than is necessary. Where the programme has arcs, their lengths are among
the unknowns, so the switching times of bang-bang controls are judged with the rest.

In the metric W, the share of [0, T] that an unknown stands for, d'Wd is the square of the L2 norm in scaled units, and
an eigenvalue of W^-1/2 H W^-1/2 is a curvature of J that does not change with the mesh. With it, and with rows of A
of length 1, the matrix

    K(σ) = [[H + σI, A'], [A, -δI]]

has as many negative eigenvalues as A has rows, and one more for each direction with A d = 0 and d'Hd < -σ. Its
factorisation LDL' without pivoting counts them, by the signs of D (Sylvester).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from mathnavi.controllers.ocp.solution import SolvedProgramme
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_integral_weights
from mathnavi.interfaces.signals import Array, Integers

_REGULARISATION = 1e-12  # δ: dependent rows have a pivot too
_SHIFT = 1e-6  # σ over the size of J: curvature that counts as none
_CURVATURE_SIZE = 1e-3  # share of the largest entry of H that stands for the size of a J that is nearly 0
_SHIFTS = (1.0, 3.0, 10.0)  # times σ, until a factorisation meets no pivot that is exactly 0
_TOUCHING = 1e-7  # distance to a limit, over max(1, |x|)
_FELT = 1e-6  # multiplier over the size of J and the metric, above which a limit holds
_LEAST_SHARE = 1e-9
_BISECTIONS, _ITERATIONS = 18, 5


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Second-order condition of a programme: whether it was decided, and a direction along which J falls if not met."""

    decided: bool  # False if the matrix could not be factorised
    curvature: float = 0.0  # d'Hd [J] of the direction, of length 1 in the metric; 0 where none is negative
    direction: Array | None = None  # (n,) d in the programme's scaled unknowns; None where no curvature is negative


def second_order(solved: SolvedProgramme, size: float) -> SecondOrder:
    """Judge the second-order condition at the answer of a programme; ``size`` is that of J, in its units."""
    matrix = _KktMatrix.of(solved, size)
    least = _SHIFT * max(size, _CURVATURE_SIZE * matrix.largest)
    for times in _SHIFTS:
        found = matrix.factorised(times * least)
        if found.exact:
            break
    else:
        return SecondOrder(decided=False)
    if found.negative <= 0:
        return SecondOrder(decided=True)
    curvature, direction = matrix.most_negative(times * least)
    if curvature > -least:  # rounding of dependent rows
        return SecondOrder(decided=True)
    return SecondOrder(True, curvature, direction)


@dataclass(frozen=True)
class _Factorisation:
    """LU of K(σ), its number of negative eigenvalues beyond the rows of A, and whether all pivots are diagonal."""

    lu: SuperLU | None
    negative: int
    exact: bool


@dataclass(frozen=True, eq=False)
class _KktMatrix:
    """H and A over the metric, of the unknowns that no limit holds."""

    hessian: sp.csc_matrix  # (n, n)
    rows: sp.csc_matrix  # (m, n) of length 1
    root: Array  # (n,) W^-1/2
    free: Integers  # (n,) places of these unknowns in the programme's
    size: int  # number of the programme's unknowns

    @classmethod
    def of(cls, solved: SolvedProgramme, size: float) -> _KktMatrix:
        x, known = solved.x, solved.without_smoothing
        functions = solved.programme.assembly.derivatives("ipopt")
        g, jacobian = functions["nlp_jac_g"](x, known)
        upper = functions["nlp_hess_l"](x, known, 1.0, solved.multipliers[1]).sparse()
        hessian = upper + sp.triu(upper, 1).T
        w = metric(solved)
        x_lower, x_upper, lower, upper_rows = solved.bounds
        of_bounds, of_rows = solved.multipliers
        free = np.flatnonzero(~_held(x, x_lower, x_upper, of_bounds, _FELT * size * w))
        held = np.flatnonzero(_held(g.full()[:, 0], lower, upper_rows, of_rows, _FELT * size * float(w.min())))
        root = 1.0 / np.sqrt(w[free])
        scaling = sp.diags(root)
        A = sp.csc_matrix(jacobian.sparse())[held][:, free] @ scaling
        lengths = np.sqrt(np.asarray(A.multiply(A).sum(axis=1)).ravel())
        A = sp.diags(1.0 / np.where(lengths > 0.0, lengths, 1.0)) @ A
        own = scaling @ sp.csc_matrix(hessian)[free][:, free] @ scaling
        return cls(sp.csc_matrix(own), sp.csc_matrix(A), root, free, len(x))

    @property
    def largest(self) -> float:
        """Largest magnitude of an entry of H."""
        return float(np.abs(self.hessian.data).max(initial=0.0))

    def factorised(self, shift: float) -> _Factorisation:
        (m, n) = self.rows.shape
        if not n:
            return _Factorisation(None, 0, True)
        regular = sp.identity(m, format="csc") * -_REGULARISATION
        K = sp.bmat([[self.hessian + shift * sp.identity(n), self.rows.T], [self.rows, regular]], format="csc")
        if not np.isfinite(K.data).all():
            return _Factorisation(None, 0, False)
        try:
            lu = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:  # a pivot is exactly 0
            return _Factorisation(None, 0, False)
        negative = int(np.count_nonzero(lu.U.diagonal() < 0.0)) - m
        return _Factorisation(lu, negative, bool((lu.perm_r == lu.perm_c).all()))

    def most_negative(self, least: float) -> tuple[float, Array]:
        """Curvature and direction of the least eigenvalue, below -``least``: bisection of σ, then inverse iteration."""
        low, high = least, 10.0 * max(self.largest, least)
        for _ in range(_BISECTIONS):
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if self.factorised(middle).negative > 0 else (low, middle)
        m, n = self.rows.shape
        lu = self.factorised(1.02 * high).lu
        if lu is None:
            return 0.0, np.zeros(self.size)
        v = np.random.default_rng(0).normal(size=n)
        for _ in range(_ITERATIONS):
            v = lu.solve(np.concatenate([v, np.zeros(m)]))[:n]
            v /= np.linalg.norm(v)
        direction = np.zeros(self.size)
        direction[self.free] = self.root * v
        return float(v @ (self.hessian @ v)), direction


def metric(solved: SolvedProgramme) -> Array:
    """Weights W (n,) of a programme's unknowns: the share of [0, T] of a value at a point, 1 for a length in all."""
    layout, grid = solved.programme.layout, solved.grid
    problem, scheme, count = layout.problem, layout.scheme, layout.nodes - 1
    shares = np.broadcast_to(interval_integral_weights(scheme, np.ones(1))[:, 0], (count, len(scheme.points)))
    shares = grid.widths[:, None] * shares
    own_shares = shares.copy()
    if scheme.shared:  # a node's control is that of both its intervals
        own_shares[1:, 0] += shares[:-1, -1]
    z = np.full((count + 1, layout.state_size), 1.0 / (count + 1))
    z[:, : problem.nx] = 0.0
    z[:-1, : problem.nx] += 0.5 * grid.widths[:, None]
    z[1:, : problem.nx] += 0.5 * grid.widths[:, None]
    inside = shares[:, [j for j, c in enumerate(scheme.points) if 0.0 < c < 1.0][: scheme.interior]]
    w = np.hstack([
        np.repeat(own_shares[:, : layout.own_points], problem.nu, axis=1),
        np.repeat(inside, problem.nx, axis=1),
        np.full((count, int(layout.moving)), 1.0 / count),
    ])  # fmt: skip
    last = np.full(layout.last_input_size, shares[-1, -1])
    own: Array = np.maximum(layout.join(z, w, last) * layout.scale, _LEAST_SHARE)
    return own


def _held(values: Array, lower: Array, upper: Array, multipliers: Array, felt: Array | float) -> NDArray[np.bool_]:
    """True for equations, and for values at a limit (finite ones) with a multiplier that is felt."""
    distance = np.minimum(values - lower, upper - values)  # inf without limits
    touching = distance <= _TOUCHING * np.maximum(1.0, np.abs(values))
    held: NDArray[np.bool_] = (lower == upper) | (touching & (np.abs(multipliers) > felt))
    return held
