"""The flight planner's problem stated for do-mpc (extra ``[bench]``), for comparison in ``flight_solvers``.

Only uniform grids are supported. benchmarks/README.md explains how this statement differs from the planner's.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.flight import spline
from mathnavi.controllers.flight.kernels import problem_data
from mathnavi.controllers.flight.problem import (
    POINTS_ON_MANOEUVRE,
    POINTS_PER_ARC,
    PlanningEnvironment,
    PlanSolution,
    Problem,
)
from mathnavi.controllers.flight.spline import TARGET_LENGTH
from mathnavi.interfaces.signals import Array


class DoMpc:
    """do-mpc's controller, built once per environment and warm started like the other solvers."""

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._environment: PlanningEnvironment | None = None
        self._mpc: Any = None

    def prepare(self, problem: Problem, guess: Array) -> None:
        """Prepare the model of a new environment, and the guess; this is not timed."""
        if self._environment is not problem.environment:
            self._environment, self._mpc = problem.environment, _do_mpc(problem, self._tolerance)
        mpc, h, x = self._mpc, problem.parameters.h, problem.start
        for i, a in enumerate(guess[:-1].reshape(-1, 3)):
            climb = guess[-1] if i == problem.arcs - 1 else 0.0
            mpc.opt_x_num["_x", i, 0, -1] = np.append(x, 0.0)
            mpc.opt_x_num["_u", i, 0] = np.append(a, climb)
            x = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * a, x[3:] + h * a])
        mpc.opt_x_num["_x", problem.arcs, 0, -1] = np.append(x, guess[-1])

    def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
        mpc = self._mpc
        mpc.make_step(np.append(problem.start, 0.0)[:, None])
        statistics = mpc.solver_stats
        if not statistics["success"]:
            return str(statistics["return_status"])
        inputs = np.array([mpc.opt_x_num["_u", i, 0] for i in range(problem.arcs)]).reshape(problem.arcs, 4)
        return PlanSolution(inputs[:, :3], float(inputs[-1, 3]), math.nan, True, int(statistics["iter_count"]))


