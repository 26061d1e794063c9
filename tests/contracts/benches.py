"""Benches for estimators: small simulated vehicles, each with the mission that an estimator is built for."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.estimators.invariant.inclination_kernels import turned
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array, Estimate, Measurement
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
from tests.unicycle import STANDARD, Imagined


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


@dataclass(frozen=True)
class Step:
    """One call of an estimator: what it is given, and what is true then."""

    t: float
    measurements: tuple[Measurement, ...]
    command: Array
    truth: Array


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
