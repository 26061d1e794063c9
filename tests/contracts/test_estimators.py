"""The contract of every entry of ``mathnavi.estimators``, whoever wrote it.

An estimator is flown on every bench that fits the missions it is built for, by the type of ``build``'s argument
``mission``: a small simulated vehicle with the sensors that the estimator asks for. Those that declare what they are as
observers are held to Definition 2.1 of the thesis on a silent bench, one without noise whose start is known.
"""

from __future__ import annotations

import dataclasses
import math
import operator
import pickle
import re
import typing
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import entry_points
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.estimators.ranging.observer import FEED_FORWARDS, FeedForward, RangeObserver, RangeObserverConfig
from mathnavi.estimators.velocity.possible import impossible
from mathnavi.interfaces.innovations import INNOVATION_STD, INNOVATIONS
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Estimator, EstimatorPlugin, StateView
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.dynamics import TICK, flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.inertial_mission import InertialMission
from mathnavi.models.manifold.attitude import nearer
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.manifold.systems import PointSystem, RigidBody, linear
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.missile.coordinates import COORDINATES
from mathnavi.models.missile.dynamics import TICK as MISSILE_TICK
from mathnavi.models.missile.mission import CASES, MissileMission, StateNoise, Target
from mathnavi.models.quadrotor.dynamics import rigid_dynamics
from mathnavi.models.quadrotor.mission import InertialQuality, QuadrotorMission
from mathnavi.models.quaternion import rotation
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.unicycle.beacons import BeaconMission, BeaconQuality
from mathnavi.models.unicycle.mission import TICK as RANGING_TICK
from mathnavi.models.unicycle.mission import RangingMission, wheel_rates
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.engine.loop import whole_ticks
from tests.unicycle import STANDARD, Imagined

PLUGINS = {entry.name: entry for entry in entry_points(group="mathnavi.estimators")}


@dataclass(frozen=True)
class Truth:
    """A ``mathnavi.interfaces.protocols.StateView``. Whatever a sensor does to the state stays its own: all flights of
    a bench share one motion.
    """

    state: Array
    acceleration: Array

    @property
    def x(self) -> Array:
        return self.state.copy()

    def sensed(self, name: str) -> Array:
        raise ValueError(f"there is no sensor {name!r} here")


@dataclass(frozen=True, eq=False)
class Bench:
    """A mission with the vehicle that flies it; the state is led by what is estimated, (n,)."""

    mission: Any
    dt: float  # [s] tick
    start: Array  # (nx,) state
    input_at: Callable[[float], Array]  # t [s] -> u
    step: Callable[[Array, Array], Array]  # (x, u) -> x after a tick
    motion: Callable[[Array, Array], StateView]  # (x, u) -> what the sensors see
    tolerance: Array  # (n,) largest error of a converged estimate
    stays: Array  # (n,) largest error of one that stays on the truth, without noise
    duration: float  # [s] of a flight
    difference: Callable[[Array, Array], Array] = operator.sub  # (estimate, truth) -> (n,)
    read: Any = None  # mission of what the sensors read, where that is more than an estimator is given

    @property
    def size(self) -> int:
        """n."""
        return len(self.tolerance)

    def error(self, estimate: Estimate, step: Step) -> Array:
        """(n,) magnitudes."""
        return np.abs(self.difference(estimate.x, step.truth[: self.size]))


def flight_bench(silent: bool = False) -> Bench:
    """A slalom of the aerial vehicle in still air, with position readings off by 2 m."""
    terrain = HeightField(np.zeros((3, 3)), 5000.0)
    noise = 0.0 if silent else 2.0
    mission = FlightMission(
        terrain, (4000.0, 4000.0, 900.0), (9000.0, 9000.0, 900.0), position_noise=noise, gust=DeclaredGusts(1.0)
    )
    return Bench(
        mission,
        TICK,
        np.array([*mission.start, 0.0, 0.0, 0.0]),
        lambda t: np.array([4.0 * math.cos(0.5 * t), 3.0 * math.sin(0.7 * t), math.cos(1.1 * t)]),
        lambda x, u: flow(x, u, TICK),
        Truth,
        np.array([10.0] * 3 + [6.0] * 3),
        np.array([0.01] * 3 + [0.05] * 3),
        10.0,
    )


def beacon_flight_bench(silent: bool = False) -> Bench:
    """The slalom among four beacons of which all is read; estimators that read fixes or the state do so here too."""
    bench = flight_bench(silent)
    places = ((2500.0, 2500.0, 300.0), (5500.0, 2800.0, 1500.0), (2600.0, 5600.0, 1000.0), (5400.0, 5500.0, 100.0))
    beacons = FlightBeacons(
        places, 0.0 if silent else 1.0, read=("ranges", "bearings", "range-differences"),
        bearing_noise=0.0 if silent else 0.002,
    )  # fmt: skip
    return dataclasses.replace(bench, mission=dataclasses.replace(bench.mission, beacons=beacons))


