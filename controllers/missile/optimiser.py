"""Optimisers of a flight: inputs held between breaks, flown through the declared body.

``JointOptimiser`` solves the flight as one problem, in the pitch plane or in space with all states at once;
``pitch_and_yaw`` has the one that alternates between the planes. ``OptimiserWithFallback`` tries a second one where the
first fails.

**First guesses** of a flight: a smooth path at constant speed, flown along its tangent.

    P(s) = (1 + 2 s)(1 - s)^2 P_0 + s (1 - s)^2 D_0 + s^2 (3 - 2 s) P_1 - s^2 (1 - s) D_1,     0 <= s <= 1,

Hermite's cubic from the start to the target, with tangents D along the velocity at the start and the aspect angle at
the end. At speed U along it, theta is the angle of the tangent, w = 0, q = theta', and the inputs follow from the
equations of motion: the missile is differentially flat in its place and attitude. The yaw plane's path is a cubic
too, over time, and the nose follows it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numba import float64

from mathnavi.controllers.missile.planes import inputs_between, joined, split
from mathnavi.controllers.missile.problem import (
    ALLOWANCE,
    TerminalCondition,
    ground_parameters,
    guidance_problem,
    out_of_bounds,
    weights,
)
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, TWO, combined
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile import kernels
from mathnavi.models.missile.coordinates import PLANAR, STEP, Coordinates
from mathnavi.models.missile.dynamics import SPATIAL_STATES, Body
from mathnavi.models.missile.kernels import (
    flow,
    from_joints,
    inverse_dynamics,
    joint_accelerations,
    states_on,
    to_joints,
)
from mathnavi.models.missile.mission import Case

TANGENTS = (1.0, 0.5, 2.0)
"""lengths of the tangents over the distance, in the order in which they are tried; only the first in flight, as another
plan follows soon"""

_DENSE = 400  # points of the path whose length is measured


def pitch_guess(start: Array, terminal: TerminalCondition, body: Body, nodes: Array, tangent: float) -> Solved:
    """Guess of the pitch plane's states (N, 6) and inputs (N - 1, 3), (F_1, F_z, I a), from a state (6,)."""
    U, w, theta, place = start[0], start[1], start[3], start[4:]
    speed = max(math.hypot(U, w), 1.0)
    target = terminal.place[[0, 2]]
    tangent_length = tangent * float(np.linalg.norm(target - place))
    c, s = math.cos(theta), math.sin(theta)
    velocity = np.array([U * c + w * s, w * c - U * s])
    ends = tangent_length * np.array([velocity / speed, [math.cos(terminal.theta), -math.sin(terminal.theta)]])
    fine = np.linspace(0.0, 1.0, _DENSE)
    path = _hermite(fine, place, target, *ends)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    T = max(float(length[-1]) / speed, 0.1)
    slope = np.gradient(path, fine, axis=0)
    angle = np.unwrap(np.arctan2(-slope[:, 1], slope[:, 0]))
    angle += 2.0 * math.pi * round((theta - angle[0]) / (2.0 * math.pi))
    angle += terminal.wound_to(angle[-1]).theta - angle[-1]  # rounding
    at = np.interp(nodes * length[-1], length, fine)

    x, times = np.zeros((len(nodes), 6)), nodes * T
    x[:, 0], x[:, 3], x[:, 4:] = speed, np.interp(at, fine, angle), _hermite(at, place, target, *ends)
    theta_rate, x[:, 2] = _rates(x[:, 3], times)
    middle = 0.5 * (x[:-1, 3] + x[1:, 3])
    weight, m = body.mass * body.gravity, body.mass
    inputs = np.column_stack(
        [
            weight * np.sin(middle),
            -m * theta_rate * speed - weight * np.cos(middle),
            body.inertia * np.diff(x[:, 2]) / np.diff(times),
        ]
    )
    return Solved(x, inputs, nodes, T, np.empty(0), math.nan, 0)


def yaw_guess(start: Array, terminal: TerminalCondition, body: Body, pitch: Solved) -> Solved:
    """Guess of the yaw plane's states (N, 4) and inputs (N - 1, 2), (F_2, I b), from ``start`` (4,)."""
    V, _, _, y = start
    T = pitch.duration
    ends = np.array([[y], [terminal.after(T)[1]], [T * V], [T * terminal.velocity[1]]])
    path = _hermite(pitch.nodes, *ends)[:, 0]
    _, velocity = _rates(path, pitch.times)
    psi = np.arctan2(velocity, pitch.x[:, 0])
    _, r = _rates(psi, pitch.times)
    d = np.diff(pitch.times)
    inputs = np.column_stack([body.mass * np.diff(velocity) / d, body.inertia * np.diff(r) / d])
    x = np.column_stack([velocity, r, psi, path])
    return Solved(x, inputs, pitch.nodes, T, np.empty(0), math.nan, 0)


