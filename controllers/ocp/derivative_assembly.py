"""The functions that an NLP solver evaluates, assembled from the derivatives of one stage.

    f(x) = Σ_b Σ_k w_bk c_b(v_bk),    g(x) = L x + Σ_b S_b r_b(v_b),    v_bk = a part of x, copy k of block b.

The rows r_b of a block's copies stand each at its own place of g or, with the constant factors of a matrix S_b, enter
several of them; L is constant. A stage (the start, an interval or a point of one, the end) is differentiated once and
mapped over the copies of its block. CasADi's own derivatives of the whole programme differentiate every stage in every
direction of a colouring: they take several times as long, and as C they are large enough to keep a compiler busy for
half a minute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array, Integers


@dataclass(frozen=True, eq=False)
class NlpStage:
    """Rows r(v; data) and a share c(v; data) of the objective, with their derivatives as functions, each built once."""

    v: ca.SX  # (nv,) unknowns of a copy
    data: ca.SX  # (nd,) known values of a copy
    rows: ca.SX  # (nr,)
    cost: ca.SX  # ()
    _made: dict[str, ca.Function] = field(default_factory=dict)

    @cached_property
    def multipliers(self) -> ca.SX:
        """Symbols (1 + nr,): σ of the objective and μ of the rows."""
        return ca.SX.sym("m", 1 + self.rows.numel())

    @cached_property
    def lagrangian(self) -> ca.SX:
        """A copy's share () of the Lagrangian, σ c + μ'r."""
        return self.multipliers[0] * self.cost + ca.dot(self.multipliers[1:, :], self.rows)

    @cached_property
    def jacobian(self) -> ca.SX:
        """(nr, nv) ∂r/∂v."""
        return ca.jacobian(self.rows, self.v)

    @cached_property
    def hessian(self) -> ca.SX:
        """Upper triangle (nv, nv) of the Hessian of the Lagrangian."""
        return ca.triu(ca.hessian(self.lagrangian, self.v)[0])

    def function(self, name: str) -> ca.Function:
        """(v, data) or, where the Lagrangian enters, (v, data, multipliers) -> a column, by its name.

        "cost", "rows", "gradient" of the cost, "jacobian" and "hessian", their nonzeros column by column, "gamma", the
        gradient of the Lagrangian, and "share", that by the data.
        """
        if name not in self._made:
            result = {
                "cost": lambda: self.cost,
                "rows": lambda: self.rows,
                "gradient": lambda: ca.gradient(self.cost, self.v),
                "jacobian": lambda: self.jacobian.nz[:],
                "hessian": lambda: self.hessian.nz[:],
                "gamma": lambda: ca.gradient(self.lagrangian, self.v),
                "share": lambda: ca.gradient(self.lagrangian, self.data),
            }[name]()
            symbols = [self.v, self.data, *([self.multipliers] if name in _OF_LAGRANGIAN else [])]
            self._made[name] = ca.Function(name, symbols, [ca.densify(result)], {"cse": True})
        return self._made[name]


_OF_LAGRANGIAN = ("hessian", "gamma", "share")


class Factors(NamedTuple):
    """A sparse matrix: entries (k,) at rows (k,) and columns (k,), those at the same place added up."""

    rows: Integers
    columns: Integers
    values: Array

    def matrix(self, height: int, width: int) -> ca.DM:
        """Dense matrix (height, width)."""
        return _sparse(self.values, self.rows, self.columns, (height, width))


@dataclass(frozen=True, eq=False)
class Block:
    """Copies of one stage: the same expressions at several parts of x."""

    stage: NlpStage
    columns: Integers  # (copies, nv) where in x each copy's unknowns stand
    places: Integers | Factors  # (copies, nr) where in g its rows stand; or S, (m, nr copies), copy by copy
    known: ca.MX  # (nd, copies) values of ``data``, expressions of p
    weights: Array | None = None  # (copies,) w of each copy's cost; None for ones

    @property
    def copies(self) -> int:
        """Number of copies."""
        return len(self.columns)


class _Part(NamedTuple):
    """Contributions to the nonzeros of a matrix, whose entries may be sums of several of them."""

    values: ca.MX  # (n,)
    rows: Integers  # (k,) of each contribution
    columns: Integers  # (k,)
    sources: Integers | None = None  # (k,) the value that is contributed; None for one each, in their order
    factors: Array | None = None  # (k,) of each value; None for ones


class Assembly:
    """Objective f, rows g and their derivatives, from the derivatives of each block."""

    def __init__(self, x: ca.MX, p: ca.MX, rows: int, blocks: Sequence[Block], linear: Factors | None = None) -> None:
        """Assemble blocks that with L, (m, n), make each of the ``rows`` m; x (n,) unknowns, p parameters."""
        self._x, self._p, self._m, self._blocks, self._linear = x, p, rows, tuple(blocks), linear
        self._sigma, self._mu = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows)
        self._parts = [
            ca.reshape(x[block.columns.ravel().tolist()], block.columns.shape[1], block.copies) for block in blocks
        ]

    @cached_property
    def f(self) -> ca.MX:
        """Objective f(x, p) () = Σ_b Σ_k w_bk c_b(v_bk)."""
        total = ca.MX(0)
        for k, block in enumerate(self._blocks):
            if not block.stage.cost.is_zero():
                cost = self._called(k, "cost")
                total += ca.sum2(cost) if block.weights is None else ca.dot(cost, ca.DM(block.weights).T)
        return total

    @cached_property
    def g(self) -> ca.MX:
        """Rows g(x, p) (m,)."""
        blocks = [(k, block) for k, block in enumerate(self._blocks) if block.stage.rows.numel()]
        values = ca.vertcat(ca.MX(0, 1), *(ca.vec(self._called(k, "rows")) for k, _ in blocks))
        if self._linear is None:
            places = [block.places.ravel() for _, block in blocks if not isinstance(block.places, Factors)]
            if len(places) == len(blocks):
                return values[np.argsort(np.concatenate(places)).tolist()]
        shares = [_shares(block) for _, block in blocks]
        sizes = np.cumsum([0, *(block.copies * block.stage.rows.numel() for _, block in blocks)])
        joined = Factors(
            np.concatenate([each.rows for each in shares]),
            np.concatenate([each.columns + before for each, before in zip(shares, sizes, strict=False)]),
            np.concatenate([each.values for each in shares]),
        )
        rows = ca.mtimes(joined.matrix(self._m, int(sizes[-1])), values)
        if self._linear is not None:
            rows += ca.mtimes(self._linear.matrix(self._m, self._x.numel()), self._x)
        return rows

    def derivatives(self, solver: str) -> dict[str, ca.Function]:
        """Gradient, Jacobian and Hessian with the names and results that CasADi's ``solver`` needs.

        ∇f (n,), ∂g/∂x (m, n) and the Hessian (n, n) of σ f + μ'g, its upper triangle for "ipopt" whole for
        any other.
        """
        known, names = [self._x, self._p], ["x", "p"]
        all_known, all_names = [*known, self._sigma, self._mu], [*names, "lam_f", "lam_g"]
        gradient = self._gradient("gradient")
        if solver == "ipopt":
            gradients = [self.f, gradient], ["f", "grad_f_x"]
            hessians = [self._hessian()], ["triu_hess_gamma_x_x"]
        else:
            gradients = [gradient], ["grad_f_x"]
            of_lagrangian = self._gradient("gamma")
            if self._linear is not None:
                of_lagrangian += ca.mtimes(self._linear.matrix(self._m, self._x.numel()).T, self._mu)
            hessians = [of_lagrangian, ca.triu2symm(self._hessian())], ["grad_gamma_x", "hess_gamma_x_x"]
        made = (
            ca.Function("nlp_grad_f", known, gradients[0], names, gradients[1]),
            ca.Function("nlp_jac_g", known, [self.g, self._jacobian()], names, ["g", "jac_g_x"]),
            ca.Function("nlp_hess_l", all_known, hessians[0], all_names, hessians[1]),
        )
        return {function.name(): function for function in made}

    def parameter_gradient(self, count: int) -> ca.Function:
        """(x, p, μ) -> gradient (count,) of f + μ'g by the first ``count`` known values of every copy."""
        called = [self._called(k, "share") for k, block in enumerate(self._blocks) if block.stage.data.numel() >= count]
        total = sum((ca.sum2(each[:count, :]) for each in called), ca.MX(count, 1))
        known = [self._x, self._p, self._mu]
        return ca.Function("parameter_gradient", known, [ca.substitute(total, self._sigma, ca.MX(1.0))])

    def _called(self, k: int, name: str) -> ca.MX:
        """A result (·, copies) of each copy of block k."""
        block = self._blocks[k]
        given = [self._parts[k], block.known]
        if name in _OF_LAGRANGIAN:
            height, shape = block.stage.rows.numel(), (block.stage.rows.numel(), block.copies)
            if isinstance(block.places, Factors):
                mu = ca.mtimes(block.places.matrix(self._m, height * block.copies).T, self._mu)
            else:
                mu = self._mu[block.places.ravel().tolist()]
            ones = np.ones(block.copies) if block.weights is None else block.weights
            given.append(ca.vertcat(self._sigma * ca.DM(ones).T, ca.reshape(mu, *shape)))
        called: ca.MX = block.stage.function(name).map(block.copies)(*given)
        return called

    def _gradient(self, name: str) -> ca.MX:
        parts = []
        for k, block in enumerate(self._blocks):
            if name == "gradient" and block.stage.cost.is_zero():
                continue
            columns, factors = block.columns.ravel(), None
            if name == "gradient" and block.weights is not None:
                factors = np.repeat(block.weights, block.columns.shape[1])
            values = ca.vec(self._called(k, name))
            parts.append(_Part(values, columns, np.zeros_like(columns), factors=factors))
        return ca.densify(_assembled(parts, self._x.numel(), 1))

    def _jacobian(self) -> ca.MX:
        parts = []
        for k, block in enumerate(self._blocks):
            i, j = _pattern(block.stage.jacobian)
            if not len(i):
                continue
            values = ca.vec(self._called(k, "jacobian"))
            if not isinstance(block.places, Factors):
                parts.append(_Part(values, block.places[:, i].ravel(), block.columns[:, j].ravel()))
                continue
            # Every entry of S times every nonzero of its row of a copy's Jacobian.
            height, rows, columns, sources, factors = block.stage.rows.numel(), [], [], [], []
            for row in range(height):
                nonzeros, of_row = np.flatnonzero(i == row), block.places.columns % height == row
                copies = block.places.columns[of_row] // height
                rows.append(np.repeat(block.places.rows[of_row], len(nonzeros)))
                columns.append(block.columns[copies][:, j[nonzeros]].ravel())
                sources.append((copies[:, None] * len(i) + nonzeros).ravel())
                factors.append(np.repeat(block.places.values[of_row], len(nonzeros)))
            parts.append(_Part(values, *(np.concatenate(each) for each in (rows, columns, sources, factors))))
        return _assembled(parts, self._m, self._x.numel(), self._linear)

    def _hessian(self) -> ca.MX:
        """Upper triangle (n, n) of the Hessian of σ f + μ'g."""
        parts = []
        for k, block in enumerate(self._blocks):
            i, j = _pattern(block.stage.hessian)
            if len(i):
                one, other = block.columns[:, i].ravel(), block.columns[:, j].ravel()
                values = ca.vec(self._called(k, "hessian"))
                parts.append(_Part(values, np.minimum(one, other), np.maximum(one, other)))
        return _assembled(parts, self._x.numel(), self._x.numel())


