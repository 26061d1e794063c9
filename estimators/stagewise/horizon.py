"""Moving-horizon estimation: least squares over the last stages, with an arrival cost for all that came before.

Over the stages of a window with states x_1, ..., x_M, prior mean m and covariance P at the first, one real-time
Gauss-Newton iteration solves the quadratic programme below about the current states, and moves them by its solution (M.
Diehl, H. G. Bock and J. P. Schloeder, SIAM J. Control and Optimization 43, 2005). Without its limits the programme is
solved in closed form; if that solution is within the limits it is the programme's solution, as the programme is convex;
otherwise FATROP solves it. Outliers are weighted by Huber's loss with threshold delta: a whitened residual r has the
weight min(1, delta / |r|), at first with its predicted deviation in place of 1.

When the window moves on, the prior is updated with the readings of the stage that leaves, as by an extended Kalman
filter that is linearised at the smoothed state, and is propagated to the next stage (C. V. Rao, J. B. Rawlings and D.
Q. Mayne, IEEE Trans. Automatic Control 48, 2003). So for a linear model without outliers and limits it is the Kalman
filter.

**The quadratic programme**, stage by stage, with its limits, in the form that FATROP solves.

With errors e_i (d,) of N stages, scaled to similar magnitudes, readings W e = r + noise of H = W' W and g = W' r, and
noises n_i (d,) between the stages,

    min 1/2 |e_0|^2 + 1/2 sum |n_i|^2 + sum (1/2 e_i' H_i e_i - g_i' e_i)
    subject to  e_{i+1} = A_i e_i + B_i n_i + c_i,   low_i <= e_i <= high_i,

where e_0 is the whitened error of the arrival cost, which A_0 and c_0 lead to the first stage. All matrices are
parameters, so that one programme is compiled for all updates and models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.stagewise.model import (
    AssociatingModel,
    Piece,
    SmootherStage,
    StagewiseModel,
    advanced,
    residuals,
)
from mathnavi.estimators.stagewise.smoother import square_root
from mathnavi.interfaces.signals import Array
from mathnavi.models.nlp_solver import NlpSolver, SolverOutcome, StageStructure, fatrop_settings

_TOLERANCE, _ITERATIONS = 1e-4, 50  # of deviations; dual errors do not fall below 1e-5 if a noise is nearly singular
_SECONDS = 1.0  # of CPU time after which a solve is ended


class HorizonProgramme:
    """The programme of N ``stages`` with d ``states``; it is built with its first solve.

    An update writes into its arrays: ``A``, ``B`` (N, d, d) and ``c`` (N, d) lead to stage i from the one
    before; ``H`` (N, d, d) and ``g`` (N, d) are its readings; ``low`` and ``high`` (N, d) its limits.
    """

    def __init__(self, states: int, stages: int) -> None:
        d, N = self._d, self._stages = states, stages
        self.A, self.B, self.H = np.zeros((N, d, d)), np.zeros((N, d, d)), np.zeros((N, d, d))
        self.c, self.g = np.zeros((N, d)), np.zeros((N, d))
        self.low, self.high = np.full((N, d), -np.inf), np.full((N, d), np.inf)
        self._solver: NlpSolver | None = None

    def clear(self) -> None:
        """Reset every stage to a copy of the one before, without noise, readings and limits."""
        self.A[:], self.low[:], self.high[:] = np.eye(self._d), -np.inf, np.inf
        for array in (self.B, self.H, self.c, self.g):
            array[:] = 0.0

    def solve(self) -> tuple[Array | None, str]:
        """Errors (N, d) of the stages; None and the solver's message if they were not found."""
        d, N = self._d, self._stages
        if self._solver is None:
            self._solver = _solver(d, N)
        inputs = self._solver.inputs
        blocks = (self.A.transpose(0, 2, 1), self.B.transpose(0, 2, 1), self.H, self.c, self.g)
        inputs["p"][:] = np.concatenate([block.reshape(N, -1) for block in blocks], axis=1).ravel()
        if not np.isfinite(inputs["p"]).all() or np.isnan(self.low).any() or np.isnan(self.high).any():
            return None, "the programme holds NaN or infinity"  # which FATROP would report as solved
        inputs["x0"][:] = 0.0
        for key, limits, none in (("lbx", self.low, -np.inf), ("ubx", self.high, np.inf)):
            inputs[key][:] = none
            for i in range(N):
                inputs[key][2 * d * (i + 1) : 2 * d * (i + 1) + d] = limits[i]
        report = self._solver.solve()
        found = self._solver.outputs["x"]
        if report.outcome is not SolverOutcome.CONVERGED or not np.isfinite(found).all():
            return None, report.message
        errors = np.stack([found[2 * d * (i + 1) : 2 * d * (i + 1) + d] for i in range(N)])
        return errors, report.message