def _rates(values: Array, times: Array) -> tuple[Array, Array]:
    """Rates (N - 1,) of values (N,) between the times (N,), and (N,) at them."""
    between = np.diff(values) / np.diff(times)
    return between, np.interp(times, 0.5 * (times[:-1] + times[1:]), between)


def _hermite(s: Array, start: Array, end: Array, leaving: Array, arriving: Array) -> Array:
    """Points (n, m) of the cubic at s (n,)."""
    t = s[:, None]
    points: Array = (
        (1 + 2 * t) * (1 - t) ** 2 * start
        + t * (1 - t) ** 2 * leaving
        + t**2 * (3 - 2 * t) * end
        - t**2 * (1 - t) * arriving
    )
    return points


SAMPLE = 0.02
"""interval [s] at which a height is sampled"""
ROUNDS = 4
"""largest number of solves of one flight that misses its end or passes below the ground between its nodes"""
ACCEPTED = 0.1
"""terminal error [m] that is acceptable to fly: the next plan corrects it"""


@dataclass(frozen=True, eq=False)
class MissileTrajectory:
    """Arcs with inputs ``u`` (K, nu) held between the times ``t`` (K + 1,) [s], from 0 on, and the states ``x``
    (K + 1, nx) at them: each is where the one before leads to."""

    t: Array
    x: Array
    u: Array
    cost: float  # J
    remark: str = ""  # note to record on how it was found

    @property
    def duration(self) -> float:
        """Length of the trajectory [s]."""
        return float(self.t[-1])


class Optimiser(Protocol):
    """Optimises the flight from a state to a terminal condition, again and again."""

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        """Return the flight from the state ``start`` (nx,) at t [s], or ``Failed`` with the reason."""
        ...


def lowest_height(trajectory: MissileTrajectory, coordinates: Coordinates, body: Body) -> float:
    """Least height [m] over the ground along a trajectory, as flown in space; inf where it stays far above it.

    Over an arc of duration d with an acceleration of at most A the path is at most A d^2 / 8 below the lower end.
    """
    height, d = -coordinates.place(trajectory.x)[:, 2], np.diff(trajectory.t)
    ends = np.minimum(height[:-1], height[1:])
    forces = np.linalg.norm(coordinates.input_in_space(trajectory.u)[:, :3], axis=1)
    low = np.flatnonzero(ends < (forces / body.mass + body.gravity) * d**2 / 8.0)
    x, u = coordinates.in_space(trajectory.x), coordinates.input_in_space(trajectory.u)
    return min((_lowest(x[k], float(d[k]), u[k], body.numbers, STEP) for k in low), default=math.inf)


@njit(cache=True, nogil=True)
def _lowest(start: Array, duration: float, u: Array, numbers: kernels.Numbers, step: float) -> float:
    """Least height [m] over an arc from ``start`` (10,), sampled every ``SAMPLE`` or more often."""
    count = max(2, math.ceil(duration / SAMPLE))
    now, highest = start, start[9]
    for _ in range(count):
        now = kernels.flow(now, u, duration / count, numbers, step)
        highest = max(highest, now[9])
    return -float(highest)


def flown(start: Array, t: Array, u: Array, coordinates: Coordinates, body: Body) -> Array:
    """States (K + 1, nx) at the times t (K + 1,) [s] of a body from ``start`` (nx,) that holds inputs u (K, nu)."""
    x = _flown(coordinates.in_space(start), np.diff(t), coordinates.input_in_space(u), body.numbers, STEP)
    return x[:, [SPATIAL_STATES.index(name) for name in coordinates.states]]


@njit(cache=True, nogil=True)
def _flown(start: Array, durations: Array, u: Array, numbers: kernels.Numbers, step: float) -> Array:
    x = np.empty((len(u) + 1, len(start)))
    x[0] = start
    for k in range(len(u)):
        x[k + 1] = kernels.flow(x[k], u[k], durations[k], numbers, step)
    return x


