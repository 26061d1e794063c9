"""Moving-horizon estimation: least squares over the last stages, with an arrival cost for all that came before.

Over the stages of a window with states x_1, ..., x_M, prior mean m and covariance P at the first, one real-time
Gauss-Newton iteration solves the quadratic programme of ``horizon_programme`` about the current states, and moves them
by its solution (M. Diehl, H. G. Bock and J. P. Schloeder, SIAM J. Control and Optimization 43, 2005). Without its
limits the programme is solved in closed form; if that solution is within the limits it is the programme's solution, as
the programme is convex; otherwise FATROP solves it. Outliers are weighted by Huber's loss with threshold delta: a
whitened residual r has the weight min(1, delta / |r|), at first with its predicted deviation in place of 1.

When the window moves on, the prior is updated with the readings of the stage that leaves, as by an extended Kalman
filter that is linearised at the smoothed state, and is propagated to the next stage (C. V. Rao, J. B. Rawlings and D.
Q. Mayne, IEEE Trans. Automatic Control 48, 2003). So for a linear model without outliers and limits it is the Kalman
filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from mathnavi.estimators.stagewise.horizon_programme import HorizonProgramme
from mathnavi.estimators.stagewise.model import Piece, SmootherStage, StagewiseModel, advanced, residuals
from mathnavi.estimators.stagewise.smoother import square_root
from mathnavi.interfaces.signals import Array

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


class MovingHorizon:
    """Window of ``stages`` stages of a model; ``x`` and ``P`` are the state and its covariance at the newest."""

    def __init__(self, model: StagewiseModel, stages: int, iterations: int, slope: float) -> None:
        """``slope`` is delta, ``iterations`` is the number of Gauss-Newton iterations at each reading."""
        self._model, self._stages, self._iterations, self._slope = model, stages, iterations, slope
        self._programme = HorizonProgramme(model.size, stages)
        self._nodes: list[_Node] = []
        self._prior: tuple[Array, Array]  # m, P at the first node
        self._scale: Array  # (d,) of the errors
        self.P = np.full((model.size, model.size), np.nan)
        self.failure = ""  # the solver's message, where the last programme was not solved
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
            self._nodes[-1].spread = self._spread(stage)
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
        r, _ = residuals(model, newest.x, newest.readings)
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

    def _spread(self, stage: SmootherStage) -> Array:
        _, W = residuals(self._model, self._nodes[-1].x, stage.readings)
        spread: Array = np.sqrt(1.0 + np.einsum("ij,jk,ik->i", W, self.P, W))
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