def missile_bench(name: str, silent: bool = False) -> Bench:
    """Nearly level flight of the missile, swaying, with all of its state read with noise."""
    coordinates = COORDINATES[name]
    start = np.zeros(coordinates.state_size)
    start[coordinates.index("u")], start[coordinates.index("z_e")] = 120.0, -300.0
    noise = StateNoise(position=0.5, velocity=0.2, angle=0.005, rate=0.005)
    read = StateNoise() if silent else noise
    mission = MissileMission(tuple(start), Target((700.0, 0.0, 0.0)), CASES["SM"], coordinates, noise=read)
    weight = mission.body.mass * mission.body.gravity
    swing = {
        "F_x": lambda t: 400.0 * math.cos(t),
        "F_y": lambda t: 200.0 * math.sin(1.3 * t),
        "F_z": lambda t: -weight + 300.0 * math.sin(2.0 * t),
        "M": lambda t: 20.0 * math.cos(1.5 * t),
        "N": lambda t: 15.0 * math.cos(1.1 * t),
    }
    return Bench(
        mission,
        MISSILE_TICK,
        start,
        lambda t: np.array([swing[each](t) for each in coordinates.inputs]),
        lambda x, u: coordinates.flow(x, u, MISSILE_TICK),
        lambda x, u: Truth(coordinates.to_joints(x), coordinates.joint_acceleration(x, u)),
        6.0 * noise.deviations(coordinates),
        0.1 * noise.deviations(coordinates),
        2.0,
    )


def ranging_bench(silent: bool = False) -> Bench:
    """A figure of eight in an ellipse, with four range sensors and odometry; the start is known, roughly with noise.

    The silent bench gives the start exactly and declares it uncertain: what stays on the truth does so all the same.
    The state is that of the ideal robot's joints: the pose and the two wheels.
    """
    start = np.array([0.6, -0.3, 0.8, 0.0, 0.0])
    start_error = (0.0, 0.0, 0.0) if silent else (0.08, -0.05, 0.06)
    mission = RangingMission(
        STANDARD,
        tuple(math.radians(angle) for angle in (0.0, 90.0, 180.0, 270.0)),
        RangeQuality() if silent else RangeQuality(0.02, dropout=0.05),
        OdometryQuality() if silent else OdometryQuality((0.05, 0.05), 0.02),
        KnownStart(tuple(start[:3] + start_error), (0.3,) * 3 if silent else (0.1,) * 3),
    )
    return Bench(
        mission,
        RANGING_TICK,
        start,
        lambda t: np.array(figure_eight(t + 0.5 * mission.period, 0.5, 8.0)),
        lambda x, u: np.concatenate([mission.flow(x[:3], u, RANGING_TICK), x[3:] + wheel_rates(u) * RANGING_TICK]),
        lambda x, u: Imagined(mission, x[:3], wheels=x[3:]),
        np.array([0.3, 0.3, 0.2]),
        np.array([1e-4, 1e-4, 1e-4]),
        3.0,
        mission.difference,
    )


def beacons_bench(silent: bool = False) -> Bench:
    """A figure of eight among four beacons whose ranges are read, from a start that is not known but on the silent
    bench.
    """
    start, period = np.array([0.6, -0.3, 0.8, 0.0, 0.0]), 0.05
    mission = BeaconMission(
        ((3.0, 2.0), (-3.0, 2.5), (-2.5, -3.0), (3.5, -2.0)),
        BeaconQuality() if silent else BeaconQuality(0.05, dropout=0.05),
        range_scale=0.0 if silent else 0.02,
        odometry=OdometryQuality() if silent else OdometryQuality((0.05, 0.05), 0.02),
        start=KnownStart(tuple(start[:3]), (0.3,) * 3) if silent else None,
        surroundings=2.0,
        period=period,
    )
    return Bench(
        mission,
        period,
        start,
        lambda t: np.array(figure_eight(t + 0.5 * period, 0.5, 8.0)),
        lambda x, u: np.concatenate([mission.flow(x[:3], u, period), x[3:] + wheel_rates(u) * period]),
        lambda x, u: Imagined(mission, x[:3], wheels=x[3:]),
        np.array([0.3, 0.3, 0.2]),
        np.array([1e-4, 1e-4, 1e-4]),
        12.0,
        mission.difference,
    )


def unknown_beacons_bench(silent: bool = False) -> Bench:
    """The bench of beacons with a start that is known, and two places that are not."""
    known = beacons_bench(silent)
    start = KnownStart(tuple(known.start[:3].tolist()), (0.3,) * 3 if silent else (0.05,) * 3)
    places = (*known.mission.beacons[:2], None, None)
    mission = dataclasses.replace(known.mission, start=start, beacons=places)
    return dataclasses.replace(known, mission=mission, read=known.mission)


@dataclass(frozen=True)
class Shown(Truth):
    """A motion that shows the output of a system."""

    y: Array

    def sensed(self, name: str) -> Array:
        return self.y.copy()


def textbook_bench(name: str, silent: bool = False) -> Bench:
    """A system of the textbook under its own input, with readings that are 0.005 off."""
    system = SYSTEMS[name]
    start_error = np.zeros(len(system.states)) if silent else np.array(system.start_error)
    start = np.array(system.start)
    mission = TextbookMission(
        system, tuple(start + start_error), tuple(np.maximum(np.abs(start_error), 1e-3)), noise=0.0 if silent else 0.005
    )
    return Bench(
        mission,
        mission.period,
        start,
        lambda t: np.array(system.constant) + np.array(system.amplitude) * math.sin(t + 0.5 * mission.period),
        lambda x, u: system.flow(x, u, mission.period),
        lambda x, u: Shown(x, np.zeros(0), system.output(x, u)),
        np.full(len(start), 0.25),
        np.full(len(start), 1e-5),
        6.0,
        system.difference,
    )