@lru_cache(maxsize=8)
def _stage(d: int) -> tuple[ca.Function, ca.Function]:
    """Functions (e, n, A, B, c) -> next error, cost of the noise; and (e, H, g) -> cost of the readings."""
    e, n, c, g = (ca.SX.sym(name, d) for name in ("e", "n", "c", "g"))
    A, B, H = (ca.SX.sym(name, d, d) for name in ("A", "B", "H"))
    transition = ca.Function("transition", [e, n, A, B, c], [A @ e + B @ n + c, 0.5 * ca.sumsqr(n)])
    return transition, ca.Function("readings", [e, H, g], [0.5 * ca.bilin(H, e, e) - ca.dot(g, e)])


def _solver(d: int, N: int) -> NlpSolver:
    transition, readings = _stage(d)
    sizes = (d * d, d * d, d * d, d, d)
    p = ca.MX.sym("p", N * sum(sizes))
    e, gaps = ca.MX.sym("e0", d), []
    variables, cost = [e], 0.5 * ca.sumsqr(e)
    for i, block in enumerate(ca.vertsplit(p, sum(sizes))):
        A, B, H, c, g = ca.vertsplit(block, [0, *np.cumsum(sizes).tolist()])
        n = ca.MX.sym(f"n{i}", d)
        reached, noise = transition(e, n, ca.reshape(A, d, d), ca.reshape(B, d, d), c)
        e = ca.MX.sym(f"e{i + 1}", d)
        variables += [n, e]
        gaps.append(e - reached)
        cost += noise + readings(e, ca.reshape(H, d, d), g)
    functions = {"x": ca.vertcat(*variables), "p": p, "f": cost, "g": ca.vertcat(*gaps)}
    stages = StageStructure([d] * (N + 1), [d] * N + [0], [0] * (N + 1), [True] * (N * d))
    settings = fatrop_settings(stages, _TOLERANCE, _ITERATIONS, {})
    return NlpSolver("horizon", "fatrop", functions, settings, ("x",), seconds=_SECONDS)


Flags = NDArray[np.bool_]

_MOVED = 0.5  # deviations by which a state may move before its transition is linearised again
_GOOD = 4.0  # deviations within which a component of a reading agrees with the estimate


@dataclass(eq=False)
class _Node:
    """A stage of the window."""

    inputs: tuple[Piece, ...]
    readings: tuple[Array, ...]
    x: Array
    at: Array = field(default_factory=lambda: np.empty(0))  # state of the node before that F is linearised at
    reached: Array = field(default_factory=lambda: np.empty(0))  # where it leads
    F: Array = field(default_factory=lambda: np.empty(0))
    Q: Array = field(default_factory=lambda: np.empty(0))  # from there
    spread: Array | None = None  # predicted deviations of a new reading's residuals, in theirs


@dataclass(frozen=True, eq=False)
class Predicted:
    """Prediction for a reading y, with the ways that were chosen for it: the state x, the innovation r (k,) in
    deviations of the reading, and its covariance S (k, k), of the window's estimate before the reading and its noise.
    """

    x: Array
    y: Array
    known: Flags  # (rows,) True for the components that r has
    r: Array
    S: Array


