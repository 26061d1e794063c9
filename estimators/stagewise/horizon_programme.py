"""The quadratic programme of a moving horizon, stage by stage, with its limits, in the form that FATROP solves.

With errors e_i (d,) of N stages, scaled to similar magnitudes, readings W e = r + noise of H = W' W and
g = W' r, and noises n_i (d,) between the stages,

    min 1/2 |e_0|^2 + 1/2 sum |n_i|^2 + sum (1/2 e_i' H_i e_i - g_i' e_i)
    subject to  e_{i+1} = A_i e_i + B_i n_i + c_i,   low_i <= e_i <= high_i,

where e_0 is the whitened error of the arrival cost, which A_0 and c_0 lead to the first stage. All matrices are
parameters, so that one programme is compiled for all updates and models.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

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