def quadrotor_bench(silent: bool = False) -> Bench:
    """Near hover, swaying, position readings off by .3 m; its state is (p, v, q, omega), the planner's first."""
    terrain = HeightField(np.zeros((3, 3)), 200.0)
    flight = FlightMission(
        terrain, (100.0, 100.0, 90.0), (300.0, 300.0, 90.0), position_noise=0.0 if silent else 0.3,
        control_period=2 * TICK,
    )  # fmt: skip
    inertial = InertialQuality(0.0, 0.0) if silent else InertialQuality()
    mission = QuadrotorMission(flight, inertial=inertial)
    ordered = [0, 1, 2, 7, 8, 9, 3, 4, 5, 6, 10, 11, 12]
    back = np.argsort(ordered)
    sway, phases = np.array([0.02, -0.02, -0.02, 0.02]), np.array([0.0, 0.0, 0.3, 0.3])

    def step(x: Array, u: Array) -> Array:
        return mission.flow(x[back], u, TICK)[ordered]

    def motion(x: Array, u: Array) -> Truth:
        return Truth(x[back], np.asarray(rigid_dynamics(mission.vehicle)(x[back], u))[7:, 0])

    return Bench(
        mission,
        TICK,
        mission.start_state[ordered],
        lambda t: mission.vehicle.hover_thrust + sway * np.cos(6.0 * t + phases),
        step,
        motion,
        np.array([1.0] * 3 + [0.5] * 3),
        np.array([1e-3] * 3 + [5e-3] * 3),
        2.0,
    )


LAGRANGIAN_PERIOD = 0.02  # [s] of the readings of both Lagrangian systems


def lagrangian_mission(system: LagrangianSystem, silent: bool) -> LagrangianMission:
    """Positions that are .001 off; on the silent bench they are read as they are, and the start at rest is known."""
    quality = PositionQuality() if silent else PositionQuality(0.001, dropout=0.05)
    return LagrangianMission(system, quality, LAGRANGIAN_PERIOD, speed_max=3.0)


def rigid_body_bench(silent: bool = False) -> Bench:
    """A body that tumbles under a torque, its attitude read as a quaternion: q and -q are the same."""
    body = RigidBody(0.05)
    rate = np.zeros(3) if silent else np.array([1.0, -2.0, 0.5])

    def difference(estimate: Array, truth: Array) -> Array:
        return np.concatenate([nearer(truth[:4], estimate[:4]) - truth[:4], estimate[4:] - truth[4:]])

    return Bench(
        lagrangian_mission(body, silent),
        LAGRANGIAN_PERIOD,
        np.concatenate([[1.0, 0.0, 0.0, 0.0], rate]),
        lambda t: 0.1 * np.array([math.sin(t), math.cos(1.3 * t), math.sin(0.7 * t)]),
        lambda x, u: finely(body, x, u),
        lambda x, u: Truth(x, body.force(x[:4], x[4:], u)),
        np.array([0.02] * 4 + [0.4] * 3),
        np.array([1e-4] * 4 + [1e-3] * 3),
        2.0,
        difference,
    )


def point_bench(manifold: ConstantCurvature, silent: bool = False) -> Bench:
    """A point that goes round in the bowl U = p_0, pushed about."""
    system, n = PointSystem(manifold, linear(1.0, 0)), manifold.size
    origin = np.eye(n)[0]
    start = manifold.exp(origin, 0.5 * np.eye(n)[1])
    v = manifold.tangent(start, (0.0 if silent else 0.8) * np.eye(n)[2])
    return Bench(
        lagrangian_mission(system, silent),
        LAGRANGIAN_PERIOD,
        system.state(start, v),
        lambda t: 0.4 * np.cos(2.0 * t + np.arange(n)),
        lambda x, u: system.reach(x, u, LAGRANGIAN_PERIOD)[0],
        lambda x, u: Truth(x, system.force(x[:n], x[n:], u)),
        np.array([0.02] * n + [0.4] * n),
        np.array([1e-4] * n + [1e-3] * n),
        2.0,
    )


def arm_bench(silent: bool = False) -> Bench:
    """Two hinges in a vertical plane, which hang and are driven to and fro.

    The mean of the sigma points is off by .2 rad/s, and differences of readings that are 1 mrad off by a radian
    per second.
    """
    system = MechanismSystem(build_spec("two-link").compile())
    rate = np.zeros(2) if silent else np.array([0.3, -0.3])
    return Bench(
        lagrangian_mission(system, silent),
        LAGRANGIAN_PERIOD,
        np.concatenate([[0.1, -0.1], rate]),
        lambda t: np.array([0.5 * math.sin(3.0 * t), 0.2 * math.cos(2.0 * t)]),
        lambda x, u: system.flow(x, u, LAGRANGIAN_PERIOD),
        lambda x, u: Truth(x, system.force(x[:2], x[2:], u)),
        np.array([0.05] * 2 + [1.5] * 2),
        np.array([1e-4] * 2 + [0.3] * 2),
        2.0,
    )


