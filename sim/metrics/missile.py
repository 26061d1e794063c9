"""Figures of a missile's flight, from its log and the truth.

The posterior Cramér-Rao bound of a missile, as recorded.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import MissileMission, TargetMotion
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.convergence import last_quarter
from mathnavi.sim.metrics.planning import FAILURES, planner_share, solve_times
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, bound_along, estimates_at, judged_bound


def missile_bound(recording: Recording, name: str, mission: MissileMission) -> PosteriorBound:
    """Bound of the thesis' state (nx,) under the declared gusts, judged by the position.

    The gusts that acted are not recorded: the Jacobians are those without gusts.
    """
    n, readings = recording.length, recording.agents[name].readings.get("full_state")
    coordinates = mission.coordinates
    if readings is None:
        return PosteriorBound.none("the estimator does not read the state", n)
    if not (mission.noise.deviations(coordinates) > 0.0).all():
        return PosteriorBound.none("some part of the state is declared to be read exactly", n)
    if not mission.gust.force > 0.0 and not mission.gust.moment > 0.0:
        return PosteriorBound.none("the start is exact, no gusts are declared, and so the bound is zero", n)
    from mathnavi.estimators.stagewise.missile import MissileModel  # CasADi takes a while to import

    model = MissileModel.as_declared(mission)
    x = np.column_stack([coordinates.from_joints(recording.truths[name]), np.zeros((n, coordinates.input_size))])
    commands, t = recording.agents[name].commands, recording.t
    inputs = [model.inputs(float(t[k]), float(t[k + 1]), (), commands[k]) for k in range(n - 1)]
    weighted = [_of_state(model, *row) for row in zip(x, readings[:n], strict=True)]
    start = model.start(None)
    assert start is not None
    deviation = bound_along(model, x, inputs, weighted, BoundRecursion(covariance=start[1]))
    judged = tuple(k for k, state in enumerate(coordinates.states) if state in ("x_e", "y_e", "z_e"))
    return judged_bound(deviation[:, : coordinates.state_size], judged, "the position")


def _of_state(model: StagewiseModel, x: Array, y: Array) -> Array:
    r, W = model.residual(x, y)
    return W[np.isfinite(r)]


_ROUND_OFF = 1e-9  # relative excess of an input that does not count


@dataclass(frozen=True, eq=False)
class Approach:
    """Moment at which a missile was nearest to its target."""

    t: float  # [s]
    miss: float  # [m]
    x: Array  # (nx,) the thesis' state


def closest_approach(t: Array, joints: Array, coordinates: Coordinates, target: TargetMotion) -> Approach:
    """Closest approach of a flight sampled at t (n,) [s], with joints (n, nx), to the true position of the target.

    Between two samples the path is the cubic through both positions and velocities. Inputs are held in between, so at
    250 samples a second it is within 1e-9 m of the true path, or 1e-4 m where late thrusters change in between.
    """
    distance = np.linalg.norm(coordinates.place(coordinates.from_joints(joints)) - target.at(t), axis=1)
    k = int(np.argmin(distance))

    best = Approach(float(t[k]), float(distance[k]), coordinates.from_joints(joints[k]))
    for begin in range(max(k - 1, 0), min(k + 1, len(t) - 1)):

        def after(s: float, begin: int = begin) -> Approach:
            at = float(t[begin]) + s
            x = coordinates.from_joints(_between(t, joints, begin, s))
            return Approach(at, float(np.linalg.norm(coordinates.place(x) - target.at(at))), x)

        h = float(t[begin + 1] - t[begin])
        found = minimize_scalar(lambda s: after(s).miss, bounds=(0.0, h), method="bounded", options={"xatol": 1e-10})
        best = min(best, after(float(found.x)), key=lambda approach: approach.miss)
    return best


def _between(t: Array, joints: Array, k: int, after: float) -> Array:
    """Joint coordinates and rates (nx,) ``after`` [s] from sample k, before the next, by Hermite's cubic."""
    h, half = t[k + 1] - t[k], joints.shape[1] // 2
    s = after / h
    (q0, v0), (q1, v1) = ((joints[i, :half], joints[i, half:]) for i in (k, k + 1))
    q = q0 + s * h * v0 + s**2 * (3.0 * (q1 - q0) - h * (2.0 * v0 + v1)) + s**3 * (2.0 * (q0 - q1) + h * (v0 + v1))
    v = v0 + 2.0 * s / h * (3.0 * (q1 - q0) - h * (2.0 * v0 + v1)) + 3.0 * s**2 / h * (2.0 * (q0 - q1) + h * (v0 + v1))
    return np.concatenate([q, v])


