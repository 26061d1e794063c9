"""The flight as one problem: in the pitch plane, or in space with all states at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from mathnavi.controllers.missile.aim import TerminalCondition
from mathnavi.controllers.missile.guess import TANGENTS, pitch_guess, yaw_guess
from mathnavi.controllers.missile.planes import inputs_between, split, together
from mathnavi.controllers.missile.problem import guidance_problem, out_of_bounds, weights
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved
from mathnavi.controllers.missile.trajectory import Trajectory, flown
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.models.missile.coordinates import PLANAR, Coordinates
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import Case
from mathnavi.sim.interfaces.signals import Array


class WholeFlight:
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

    def optimise(self, t: float, start: Array, aim: TerminalCondition) -> Trajectory | Failed:
        parameters = np.concatenate([self._weights, aim.parameters(start, self._coordinates)])
        failed = Failed("nothing was tried", infeasible=False)
        if (reason := out_of_bounds(start, self._coordinates)) is not None:
            return Failed(reason, infeasible=True)
        for guess, first in self._guesses(t, start, aim):
            solved = self._shooting.solve(guess, parameters, first=first)
            if isinstance(solved, Solved):
                self._last = t, solved
                x = flown(start, solved.times, solved.u, self._coordinates, self._body)
                return Trajectory(solved.times, x, solved.u, solved.cost)
            failed = solved
        return failed

    def _guesses(self, t: float, start: Array, aim: TerminalCondition) -> Iterator[tuple[Solved, bool]]:
        if self._last is not None and t - self._last[0] < self._last[1].duration:
            yield self._last[1].after(t - self._last[0]), False
        for tangent in TANGENTS if self._last is None else TANGENTS[:1]:
            if self._coordinates is PLANAR:
                yield pitch_guess(start, aim, self._body, self._nodes, tangent), True
                continue
            in_pitch, in_yaw = split(start)
            pitch = pitch_guess(in_pitch, aim, self._body, self._nodes, tangent)
            yaw = yaw_guess(in_yaw, aim, self._body, pitch)
            _, u = inputs_between(pitch, yaw, 1, self._body)
            yield dataclasses.replace(pitch, x=together(pitch.x, yaw.x), u=u), True
