"""Runs with the noise that is declared, over which every estimator that fits answers, and their bounds.

Each system moves under inputs that do not depend on any estimate, with process noise and readings drawn from the very
model that is declared to the estimators, so that an error above the bound is the estimator's own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.missile import MissileModel
from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.estimators.stagewise.smoother import square_root
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.field.curve import ellipse
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, Target
from mathnavi.models.missile.sensors import StateNoise
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.interfaces.signals import Array, Measurement, Status
from mathnavi.sim.metrics.flight_bound import flight_bound
from mathnavi.sim.metrics.lagrangian_bound import lagrangian_bound
from mathnavi.sim.metrics.missile_bound import missile_bound
from mathnavi.sim.metrics.posterior_bound import PosteriorBound
from mathnavi.sim.metrics.ranging_bound import ranging_bound
from mathnavi.sim.metrics.tuning import RecordedCall
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.encoding import MeasuredTime

PIECES = 50
"""of a run, over each of which errors are averaged for the figure"""
_NAME = "it"
Difference = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class BoundRun:
    """A run of a scenario."""

    scenario: str
    seed: int
    seconds: float


@dataclass(frozen=True)
class BoundErrors:
    """An estimator over the second half of a run and, piece by piece, all of it, in the components that are judged."""

    scenario: str
    estimator: str
    squares: float  # sum of squared errors
    bounds: float  # sum of the bounds on them
    ok: float  # share of the estimates with the status OK
    cost: MeasuredTime  # [us] CPU time of an update, the median
    t: tuple[float, ...]  # [s] middles of the pieces
    course: tuple[float, ...]  # mean of the squared error over each
    least: tuple[float, ...]  # and of the bound on it, NaN where there is none


@dataclass(frozen=True, eq=False)
class _Recorded:
    mission: Any
    calls: Sequence[RecordedCall]
    bound: PosteriorBound
    difference: Difference  # (estimate, truth) -> the judged components of the error


def compared(run: BoundRun) -> list[BoundErrors]:
    """Errors of each estimator that fits over one run."""
    record, estimators, _ = SCENARIOS[run.scenario]
    rng = np.random.default_rng(run.seed)
    recorded = record(rng, run.seconds)
    late = slice(len(recorded.calls) // 2, None)
    squared_bounds = np.square(recorded.bound.deviation[:, list(recorded.bound.judged)]).sum(axis=1)
    bounds = float(squared_bounds[late].sum())
    pieces = np.array_split(np.arange(len(recorded.calls)), min(PIECES, len(recorded.calls)))
    t = tuple(float(np.mean([recorded.calls[k].t for k in piece])) for piece in pieces)
    least = tuple(float(squared_bounds[piece].mean()) for piece in pieces)
    found = []
    for name in estimators:
        called, fields = TUNED.get(name, (name, {}))
        plugin = load("estimators", called)
        estimator = plugin.build(plugin.Config(**fields), recorded.mission)
        errors, statuses, costs = [], [], []
        for call in recorded.calls:
            began = time.process_time()
            estimate = estimator.update(call.t, call.measurements, call.command)
            costs.append(1e6 * (time.process_time() - began))
            errors.append(recorded.difference(estimate.x, call.truth))
            statuses.append(estimate.status is Status.OK)
        each = np.square(errors).sum(axis=1)
        squares, course = float(each[late].sum()), tuple(float(each[piece].mean()) for piece in pieces)
        ok = float(np.mean(statuses[late]))
        cost = MeasuredTime(np.median(costs))
        found.append(BoundErrors(run.scenario, name, squares, bounds, ok, cost, t, course, least))
    return found


# ---- the scenarios


def _ranges(rng: np.random.Generator, seconds: float) -> _Recorded:
    """A figure of eight in an ellipse with three sensors; the start is known roughly."""
    pose, deviation = np.array([0.6, -0.3, 0.8]), np.array([0.1, 0.1, 0.1])
    known = pose + deviation * rng.standard_normal(3)
    quality, odometry = RangeQuality(0.02, 0.01), OdometryQuality((0.05, 0.05), 0.02)
    mission = RangingMission(
        ellipse(3.763, math.sqrt(2.0)), (0.0, 0.5 * math.pi, -1.7), quality, odometry,
        KnownStart((float(known[0]), float(known[1]), float(known[2])), (0.1, 0.1, 0.1)),
    )  # fmt: skip
    scale, h = odometry.bias * rng.standard_normal(), mission.period
    truths, readings, inputs = [], [], []
    for k in range(round(seconds / h) + 1):
        exact, _ = mission.curve.ranges(pose, mission.alpha)
        noise = rng.standard_normal((2, mission.sensors))
        read = exact * (1.0 + quality.relative * noise[0]) + quality.absolute * noise[1]
        truths.append(pose)
        readings.append([("ranges", read)])
        u = np.array(figure_eight((k + 0.5) * h, 0.5, 8.0))
        inputs.append(u)
        if k:
            driven = (1.0 + scale) * inputs[-2] + np.array(odometry.noise) * rng.standard_normal(2)
            readings[-1].append(("odometry", driven))
        pose = mission.flow(pose, u, h)
    recording, calls = _logged(h, truths, readings, inputs)
    return _Recorded(
        mission, calls, ranging_bound(recording, _NAME, mission), lambda x, truth: mission.difference(x, truth)[:2]
    )


def _flight(rng: np.random.Generator, seconds: float) -> _Recorded:
    """A point mass under gusts that sways, with ten fixes a second."""
    mission = FlightMission(
        HeightField(np.zeros((3, 3)), 5000.0), (4000.0, 4000.0, 900.0), (9000.0, 9000.0, 900.0), position_noise=3.0,
        gust=DeclaredGusts(0.5),
    )  # fmt: skip

    def read(x: Array, k: int) -> list[tuple[str, Array]]:
        return [("position", x[:3] + mission.position_noise * rng.standard_normal(3))] if k % 6 == 0 else []

    def command(t: float) -> Array:
        return np.array([4.0 * math.cos(0.5 * t), 3.0 * math.sin(0.7 * t), math.cos(1.1 * t)])

    truths, readings, inputs = _simulated(
        FlightModel.as_declared(mission), rng, seconds, mission.control_period, command, read
    )
    recording, calls = _logged(mission.control_period, [x[:6] for x in truths], readings, inputs)
    bound = flight_bound(recording, _NAME, mission)
    return _Recorded(mission, calls, bound, lambda x, truth: x[:3] - truth[:3])


def _missile(rng: np.random.Generator, seconds: float) -> _Recorded:
    """Nearly level flight in a plane under gusts, all of the state read."""
    start = np.zeros(PLANAR.state_size)
    start[PLANAR.index("u")], start[PLANAR.index("z_e")] = 120.0, -300.0
    mission = MissileMission(
        tuple(start), Target((700.0, 0.0, 0.0)), CASES["SM"], PLANAR,
        noise=StateNoise(position=2.0, velocity=1.0, angle=0.02, rate=0.02), gust=GustStrength(300.0, 20.0),
    )  # fmt: skip
    weight, deviations = mission.body.mass * mission.body.gravity, mission.noise.deviations(PLANAR)

    def command(t: float) -> Array:
        forces = (400.0 * math.cos(t), -weight + 300.0 * math.sin(2.0 * t), 20.0 * math.cos(1.5 * t))
        return np.array(forces)

    def read(x: Array, k: int) -> list[tuple[str, Array]]:
        return [("full_state", x[: len(start)] + deviations * rng.standard_normal(len(start)))]

    truths, readings, inputs = _simulated(
        MissileModel.as_declared(mission), rng, seconds, mission.control_period, command, read
    )
    states = [x[: len(start)] for x in truths]
    recording, calls = _logged(mission.control_period, states, readings, inputs)
    recording.truths[_NAME] = PLANAR.to_joints(np.array(states))
    bound = missile_bound(recording, _NAME, mission)
    judged = list(bound.judged)
    return _Recorded(mission, calls, bound, lambda x, truth: x[judged] - truth[judged])


def _mechanism(rng: np.random.Generator, seconds: float) -> _Recorded:
    """An arm with two joints under torques, its angles read with noise; nothing disturbs it."""
    system = MechanismSystem(build_model("two-link", name="arm"))
    mission = LagrangianMission(system, PositionQuality(1e-3), 5e-3, speed_max=30.0)
    n, x = system.manifold.size, mission.start_state
    truths, readings, inputs = [], [], []
    for k in range(round(seconds / mission.period) + 1):
        t = k * mission.period
        truths.append(x)
        readings.append([("position", x[:n] + mission.reading.noise * rng.standard_normal(n))])
        inputs.append(np.array([math.sin(3.0 * t), 0.5 * math.cos(2.0 * t)]))
        x = mission.flow(x, inputs[-1], mission.period)
    recording, calls = _logged(mission.period, truths, readings, inputs)
    bound = lagrangian_bound(recording, _NAME, mission)
    return _Recorded(mission, calls, bound, lambda x, truth: x[n:] - truth[n:])


DECLARED = "missile_kalman, declared"
TUNED: dict[str, tuple[str, dict[str, float]]] = {
    DECLARED: (
        "missile_kalman",
        {
            **{"force_std": 1e-3, "moment_std": 1e-3, "time_constant": 1.0},
            **{"start_position_std": 1e-3, "start_velocity_std": 1e-3, "start_angle_std": 1e-5, "start_rate_std": 1e-5},
        },
    )
}
"""estimators with other fields than the standard ones, by the name that they have here"""

SLOW_ERRORS = {"missile": 4}
"""times as many runs of a scenario whose errors change so slowly that a run is little more than one sample of them"""

Readings = list[list[tuple[str, Array]]]

SCENARIOS: dict[str, tuple[Callable[[np.random.Generator, float], _Recorded], tuple[str, ...], float]] = {
    "ranges": (_ranges, ("feasible_set_bank", "range_ekf", "range_ukf", "range_particle", "moving_horizon"), 6.0),
    "flight": (_flight, ("kalman", "moving_horizon"), 20.0),
    "missile": (_missile, ("missile_kalman", DECLARED, "moving_horizon"), 4.0),
    "mechanism": (
        _mechanism,
        ("riemannian_observer", "lagrangian_ekf", "lagrangian_ukf", "high_gain", "filtered_differences",
         "moving_horizon"),
        2.0,
    ),
}  # fmt: skip
"""by name: the run, the estimators, and how long it is [s]"""


def _simulated(
    model: StagewiseModel,
    rng: np.random.Generator,
    seconds: float,
    h: float,
    command: Callable[[float], Array],
    read: Callable[[Array, int], list[tuple[str, Array]]],
) -> tuple[list[Array], Readings, list[Array]]:
    """States, readings and inputs of a model with its start and its process noise drawn."""
    started = model.start(None)
    assert started is not None
    x = started[0] + square_root(started[1]) @ rng.standard_normal(model.size)
    truths: list[Array] = []
    readings: Readings = []
    inputs: list[Array] = []
    for k in range(round(seconds / h) + 1):
        truths.append(x)
        readings.append(read(x, k))
        inputs.append(command(k * h))
        after, _, Q = model.transition(x, inputs[-1], h)
        x = after + square_root(Q) @ rng.standard_normal(model.size)
    return truths, readings, inputs


def _logged(
    h: float, truths: Sequence[Array], readings: Readings, inputs: Sequence[Array]
) -> tuple[Recording, list[RecordedCall]]:
    """The run as the bounds take it, and as the calls of an estimator."""
    n = len(truths)
    kept: dict[str, Array] = {}
    calls = []
    for k, read in enumerate(readings):
        for name, value in read:
            kept.setdefault(name, np.full((n, len(value)), np.nan))[k] = value
        measurements = tuple(Measurement(name, k * h, value) for name, value in read)
        command = inputs[k - 1] if k else np.zeros_like(inputs[0])
        calls.append(RecordedCall(k * h, measurements, command, truths[k]))
    agent = AgentRecorder(_NAME, [], np.array(inputs), kept)
    t: Array = h * np.arange(n, dtype=np.float64)
    return Recording(t, {_NAME: np.array(truths)}, {_NAME: agent}, [], {_NAME: ()}, n), calls
