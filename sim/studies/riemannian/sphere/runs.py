"""Runs of the study ``sphere`` without noise: the observer (D.6) on S^3 and H^2, and on the cart and pendulum."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.estimators.riemannian.continuous import ContinuousObserver, Instant
from mathnavi.estimators.riemannian.gains import IntrinsicGains
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space, sphere
from mathnavi.models.manifold.systems import PointSystem, chart, linear, printed
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.lagrangian import VelocityErrors, errors_of
from mathnavi.sim.scenarios.arm_velocity import VEHICLE as MECHANISM
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.scenarios.sphere_observer import rigid_body_plant
from mathnavi.sim.sweep.trial import Trial, trial

ANGLES, RATES = np.array([1.0, 0.7, 2.0]), np.array([2.25, 1.25, 4.0])  # x(0) and v(0) of D.5
BOWL = 4.0  # [1/s^2] c of the potential on H^2
H2_START, H2_VELOCITY = (0.8, 0.3), (0.9, 2.4)  # in normal coordinates about the origin, and in the frame there
KEPT = 0.01  # [s] between what is kept of a run
STEPS = {"printed": 2e-4, "repaired": 1e-3}  # [s]; the printed A is up to 9487 per second, of which RK4 bears 2.78
FASTEST = 10.0  # [rad/s] of the free body in MuJoCo

_GAINS: Mapping[str, Mapping[str, Any]] = {
    "printed": {"gains": "printed"},
    "repaired": {"bandwidth": math.sqrt(3.0), "damping": 0.5 * math.sqrt(3.0)},  # A = B = 3
}


@dataclass(frozen=True)
class ContinuousRun:
    """A run in continuous time, with one pair of gains."""

    space: str  # "S^3" or "H^2"
    gains: str  # "printed" or "repaired"
    seconds: float


def flown(run: ContinuousRun) -> dict[str, Array]:
    """Integrate; every ``KEPT`` s t, theta, |Delta v|, v and v^ (ambient), and (|Delta v|^2 / 2, S, <s, Delta v>)."""
    system, start = _system(run.space)
    space, n = system.manifold, system.manifold.size
    fields = _GAINS[run.gains]
    gains = IntrinsicGains(
        fields.get("bandwidth", 1.0), fields.get("damping", 1.0), fields.get("gains", "constant"), "minus-one",
        space.kappa,
    )  # fmt: skip
    observer = ContinuousObserver(space, gains, start[:n], np.zeros(n))
    h, none = STEPS[run.gains], np.zeros(n)
    every = round(KEPT / h)
    rows: dict[str, list[Any]] = {name: [] for name in ("t", "theta", "speed_error", "v", "v_hat", "lyapunov")}
    x = start
    for k in range(round(run.seconds / h) + 1):
        if k % every == 0:
            theta, _, error, lyapunov = errors_of(space, x, np.concatenate([observer.xi, observer.eta]))
            v_hat = space.transport(observer.xi, x[:n], observer.eta)
            values = (k * h, theta, error, x[n:], v_hat, lyapunov)
            for name, value in zip(rows, values, strict=True):
                rows[name].append(value)
        middle, _ = system.reach(x, none, 0.5 * h)
        end, _ = system.reach(middle, none, 0.5 * h)
        observer.step(h, _instant(system, x), _instant(system, middle), _instant(system, end))
        x = end
    return {name: np.array(values) for name, values in rows.items()}


def _system(space: str) -> tuple[PointSystem, Array]:
    """The system and its state at the start."""
    if space == "S^3":
        system = PointSystem(sphere(3), printed)
        point, slope = chart(ANGLES)
        return system, system.state(point, slope @ RATES)
    plane: ConstantCurvature = hyperbolic_space(2)
    point = plane.point(plane.origin, np.array(H2_START))
    system = PointSystem(plane, linear(BOWL, 0))
    return system, system.state(point, plane.vector(point, np.array(H2_VELOCITY)))


def _instant(system: PointSystem, state: Array) -> Instant:
    n = system.manifold.size
    x = state[:n]
    return x, system.force(x, state[n:], np.zeros(n))


# ---- the cart and pendulum


def cart_pendulum(gains: str, seconds: float) -> Trial:
    """Trial in MuJoCo, let go at an angle, sampled at 1 kHz with exact encoders."""
    fields = {
        "mechanism": "cart-pendulum", "reading.resolution": 0, "duration": seconds, "settled": 0.0,
        "start": (0.0, 2.0, 0.4, 3.0), **{f"estimator.{name}": value for name, value in _GAINS[gains].items()},
    }  # fmt: skip
    return trial("arm-velocity", 0, controller="input_signal", fields=fields, measure=f"{__name__}:mechanism_errors")


def mechanism_errors(outcome: RunResult) -> dict[str, Any]:
    """A measure: errors every ``KEPT`` s."""
    manifold = MechanismSystem(build_model(outcome.config["fields"]["mechanism"], name=MECHANISM)).manifold
    errors = VelocityErrors.from_recording(outcome.recording, MECHANISM, manifold)
    every = max(1, round(KEPT / float(errors.t[1] - errors.t[0])))
    kept = {"t": errors.t, "theta": errors.position, "speed_error": errors.norm}
    return {name: values[::every].tolist() for name, values in kept.items()}


# ---- MuJoCo's ball joint


def distance_to_geodesic(seed: int) -> float:
    """[rad] by how much, at most over 5 s, a free body in MuJoCo is turned from the geodesic that it starts on."""
    rng, attitude = np.random.default_rng(seed), Attitude()
    start, axis = sphere(3).draw(rng), rng.standard_normal(3)
    omega = FASTEST * axis / np.linalg.norm(axis)
    plant = rigid_body_plant("body", np.concatenate([start, omega]), (), 0.05, rng)
    worst = 0.0
    for _ in range(50):
        plant.step({}, 100)
        worst = max(worst, 2.0 * attitude.distance(plant.state("body")[:4], attitude.exp(start, plant.t * omega)))
    return worst
