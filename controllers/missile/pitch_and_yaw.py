"""Flight in space by a pitch planner and a yaw planner together, which the thesis names (B.4) and does not do.

The motions of the two planes are independent (``planes``), the cost is not: a force along the missile is dear, one
across it cheap, and how F_1 and F_2 fall on the two depends on psi. So the planners take turns on one and the same J,
each with what the other found held still:

    pitch   minimises J over (U, w, q, theta, x_e, z_e) and T; the yaw motion is held as a function of τ = t / T;
    yaw     minimises J over (V, r, psi, y_e); the pitch motion and T are held.

When T changes, the yaw motion shall keep its start and its end. With V_0 at the start and a target that moves at v_y,

    V = A(τ) + B(τ) / T,    F_2 / m = A'(τ) / T + B'(τ) / T^2,    A = V_0 (1 - 4 τ + 3 τ^2) + v_y (6 τ - 6 τ^2),

and the pitch planner holds B. What the turns lead to is near an optimum of the whole problem: but for the series'
error, for what M and N have beside I_y a cos psi and I_y b, and for the turns not taken once they gain little. Where
limits are active it is neither optimal nor complete: a flight may exist that the turns do not find, and one that asks
for more than the thrusters have is refused. The inputs of both are flown through the dynamics in space after every
turn, and what misses the aim is aimed off in the next, so that the flight does not depend on the decoupling.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.missile.aim import TerminalCondition
from mathnavi.controllers.missile.guess import TANGENTS, pitch_guess, yaw_guess
from mathnavi.controllers.missile.plane_problems import Limits, lateral_baseline, pitch_problem, yaw_problem
from mathnavi.controllers.missile.planes import inputs_between, split
from mathnavi.controllers.missile.problem import out_of_bounds, weights
from mathnavi.controllers.missile.profile import fitted
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved
from mathnavi.controllers.missile.trajectory import Trajectory, flown
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.models.missile.coordinates import SPATIAL
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import Case
from mathnavi.sim.interfaces.signals import Array

PART = 0.04
"""[s] longest time that a spatial input is held"""
FIRST_TURNS, TURNS = 10, 3
"""most turns of a first flight, and of one that starts from the last"""
EXACT, ACCEPTED = 1e-3, 0.1
"""[m] of a miss that needs no further turn, and of one that is worth flying: the next plan makes it good"""
ROUND_OFF = 1e-6
"""relative excess over a limit that is none"""
SETTLED = 1e-3
"""share of J that a turn must gain to be followed by another"""


@dataclass(frozen=True, eq=False)
class _Turn:
    """Both planes' motion."""

    pitch: Solved
    yaw: Solved


