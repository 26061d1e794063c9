"""Guesses to restart from where a solve found no feasible point: controls of several shapes, simulated from the start.

A guess of zeros may be a stationary point of a constraint (x' = u |u|, a vehicle that cannot move sideways, a line
through the middle of an obstacle), where no direction makes its violation smaller. Trajectories of the dynamics under
other controls are not, but for chance.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.clocks import clocks_of
from mathnavi.controllers.ocp.feasibility.enclosure import pinned
from mathnavi.controllers.ocp.problem_functions import GuessedTrajectory, Interval, ProblemFunctions
from mathnavi.interfaces.signals import Array

_TIMES = 31  # of a guess
_SUBSTEPS = 10  # of a simulation between two of them
_NOISE = 0.3  # of an own guess that is perturbed, over scales and half the range of the controls
_LARGEST = 1e6  # scaled state of a simulation that counts as diverged
_INSIDE = 0.05  # share of a control's range that a guess keeps away from its limits


def starts(
    problem: ProblemFunctions, own: GuessedTrajectory, p: Array, count: int, rng: np.random.Generator
) -> Iterator[tuple[str, GuessedTrajectory]]:
    """Name and guess of at most ``count`` restarts.

    First the controls of the own guess, simulated; then by turns controls that are constant, that wander, those of the
    own guess with noise, and that are bent once. A free final time is half to four times the guessed one. So is an
    unknown constant that is positive by its bounds, as the duration of a phase is; another one is drawn around its
    guess. What diverges is left out.
    """
    tau = np.linspace(0.0, 1.0, _TIMES)
    states, controls = own.states_at(tau), own.controls_at(tau)
    reach = np.maximum(problem.control_scale, np.abs(controls).max(axis=0, initial=0.0))
    lower, upper = (
        np.where(np.isfinite(side), side, sign * reach)
        for side, sign in zip(problem.control_bounds, (-1.0, 1.0), strict=True)
    )
    for clock in clocks_of(problem):  # time passes as it does in the guess
        lower[clock.rate], upper[clock.rate] = 1.0, 1.0
    if not count:
        return
    box = pinned(problem, p, "start")
    guessed, of_constants = np.clip(states[0], box.lower, box.upper), rng.spawn(1)[0]

    def simulation(u: Array, duration: float, start: Array) -> GuessedTrajectory | None:
        x = _simulated(problem, start, tau * duration, u, p)
        return None if x is None else GuessedTrajectory(tau, np.clip(x, *problem.state_bounds), u, duration)

    def knots(many: int) -> Array:
        shares, at = rng.uniform(_INSIDE, 1.0 - _INSIDE, (many, problem.nu)), np.linspace(0.0, 1.0, many)
        columns = [np.interp(tau, at, column) for column in shares.T]
        values: Array = lower + np.array(columns).T.reshape(len(tau), problem.nu) * (upper - lower)
        return values

    if (found := simulation(np.clip(controls, lower, upper), own.duration, guessed)) is not None:
        yield "its controls, simulated", found
    for k in range(count - 1):
        factor, duration = 2.0 ** int(rng.integers(-1, 3)), own.duration
        if problem.free_duration:
            duration = float(np.clip(factor * duration, *problem.duration_bounds))
        kind = ("constant controls", "wandering controls", "the guess with noise", "bent controls")[k % 4]
        if kind == "the guess with noise":
            x = states + _NOISE * rng.normal(size=states.shape) * problem.state_scale
            u = controls + _NOISE * rng.normal(size=controls.shape) * 0.5 * (upper - lower)
            x, u = np.clip(x, *problem.state_bounds), np.clip(u, lower, upper)
            yield kind, GuessedTrajectory(tau, x, u, duration)
            continue
        u = knots({"c": 1, "w": 5, "b": 3}[kind[0]])
        drawn = np.where(_constants(problem), _drawn(guessed, box, problem.state_scale, of_constants), guessed)
        if (found := simulation(u, duration, drawn)) is not None:
            yield kind, found


@lru_cache(maxsize=64)
def _constants(problem: ProblemFunctions) -> NDArray[np.bool_]:
    """True (nx,) for the states that are constants, of zero rates, and in no condition at the start."""
    x, u, t, p = problem.dynamics.sx_in()
    rates = ca.vertsplit(ca.densify(problem.dynamics(x, u, t, p)))
    constant = np.array([rate.is_zero() for rate in rates], dtype=np.bool_)
    constant[list(problem.initial.jac_sparsity(0, 0).get_triplet()[1])] = False
    return constant


def _drawn(guessed: Array, box: Interval, scale: Array, rng: np.random.Generator) -> Array:
    """States (nx,) at the start, drawn around those of a guess where the box of what is allowed leaves them free."""
    positive = (box.lower >= 0.0) & (guessed > 0.0)
    factors, steps = 2.0 ** rng.uniform(-1.0, 2.0, len(guessed)), rng.normal(size=len(guessed))
    width = np.where(np.isfinite(box.upper - box.lower), 0.5 * (box.upper - box.lower), np.inf)
    reach = np.minimum(np.maximum(scale, np.abs(guessed)), width)
    drawn: Array = np.clip(np.where(positive, factors * guessed, guessed + reach * steps), box.lower, box.upper)
    return drawn


def _simulated(problem: ProblemFunctions, start: Array, times: Array, controls: Array, p: Array) -> Array | None:
    """States (k, nx) under controls (k, nu), straight between times (k,) [s], by Runge-Kutta's method; None if lost."""
    steps = _SUBSTEPS * (len(times) - 1)
    fine = np.interp(np.arange(steps + 1) / _SUBSTEPS, np.arange(len(times)), times)
    u = np.array([np.interp(fine, times, column) for column in controls.T]).reshape(problem.nu, steps + 1)
    known = np.vstack([u[:, :-1], u[:, 1:], fine[None, :-1], np.diff(fine)[None, :]])
    x = np.array(_simulation(problem, steps)(start, known, np.tile(p[:, None], (1, steps))).full())
    found = np.vstack([start, x.T[_SUBSTEPS - 1 :: _SUBSTEPS]])
    return found if np.abs(found / problem.state_scale).max(initial=0.0) < _LARGEST else None  # NaN is not


@lru_cache(maxsize=64)
def _simulation(problem: ProblemFunctions, steps: int) -> ca.Function:
    """(x, known (2 nu + 2, steps), p (np, steps)) -> states (nx, steps) after each step."""
    x, p = ca.SX.sym("x", problem.nx), ca.SX.sym("p", len(problem.parameters))
    u_0, u_1, t, h = ca.SX.sym("u_0", problem.nu), ca.SX.sym("u_1", problem.nu), ca.SX.sym("t"), ca.SX.sym("h")
    u_m, half = 0.5 * (u_0 + u_1), 0.5 * h
    a = problem.dynamics(x, u_0, t, p)
    b = problem.dynamics(x + half * a, u_m, t + half, p)
    c = problem.dynamics(x + half * b, u_m, t + half, p)
    d = problem.dynamics(x + h * c, u_1, t + h, p)
    step = ca.Function("step", [x, ca.vertcat(u_0, u_1, t, h), p], [x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)])
    return step.mapaccum("simulation", steps)