HULL = """<mujoco><option timestep=".005"/><worldbody><body name="hull"><freejoint/><geom type="box" size=".2 .1 .05"
mass="2"/><site name="lift"/><site name="imu" pos=".1 0 .02"/>
<body pos="0 0 -.1"><joint name="boom" axis="0 1 0"/><geom type="capsule"
size=".02" fromto="0 0 0 0 0 -.3" mass=".3"/></body></body></worldbody><actuator><motor site="lift" gear="0 0 1"/>
<motor joint="boom"/></actuator>
<sensor><gyro site="imu" noise="{gyro}"/><accelerometer site="imu" noise="{force}"/></sensor></mujoco>"""


def hull_bench(silent: bool = False) -> Bench:
    """A body with an IMU that is lifted, with a boom that is driven to and fro: its place is not read."""
    gyro, force = (0.0, 0.0) if silent else (0.002, 0.02)
    system = MechanismSystem(mujoco.MjModel.from_xml_string(HULL.format(gyro=gyro, force=force)))
    n, dt = system.manifold.size, 0.005
    rate = np.zeros(7) if silent else np.array([0.03, -0.02, 0.04, 0.01, -0.01, 0.01, 0.5])

    def step(x: Array, u: Array) -> Array:
        return system.flow(x, u, dt)

    return Bench(
        lagrangian_mission(system, silent),
        dt,
        np.concatenate([system.manifold.origin, rate]),
        lambda t: np.array([2.3 * 9.81, 0.02 * math.sin(3.0 * t)]),
        step,
        lambda x, u: Truth(x, (step(x, u) - x)[n:] / dt),
        np.array([0.5] * 3 + [0.05] * 4 + [0.05] + [0.4] * 3 + [0.05] * 3 + [1.5]),
        np.array([0.05] * 3 + [1e-3] * 4 + [1e-3] + [0.05] * 3 + [0.05] * 3 + [0.3]),
        1.2,
    )


def finely(system: LagrangianSystem, x: Array, u: Array) -> Array:
    """The state after a period, in ten steps."""
    for _ in range(10):
        x = system.flow(x, u, 0.1 * LAGRANGIAN_PERIOD)
    return x


def handheld_bench(silent: bool = False) -> Bench:
    """A device that is turned about all axes and moved to and fro; its state is its attitude, then what moves it.

    Only the vertical counts, in the axes of the device: the heading is not observed.
    """
    mission = InertialMission(InertialQuality(0.0, 0.0) if silent else InertialQuality(0.005, 0.05))
    phases, frequencies, reach = np.array([0.0, 1.0, 2.0]), np.array([5.0, 4.0, 6.0]), 0.1

    def rate(t: float) -> Array:
        turning: Array = np.array([1.5, 1.0, 0.8]) * np.sin(np.array([2.0, 1.3, 0.7]) * t + phases)
        return turning

    def step(x: Array, u: Array) -> Array:
        t, q = x[4] + mission.period, turned(x[:4], mission.period * rate(x[4] + 0.5 * mission.period))
        return np.array([*q, t])

    def motion(x: Array, u: Array) -> Truth:
        """The gyro's reading is the mean rate since the one before, as that of a real one is."""
        t = x[4]
        state = np.concatenate([np.zeros(3), x[:4], np.zeros(3), rate(t - 0.5 * mission.period)])
        return Truth(state, -reach * frequencies**2 * np.sin(frequencies * t + phases))

    def difference(estimate: Array, truth: Array) -> Array:
        up = rotation(estimate)[2] - rotation(truth[:4])[2]
        return np.array([*up, 0.0])

    return Bench(
        mission,
        mission.period,
        np.array([1.0, 0.0, 0.0, 0.0, 0.0]),
        lambda t: np.zeros(0),
        step,
        motion,
        np.full(4, 0.1),
        np.full(4, 1e-3),
        12.0,
        difference,
    )


BENCHES: dict[str, Callable[[bool], Bench]] = {
    "flight": flight_bench,
    "flight among beacons": beacon_flight_bench,
    "planar missile": partial(missile_bench, "planar"),
    "spatial missile": partial(missile_bench, "spatial"),
    "ranging": ranging_bench,
    "beacons": beacons_bench,
    "unknown beacons": unknown_beacons_bench,
    "handheld": handheld_bench,
    "quadrotor": quadrotor_bench,
    "rigid body": rigid_body_bench,
    "hyperbolic plane": partial(point_bench, hyperbolic_space(2)),
    "two-link arm": arm_bench,
    **{name: partial(textbook_bench, name) for name in SYSTEMS if name != "example-2-1"},  # which has no observer
}


ONLY: dict[str, Callable[[bool], Bench]] = {"hull": hull_bench}
"""benches for plug-ins that none of the others fits"""
EVERY = BENCHES | ONLY


@cache
def bench_of(name: str, silent: bool) -> Bench:
    """The bench that all tests share."""
    return EVERY[name](silent)


def benches_of(plugin: Any) -> list[str]:
    """The benches whose missions a plug-in is built for, but for systems that it refuses."""
    fitting = [name for name in BENCHES if fits(plugin, bench_of(name, False).mission)]
    return fitting or [name for name in ONLY if fits(plugin, bench_of(name, False).mission)]