class PitchAndYaw:
    """An ``Optimiser`` of flights in space; see the module docstring."""

    def __init__(
        self,
        case: Case,
        body: Body,
        limits: Limits,
        most: Limits,
        nodes: int,
        backend: Backend,
        distribution: NodeDistribution,
    ) -> None:
        """Plans within ``limits``; what M adds to the planes may come up to ``most``, what the thrusters have."""
        self._case, self._body, self._nodes = case, body, np.linspace(0.0, 1.0, nodes)
        self._weights, self._most = weights(case), np.array(most)
        self._pitch = Shooting(pitch_problem(body, limits), nodes, backend, distribution)
        self._yaw = Shooting(yaw_problem(body, limits), nodes, backend, steps=1)
        self._last: tuple[float, _Turn] | None = None  # when it starts [s], and it

    def optimise(self, t: float, start: Array, aim: TerminalCondition) -> Trajectory | Failed:
        if (reason := out_of_bounds(start, SPATIAL)) is not None:
            return Failed(reason, infeasible=True)
        found: Trajectory | Failed = Failed("nothing was tried", infeasible=False)
        if self._last is not None and t - self._last[0] < self._last[1].pitch.duration:
            shift = t - self._last[0]
            shifted = _Turn(self._last[1].pitch.after(shift), self._last[1].yaw.after(shift))
            found = self._alternated(t, start, aim, shifted, first=False)
        in_pitch, in_yaw = split(start)
        for tangent in TANGENTS if self._last is None else TANGENTS[:1]:
            if isinstance(found, Trajectory):
                break
            pitch = pitch_guess(in_pitch, aim, self._body, self._nodes, tangent)
            guess = _Turn(pitch, yaw_guess(in_yaw, aim, self._body, pitch))
            found = self._alternated(t, start, aim, guess, first=True)
        return found

    def _alternated(
        self, t: float, start: Array, aim: TerminalCondition, now: _Turn, *, first: bool
    ) -> Trajectory | Failed:
        """Turns until the flight is exact and, of a ``first`` guess, until they gain nothing any more."""
        aimed, best, off = aim, math.inf, math.inf
        found: Trajectory | Failed = Failed("no turn was taken", infeasible=False)
        for _ in range(FIRST_TURNS if first else TURNS):
            after = self._turn(start, aimed, now, first=first)
            if isinstance(after, Failed):  # what the turns before led to may be a flight as well
                return found if off < ACCEPTED else after
            now = after
            self._last = t, now
            found = self._together(start, now)
            miss = aim.missed_by(found.x[-1], found.duration, SPATIAL)
            off = miss.size
            if off < EXACT and not (first and found.cost < best * (1.0 - SETTLED)):
                break
            aimed, best = aimed.corrected_for(miss), found.cost
        if not off < ACCEPTED or isinstance(found, Failed):
            return Failed(f"pitch and yaw together miss by {off:.3g} m", infeasible=False)
        share = np.abs(found.u).max(axis=0) / self._most
        if share.max() > 1.0 + ROUND_OFF:
            name = SPATIAL.inputs[int(share.argmax())]
            return Failed(
                f"pitch and yaw together ask for {share.max():.3g} times the limit of {name}", infeasible=False
            )
        return found

    def _turn(self, start: Array, aim: TerminalCondition, now: _Turn, *, first: bool) -> _Turn | Failed:
        """The pitch planner's answer to a motion, and the yaw planner's to that."""
        in_pitch, in_yaw = split(start)
        V_0, v_y = float(in_yaw[0]), float(aim.velocity[1])
        end = [aim.place[0], aim.velocity[0], aim.place[2], aim.velocity[2], aim.theta, aim.w]
        held = _held(now.yaw, V_0, v_y, self._body)
        pitch = self._pitch.solve(
            now.pitch, np.concatenate([self._weights, held, [V_0, v_y], in_pitch, end]), first=first
        )
        if isinstance(pitch, Failed):
            return Failed(f"pitch: {pitch.message}", infeasible=False)  # with the other plane's motion as it is
        T, U = pitch.duration, pitch.x[:, 0]
        middle = 0.5 * (pitch.nodes[:-1] + pitch.nodes[1:])
        lateral = aim.v * math.cos(aim.psi) + U[-1] * math.sin(aim.psi)
        known = [self._weights, [T], fitted(pitch.nodes, [U]), fitted(middle, [pitch.u[:, 0]]), in_yaw]
        guess = dataclasses.replace(now.yaw, nodes=pitch.nodes, duration=T)
        yaw = self._yaw.solve(guess, np.concatenate([*known, [lateral, aim.psi, aim.after(T)[1]]]), first=first)
        if isinstance(yaw, Failed):
            return Failed(f"yaw: {yaw.message}", infeasible=False)
        return _Turn(pitch, yaw)

    def _together(self, start: Array, motion: _Turn) -> Trajectory:
        """Both planes' inputs, flown in space; J by the trapezoidal rule."""
        longest = float(np.diff(motion.pitch.times).max())
        parts = max(1, math.ceil(longest / PART))
        times, u = inputs_between(motion.pitch, motion.yaw, parts, self._body)
        x = flown(start, times, u, SPATIAL, self._body)
        rates = 0.5 * sum(self._case.running_cost(SPATIAL, ends, u, self._body) for ends in (x[:-1], x[1:]))
        return Trajectory(times, x, u, float(rates @ np.diff(times)))


def _held(yaw: Solved, V_0: float, v_y: float, body: Body) -> Array:
    """The series psi, B and B' of a yaw motion."""
    T, nodes = yaw.duration, yaw.nodes
    middle = 0.5 * (nodes[:-1] + nodes[1:])
    A, _ = lateral_baseline(nodes, V_0, v_y)
    _, A_rate = lateral_baseline(middle, V_0, v_y)
    B, B_rate = T * (yaw.x[:, 0] - A), T**2 * yaw.u[:, 0] / body.mass - T * A_rate
    return np.concatenate([fitted(nodes, [yaw.x[:, 2], B]), fitted(middle, [B_rate])])
