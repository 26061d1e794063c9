"""Runs of the range observer from the start of the thesis and from drawn ones, and residuals of its rates on the truth.

The robot moves exactly as a unicycle; its ranges are exact, or have Gaussian errors of 5 % of their lengths (C.5). The
thesis does not state the inputs, so several are tried.

Is Q = 0 on the truth, and is each feed-forward Psi_* F there? Both are compared with independent derivatives. The rates
of rho and s are computed by a complex step through the ray: with x(t + ih) = x + ih F(x, u), the ray solves q_1^2 +
q_2^2 = 1 for q = (p_1 / c_1, p_2 / c_2) at p = (x_1, x_2) + rho e. The imaginary parts over h are the derivatives, to
round-off, and s' = q_1 q_2' - q_2 q_1' as q = (cos s, sin s).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from mathnavi.estimators.observability.output_flow import output_flow
from mathnavi.estimators.observability.region import ExactRun, exact_run
from mathnavi.estimators.ranging.feedforward_kernels import LEAST_DENOMINATOR, rho_dot_rate, s_rate
from mathnavi.estimators.ranging.observer import FEED_FORWARDS, RangeObserver, RangeObserverConfig
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.angles import wrapped
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import circle, figure_eight
from mathnavi.models.unicycle.quality import KnownStart, RangeQuality
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.ranging import HEADING, POSITION, rms
from mathnavi.studies.ranging.observability_measures import (
    HALF_AXES,
    SENSORS,
    STANDARD,
    THESIS_START,
    drawn_start,
    driving,
)

NOISE = 0.05  # of a range
VICINITY = 0.2  # [rad] by which each component of the first z is off at most
STRIDE = 5  # readings from one at which errors are taken to the next
MOTIONS: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "figure of eight": lambda t: figure_eight(t, 0.25, 8.0),
    "circle": lambda t: circle(t, 0.15, 1.0),
    "weaving": lambda t: (0.1, 0.5 * math.sin(t)),
    "on the spot": lambda t: circle(t, 0.0, 0.5),
    "up and down": lambda t: (0.5 if t % 8.0 < 4.0 else -0.5, 0.0),
    "standing still": lambda t: (0.0, 0.0),
}
"""inputs of runs from the start of the thesis, by name"""
DRIVES: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "standard": driving,
    "half as fast": lambda t: figure_eight(t, 0.25, 16.0),
}
"""inputs of runs from drawn starts, by name: one figure of eight, in 8 s and in 16 s"""

RESIDUALS = ("Q", "s", "rho_dot", "manifold", "heun_s", "heun_rho_dot")
FASTEST = (1.0, 2.0)  # [m/s, rad/s] of an input that is drawn, either way
PERIOD = 0.01  # [s]
_STEP = 1e-30  # [s]


@dataclass(frozen=True)
class ThesisRun:
    """Run from the start of the thesis with sensors at -90° and -45°; z(0) has an error drawn by a seed, or none."""

    motion: str
    observer: RangeObserverConfig
    seed: int
    seconds: int
    noisy: tuple[bool, bool] = (False, False)  # which of the two rays err
    true_start: bool = False


@dataclass(frozen=True)
class DrawnRun:
    """Runs of the printed observer from a drawn, known start, one for each gain k = k_V = k_Q."""

    sensors: str
    drive: str
    gains: tuple[float, ...]
    seed: int
    seconds: int
    period: float = PERIOD  # [s] between readings


@dataclass(frozen=True, eq=False)
class ObserverRun:
    """Run of the range observer, sampled at every ``STRIDE``-th reading."""

    run: ExactRun
    t: Array  # (n,) [s]
    x: Array  # (n, 3) estimate
    truth: Array  # (n, 3)
    z: Array  # (n, l + 1) estimate
    z_true: Array  # (n, l + 1) without jumps
    value: Array  # (n, 2) V_rho and |Q|^2 / 2
    error: Array  # (n, 3) x less its truth, modulo the symmetry of the wall
    error_z: Array  # (n, l + 1) z likewise

    @property
    def position(self) -> Array:
        """Position errors (n,) [m]."""
        length: Array = np.hypot(self.error[:, 0], self.error[:, 1])
        return length

    @property
    def in_z(self) -> Array:
        """Root mean square errors (n,) [rad] over the components of z."""
        size: Array = np.sqrt(np.square(self.error_z).mean(axis=1))
        return size

    @property
    def last(self) -> slice:
        """The last quarter of the run, over which errors are evaluated."""
        return slice(round((1.0 - LAST) * (len(self.t) - 1)), None)


# ---- what runs in the processes of trials


def thesis_errors(asked: ThesisRun) -> dict[str, Any]:
    """A job: errors of the observer in a run from the start of the thesis."""
    return errors(from_thesis_start(asked))


def drawn_errors(asked: DrawnRun) -> list[dict[str, Any]]:
    """A job: errors of the observer at each gain."""
    start = drawn_start(STANDARD, np.random.default_rng(asked.seed))
    mission = mission_with(asked.sensors, RangeQuality(), start, asked.period)
    run = exact_run(mission, start, DRIVES[asked.drive], float(asked.seconds))
    return [errors(follow(run, RangeObserverConfig("none", k, k))) for k in asked.gains]


def shown_run(asked: ThesisRun) -> ObserverRun:
    """A job: run of the observer from the start of the thesis, for a figure, without the readings."""
    seen = from_thesis_start(asked)
    return dataclasses.replace(seen, run=dataclasses.replace(seen.run, readings=()))


def averaged(asked: ThesisRun) -> tuple[float, float]:
    """A job: RMS errors [m] of the position by the mean of all rays, and by the faulty ones alone, from the same z."""
    seen = from_thesis_start(asked)
    rho = np.array([readings[0].value for readings in seen.run.readings[::STRIDE]])
    v = places(seen.z, rho, seen.run.mission.alpha)[seen.last]
    truth = seen.truth[seen.last, None, :2]
    by_mean, by_faulty = v.mean(axis=1, keepdims=True) - truth, v[:, np.array(asked.noisy)] - truth
    return _rms_length(by_mean), _rms_length(by_faulty)


def identities(asked: tuple[str, int, int]) -> dict[str, Array]:
    """A job: residuals (states,) on the truth at drawn states and inputs; ``asked`` is (sensors, seed, states).

    ``Q`` is |Q| [m^2/s], as printed; ``s`` and ``rho_dot`` [rad/s] are the largest components of the rate less Psi_* F,
    NaN where the denominator is guarded; ``manifold`` [rad] is that of z less Psi(x) after a period, and ``heun_s`` and
    ``heun_rho_dot`` [rad] are the same with s and rho_dot integrated over the period.
    """
    sensors, seed, states = asked
    rng = np.random.default_rng(seed)
    found = [_residuals(sensors, STANDARD.draw(rng, 0.05), rng.uniform(-1.0, 1.0, 2) * FASTEST) for _ in range(states)]
    return dict(zip(RESIDUALS, np.array(found).T, strict=True))


# ---- the observer in a run


def from_thesis_start(asked: ThesisRun) -> ObserverRun:
    """Run the observer from the start of the thesis."""
    rng = np.random.default_rng(asked.seed).spawn(1)[0]
    z, x = ((), THESIS_START) if asked.true_start else first_z(asked.seed)
    quality = RangeQuality(NOISE if any(asked.noisy) else 0.0)
    exact = _thesis_truth(asked.motion, asked.seconds)
    run = dataclasses.replace(exact, mission=mission_with("2t", quality, x))
    if any(asked.noisy):
        run = _with_noise(run, np.where(asked.noisy, NOISE, 0.0), rng)
    return follow(run, dataclasses.replace(asked.observer, z_0=z))


def first_z(seed: int) -> tuple[tuple[float, ...], Array]:
    """Draw z^(0) (3,) near Psi(x(0)) with Phi(z^(0)) within the wall; return it and that pose (3,)."""
    rng, alpha = np.random.default_rng(seed), np.radians(SENSORS["2t"])
    rho, s = STANDARD.ranges(THESIS_START, alpha)
    while True:
        z: Array = np.append(s, THESIS_START[2]) + rng.uniform(-VICINITY, VICINITY, 3)
        x: Array = np.append(places(z, rho, alpha).mean(axis=0), z[2])
        if STANDARD.contains(x[:2]):
            return tuple(z.tolist()), x


def places(z: Array, rho: Array, alpha: Array) -> Array:
    """Return v_i (..., l, 2) [m] of z (..., l + 1): positions of the robot by each ray."""
    beta = z[..., -1:] + alpha
    ray: Array = rho[..., None] * np.stack([np.cos(beta), np.sin(beta)], axis=-1)
    return STANDARD.points(z[..., :-1]) - ray


def mission_with(sensors: str, quality: RangeQuality, start: Array, period: float = PERIOD) -> RangingMission:
    """Return a mission in the standard field with a known start (3,)."""
    angles = tuple(math.radians(angle) for angle in SENSORS[sensors])
    x_1, x_2, phi = start.tolist()
    return RangingMission(STANDARD, angles, ranging=quality, start=KnownStart((x_1, x_2, phi)), period=period)


@lru_cache(maxsize=8)
def _thesis_truth(motion: str, seconds: int) -> ExactRun:
    return exact_run(mission_with("2t", RangeQuality(), THESIS_START), THESIS_START, MOTIONS[motion], float(seconds))


def _with_noise(run: ExactRun, relative: Array, rng: np.random.Generator) -> ExactRun:
    """Scale every range (l,) by a Gaussian of ``relative`` (l,)."""
    factors = 1.0 + relative * rng.standard_normal((len(run.t), len(relative)))
    readings = tuple(
        (Measurement(ranges.name, ranges.t, factor * ranges.value), *rest)
        for factor, (ranges, *rest) in zip(factors, run.readings, strict=True)
    )
    return dataclasses.replace(run, readings=readings)


def follow(run: ExactRun, config: RangeObserverConfig) -> ObserverRun:
    """Run the observer over the readings of a run; its errors are modulo the symmetry of the wall."""
    mission, curve = run.mission, run.mission.curve
    made = RangeObserver.build(config, mission)
    estimates = [
        made.update(t, readings, command)
        for t, readings, command in zip(run.t, run.readings, run.commands, strict=True)
    ][::STRIDE]
    truth = run.truth[::STRIDE]
    x = np.array([estimate.x for estimate in estimates])
    z = np.array([estimate.extra["z"] for estimate in estimates])
    s = np.unwrap(np.array([curve.ranges(pose, mission.alpha)[1] for pose in truth]), axis=0)
    z_true = np.column_stack([s, truth[:, 2]])
    turns = 2.0 * math.pi / curve.symmetry * np.arange(curve.symmetry)  # of an ellipse, also by how much s is off
    images = wrapped(z[:, None] - z_true[:, None] - turns[:, None])
    nearest = np.square(images).sum(axis=2).argmin(axis=1)
    return ObserverRun(
        run, run.t[::STRIDE], x, truth, z, z_true,
        np.array([estimate.extra["value"] for estimate in estimates]),
        np.array([mission.difference(one, true) for one, true in zip(x, truth, strict=True)]),
        images[np.arange(len(z)), nearest],
    )  # fmt: skip


def errors(run: ObserverRun) -> dict[str, Any]:
    """Return RMS errors over the last quarter of a run, also relative to the truth, and the largest of all.

    Lock is kept in X, or in Z, if the estimate has converged there.
    """
    last, truth = run.last, run.truth
    position, heading, in_z = rms(run.position[last]), rms(run.error[last, 2]), rms(run.in_z[last])
    return {
        "position_rms_m": position,
        "heading_rms_rad": heading,
        "z_rms_rad": in_z,
        "keeps_lock": position < POSITION and heading < HEADING,
        "keeps_lock_in_z": in_z < HEADING,
        "worst_m": float(run.position.max()),
        "relative_position": position / _rms_length(truth[last, :2]),
        "relative_heading": heading / rms(truth[last, 2]),
    }


def _rms_length(error: Array) -> float:
    return rms(np.hypot(error[..., 0], error[..., 1]))


# ---- identities on the truth


def _residuals(sensors: str, x: Array, u: Array) -> tuple[float, ...]:
    alpha = np.radians(SENSORS[sensors])
    table, wall = STANDARD.table, STANDARD.wall
    rho, s = STANDARD.ranges(x, alpha)
    rho_dot, s_dot = complex_step(x, u, alpha)
    z, rate = np.append(s, x[2]), np.append(s_dot, u[1])
    Q, _ = output_flow(STANDARD, tuple(alpha.tolist()))(z, rho, rho_dot, u)
    after = integrate(x, u[0], u[1], PERIOD)
    is_clear = _least_denominator(x, alpha) >= LEAST_DENOMINATOR
    ends = dict.fromkeys(FEED_FORWARDS, math.nan)
    if is_clear and STANDARD.contains(after[:2]) and _least_denominator(after, alpha) >= LEAST_DENOMINATOR:
        z_after = np.append(STANDARD.ranges(after, alpha)[1], after[2])
        there = np.stack([STANDARD.ranges(after, alpha)[0], complex_step(after, u, alpha)[0]])
        for name, forward in FEED_FORWARDS.items():
            reached = forward(wall, alpha, z, np.stack([rho, rho_dot]), there, u, PERIOD)
            ends[name] = float(np.abs(wrapped(reached - z_after)).max())
    return (
        float(np.linalg.norm(np.array(Q))),
        float(np.abs(s_rate(table, alpha, z, rho, u) - rate).max()) if is_clear else math.nan,
        float(np.abs(rho_dot_rate(table, alpha, z, rho, rho_dot, u) - rate).max()) if is_clear else math.nan,
        ends["manifold"],
        ends["s"],
        ends["rho_dot"],
    )


def complex_step(x: Array, u: Array, alpha: Array) -> tuple[Array, Array]:
    """Return rho' (l,) [m/s] and s' (l,) [rad/s] of the rays of a pose x (3,) that moves with u (2,)."""
    c = np.array(HALF_AXES)
    phi = x[2] + 1j * _STEP * u[1]
    p = (x[:2] + 1j * _STEP * u[0] * np.array([math.cos(x[2]), math.sin(x[2])])) / c
    e = np.stack([np.cos(phi + alpha), np.sin(phi + alpha)], axis=1) / c  # (l, 2)
    a, b = np.square(e).sum(axis=1), (e * p).sum(axis=1)
    rho = (-b + np.sqrt(b * b - a * (np.square(p).sum() - 1.0))) / a
    q = p + rho[:, None] * e
    q_dot = q.imag / _STEP
    return rho.imag / _STEP, q[:, 0].real * q_dot[:, 1] - q[:, 1].real * q_dot[:, 0]


def _least_denominator(x: Array, alpha: Array) -> float:
    """Return the least |theta'(s)' R_{phi + alpha} e_2| [m] of all rays."""
    _, s = STANDARD.ranges(x, alpha)
    tangent, beta = STANDARD.tangent(s), x[2] + alpha
    return float(np.abs(tangent[:, 1] * np.cos(beta) - tangent[:, 0] * np.sin(beta)).min())