def fits(plugin: Any, mission: Any) -> bool:
    kind = typing.get_type_hints(plugin.build).get("mission")
    # What is estimated of a quadrotor is its point mass, and attitude and rate beside it: an estimator of any whole
    # state says something else.
    others = not isinstance(mission, kind or object)
    if others or (isinstance(mission, QuadrotorMission) and kind is not QuadrotorMission):
        return False
    try:
        plugin.build(plugin.Config(), mission)
    except ValueError as error:
        return kind is not None and not re.match("(system|beacons) = .*; allowed", str(error))
    except Exception:  # without a type hint it fits what it is built for without an error
        if kind is None:
            return False
        raise
    return True


FLOWN = [(name, bench) for name in sorted(PLUGINS) for bench in benches_of(PLUGINS[name].load())]


@dataclass(frozen=True)
class Step:
    """One call of an estimator: what it is given, and what is true then."""

    t: float
    measurements: tuple[Measurement, ...]
    command: Array
    truth: Array


@pytest.fixture(scope="module", params=FLOWN, ids=" on ".join)
def flown(request: pytest.FixtureRequest) -> tuple[str, str]:
    """A plug-in and a bench that fits it, by name."""
    chosen: tuple[str, str] = request.param
    return chosen


@pytest.fixture
def plugin(flown: tuple[str, str]) -> type[EstimatorPlugin]:
    loaded: type[EstimatorPlugin] = PLUGINS[flown[0]].load()
    return loaded


@pytest.fixture
def bench(flown: tuple[str, str]) -> Bench:
    return bench_of(flown[1], False)


@pytest.fixture
def estimator(plugin: type[EstimatorPlugin], bench: Bench) -> Estimator:
    return plugin.build(plugin.Config(), bench.mission)


@pytest.fixture
def flight(flown: tuple[str, str]) -> list[Step]:
    return recorded(*flown).steps


@pytest.fixture
def estimates(flown: tuple[str, str]) -> Sequence[Estimate]:
    """Estimates of the plug-in on the flight, for the tests that only read them."""
    return recorded(*flown).estimates


@dataclass(frozen=True, eq=False)
class Record:
    """A flight, and what an estimator made of it."""

    steps: list[Step]
    handed_out: Sequence[Estimate]
    estimates: Sequence[Estimate]  # copies, each made as soon as it was handed out
    changed: Sequence[float]  # [s] times of the calls that changed what they were given


@cache
def recorded(name: str, bench: str) -> Record:
    """The flight shared by all tests of a plug-in on a bench."""
    plugin, built = PLUGINS[name].load(), bench_of(bench, False)
    estimator: Estimator = plugin.build(plugin.Config(), built.mission)
    steps = fly(plugin, bench, False, estimator)
    handed_out, estimates, changed = [], [], []
    for step in steps:
        given = [(step.command, step.command.copy()), *((m.value, m.value.copy()) for m in step.measurements)]
        estimate = estimator.update(step.t, step.measurements, step.command)
        handed_out.append(estimate)
        estimates.append(copied(estimate))
        if not all(np.array_equal(values, before, equal_nan=True) for values, before in given):
            changed.append(step.t)
    return Record(steps, handed_out, estimates, changed)


def copied(estimate: Estimate) -> Estimate:
    extra = {name: values.copy() for name, values in estimate.extra.items()}
    return dataclasses.replace(estimate, x=estimate.x.copy(), covariance=copy(estimate.covariance), extra=extra)


@cache
def motion_of(bench: str, silent: bool, every: int) -> list[tuple[Array, Array, StateView]]:
    """(x, u, what the sensors see) at every tick, each input held for so many ticks from its call on."""
    built = bench_of(bench, silent)
    x, u = built.start, np.zeros(len(built.input_at(0.0)))
    ticks = []
    for k in range(round(built.duration / built.dt) + 1):
        ticks.append((x, u, built.motion(x, u)))
        if k % every == 0:
            u = built.input_at(k * built.dt)
        x = built.step(x, u)
    return ticks


def fly(plugin: type[EstimatorPlugin], bench: str, silent: bool, estimator: Estimator) -> list[Step]:
    """The calls of a loop that flies the bench's inputs, each held from one call to the next."""
    built = bench_of(bench, silent)
    sensors = plugin.sensors(plugin.Config(), built.read or built.mission)
    every = whole_ticks(estimator.period, built.dt, "period")
    due = [whole_ticks(1.0 / s.rate, built.dt, s.name) if s.rate is not None else every for s in sensors]
    rng = np.random.default_rng(5)
    steps: list[Step] = []
    inbox: list[Measurement] = []
    for k, (x, u, truth) in enumerate(motion_of(bench, silent, every)):
        t = k * built.dt
        for sensor, ticks in zip(sensors, due, strict=True):
            value = sensor.read(truth, rng) if k % ticks == 0 else None
            if value is not None:
                inbox.append(Measurement(sensor.name, t, value))
        if k % every == 0:
            steps.append(Step(t, tuple(inbox), u.copy(), x))
            inbox = []
    return steps


