"""The functions that an NLP solver evaluates, assembled from the derivatives of one stage.

    f(x) = Σ_b Σ_k c_b(v_bk),    g(x) = the rows r_b(v_bk), each at its place,    v_bk = a part of x, copy k of block b.

A block (the start, an interval, the end) is differentiated once and mapped over its copies. CasADi's own derivatives of
the whole programme differentiate every stage in every direction of a colouring: they take several times as long, and
as C they are large enough to keep a compiler busy for half a minute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from mathnavi.sim.interfaces.signals import Integers


@dataclass(frozen=True, eq=False)
class Block:
    """Rows r(v; data) and a share c(v; data) of the objective, the same expressions of several parts of x."""

    v: ca.SX  # (nv,) a copy's unknowns
    data: ca.SX  # (nd,) a copy's known values
    rows: ca.SX  # (nr,)
    cost: ca.SX  # ()
    columns: Integers  # (copies, nv) where in x each copy's unknowns stand, in increasing order
    places: Integers  # (copies, nr) where in g its rows stand
    known: ca.MX  # (nd, copies) values of ``data``, expressions of p

    @property
    def copies(self) -> int:
        """Number of parts of x that the expressions are of."""
        return len(self.columns)

    @cached_property
    def multipliers(self) -> ca.SX:
        """Symbols (1 + nr,): σ of the objective and μ of the rows."""
        return ca.SX.sym("m", 1 + self.rows.numel())

    @cached_property
    def lagrangian(self) -> ca.SX:
        """A copy's share () of the Lagrangian, σ c + μ'r."""
        return self.multipliers[0] * self.cost + ca.dot(self.multipliers[1:, :], self.rows)


@dataclass(frozen=True, eq=False)
class _Entries:
    """Contributions to the nonzeros of a matrix: some entries may be sums of several of them."""

    values: Sequence[ca.MX]  # one column vector for each block
    rows: Integers  # of each contribution
    columns: Integers

    def matrix(self, height: int, width: int) -> ca.MX:
        own = self.columns * height + self.rows  # CasADi counts column by column
        keys, where = np.unique(own, return_inverse=True)
        values, count = ca.vertcat(*self.values), len(own)
        if len(keys) == count:
            nonzeros = values[np.argsort(where).tolist()]
        else:
            total = ca.Sparsity.triplet(len(keys), count, where.tolist(), list(range(count)))
            nonzeros = ca.mtimes(ca.DM(total, 1.0), values)
        sparsity = ca.Sparsity.triplet(height, width, (keys % height).tolist(), (keys // height).tolist())
        return ca.MX(sparsity, nonzeros)


class Assembly:
    """Objective f, rows g and their derivatives, from the derivatives of each block."""

    def __init__(self, x: ca.MX, p: ca.MX, rows: int, blocks: Sequence[Block]) -> None:
        """Assemble blocks whose ``places`` cover each of the ``rows`` m once; x (n,) unknowns, p parameters."""
        self._x, self._p, self._m, self._blocks = x, p, rows, tuple(blocks)
        self._sigma, self._mu = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)

    @property
    def f(self) -> ca.MX:
        """Objective f(x, p) () = Σ_b Σ_k c_b(v_bk)."""
        costs = [self._called(block, "cost", block.cost) for block in self._blocks]
        return sum((ca.sum2(cost) for cost in costs), ca.MX(0))

    @property
    def g(self) -> ca.MX:
        """Rows g(x, p) (m,), each at its place."""
        values = [ca.vec(self._called(block, "rows", block.rows)) for block in self._blocks]
        places = np.concatenate([block.places.ravel() for block in self._blocks])
        return ca.vertcat(*values)[np.argsort(places).tolist()]

    def derivatives(self, solver: str) -> dict[str, ca.Function]:
        """Gradient, Jacobian and Hessian under the names and with the results that CasADi's ``solver`` asks for.

        ∇f (n,), ∂g/∂x (m, n) and the Hessian (n, n) of σ f + μ'g, its upper triangle for "ipopt" whole for
        any other.
        """
        known, names = [self._x, self._p], ["x", "p"]
        all_known, all_names = [*known, self._sigma, self._mu], [*names, "lam_f", "lam_g"]
        gradient = self._gradient("gradient", [block.cost for block in self._blocks])
        of_lagrangian = self._gradient("gamma", [block.lagrangian for block in self._blocks])
        if solver == "ipopt":
            gradients = [self.f, gradient], ["f", "grad_f_x"]
            hessians = [self._hessian()], ["triu_hess_gamma_x_x"]
        else:
            gradients = [gradient], ["grad_f_x"]
            hessians = [of_lagrangian, ca.triu2symm(self._hessian())], ["grad_gamma_x", "hess_gamma_x_x"]
        made = (
            ca.Function("nlp_grad_f", known, gradients[0], names, gradients[1]),
            ca.Function("nlp_jac_g", known, [self.g, self._jacobian()], names, ["g", "jac_g_x"]),
            ca.Function("nlp_hess_l", all_known, hessians[0], all_names, hessians[1]),
        )
        return {function.name(): function for function in made}

    def parameter_gradient(self, count: int) -> ca.Function:
        """(x, p, μ) -> gradient (count,) of f + μ'g by the first ``count`` known values of every copy."""
        shares = [ca.gradient(block.lagrangian, block.data[:count]) for block in self._blocks]
        parts = zip(self._blocks, shares, strict=True)
        total = sum((ca.sum2(self._called(block, "share", share)) for block, share in parts), ca.MX(count, 1))
        known = [self._x, self._p, self._mu]
        return ca.Function("parameter_gradient", known, [ca.substitute(total, self._sigma, ca.MX(1.0))])

    def _called(self, block: Block, name: str, result: ca.SX) -> ca.MX:
        """A result (·, copies) of each of a block's copies."""
        symbols = [block.v, block.data]
        given = [ca.reshape(self._x[block.columns.ravel().tolist()], block.v.numel(), block.copies), block.known]
        if ca.depends_on(result, block.multipliers):
            mu = ca.reshape(self._mu[block.places.ravel().tolist()], block.rows.numel(), block.copies)
            symbols.append(block.multipliers)
            given.append(ca.vertcat(ca.repmat(self._sigma, 1, block.copies), mu))
        called: ca.MX = ca.Function(name, symbols, [result], {"cse": True}).map(block.copies)(*given)
        return called

    def _gradient(self, name: str, expressions: Sequence[ca.SX]) -> ca.MX:
        values, columns = [], []
        for block, expression in zip(self._blocks, expressions, strict=True):
            values.append(ca.vec(self._called(block, name, ca.gradient(expression, block.v))))
            columns.append(block.columns.ravel())
        every = np.concatenate(columns)
        return ca.densify(_Entries(values, every, np.zeros_like(every)).matrix(self._x.numel(), 1))

    def _jacobian(self) -> ca.MX:
        return self._matrix("jacobian", [(ca.jacobian(b.rows, b.v), b.places) for b in self._blocks], self._m)

    def _hessian(self) -> ca.MX:
        """Upper triangle (n, n) of the Hessian of σ f + μ'g."""
        hessians = [(ca.triu(ca.hessian(b.lagrangian, b.v)[0]), b.columns) for b in self._blocks]
        return self._matrix("hessian", hessians, self._x.numel())

    def _matrix(self, name: str, parts: Sequence[tuple[ca.SX, Integers]], height: int) -> ca.MX:
        """The sum of each block's matrices (·, nv), whose rows stand at the places given, over all copies."""
        values, rows, columns = [], [], []
        for block, (matrix, places) in zip(self._blocks, parts, strict=True):
            i, j = (np.array(index, dtype=np.int64) for index in matrix.sparsity().get_triplet())
            if len(i):
                values.append(ca.vec(self._called(block, name, _nonzeros(matrix))))
                rows.append(places[:, i].ravel())
                columns.append(block.columns[:, j].ravel())
        if not values:
            return ca.MX(height, self._x.numel())
        return _Entries(values, np.concatenate(rows), np.concatenate(columns)).matrix(height, self._x.numel())


def _nonzeros(matrix: ca.SX) -> ca.SX:
    """(nnz, 1) column by column."""
    entries: ca.SX = matrix.nz[:]
    return entries
