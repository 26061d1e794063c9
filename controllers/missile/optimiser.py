"""Optimisers of a flight: inputs held between breaks, flown through the declared body.

``JointOptimiser`` solves the flight as one problem, in the pitch plane or in space with all states at once;
``pitch_and_yaw`` has the one that alternates between the planes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from mathnavi.controllers.missile.guess import TANGENTS, pitch_guess, yaw_guess
from mathnavi.controllers.missile.planes import inputs_between, joined, split
from mathnavi.controllers.missile.problem import TerminalCondition, guidance_problem, out_of_bounds, weights
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.models.missile import kernels
from mathnavi.models.missile.coordinates import PLANAR, STEP, Coordinates
from mathnavi.models.missile.dynamics import SPATIAL_STATES, Body
from mathnavi.models.missile.mission import Case
from mathnavi.sim.interfaces.signals import Array


@dataclass(frozen=True, eq=False)
class MissileTrajectory:
    """Arcs with inputs ``u`` (K, nu) held between the times ``t`` (K + 1,) [s], from 0 on, and the states ``x``
    (K + 1, nx) at them: each is where the one before leads to."""

    t: Array
    x: Array
    u: Array
    cost: float  # J

    @property
    def duration(self) -> float:
        return float(self.t[-1])


class Optimiser(Protocol):
    """Optimises the flight from a state to a terminal condition, again and again."""

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        """The flight from the state ``start`` (nx,) at t [s], or the reason why there is none."""
        ...


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
    """An ``Optimiser``: starts from its last solution, and from first guesses where there is none or it fails."""

    def __init__(
        self,
        case: Case,
        body: Body,
        coordinates: Coordinates,
        limits: tuple[float, ...],
        nodes: int,
        backend: Backend,
        distribution: NodeDistribution,
    ) -> None:
        problem, self._weights = guidance_problem(body, coordinates, limits), weights(case)
        self._shooting = Shooting(problem, nodes, backend, distribution)
        self._coordinates, self._body, self._nodes = coordinates, body, np.linspace(0.0, 1.0, nodes)
        self._last: tuple[float, Solved] | None = None  # when it starts [s], and it

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        parameters = np.concatenate([self._weights, terminal.parameters(start, self._coordinates)])
        failed = Failed("nothing was tried", infeasible=False)
        if (reason := out_of_bounds(start, self._coordinates)) is not None:
            return Failed(reason, infeasible=True)
        for guess, first in self._guesses(t, start, terminal):
            solved = self._shooting.solve(guess, parameters, first=first)
            if isinstance(solved, Solved):
                self._last = t, solved
                x = flown(start, solved.times, solved.u, self._coordinates, self._body)
                return MissileTrajectory(solved.times, x, solved.u, solved.cost)
            failed = solved
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