class MovingHorizon:
    """Window of ``stages`` stages of a model; ``x`` and ``P`` are the state and its covariance at the newest."""

    def __init__(self, model: StagewiseModel, stages: int, iterations: int, slope: float) -> None:
        """``slope`` is delta, ``iterations`` is the number of Gauss-Newton iterations at each reading."""
        self._model, self._stages, self._iterations, self._slope = model, stages, iterations, slope
        self._associating = model if isinstance(model, AssociatingModel) and model.is_ambiguous else None
        self._programme = HorizonProgramme(model.size, stages)
        self._nodes: list[_Node] = []
        self._prior: tuple[Array, Array]  # m, P at the first node
        self._scale: Array  # (d,) of the errors
        self.P = np.full((model.size, model.size), np.nan)
        self.failure = ""  # the solver's message, where the last programme was not solved
        self.predicted: list[Predicted] = []
        """predictions of the earlier stages for each reading of the last stage"""
        self.residual = np.empty(0)  # (k,) of the newest reading, in standard deviations
        self.agrees = False  # whether half of the newest reading's components agree with the estimate

    @property
    def started(self) -> bool:
        """True once there is a stage that the model can start at."""
        return bool(self._nodes)

    @property
    def x(self) -> Array:
        """State at the newest stage."""
        return self._nodes[-1].x

    def forget(self) -> None:
        """Discard the window and start again at the next stage."""
        self._nodes = []

    def add(self, stage: SmootherStage) -> None:
        """Add the next stage, and solve at each of its readings.

        Raises LinAlgError, ArithmeticError or the model's own errors if the state cannot be propagated.
        """
        self.predicted = []
        for k, reading in enumerate(stage.readings or (None,)):
            self._add(SmootherStage(stage.t, () if k else stage.inputs, () if reading is None else (reading,)))

    def _add(self, stage: SmootherStage) -> None:
        if not self._nodes:
            started = self._model.start(stage.readings[0] if stage.readings else None)
            if started is None:
                return
            x, P = started
            self._prior, self.P = (x, P), P
            self._scale = np.maximum(np.sqrt(np.maximum(np.diag(P), 0.0)), 1e-9)
            self._nodes.append(_Node((), stage.readings, x))
        else:
            self._append(stage)
        if stage.readings:
            node = self._nodes[-1]
            node.readings = self._associated(stage.readings)
            node.spread = self._spread(node)
            self._solve()
            if self._associating is not None and not self.failure:
                node.readings = self._associated(stage.readings)
                self._solve()

    def _append(self, stage: SmootherStage) -> None:
        last, inputs = self._nodes[-1], stage.inputs
        x, F, Q = advanced(self._model, last.x, inputs)
        self.P = F @ self.P @ F.T + Q
        _check(x, self.P)
        if not last.readings and len(self._nodes) > 1:  # a stage without readings: the two transitions are merged
            self._nodes.pop()
            node = _Node(last.inputs + inputs, stage.readings, x, last.at, x, F @ last.F, Q=F @ last.Q @ F.T + Q)
        else:
            node = _Node(inputs, stage.readings, x, last.x, x, F, Q=Q)
        self._nodes.append(node)
        while len(self._nodes) > self._stages:
            self._shift()

    def _shift(self) -> None:
        """Let the first stage leave the window: its readings become part of the prior."""
        leaving, first = self._nodes[0], self._nodes[1]
        e, P = self._conditioned(leaving, self._model.difference(self._prior[0], leaving.x), self._prior[1])
        self._relinearise(first, leaving)
        mean = self._model.sum(self._reached(first, leaving), first.F @ e)
        P = first.F @ P @ first.F.T + first.Q
        self._prior = mean, 0.5 * (P + P.T)
        _check(*self._prior)
        self._nodes.pop(0)

    def _solve(self) -> None:
        model, nodes = self._model, self._nodes
        for _ in range(self._iterations):
            readings = [self._weighted(node) for node in nodes]
            offsets = [model.difference(self._prior[0], nodes[0].x)]
            for before, node in pairwise(nodes):
                self._relinearise(node, before)
                offsets.append(model.difference(self._reached(node, before), node.x))
            limits = [model.limits(node.x) for node in nodes]
            errors, self.P = self._unlimited(offsets, readings)
            self.failure = ""
            if any((e < low).any() or (e > high).any() for e, (low, high) in zip(errors, limits, strict=True)):
                limited, message = self._limited(offsets, readings, limits)
                if limited is None:
                    self.failure = message
                    return
                errors = limited
            for error, node in zip(errors, nodes, strict=True):
                node.x = model.sum(node.x, error)
        newest = nodes[-1]
        newest.spread = None
        _check(newest.x, self.P)
        self.residual, _ = residuals(model, newest.x, newest.readings)
        r = self.residual
        self.agrees = bool(len(r)) and float(np.mean(np.abs(r) < _GOOD)) >= 0.5

    def _unlimited(
        self, offsets: Sequence[Array], readings: Sequence[tuple[Array, Array]]
    ) -> tuple[list[Array], Array]:
        """Solution (d,) at each node without limits, and P at the newest: a Kalman filter forward, and backward the

        smoother of Bryson and Frazier, which inverts no covariance:

            lambda <- F' ((I - K W)' lambda - W' S^{-1} (r - W e)),    e^ = e - P lambda.
        """
        e, P = offsets[0], self._prior[1]
        forward = []
        for k, (node, (r, W)) in enumerate(zip(self._nodes, readings, strict=True)):
            if k:
                e, P = node.F @ e + offsets[k], node.F @ P @ node.F.T + node.Q
            PW = P @ W.T
            solved = np.linalg.solve(np.eye(len(r)) + W @ PW, np.column_stack([W, r - W @ e]))  # S^{-1} (W, r - W e)
            kept = np.eye(len(P)) - PW @ solved[:, :-1]
            e = e + PW @ solved[:, -1]
            P = kept @ P
            P = 0.5 * (P + P.T)
            forward.append((e, P, kept, W.T @ solved[:, -1]))
        costate, errors = np.zeros(len(P)), []
        for (filtered, covariance, kept, gradient), node in zip(forward[::-1], self._nodes[::-1], strict=True):
            errors.append(filtered - covariance @ costate)
            if node is not self._nodes[0]:
                costate = node.F.T @ (kept.T @ costate - gradient)
        return errors[::-1], P

    def _limited(
        self,
        offsets: Sequence[Array],
        readings: Sequence[tuple[Array, Array]],
        limits: Sequence[tuple[Array, Array]],
    ) -> tuple[list[Array] | None, str]:
        """Solution (d,) at each node within the limits, by FATROP; None and its message if it found none."""
        programme, S = self._programme, self._scale
        programme.clear()
        padding = self._stages - len(self._nodes)
        programme.A[0] = square_root(self._prior[1]) / S[:, np.newaxis]
        programme.c[0] = offsets[0] / S
        for k, (node, (r, W), (low, high)) in enumerate(zip(self._nodes, readings, limits, strict=True)):
            i = padding + k
            if k:
                programme.A[i] = node.F * S / S[:, np.newaxis]
                programme.B[i] = square_root(node.Q) / S[:, np.newaxis]
                programme.c[i] = offsets[k] / S
            programme.H[i], programme.g[i] = (W * S).T @ (W * S), (W * S).T @ r
            programme.low[i], programme.high[i] = low / S, high / S
        errors, message = programme.solve()
        return None if errors is None else [S * error for error in errors[padding:]], message

    def _conditioned(self, node: _Node, e: Array, P: Array) -> tuple[Array, Array]:
        """Error e (d,) about the node's state with covariance P, conditioned on its readings."""
        r, W = self._weighted(node)
        if not len(r):
            return e, P
        PW = P @ W.T
        gain = np.linalg.solve(np.eye(len(r)) + W @ PW, PW.T).T
        kept = np.eye(len(P)) - gain @ W
        return e + gain @ (r - W @ e), kept @ P @ kept.T + gain @ gain.T

    def _weighted(self, node: _Node) -> tuple[Array, Array]:
        """r (k,) and W (k, d) at the node, times the roots of Huber's weights."""
        r, W = residuals(self._model, node.x, node.readings)
        size = np.abs(r)
        if node.spread is not None and len(node.spread) == len(r):
            size = size / node.spread
        if not (size > self._slope).any():
            return r, W
        root = np.sqrt(self._slope / np.maximum(size, self._slope))
        return root * r, root[:, np.newaxis] * W

    def _associated(self, readings: tuple[Array, ...]) -> tuple[Array, ...]:
        """The readings at the newest node, with what a model of several alternatives chooses at its estimate."""
        if self._associating is None:
            return readings
        return tuple(self._associating.associated(self.x, self.P, y) for y in readings)

    def _spread(self, node: _Node) -> Array:
        (y,) = node.readings
        r, W = self._model.residual(node.x, y)
        known = np.isfinite(r) & np.isfinite(W).all(axis=1)
        r, W = r[known], W[known]
        S = np.eye(len(r)) + W @ self.P @ W.T
        self.predicted.append(Predicted(node.x, y, known, r, S))
        spread: Array = np.sqrt(S.diagonal())
        return spread

    def _relinearise(self, node: _Node, before: _Node) -> None:
        """Linearise the transition to a node again if the state before it has moved noticeably."""
        moved = np.abs(self._model.difference(before.x, node.at))
        if (moved > _MOVED * np.sqrt(np.maximum(np.diag(self.P), 0.0))).any():
            node.at = before.x
            node.reached, node.F, node.Q = advanced(self._model, before.x, node.inputs)

    def _reached(self, node: _Node, before: _Node) -> Array:
        """State to which the state of the node before leads, to first order about the point of linearisation."""
        return self._model.sum(node.reached, node.F @ self._model.difference(before.x, node.at))


def _check(x: Array, P: Array) -> None:
    if not (np.isfinite(x).all() and np.isfinite(P).all()):
        raise FloatingPointError("the state or its covariance is not finite")
