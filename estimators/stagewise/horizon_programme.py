"""The quadratic programme of a moving horizon, stage by stage, as FATROP takes it.

With errors e_i (d,) of N stages, scaled so that they are of one size, and noises n_i (d,) between them,

    min 1/2 |e_0|^2 + 1/2 sum |n_i|^2 + 1/2 sum |r_i - W_i e_i|^2
    subject to  e_{i+1} = A_i e_i + B_i n_i + c_i,   low_i <= e_i <= high_i,

where e_0 is the whitened error of the arrival cost, which A_0 and c_0 lead to the first stage. All matrices are
parameters, so that one programme serves every update, whatever the model.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.models.nlp_solver import NlpSolver, Outcome, StageStructure, fatrop_settings
from mathnavi.sim.interfaces.signals import Array

_TOLERANCE, _ITERATIONS = 1e-8, 50
_SECONDS = 1.0  # of CPU time after which a solve is ended


class HorizonProgramme:
    """The programme of N ``stages`` with d ``states`` and at most m ``rows`` of readings each.

    Its arrays are what an update writes into: ``A``, ``B`` (N, d, d) and ``c`` (N, d) lead to stage i from the one
    before; ``W`` (N, m, d) and ``r`` (N, m) are its readings; ``low`` and ``high`` (N, d) its limits.
    """

    def __init__(self, states: int, rows: int, stages: int) -> None:
        d, m, N = self._d, _, self._stages = states, rows, stages
        self.A, self.B = np.zeros((N, d, d)), np.zeros((N, d, d))
        self.c, self.W, self.r = np.zeros((N, d)), np.zeros((N, m, d)), np.zeros((N, m))
        self.low, self.high = np.full((N, d), -np.inf), np.full((N, d), np.inf)
        self._solver = _solver(d, m, N)

    def clear(self) -> None:
        """Make every stage one that is as the one before, without noise, readings and limits."""
        self.A[:], self.low[:], self.high[:] = np.eye(self._d), -np.inf, np.inf
        for array in (self.B, self.c, self.W, self.r):
            array[:] = 0.0

    def solve(self) -> tuple[Array | None, str]:
        """Errors (N, d) of the stages; None, and the solver's message, where they were not found."""
        d, N, inputs = self._d, self._stages, self._solver.inputs
        parts = [
            np.concatenate([block[i].ravel(order="F") for block in (self.A, self.B, self.c, self.W, self.r)])
            for i in range(N)
        ]
        inputs["p"][:] = np.concatenate(parts)
        if not np.isfinite(inputs["p"]).all() or np.isnan(self.low).any() or np.isnan(self.high).any():
            return None, "the programme holds NaN or infinity"  # which FATROP would call solved
        inputs["x0"][:] = 0.0
        inputs["lbx"][:], inputs["ubx"][:] = -np.inf, np.inf
        for key, limits in (("lbx", self.low), ("ubx", self.high)):
            for i in range(N):
                begin = 2 * d * (i + 1)
                inputs[key][begin : begin + d] = limits[i]
        report = self._solver.solve()
        found = self._solver.outputs["x"]
        if report.outcome is not Outcome.CONVERGED or not np.isfinite(found).all():
            return None, report.message
        errors = np.stack([found[2 * d * (i + 1) : 2 * d * (i + 1) + d] for i in range(N)])
        return errors, report.message


@lru_cache(maxsize=8)
def _stage(d: int, m: int) -> tuple[ca.Function, ca.Function]:
    """(e, n, A, B, c) -> the next error and the cost of the noise; (e, W, r) -> the cost of the readings."""
    e, n, c, r = (ca.SX.sym(name, size) for name, size in (("e", d), ("n", d), ("c", d), ("r", m)))
    A, B, W = ca.SX.sym("A", d, d), ca.SX.sym("B", d, d), ca.SX.sym("W", m, d)
    following = A @ e + B @ n + c
    transition = ca.Function("transition", [e, n, A, B, c], [following, 0.5 * ca.sumsqr(n)])
    return transition, ca.Function("readings", [e, W, r], [0.5 * ca.sumsqr(r - W @ e)])


def _solver(d: int, m: int, N: int) -> NlpSolver:
    transition, readings = _stage(d, m)
    sizes = (d * d, d * d, d, m * d, m)
    p = ca.MX.sym("p", N * sum(sizes))
    e, variables, gaps, cost = ca.MX.sym("e0", d), [], [], ca.MX(0)
    variables.append(e)
    cost += 0.5 * ca.sumsqr(e)
    for i, block in enumerate(ca.vertsplit(p, sum(sizes))):
        A, B, c, W, r = ca.vertsplit(block, [0, *np.cumsum(sizes).tolist()])
        n = ca.MX.sym(f"n{i}", d)
        reached, noise = transition(e, n, ca.reshape(A, d, d), ca.reshape(B, d, d), c)
        e = ca.MX.sym(f"e{i + 1}", d)
        variables += [n, e]
        gaps.append(e - reached)
        cost += noise + readings(e, ca.reshape(W, m, d), r)
    functions = {"x": ca.vertcat(*variables), "p": p, "f": cost, "g": ca.vertcat(*gaps)}
    stages = StageStructure([d] * (N + 1), [d] * N + [0], [0] * (N + 1), [True] * (N * d))
    settings = fatrop_settings(stages, _TOLERANCE, _ITERATIONS, {})
    return NlpSolver("horizon", "fatrop", functions, settings, ("x",), seconds=_SECONDS)