@pytest.mark.parametrize(
    ("name", "bench"), [each for each in FLOWN if each[1] not in {"hyperbolic plane", *SYSTEMS}], ids=" on ".join
)
def test_it_can_be_pickled_and_goes_on_as_it_did(name: str, bench: str) -> None:
    """All but those of systems whose equations are functions within functions."""
    plugin, steps = PLUGINS[name].load(), recorded(name, bench).steps[:12]
    estimator = plugin.build(plugin.Config(), bench_of(bench, False).mission)
    for step in steps[:8]:
        estimator.update(step.t, step.measurements, step.command)
    again = pickle.loads(pickle.dumps(estimator))
    for step in steps[8:]:
        one, other = (each.update(step.t, step.measurements, step.command) for each in (estimator, again))
        np.testing.assert_array_equal(one.x, other.x)


def replay(estimator: Estimator, steps: Sequence[Step]) -> Iterator[tuple[Step, Estimate]]:
    for step in steps:
        yield step, estimator.update(step.t, step.measurements, step.command)


def test_there_are_estimators() -> None:
    assert {"full_state", "kalman", "missile_kalman", "quadrotor_state"} <= PLUGINS.keys()


def test_there_is_a_bench_for_each() -> None:
    assert set(PLUGINS) == {name for name, _ in FLOWN}, "this suite has no bench for the missions that one is built for"


def test_it_is_what_the_protocol_asks_for(plugin: type[EstimatorPlugin], bench: Bench, estimator: Estimator) -> None:
    """A frozen configuration with defaults, a period of whole ticks, and sensors with names of their own."""
    assert isinstance(estimator, Estimator)
    assert whole_ticks(estimator.period, bench.dt, "period") >= 1
    config = plugin.Config()
    assert dataclasses.is_dataclass(config)
    for field in dataclasses.fields(config):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(config, field.name, getattr(config, field.name))
    names = [sensor.name for sensor in plugin.sensors(config, bench.mission)]
    assert names
    assert len(set(names)) == len(names)


def test_an_estimate_is_finite_valid_at_its_time_and_of_the_right_shape(
    estimates: Sequence[Estimate], flight: list[Step], bench: Bench
) -> None:
    """What else it tells has the same names and shapes at every call; NaN stands for what there is not."""
    n = bench.size
    shapes = {name: values.shape for name, values in estimates[0].extra.items()}
    for step, estimate in zip(flight, estimates, strict=True):
        assert estimate.t == step.t
        assert estimate.x.shape == (n,)
        assert np.isfinite(estimate.x).all()
        assert isinstance(estimate.status, Status)
        if estimate.covariance is not None:
            assert estimate.covariance.shape == (n, n)
            assert np.isfinite(estimate.covariance).all()
        assert {name: values.shape for name, values in estimate.extra.items()} == shapes
        assert not any(np.isinf(values).any() for values in estimate.extra.values())


TRUTH = ("full_state", "quadrotor_state")
"""plug-ins that read the true state, which nothing is predicted for"""
ABSENT = ("filtered_differences",)
"""plug-ins without a model that predicts a reading"""


def innovations_of(estimates: Sequence[Estimate]) -> tuple[Array, Array]:
    """Published innovations (n, m) and their standard deviations (n, m)."""
    nu, deviation = (np.array([each.extra[name] for each in estimates]) for name in (INNOVATIONS, INNOVATION_STD))
    return nu, deviation


def test_it_publishes_innovations_with_their_standard_deviations_or_neither(
    flown: tuple[str, str], estimates: Sequence[Estimate], flight: list[Step]
) -> None:
    """Both arrays are of one shape and NaN alike; of readings that come with every second call or less often, NaN in
    between.

    Every estimator of mathnavi that reads numbers has them; a plug-in of somebody else may.
    """
    named = {name for name in (INNOVATIONS, INNOVATION_STD) if name in estimates[0].extra}
    own = PLUGINS[flown[0]].value.startswith("mathnavi.") and flown[0] not in TRUTH
    assert len(named) in ((2,) if own else (0, 2)), f"it publishes {named} alone"
    if not named:
        return
    nu, deviation = innovations_of(estimates)
    assert nu.ndim == 2
    assert nu.shape == deviation.shape
    np.testing.assert_array_equal(np.isnan(nu), np.isnan(deviation))
    known = np.isfinite(nu)
    assert (deviation[known] > 0.0).all()
    assert np.isfinite(deviation[known]).all()
    assert known.any() == (flown[0] not in ABSENT)
    silent = np.array([not any(np.isfinite(each.value).any() for each in step.measurements) for step in flight])
    assert not known[silent].any()


