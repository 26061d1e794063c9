"""Flight in space by a pitch planner and a yaw planner in turn (block-coordinate descent), which the thesis names (B.4)
and does not do.

The motions of the two planes are independent (``planes``), the cost is not: a force along the missile is expensive, one
across it cheap, and how F_1 and F_2 fall on the two depends on psi. So both planners minimise the same J, in turn, each
with the other's last motion held:

    pitch   minimises J over (U, w, q, theta, x_e, z_e) and T; the yaw motion is held as a function of τ = t / T;
    yaw     minimises J over (V, r, psi, y_e); the pitch motion and T are held.

When T changes, the yaw motion shall keep its start and its end. With V_0 at the start and a target that moves at v_y,

    V = A(τ) + B(τ) / T,    F_2 / m = A'(τ) / T + B'(τ) / T^2,    A = V_0 (1 - 4 τ + 3 τ^2) + v_y (6 τ - 6 τ^2),

and the pitch planner holds B. The sweeps converge to near an optimum of the joint problem: but for the series' error,
for the terms of M and N other than I_y a cos psi and I_y b, and for the sweeps omitted once they gain little. Where
limits are active the method is neither optimal nor complete: a flight may exist that the sweeps do not find, and one
that needs more than the thrusters have is refused. The inputs of both are flown through the dynamics in space after
every sweep, and the terminal condition is shifted by the error for the next, so that the flight does not depend on the
decoupling.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.missile.optimiser import (
    ACCEPTED,
    TANGENTS,
    MissileTrajectory,
    flown,
    lowest_height,
    pitch_guess,
    yaw_guess,
)
from mathnavi.controllers.missile.planes import (
    Limits,
    fitted,
    inputs_between,
    lateral_baseline,
    pitch_problem,
    split,
    yaw_problem,
)
from mathnavi.controllers.missile.problem import (
    ALLOWANCE,
    TerminalCondition,
    ground_parameters,
    out_of_bounds,
    weights,
)
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import SPATIAL
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import Case

PART = 0.04
"""longest time [s] that a spatial input is held"""
FIRST_SWEEPS, SWEEPS = 10, 3
"""largest number of sweeps of a first flight, and of one that starts from the last"""
EXACT = 1e-3
"""terminal error [m] that needs no further sweep"""
ROUND_OFF = 1e-6
"""relative excess over a limit that is rounding"""
SETTLED = 1e-3
"""share of J that a sweep must gain to be followed by another"""


@dataclass(frozen=True, eq=False)
class _Iterate:
    """An iterate of the block-coordinate descent: the motions of both planes."""

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
        clearance: float,
    ) -> None:
        """Plans are within ``limits`` and keep ``clearance`` [m] over the ground.

        The inputs flown may come up to ``most``, the limits of the thrusters.
        """
        self._case, self._body, self._nodes = case, body, np.linspace(0.0, 1.0, nodes)
        self._weights, self._most = weights(case), np.array(most)
        self._pitch = Shooting(pitch_problem(body, limits), nodes, backend, distribution)
        self._yaw = Shooting(yaw_problem(body, limits), nodes, backend, steps=1)
        self._clearance = clearance
        self._last: tuple[float, _Iterate] | None = None  # when it starts [s], and it

    def optimise(self, t: float, start: Array, terminal: TerminalCondition) -> MissileTrajectory | Failed:
        if (reason := out_of_bounds(start, SPATIAL)) is not None:
            return Failed(reason, infeasible=True)
        found: MissileTrajectory | Failed = Failed("nothing was tried", infeasible=False)
        if self._last is not None and t - self._last[0] < self._last[1].pitch.duration:
            shift = t - self._last[0]
            shifted = _Iterate(self._last[1].pitch.after(shift), self._last[1].yaw.after(shift))
            found = self._alternate(t, start, terminal, shifted, first=False)
        in_pitch, in_yaw = split(start)
        for tangent in TANGENTS if self._last is None else TANGENTS[:1]:
            if isinstance(found, MissileTrajectory):
                break
            pitch = pitch_guess(in_pitch, terminal, self._body, self._nodes, tangent)
            guess = _Iterate(pitch, yaw_guess(in_yaw, terminal, self._body, pitch))
            found = self._alternate(t, start, terminal, guess, first=True)
        return found

    def _alternate(
        self, t: float, start: Array, terminal: TerminalCondition, now: _Iterate, *, first: bool
    ) -> MissileTrajectory | Failed:
        """Sweep until the flight is exact and, from a ``first`` guess, until a sweep gains nothing any more."""
        terminal = terminal.wound_to(float(now.pitch.x[-1, 3]))
        shifted_terminal, best, error, below = terminal, math.inf, math.inf, 0.0
        clearance = self._clearance
        found: MissileTrajectory | Failed = Failed("no turn was taken", infeasible=False)
        for _ in range(FIRST_SWEEPS if first else SWEEPS):
            after = self._sweep(start, shifted_terminal, now, clearance, first=first)
            if isinstance(after, Failed):  # the sweeps before may have led to a flight
                return found if error < ACCEPTED and below <= 0.0 else after
            now = after
            self._last = t, now
            found = self._joined(start, now)
            miss = terminal.error_of(found.x[-1], found.duration, SPATIAL)
            error = miss.norm
            below = -ALLOWANCE - lowest_height(found, SPATIAL, self._body)
            if error < EXACT and below <= 0.0 and not (first and found.cost < best * (1.0 - SETTLED)):
                break
            clearance += 2.0 * max(0.0, below)
            shifted_terminal, best = shifted_terminal.corrected_for(miss), found.cost
        if not error < ACCEPTED or isinstance(found, Failed):
            return Failed(f"pitch and yaw together miss by {error:.3g} m", infeasible=False)
        if below > 0.0:
            return Failed(f"pitch and yaw together pass {below:.3g} m below the ground", infeasible=False)
        share = np.abs(found.u).max(axis=0) / self._most
        if share.max() > 1.0 + ROUND_OFF:
            name = SPATIAL.inputs[int(share.argmax())]
            return Failed(f"pitch and yaw together need {share.max():.3g} times the limit of {name}", infeasible=False)
        return found

    def _sweep(
        self, start: Array, terminal: TerminalCondition, now: _Iterate, clearance: float, *, first: bool
    ) -> _Iterate | Failed:
        """Next iterate: the pitch planner's solution with the yaw motion held, and the yaw planner's with that."""
        in_pitch, in_yaw = split(start)
        V_0, v_y = float(in_yaw[0]), float(terminal.velocity[1])
        place, velocity = terminal.place, terminal.velocity
        end = [place[0], velocity[0], place[2], velocity[2], terminal.theta, terminal.w]
        held, ground = _held(now.yaw, V_0, v_y, self._body), ground_parameters(-float(start[9]), clearance)
        pitch = self._pitch.solve(
            now.pitch, np.concatenate([self._weights, held, [V_0, v_y], in_pitch, end, ground]), first=first
        )
        if isinstance(pitch, Failed):
            return Failed(f"pitch: {pitch.message}", infeasible=False)  # with the other plane's motion unchanged
        T, U = pitch.duration, pitch.x[:, 0]
        middle = 0.5 * (pitch.nodes[:-1] + pitch.nodes[1:])
        lateral = terminal.v * math.cos(terminal.psi) + U[-1] * math.sin(terminal.psi)
        known = [self._weights, [T], fitted(pitch.nodes, [U]), fitted(middle, [pitch.u[:, 0]]), in_yaw]
        guess = dataclasses.replace(now.yaw, nodes=pitch.nodes, duration=T)
        yaw = self._yaw.solve(
            guess, np.concatenate([*known, [lateral, terminal.psi, terminal.after(T)[1]]]), first=first
        )
        if isinstance(yaw, Failed):
            return Failed(f"yaw: {yaw.message}", infeasible=False)
        return _Iterate(pitch, yaw)

    def _joined(self, start: Array, motion: _Iterate) -> MissileTrajectory:
        """Both planes' inputs, flown in space; J by the trapezoidal rule."""
        longest = float(np.diff(motion.pitch.times).max())
        parts = max(1, math.ceil(longest / PART))
        times, u = inputs_between(motion.pitch, motion.yaw, parts, self._body)
        x = flown(start, times, u, SPATIAL, self._body)
        rates = 0.5 * sum(self._case.running_cost(SPATIAL, ends, u, self._body) for ends in (x[:-1], x[1:]))
        return MissileTrajectory(times, x, u, float(rates @ np.diff(times)))


def _held(yaw: Solved, V_0: float, v_y: float, body: Body) -> Array:
    """Coefficients of the series psi, B and B' of a yaw motion."""
    T, nodes = yaw.duration, yaw.nodes
    middle = 0.5 * (nodes[:-1] + nodes[1:])
    A, _ = lateral_baseline(nodes, V_0, v_y)
    _, A_rate = lateral_baseline(middle, V_0, v_y)
    B, B_rate = T * (yaw.x[:, 0] - A), T**2 * yaw.u[:, 0] / body.mass - T * A_rate
    return np.concatenate([fitted(nodes, [yaw.x[:, 2], B]), fitted(middle, [B_rate])])
