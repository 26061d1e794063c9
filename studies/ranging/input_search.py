"""Least time in which any inputs can find the pose: an exhaustive search over sequences of inputs, with known pose.

With known poses x_j at nodes j, h apart, the covariance after the readings, from P at the start, is

    F_j (P^-1 + sum_{i <= j} F_i' H_i' (h / dt) R_i^-1 H_i F_i)^-1 F_j',     F_j = d x_j / d x_0,   H_j = d rho / d x,

which is the posterior Cramér-Rao bound with exact odometry, and below the bound with any other. The pose counts as
found as soon as the bound's root mean square position error is below a limit. A robot rests if an input would bring it
nearer to the wall than the margin.

The search is depth first over all sequences of inputs, each held for a fixed number of nodes and the last until the
end; it leaves a branch as soon as that takes as long as the best sequence so far.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief
from mathnavi.controllers.active_sensing.candidate_search import candidates
from mathnavi.controllers.active_sensing.kernels import RangeSensors, WallTable, clearance, inverse
from mathnavi.controllers.active_sensing.plugin import ActiveSensing, ModeName, exploration_policy
from mathnavi.controllers.active_sensing.policies import ExplorationPolicy
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import cast_ray, range_gradient
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, mounted
from mathnavi.models.unicycle.mission import LEAST_NOISE, RangingMission
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig, WallFields

WALL = WallFields().curve()
SLOW = 0.15  # [rad/s] bound of the turn rate
START_ERROR = (0.3, 0.3, math.degrees(0.3))  # [m, m, deg] of what is known of the start
NODE = 0.02  # [s] h
SEARCHED: tuple[ModeName, ...] = ("active", "random")  # modes that the best sequence is compared with


class KnownPoseProblem(NamedTuple):
    """Data that the bound depends on, and the error below which the pose counts as found."""

    wall: WallTable
    sensors: RangeSensors
    readings: float  # h / dt, of each sensor between two nodes
    margin: float  # [m] that the robot keeps from the wall
    limit: float  # [m] of the root mean square position error
    most: int  # nodes of the longest run


@dataclass(frozen=True)
class InputSearch:
    """A search from the start of a seed, at the low turn rate."""

    seed: int
    start: tuple[float, float, float]  # X Y HEADING [m, m, deg]
    limit: float  # [m]
    seconds: float
    depth: int  # inputs of a sequence


def soonest(search: InputSearch) -> dict[str, float]:
    """A job: time [s] until the pose is found by the best sequence, and by each exploration policy."""
    fields = RangeLocalisationConfig()
    mission = RangingMission(
        WALL, tuple(map(math.radians, fields.sensors)), fields.noise.ranging(), turn_rate_max=SLOW,
        speed_max=fields.speed_max, margin=fields.margin,
    )  # fmt: skip
    x_1, x_2, heading = search.start
    pose = np.array([x_1, x_2, math.radians(heading)])
    P = np.diag(np.square([*START_ERROR[:2], math.radians(START_ERROR[2])]))
    problem = known_pose_problem(mission, search.limit, search.seconds)
    piece = round(ActiveSensing.Config().period / NODE)
    nodes = {"best": soonest_nodes(problem, pose, P, candidates(mission), piece, search.depth)}
    for mode in SEARCHED:
        policy = exploration_policy(ActiveSensing.Config(mode=mode, seed=1 + search.seed), mission)
        nodes[mode] = policy_nodes(policy, problem, pose, P, piece)
    return {name: NODE * count for name, count in nodes.items()}


def known_pose_problem(mission: RangingMission, limit: float, seconds: float) -> KnownPoseProblem:
    """Return the problem of a mission: a pose counts as found below ``limit`` [m]; runs end after ``seconds`` [s]."""
    noise = np.array([mission.ranging.relative, np.hypot(mission.ranging.absolute, LEAST_NOISE)])
    return KnownPoseProblem(
        WallTable(mission.curve.table, mission.curve.polyline),
        RangeSensors(mission.rays, noise),
        NODE / mission.period * (1.0 - mission.ranging.dropout),
        mission.margin,
        limit,
        round(seconds / NODE),
    )


def policy_nodes(policy: ExplorationPolicy, problem: KnownPoseProblem, pose: Array, P: Array, piece: int) -> int:
    """Return the number of nodes until a policy has found the pose (3,) from P (3, 3), choosing every ``piece`` nodes.

    Its belief is the true pose and the bound.
    """
    x, F, information = pose, np.eye(3), inverse(P)
    for j in range(problem.most):
        if j % piece == 0:
            chosen = policy.choose(j * NODE, Belief(x, F @ inverse(information) @ F.T))
            held = round(float(chosen.duration[0]) / NODE)
        u = chosen.u[0] if j % piece < held else np.zeros(2)
        x, F, information, error = advance(problem, x, F, information, u)
        if error < problem.limit:
            return j + 1
    return problem.most


@njit(cache=True, nogil=True)
def advance(problem: Any, pose: Array, F: Array, information: Array, u: Array) -> tuple[Array, Array, Array, float]:
    """Return pose (3,), F (3, 3) and information (3, 3) a node later under u (2,), and the position error [m] there."""
    coefficients, polyline = problem.wall
    rays, noise = problem.sensors
    after = integrate(pose, u[0], u[1], NODE)
    if clearance(problem.wall, after[0], after[1]) < problem.margin:
        after = pose
    else:
        step, _ = integrate_jacobians(pose, u[0], u[1], NODE)
        F = step @ F
    information = information.copy()
    for i in range(len(rays)):
        beta, (m_1, m_2) = after[2] + rays[i, 0], mounted(rays[i], after[2])
        rho, s = cast_ray(coefficients, polyline, after[0] + m_1, after[1] + m_2, beta)
        h_1, h_2, h_3 = range_gradient(coefficients, s, rho, beta)
        h_3 += h_2 * m_1 - h_1 * m_2
        if math.isfinite(h_1 + h_2 + h_3):
            row = h_1 * F[0] + h_2 * F[1] + h_3 * F[2]
            information += (problem.readings / ((noise[0] * rho) ** 2 + noise[1] ** 2)) * np.outer(row, row)
    left = F @ inverse(information) @ F.T
    return after, F, information, math.sqrt(left[0, 0] + left[1, 1])


@njit(cache=True, nogil=True)
def soonest_nodes(problem: Any, pose: Array, P: Array, inputs: Array, piece: int, depth: int) -> int:
    """Return the number of nodes until the best sequence of ``depth`` inputs has found the pose (3,) from P (3, 3).

    Each of the ``inputs`` (m, 2) is held for ``piece`` nodes, the last until the end; ``problem.most`` if none finds
    the pose.
    """
    best: int = problem.most
    level = 0
    chosen = np.zeros(depth, np.int64)
    poses, slopes, informations = np.empty((depth, 3)), np.empty((depth, 3, 3)), np.empty((depth, 3, 3))
    poses[0], slopes[0], informations[0] = pose, np.eye(3), inverse(P)
    while level >= 0:
        if chosen[level] == len(inputs):
            level -= 1
            if level >= 0:
                chosen[level] += 1
            continue
        u, last, before = inputs[chosen[level]], level == depth - 1, level * piece
        x, F, information = poses[level], slopes[level], informations[level]
        goes_on = True
        for j in range(before + 1, problem.most if last else before + piece + 1):
            if j >= best:
                goes_on = False
                break
            x, F, information, error = advance(problem, x, F, information, u)
            if error < problem.limit:
                best, goes_on = j, False
                break
        if last or not goes_on:
            chosen[level] += 1
        else:
            level += 1
            chosen[level] = 0
            poses[level], slopes[level], informations[level] = x, F, information
    return best