def test_its_innovations_are_as_large_as_it_says(flown: tuple[str, str], estimates: Sequence[Estimate]) -> None:
    """The mean of e^2, e = nu / std, is about 1 over the later three quarters of a flight on which all is as declared.

    The mean of N squares of a Gaussian sequence with autocorrelation r_1 from one to the next has about the variance
    2 / N', N' = N (1 - r_1^2) / (1 + r_1^2): one is asked to be within four of its deviations above 1. An observer with
    constant gains forgets its start slowly, so that its N' is small. Below 1 there is no such limit, for a mission
    declares what there may be: the bench that moves least does with a third of its declared speed.
    """
    if INNOVATIONS not in estimates[0].extra or flown[0] in ABSENT:
        return
    nu, deviation = innovations_of(estimates[len(estimates) // 4 :])
    columns = [e[np.isfinite(e)] for e in (nu / deviation).T]
    columns = [e for e in columns if len(e) > 2]
    squares, products = (sum(float(each @ other) for each, other in pairs) for pairs in (
        [(e, e) for e in columns], [(e[1:], e[:-1]) for e in columns]
    ))  # fmt: skip
    count, correlation = sum(map(len, columns)), min(max(products / squares, 0.0), 0.999)
    independent = count * (1.0 - correlation**2) / (1.0 + correlation**2)
    assert 0.05 < squares / count < 1.0 + 4.0 * math.sqrt(2.0 / independent)


class Unhinted:
    """An estimator's plug-in that says nothing of its mission's type: a range filter's, of somebody else."""

    Config = RangeObserverConfig

    @staticmethod
    def build(config, mission):  # type: ignore[no-untyped-def]
        return RangeObserver(config, mission)


def test_a_plugin_without_type_hints_is_flown_where_it_can_be_built() -> None:
    benches = benches_of(Unhinted)
    assert benches == benches_of(RangeObserver)


def test_a_covariance_is_symmetric_and_positive_semidefinite(estimates: Sequence[Estimate]) -> None:
    for estimate in [*estimates[:300], *estimates[300:][-300:]]:
        if estimate.covariance is not None:
            P = estimate.covariance
            assert np.abs(P - P.T).max() <= 1e-6 * np.abs(P).max(), "as the loop takes it: symmetric to rounding"
            least, *_, largest = np.linalg.eigvalsh(P)
            assert least >= -1e-9 * max(largest, 1.0)


def test_no_estimate_of_a_mechanism_that_is_faster_than_its_mission_allows_is_ok(flown: tuple[str, str]) -> None:
    """Each flight is much faster than the mission now says, whichever way the estimator looks at its readings."""
    mission = bench_of(flown[1], False).mission
    if not isinstance(mission, LagrangianMission):
        return
    plugin, slower = PLUGINS[flown[0]].load(), dataclasses.replace(mission, speed_max=1e-3)
    for step, estimate in replay(plugin.build(plugin.Config(), slower), recorded(*flown).steps):
        wrong = impossible(slower, estimate.x, estimate.covariance)
        assert not (wrong and estimate.status is Status.OK), f"at {step.t:g} s: it {wrong}"
    assert estimate.status is not Status.OK  # also of one that refuses its readings, and has no velocity


def test_neither_what_it_is_given_nor_what_it_handed_out_is_changed(flown: tuple[str, str]) -> None:
    record = recorded(*flown)
    assert record.changed == []
    for estimate, then in zip(record.handed_out, record.estimates, strict=True):
        assert same(estimate, then)


def same(one: Estimate, other: Estimate) -> bool:
    return one.status is other.status and np.array_equal(one.x, other.x)


def unexplained(estimates: Sequence[Estimate]) -> set[Status]:
    """Statuses other than OK that come without a message."""
    return {estimate.status for estimate in estimates if estimate.status is not Status.OK and not estimate.message}


def test_before_its_first_reading_it_is_initialising(estimator: Estimator, flight: list[Step]) -> None:
    for step in flight[:10]:
        estimate = estimator.update(step.t, (), step.command)
        assert estimate.status is Status.INITIALISING
        assert estimate.message.startswith("waits ")


def scribbled(estimator: Estimator, steps: Sequence[Step]) -> Iterator[Estimate]:
    """Copies of the estimates, which are made unusable after that, with readings of a stranger among those given."""
    for step in steps:
        noise = Measurement("a-strangers-sensor", step.t, np.full(2, 1e9))
        estimate = estimator.update(step.t, (noise, *step.measurements), step.command)
        yield copied(estimate)
        for array in (estimate.x, estimate.covariance, *estimate.extra.values()):
            if array is not None and array.flags.writeable:
                array[...] = np.nan


def test_the_same_readings_give_the_same_estimates_until_they_are_missing_which_is_survived_and_in_the_end_reported(
    estimator: Estimator, flight: list[Step], estimates: Sequence[Estimate]
) -> None:
    """Neither readings of other sensors nor what becomes of its estimates reach the estimator."""
    middle = len(flight) // 2
    fed = list(scribbled(estimator, flight[:middle]))
    differing = [
        step.t for step, one, other in zip(flight, fed, estimates[:middle], strict=False) if not same(one, other)
    ]
    assert differing == []
    assert fed[-1].status is Status.OK
    assert (unused_in(fed[-1].extra) or {})[Unused.UNKNOWN_SENSOR.value] == middle
    starved = [estimator.update(step.t, (), step.command) for step in flight[middle:]]
    assert np.isfinite([estimate.x for estimate in starved]).all()
    assert starved[-1].status is Status.LOST
    assert unexplained(starved) == set()


def test_it_finds_back_when_the_readings_come_back(estimator: Estimator, flight: list[Step], bench: Bench) -> None:
    third, sixth = len(flight) // 3, len(flight) // 6
    gap = [dataclasses.replace(step, measurements=()) for step in flight[third : third + sixth]]
    steps, answers = zip(*replay(estimator, [*flight[:third], *gap, *flight[third + sixth :]]), strict=True)
    last, estimate = steps[-1], answers[-1]
    assert estimate.status is Status.OK
    assert unexplained(answers) == set()
    assert np.all(bench.error(estimate, last) <= bench.tolerance)


def later(step: Step, seconds: float) -> Step:
    """The same call and readings, so much later."""
    measurements = tuple(dataclasses.replace(each, t=each.t + seconds) for each in step.measurements)
    return dataclasses.replace(step, t=step.t + seconds, measurements=measurements)


@pytest.mark.honoured("sensor log", "gap longer than declared")
def test_after_an_hour_without_readings_it_is_ok_only_where_it_is_right(
    estimator: Estimator, flight: list[Step], bench: Bench
) -> None:
    third, sixth = len(flight) // 3, len(flight) // 6
    answers = list(replay(estimator, [*flight[:third], *(later(step, 3600.0) for step in flight[third:][:sixth])]))
    assert all(np.isfinite(estimate.x).all() for _, estimate in answers)
    wrong = [
        step.t
        for step, estimate in answers[third:]
        if estimate.status is Status.OK and not np.all(bench.error(estimate, step) <= bench.tolerance)
    ]
    assert wrong == []


def test_it_is_not_ok_while_one_of_several_sensors_has_been_missing_for_longer_than_declared(
    plugin: type[EstimatorPlugin], flight: list[Step], bench: Bench
) -> None:
    config = plugin.Config()
    names = [sensor.name for sensor in plugin.sensors(config, bench.mission)]
    if len(names) == 1:
        pytest.skip("it has one sensor")
    short = {field.name: 0.2 for field in dataclasses.fields(config) if field.name in ("timeout", "imu_gap")}
    third = len(flight) // 3
    end = next(k for k, step in enumerate(flight) if step.t > flight[third].t + (0.3 if short else 0.6))
    for name in names:
        without = [
            dataclasses.replace(step, measurements=tuple(each for each in step.measurements if each.name != name))
            for step in flight[third:end]
        ]
        estimator = plugin.build(dataclasses.replace(config, **short), bench.mission)
        answers = [each for _, each in replay(estimator, [*flight[:third], *without, flight[end]])]
        assert Status.OK not in [each.status for each in answers[end - 1 :]], name
        assert unexplained(answers) == set(), name


def test_a_reading_that_is_not_finite_is_counted_and_not_used(estimator: Estimator, flight: list[Step]) -> None:
    third = len(flight) // 3
    broken = [
        dataclasses.replace(
            step,
            measurements=tuple(dataclasses.replace(m, value=np.full(len(m.value), np.inf)) for m in step.measurements),
        )
        for step in flight[third:][:5]
    ]
    *_, (_, estimate) = replay(estimator, [*flight[:third], *broken])
    assert np.isfinite(estimate.x).all()
    assert (unused_in(estimate.extra) or {}).get(Unused.NOT_FINITE.value, 0) >= sum(
        len(step.measurements) for step in broken
    )


def test_it_converges_on_a_simulated_vehicle(estimates: Sequence[Estimate], flight: list[Step], bench: Bench) -> None:
    for step, estimate in zip(flight, estimates, strict=True):
        if step.t > 0.5 * bench.duration:
            assert estimate.status is Status.OK
            assert np.all(bench.error(estimate, step) <= bench.tolerance)


def largest_error(plugin: type[EstimatorPlugin], config: Any, bench: str) -> Array:
    """(n,) magnitudes, over a silent flight, once it is initialised."""
    built = bench_of(bench, True)
    estimator = plugin.build(config, built.mission)
    errors = [
        built.error(estimate, step)
        for step, estimate in replay(estimator, fly(plugin, bench, True, estimator))
        if estimate.status is Status.OK
    ]
    largest: Array = np.max(errors, axis=0)
    return largest


def test_an_observer_stays_on_the_truth_if_it_says_so_and_leaves_it_if_not(
    flown: tuple[str, str], plugin: type[EstimatorPlugin]
) -> None:
    """Property 2.1: started on the truth, without noise, an observer stays there once it is initialised."""
    if not hasattr(plugin, "properties"):
        pytest.skip("it does not call itself an observer")
    if bench_of(flown[1], True).read is not None:
        pytest.skip("its properties are those of an observer that is given all places")
    stays, config = bench_of(flown[1], True).stays, plugin.Config()
    properties: ObserverProperties = plugin.properties(config)
    assert isinstance(properties, ObserverProperties)
    error = largest_error(plugin, config, flown[1])
    assert bool(np.all(error <= stays)) == properties.stays_on_truth, error


@pytest.mark.parametrize("feedforward", FEED_FORWARDS)
def test_the_range_observer_stays_on_the_truth_with_any_feed_forward_and_leaves_it_as_printed(
    feedforward: FeedForward,
) -> None:
    """Without one the right side of (C.5) is nought on the truth, and the truth moves on."""
    bench, config = bench_of("ranging", True), RangeObserverConfig(feedforward=feedforward)
    error, stays = largest_error(RangeObserver, config, "ranging"), RangeObserver.properties(config).stays_on_truth
    assert stays == (feedforward != "none")
    assert np.all(error <= bench.stays) if stays else np.any(error > 200.0 * bench.stays), error
