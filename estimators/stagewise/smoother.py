"""Smoothing of a whole run: Rauch, Tung and Striebel's smoother, and batch least squares.

An extended Kalman filter in the errors of a ``StagewiseModel`` runs forward over the stages; x_k|k-1 with P_k|k-1 is
the state before the readings of stage k, x_k with P_k that after them, F_k the Jacobian from stage k to k + 1.
Backward,

    G_k = P_k F_k' P_{k+1|k}^{-1},   x^_k = x_k + G_k (x^_{k+1} - x_{k+1|k}),
    P^_k = P_k + G_k (P^_{k+1} - P_{k+1|k}) G_k'.

Batch least squares takes all stages at once: the maximum a posteriori of the start and of the noises,

    min |z|^2 + sum |n_k|^2 + sum |r_k - W_k e_k|^2    subject to  e_0 = a + P_0^{1/2} z,
                                                                   e_{k+1} = F_k e_k + Q_k^{1/2} n_k + c_k,

by Gauss-Newton steps, each a sparse system of the optimality conditions. For a linear model both give the same;
otherwise the smoother is linearised at the filter's estimates and batch least squares at its own solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, bmat, csc_matrix, identity
from scipy.sparse.linalg import splu
from scipy.special import chdtri

from mathnavi.estimators.stagewise.model import AssociatingModel, SmootherStage, StagewiseModel, advanced, residuals
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

_LASTING = 10  # readings in a row beyond the gate, after which the filter is wrong, not they
_REGULAR = 1e-12  # least eigenvalue of a covariance with a diagonal of ones that is inverted
_ITERATIONS = 30  # of Gauss and Newton
_STEP = 1e-6  # of the smoothed deviations, below which they have converged


@dataclass(frozen=True, eq=False)
class SmoothedStates:
    """States of a run at its stages, from the first one that the model can start at."""

    t: Array  # (n,) [s]
    x: tuple[Array, ...]  # (n,) states
    P: tuple[Array, ...]  # (n,) covariances (d, d) of their errors
    used: tuple[tuple[Array, ...], ...]  # (n,) readings, NaN in place of outliers
    converged: bool = True  # whether the iteration converged


@dataclass(frozen=True, eq=False)
class _Forward:
    """A stage of the filter."""

    stage: SmootherStage
    before: tuple[Array, Array]  # x_k|k-1 and P_k|k-1
    after: tuple[Array, Array]  # x_k and P_k
    F: Array  # (d, d) from the stage before
    used: tuple[Array, ...]  # readings, NaN in place of outliers


def rauch_tung_striebel(model: StagewiseModel, stages: Sequence[SmootherStage], gate: float) -> SmoothedStates:
    """Smooth the stages of a run.

    A component of a reading is refused if its normalised innovation exceeds the value that a good one exceeds with
    probability ``gate``, unless that lasts. Raises ArgumentError if no stage has a reading that the model can start at,
    LinAlgError if the filter diverges.
    """
    return _backward(model, _filtered(model, stages, gate))


def _backward(model: StagewiseModel, forward: Sequence[_Forward]) -> SmoothedStates:
    x, P = forward[-1].after
    states, covariances = [x], [P]
    for now, following in zip(forward[-2::-1], forward[:0:-1], strict=True):
        x_predicted, P_predicted = following.before
        x_now, P_now = now.after
        G = P_now @ following.F.T @ _inverse(P_predicted)
        x, P = model.sum(x_now, G @ model.difference(x, x_predicted)), P_now + G @ (P - P_predicted) @ G.T
        P = 0.5 * (P + P.T)
        states.append(x)
        covariances.append(P)
    t = np.array([each.stage.t for each in forward])
    return SmoothedStates(t, tuple(states[::-1]), tuple(covariances[::-1]), tuple(each.used for each in forward))


def batch_least_squares(model: StagewiseModel, stages: Sequence[SmootherStage], gate: float) -> SmoothedStates:
    """Batch least squares over the readings that ``rauch_tung_striebel`` uses, with its result as the initial guess.

    The covariances are those of the smoother. Raises the errors of ``rauch_tung_striebel``.
    """
    forward = _filtered(model, stages, gate)
    guess = _backward(model, forward)
    x = list(guess.x)
    scale = np.maximum([np.sqrt(np.maximum(np.diag(P), 0.0)) for P in guess.P], np.finfo(float).tiny)
    for _ in range(_ITERATIONS):
        e = _gauss_newton(model, forward, x)
        if not np.isfinite(e).all():
            break
        x = [model.sum(state, error) for state, error in zip(x, e, strict=True)]
        if (np.abs(e) <= _STEP * scale).all():
            return SmoothedStates(guess.t, tuple(x), guess.P, guess.used)
    return SmoothedStates(guess.t, tuple(x), guess.P, guess.used, converged=False)


def _filtered(model: StagewiseModel, stages: Sequence[SmootherStage], gate: float) -> list[_Forward]:
    limit, beyond = float(chdtri(1, gate)), np.zeros(model.rows, dtype=int)
    forward: list[_Forward] = []
    for stage in stages:
        F = np.eye(model.size)
        if not forward:
            started = model.start(stage.readings[0] if stage.readings else None)
            if started is None:
                continue
            x, P = started
        else:
            x, F, Q = advanced(model, x, stage.inputs)
            P = F @ P @ F.T + Q
        before, used = (x, P), []
        for y in stage.readings:
            if isinstance(model, AssociatingModel) and model.is_ambiguous:
                x, P = model.conditioned(x, P, y)
                used.append(model.associated(x, P, y))
                continue
            good = _admitted(model, x, P, y, limit, beyond)
            used.append(good)
            x, P = _conditioned(model, x, P, good)
        if not np.isfinite(P).all():
            raise np.linalg.LinAlgError(f"the filter's covariance is not finite at {stage.t:g} s")
        forward.append(_Forward(stage, before, (x, P), F, tuple(used)))
    if not forward:
        raise ArgumentError("no reading was recorded that the smoother could start at; allowed: a run with readings")
    return forward


def _admitted(model: StagewiseModel, x: Array, P: Array, y: Array, limit: float, beyond: Array) -> Array:
    """Reading with NaN for components beyond the gate; all NaN if it is refused as a whole."""
    r, W = model.residual(x, y)
    squares = np.square(r) / (1.0 + np.einsum("ij,jk,ik->i", W, P, W))
    beyond[:] = np.where(squares > limit, beyond + 1, np.where(np.isnan(squares), beyond, 0))
    refused = (beyond > 0) & (beyond <= _LASTING)
    if len(y) == len(r):
        return np.where(refused, np.nan, y)
    return np.full(len(y), np.nan) if refused.any() else y


def _conditioned(model: StagewiseModel, x: Array, P: Array, y: Array) -> tuple[Array, Array]:
    if np.isnan(y).all():
        return x, P
    r, W = residuals(model, x, (y,))
    PW = P @ W.T
    gain = np.linalg.solve(np.eye(len(r)) + W @ PW, PW.T).T
    kept = np.eye(model.size) - gain @ W
    P = kept @ P @ kept.T + gain @ gain.T
    return model.sum(x, gain @ r), 0.5 * (P + P.T)


def _inverse(P: Array) -> Array:
    """Inverse of a covariance in the directions in which it is not zero."""
    deviation = np.sqrt(np.maximum(np.diag(P), 0.0))
    scale = np.where(deviation > 0.0, 1.0 / np.where(deviation > 0.0, deviation, 1.0), 0.0)
    values, vectors = np.linalg.eigh(scale[:, np.newaxis] * P * scale)
    kept = values > _REGULAR
    inverse: Array = scale[:, np.newaxis] * (vectors[:, kept] / values[kept] @ vectors[:, kept].T) * scale
    return inverse


def square_root(P: Array) -> Array:
    """Factor L (d, d) with L L' = P of a covariance that may be singular, independent of its components' units."""
    deviation = np.sqrt(np.maximum(np.diag(P), 0.0))
    scale = np.where(deviation > 0.0, 1.0 / np.where(deviation > 0.0, deviation, 1.0), 0.0)
    values, vectors = np.linalg.eigh(scale[:, np.newaxis] * P * scale)
    L: Array = deviation[:, np.newaxis] * vectors * np.sqrt(np.maximum(values, 0.0))
    return L


# ---- batch least squares


def _gauss_newton(model: StagewiseModel, forward: Sequence[_Forward], x: Sequence[Array]) -> Array:
    """Step (n, d) from states x (n,), by the optimality conditions of the programme linearised there.

    Variables are e (n d), the noises n with z first (n d), and a multiplier for each equation.
    """
    n, d = len(x), model.size
    m_0, P_0 = forward[0].before
    roots, offsets, transitions = [square_root(P_0)], [model.difference(m_0, x[0])], []
    weights, rights = [], []
    for k, stage in enumerate(forward):
        if k:
            after, F, Q = advanced(model, x[k - 1], stage.stage.inputs)
            roots.append(square_root(Q))
            offsets.append(model.difference(after, x[k]))
            transitions.append(F)
        r, W = residuals(model, x[k], stage.used)
        weights.append(W.T @ W)
        rights.append(W.T @ r)
    scale = np.tile(np.maximum(np.sqrt(np.maximum(np.diag(P_0), 0.0)), 1e-9), n)
    S = csc_matrix((scale, (range(n * d), range(n * d))), shape=(n * d, n * d))
    A = identity(n * d, format="csc")
    if n > 1:
        lower = bmat([[None, csc_matrix((d, d))], [block_diag(transitions), None]], format="csc")
        A = A - lower
    inverse_scale = csc_matrix((1.0 / scale, (range(n * d), range(n * d))), shape=(n * d, n * d))
    A = inverse_scale @ A @ S
    B = inverse_scale @ block_diag(roots, format="csc")
    H = S @ block_diag(weights, format="csc") @ S
    system = bmat([[H, None, A.T], [None, identity(n * d), -B.T], [A, -B, None]], format="csc")
    right = np.concatenate([scale * np.concatenate(rights), np.zeros(n * d), np.concatenate(offsets) / scale])
    solution = splu(system).solve(right)
    step: Array = (scale * solution[: n * d]).reshape(n, d)
    return step