def _shares(block: Block) -> Factors:
    """S of a block."""
    if isinstance(block.places, Factors):
        return block.places
    rows = block.places.ravel()
    return Factors(rows, np.arange(len(rows), dtype=np.int64), np.ones(len(rows)))


def _pattern(matrix: ca.SX) -> tuple[Integers, Integers]:
    """Rows and columns (nnz,) of the nonzeros, column by column."""
    rows, columns = (np.array(index, dtype=np.int64) for index in matrix.sparsity().get_triplet())
    return rows, columns


def _assembled(parts: Sequence[_Part], height: int, width: int, constant: Factors | None = None) -> ca.MX:
    """The sum (height, width) of contributions and of a constant matrix."""
    known = [] if constant is None else [constant]
    if not parts and not known:
        return ca.MX(height, width)
    # CasADi counts column by column.
    keys = [part.columns * height + part.rows for part in parts]
    keys += [each.columns * height + each.rows for each in known]
    places, where = np.unique(np.concatenate(keys), return_inverse=True)
    if parts:
        values = ca.vertcat(*(part.values for part in parts))
    if not known and len(places) == len(where) and all(p.sources is None and p.factors is None for p in parts):
        nonzeros = values[np.argsort(where).tolist()]
    else:
        before = np.cumsum([0, *(part.values.numel() for part in parts)])
        sources = [
            (np.arange(len(part.rows)) if part.sources is None else part.sources) + start
            for part, start in zip(parts, before, strict=False)
        ]
        factors = [np.ones(len(part.rows)) if part.factors is None else part.factors for part in parts]
        count = sum(len(part.rows) for part in parts)
        nonzeros = ca.MX(ca.DM.zeros(len(places)))
        if parts:
            shape = len(places), int(before[-1])
            nonzeros = ca.mtimes(
                _sparse(np.concatenate(factors), where[:count], np.concatenate(sources), shape), values
            )
        if known:
            nonzeros += ca.DM(np.bincount(where[count:], known[0].values, minlength=len(places)))
    sparsity = ca.Sparsity.triplet(height, width, (places % height).tolist(), (places // height).tolist())
    return ca.MX(sparsity, nonzeros)


def _sparse(values: Array, rows: Integers, columns: Integers, shape: tuple[int, int]) -> ca.DM:
    """A sparse matrix, entries at the same place added up."""
    height, width = shape
    keys, where = np.unique(columns * height + rows, return_inverse=True)  # CasADi counts column by column
    ends = np.searchsorted(keys, height * np.arange(width + 1))
    pattern = ca.Sparsity(height, width, ends.tolist(), (keys % height).tolist() if height else [])
    return ca.DM(pattern, np.bincount(where, values, minlength=len(keys)))