def references(t: Array, plans: Sequence[tuple[float, Plan]], coordinates: Coordinates, body: Body) -> Array:
    """Reference states (n, nx) of the tracker at times t (n,) [s], from ``plans`` (adopted at [s], plan).

    NaN before the first plan.
    """
    out = np.full((len(t), coordinates.state_size), np.nan)
    ends = [*(start for start, _ in plans), math.inf][1:]  # none without a plan
    for (adopted, plan), following in zip(plans, ends, strict=True):
        flown = (t >= adopted - TIME_TOLERANCE) & (t < following - TIME_TOLERANCE)
        out[flown] = coordinates.state_at(plan, t[flown], body)
    return out


def attack_angles(x: Array, coordinates: Coordinates) -> Array:
    """Angles (n,) [rad] between the nose and the velocity at states (n, nx)."""
    velocity = coordinates.in_space(x)[..., :3]  # along the axes of the body
    angles: Array = np.arctan2(np.hypot(velocity[..., 1], velocity[..., 2]), velocity[..., 0])
    return angles


def cost(t: Array, x: Array, u: Array, mission: MissileMission, until: float) -> float:
    """Cost J [s] of the mission along states (n, nx), inputs (n, nu) held between samples, up to ``until`` [s]."""
    case, coordinates, body = mission.case, mission.coordinates, mission.body
    begin = case.running_cost(coordinates, x[:-1], u[:-1], body)
    end = case.running_cost(coordinates, x[1:], u[:-1], body)
    dt = np.clip(until - t[:-1], 0.0, np.diff(t))
    return float((0.5 * (begin + end) * dt).sum())


def missile_summary(
    recording: Recording,
    name: str,
    mission: MissileMission,
    target: TargetMotion,
    planned_time: float,
    planned_cost: float,
    seed: int,
    wall_seconds: float,
) -> dict[str, Any]:
    """Flat summary of one missile's flight, with SI units in the names, angles in degrees.

    ``aspect_error_deg`` is the angle between the nose and the required direction, ``path_angle_error_deg`` that between
    the velocity and this direction, both where the missile is nearest to the target.
    """
    t, joints, agent = recording.t, recording.truths[name], recording.agents[name]
    coordinates = mission.coordinates
    x = coordinates.from_joints(joints)
    kinds = Counter(event.kind for event in recording.events if event.agent == name)
    end = closest_approach(t, joints, coordinates, target)
    command = agent.commands[: recording.length]
    limits = np.array(mission.input_max)
    applied = np.clip(command, -limits, limits)
    saturated = (np.abs(command[:-1]) / limits).max(axis=1) > 1.0 + _ROUND_OFF
    flown = np.flatnonzero(t <= end.t)
    error = coordinates.place(x) - coordinates.place(references(t, agent.plans, coordinates, mission.body))
    velocity = coordinates.velocity(end.x)
    bound = missile_bound(recording, name, mission)
    recording.cramer_rao[name] = bound.deviation
    estimated = estimates_at(recording, name, coordinates.state_size) - x
    return {
        "miss_m": end.miss,
        "aspect_error_deg": _degrees_between(coordinates.nose(end.x), mission.final_direction),
        "path_angle_error_deg": _degrees_between(velocity, mission.final_direction),
        "impact_speed_m_s": float(np.linalg.norm(velocity)),
        "impact_time_s": end.t,
        "planned_time_s": planned_time,
        "flight_time_s": float(t[-1]),
        "cost": cost(t, x, applied, mission, end.t),
        "planned_cost": planned_cost,
        **bound.figures(estimated[:, list(bound.judged)], last_quarter(t), "the last quarter"),
        "apex_m": float(joints[:, coordinates.joints.index("z")].max()),
        "attack_angle_max_deg": math.degrees(float(attack_angles(x[flown], coordinates).max())),
        "saturated_s": float(np.diff(t)[saturated].sum()),
        "tracking_error_max_m": float(np.nanmax(np.linalg.norm(error, axis=1)[flown], initial=0.0)),
        "inputs_clipped": kinds["input-clipped"],
        "replans": agent.requests,
        "plans_adopted": len(agent.plans),
        "planner_share": planner_share(float(t[0]), float(t[-1]), agent.plans),
        "late_plans": kinds["late"],
        "solver_failures": sum(kinds[kind] for kind in FAILURES),
        **solve_times(agent.solve_ms),
        "real_time_factor": float(t[-1]) / wall_seconds,
        "seed": seed,
    }


def _degrees_between(a: Array, b: Array) -> float:
    """Angle [deg] between two vectors (3,), by atan2, which is accurate for small angles."""
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))
