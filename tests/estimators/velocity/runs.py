"""Systems that observers of the velocity are tried on, and what they read on a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from mathnavi.estimators.invariant.attitude import AttitudeIekf
from mathnavi.estimators.riemannian.plugin import RiemannianObserver
from mathnavi.estimators.velocity.filtered_differences import FilteredDifferences
from mathnavi.estimators.velocity.high_gain import HighGain
from mathnavi.estimators.velocity.kalman import LagrangianEkf, LagrangianUkf
from mathnavi.interfaces.protocols import Estimator, StateView
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, flat_space, hyperbolic_space, sphere
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.manifold.systems import PointSystem, RigidBody, linear
from mathnavi.sim.engine.ode_plant import OdeMotion
from mathnavi.sim.metrics.tuning import RecordedCall

PLUGINS: Mapping[str, Any] = {
    "attitude_iekf": AttitudeIekf,
    "filtered_differences": FilteredDifferences,
    "high_gain": HighGain,
    "lagrangian_ekf": LagrangianEkf,
    "lagrangian_ukf": LagrangianUkf,
    "riemannian_observer": RiemannianObserver,
}
MODELLED = ("high_gain", "lagrangian_ekf", "lagrangian_ukf")
FILTERS = ("lagrangian_ekf", "lagrangian_ukf")


def pointed(manifold: ConstantCurvature) -> tuple[LagrangianSystem, Array]:
    """A point that falls in U = p_0 from off the origin, and its start at rest."""
    system, n = PointSystem(manifold, linear(1.0, 0)), manifold.size
    start = manifold.exp(np.eye(n)[0], 0.7 * np.eye(n)[1])
    return system, system.state(start, np.zeros(n))


SYSTEMS: Mapping[str, Callable[[], tuple[LagrangianSystem, Array]]] = {
    "rigid body": lambda: (RigidBody(0.05), np.array([1.0, *np.zeros(6)])),
    "sphere": lambda: pointed(sphere(2)),
    "hyperbolic": lambda: pointed(hyperbolic_space(2)),
    "flat": lambda: pointed(flat_space(2)),
}


def moving(name: str, speed: float) -> tuple[LagrangianSystem, Array]:
    """The system with a start at which every component of v is ``speed``."""
    system, start = _at_rest(name)
    manifold = system.manifold
    x = start[: manifold.size]
    return system, np.concatenate([x, manifold.vector(x, np.full(manifold.dimension, speed))])


@cache
def _at_rest(name: str) -> tuple[LagrangianSystem, Array]:
    """A system that all tests share, with its start."""
    return SYSTEMS[name]()


class Seen(OdeMotion):
    """A state, for a sensor that reads nothing else."""

    def __init__(self, x: Array) -> None:
        self.state = x


def recorded(
    mission: LagrangianMission,
    start: Array,
    duration: float,
    seed: int = 1,
    input_at: Callable[[float], Array] | None = None,
) -> list[RecordedCall]:
    """A run of the mission's system; zero is the input where none is given.

    Estimators of the same mission share one run, which none of them may change (``tests/contracts``).
    """
    return list(_run(mission.system, mission.reading, mission.period, tuple(start), duration, seed, input_at))


@cache
def _run(
    system: LagrangianSystem,
    reading: PositionQuality,
    period: float,
    start: tuple[float, ...],
    duration: float,
    seed: int,
    input_at: Callable[[float], Array] | None,
) -> list[RecordedCall]:
    mission = LagrangianMission(system, reading, period)
    rng, sensor = np.random.default_rng(seed), mission.sensor
    x, u, calls = np.array(start), np.zeros(len(system.inputs)), []
    for k in range(round(duration / mission.period) + 1):
        t = k * mission.period
        motion: StateView = Seen(x)
        y = sensor.read(motion, rng)
        read = () if y is None else (Measurement("position", t, y),)
        calls.append(RecordedCall(t, read, u, x))
        u = np.zeros(len(system.inputs)) if input_at is None else input_at(t)
        x = system.flow(x, u, mission.period)
    return calls


def mission_of(system: LagrangianSystem, period: float = 0.01, **quality: Any) -> LagrangianMission:
    return LagrangianMission(system, PositionQuality(**quality), period, speed_max=10.0)


def replayed(estimator: Estimator, calls: Sequence[RecordedCall]) -> list[Estimate]:
    return [estimator.update(call.t, call.measurements, call.command) for call in calls]


def velocity_error(manifold: Any, estimate: Estimate, truth: Array) -> float:
    return float(np.linalg.norm(estimate.x[manifold.size :] - truth[manifold.size :]))