class JointOptimiser:
    """An ``Optimiser`` that starts from its last solution, or from first guesses if it has no solution or fails."""

    def __init__(
        self,
        case: Case,
        body: Body,
        coordinates: Coordinates,
        limits: tuple[float, ...],
        nodes: int,
        backend: Backend,
        distribution: NodeDistribution,
        clearance: float,
    ) -> None:
        """``clearance`` [m] is what plans keep over the ground."""
        problem, self._weights = guidance_problem(body, coordinates, limits), weights(case)
        self._shooting = Shooting(problem, nodes, backend, distribution)
        self._coordinates, self._body, self._nodes = coordinates, body, np.linspace(0.0, 1.0, nodes)
        self._clearance = clearance
        self._last: tuple[float, Solved] | None = None  # when it starts [s], and it

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        failed = Failed("nothing was tried", infeasible=False)
        if (reason := out_of_bounds(start, self._coordinates)) is not None:
            return Failed(reason, infeasible=True)
        for guess, first in self._guesses(t, start, terminal):
            found = self._above_ground(start, terminal, guess, first=first)
            if not isinstance(found, Failed):
                solved, trajectory = found
                self._last = t, solved
                return trajectory
            failed = found
        return failed

    def _above_ground(
        self, start: Array, terminal: TerminalCondition, guess: Solved, *, first: bool
    ) -> tuple[Solved, MissileTrajectory] | Failed:
        """Return a solution and its flight.

        Where the flight misses what the programme reaches, or passes below the ground between nodes, it is solved again
        for an end that is shifted against the error, or with more clearance.
        """
        height, clearance = -float(self._coordinates.place(start)[2]), self._clearance
        wound = terminal.wound_to(float(guess.x[-1, self._coordinates.index("theta")]))
        aim, failed = wound, Failed("no round was taken", infeasible=False)
        for _ in range(ROUNDS):
            known = [self._weights, aim.parameters(start, self._coordinates)]
            parameters = np.concatenate([*known, ground_parameters(height, clearance)])
            solved = self._shooting.solve(guess, parameters, first=first)
            if isinstance(solved, Failed):
                return solved
            x = flown(start, solved.times, solved.u, self._coordinates, self._body)
            trajectory = MissileTrajectory(solved.times, x, solved.u, solved.cost)
            error = wound.error_of(x[-1], trajectory.duration, self._coordinates)
            below = -ALLOWANCE - lowest_height(trajectory, self._coordinates, self._body)
            if error.norm < ACCEPTED and below <= 0.0:
                return solved, trajectory
            if error.norm >= ACCEPTED:
                failed = Failed(f"the plan as flown would miss by {error.norm:.3g} m", infeasible=False)
                aim = aim.corrected_for(error)
            else:
                text = f"the flight would pass {below:.3g} m below the ground between its nodes"
                failed = Failed(text, infeasible=False)
                clearance += 2.0 * below
            guess = solved
        return failed

    def _guesses(self, t: float, start: Array, terminal: TerminalCondition) -> Iterator[tuple[Solved, bool]]:
        if self._last is not None and t - self._last[0] < self._last[1].duration:
            yield self._last[1].after(t - self._last[0]), False
        for tangent in TANGENTS if self._last is None else TANGENTS[:1]:
            if self._coordinates is PLANAR:
                yield pitch_guess(start, terminal, self._body, self._nodes, tangent), True
                continue
            in_pitch, in_yaw = split(start)
            pitch = pitch_guess(in_pitch, terminal, self._body, self._nodes, tangent)
            yaw = yaw_guess(in_yaw, terminal, self._body, pitch)
            _, u = inputs_between(pitch, yaw, 1, self._body)
            yield dataclasses.replace(pitch, x=joined(pitch.x, yaw.x), u=u), True


class OptimiserWithFallback:
    """An ``Optimiser``: ``first`` and, where it fails, the one that ``make_second`` builds when it is first needed.

    A flight by the second one carries the reason as its remark.
    """

    def __init__(self, first: Optimiser, make_second: Callable[[], Optimiser]) -> None:
        self._first, self._make_second = first, make_second

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        found = self._first.optimise(t, start, terminal)
        if not isinstance(found, Failed) or found.infeasible:
            return found
        other = self._second.optimise(t, start, terminal)
        if isinstance(other, Failed):
            return Failed(f"{found.message}; as one problem: {other.message}", other.infeasible)
        return dataclasses.replace(other, remark=f"planned as one problem: {found.message}")

    @cached_property
    def _second(self) -> Optimiser:
        return self._make_second()


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
NUMBERS = combined(float64, float64, float64, float64)
KERNELS: tuple[Signature, ...] = (
    (_flown, (ONE, ONE, TWO, NUMBERS, float64)),
    (_lowest, (ONE, float64, ONE, NUMBERS, float64)),
    (states_on, (ONE, TWO, TWO, ONE, NUMBERS, float64)),
    (flow, (ONE, ONE, float64, NUMBERS, float64)),
    (joint_accelerations, (TWO, TWO, NUMBERS)),
    (inverse_dynamics, (TWO, TWO, NUMBERS)),
    (from_joints, (TWO,)),
    (to_joints, (TWO,)),
)