def _do_mpc(problem: Problem, tolerance: float) -> Any:
    """Return do-mpc's controller for problems in this environment with these parameters."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of features that its small installation lacks
        import do_mpc
    c = problem.parameters
    h, M = c.h, c.manoeuvre_duration
    terrain, psi, low = problem.environment.terrain, _psi(problem), _lowness(problem)

    def following(x: ca.MX, a: ca.MX) -> ca.MX:
        return ca.vertcat(x[:3] + h * x[3:] + h**2 / 2 * a, x[3:] + h * a)

    model = do_mpc.model.Model("discrete", "MX")
    x = model.set_variable("_x", "x", (6, 1))
    model.set_variable("_x", "w")
    a = model.set_variable("_u", "a", (3, 1))
    climb = model.set_variable("_u", "climb")
    model.set_variable("_tvp", "is_last")
    model.set_rhs("x", following(x, a))
    model.set_rhs("w", climb)
    model.setup()
    # The set-up makes new symbols.
    p, v, w, a, climb = model.x["x"][:3], model.x["x"][3:], model.x["w"], model.u["a"], model.u["climb"]

    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.n_robust = problem.arcs, h, 0
    mpc.settings.store_full_solution = False
    mpc.settings.nlpsol_opts = {
        "print_time": False,
        "calc_lam_p": False,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": 200,
            "warm_start_init_point": "yes",
            "warm_start_bound_push": 1e-9,
            "warm_start_bound_frac": 1e-9,
            "warm_start_slack_bound_push": 1e-9,
            "warm_start_slack_bound_frac": 1e-9,
            "warm_start_mult_bound_push": 1e-9,
            "mu_strategy": "adaptive",
            "mu_init": 1e-4,
        },
    }
    arc = [low(p + t * v + t**2 / 2 * a) for t in h * np.arange(1, POINTS_PER_ARC + 1) / POINTS_PER_ARC]
    kappa = problem.terrain_weight
    stage = h * ca.sumsqr(a) + problem.packed[problem_data.CLIMB_WEIGHT] / 2 * climb**2
    stage += kappa / 2 * sum(ca.fmax(s, 0) ** 2 for s in arc)
    braking = (ca.vertcat(0, 0, w) - v) / M
    times = M * np.arange(1, POINTS_ON_MANOEUVRE + 1) / POINTS_ON_MANOEUVRE
    here, there = psi(p), psi(p + h * v)
    far = (there - here) / (h * c.beta) + 1 + c.epsilon
    final = here + problem.packed[problem_data.APPROACH_WEIGHT] / 2 * ca.fmax(far, 0) ** 2
    final += kappa / 2 * sum(ca.fmax(low(p + t * v + t**2 / 2 * braking), 0) ** 2 for t in times)
    mpc.set_objective(mterm=final, lterm=stage)
    mpc.set_rterm(a=0.0, climb=0.0)
    v_next = v + h * a
    mpc.set_nl_cons("speed", ca.sumsqr(v_next) / c.speed_max**2, ub=1.0)
    mpc.set_nl_cons("acceleration", ca.sumsqr(a) / c.acceleration_max**2, ub=1.0)
    last = model.tvp["is_last"] * ca.sumsqr(ca.vertcat(0, 0, climb) - v_next)
    mpc.set_nl_cons("manoeuvre", last / (M * c.acceleration_max) ** 2, ub=1.0)
    mpc.bounds["lower", "_u", "climb"], mpc.bounds["upper", "_u", "climb"] = 0.0, c.speed_max
    border = problem_data.BORDER
    mpc.terminal_bounds["lower", "x"] = np.array([border, border, *[-np.inf] * 4])
    mpc.terminal_bounds["upper", "x"] = np.array([terrain.width - border, terrain.depth - border, *[np.inf] * 4])
    varying = mpc.get_tvp_template()
    varying["_tvp", problem.arcs - 1, "is_last"] = 1.0
    mpc.set_tvp_fun(lambda _: varying)
    mpc.setup()
    mpc.set_initial_guess()
    return mpc


def _held(u: ca.MX, nodes: int) -> ca.MX:
    return ca.fmin(ca.fmax(u, 0), nodes - 1)


def _bspline(coordinates: list[ca.MX], coefficients: Array) -> ca.MX:
    """Return CasADi's B-spline with constant coefficients; coordinates are in cells and clamped to the nodes."""
    shape = coefficients.shape
    knots = [spline.knots(count - 2) for count in reversed(shape)]
    at = [_held(u, count - 2) for u, count in zip(coordinates, shape, strict=True)]
    return ca.bspline(ca.vertcat(*reversed(at)), ca.DM(coefficients.ravel()), knots, [3] * len(shape), 1, {})


def _lowness(problem: Problem) -> Callable[[ca.MX], ca.MX]:
    spacing, heights = problem.environment.terrain.spacing, problem.environment.heights
    floor = problem.parameters.clearance
    return lambda p: _bspline([p[1] / spacing, p[0] / spacing], heights) + floor - p[2]


def _psi(problem: Problem) -> Callable[[ca.MX], ca.MX]:
    cost, factor = problem.environment.cost, problem.parameters.psi_per_metre
    g, target = cost.grid, ca.DM(cost.target)

    def psi(p: ca.MX) -> ca.MX:
        row, column = (p[1] - g.y_0) / g.spacing, (p[0] - g.x_0) / g.spacing
        layer = (p[2] - _bspline([row, column], cost.ground) - g.level_0) / g.layer_spacing
        distance = ca.sqrt(ca.sumsqr(p - target) + TARGET_LENGTH**2)
        return factor * (distance * _bspline([layer, row, column], cost.ratio) - TARGET_LENGTH)

    return psi
