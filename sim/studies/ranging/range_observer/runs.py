"""The runs of the study ``range-observer``: the thesis' own start, drawn starts, and how the observer does in them.

The robot moves exactly as a unicycle; its ranges are exact, or err by a Gaussian of 5 % of their lengths (C.5). What it
does with its inputs the thesis does not say, so several are tried.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mathnavi.estimators.observability.region import ExactRun, exact_run
from mathnavi.estimators.ranging.observer import FeedForward, RangeObserverConfig
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import circle, figure_eight
from mathnavi.models.unicycle.quality import KnownStart, RangeQuality
from mathnavi.sim.interfaces.signals import Array, Measurement
from mathnavi.sim.metrics.ranging import rms
from mathnavi.sim.studies.ranging.observability.maps import SENSORS, STANDARD, drawn_start, driving
from mathnavi.sim.studies.ranging.range_observer.observer_run import STRIDE, ObserverRun, RunErrors, follow

START = np.array([1.0, -1.0, 0.5 * math.pi])  # x(0) of C.5
PRINTED_GAINS = (5.0, 1.0)  # k_V and k_Q of C.5
NOISE = 0.05  # of a range
VICINITY = 0.2  # [rad] by which each component of the first z is off at most

MOTIONS: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "figure of eight": lambda t: figure_eight(t, 0.25, 8.0),
    "circle": lambda t: circle(t, 0.15, 1.0),
    "weaving": lambda t: (0.1, 0.5 * math.sin(t)),
    "on the spot": lambda t: circle(t, 0.0, 0.5),
    "up and down": lambda t: (0.5 if t % 8.0 < 4.0 else -0.5, 0.0),
    "standing still": lambda t: (0.0, 0.0),
}
"""inputs from the thesis' start"""
TURNING = ("figure of eight", "circle", "weaving", "on the spot")
MOVING = (*TURNING, "up and down")
SHOWN = "figure of eight"

DRIVES: Mapping[str, Callable[[float], tuple[float, float]]] = {
    "standard": driving,
    "half as fast": lambda t: figure_eight(t, 0.25, 16.0),
}
"""inputs from starts that are drawn: one figure of eight, in 8 s and in 16 s"""


@dataclass(frozen=True)
class ObserverGains:
    """The observer in one configuration."""

    feedforward: FeedForward
    k_v: float
    k_q: float

    def config(self, z_0: tuple[float, ...] = ()) -> RangeObserverConfig:
        return RangeObserverConfig(self.feedforward, self.k_v, self.k_q, z_0=z_0)


@dataclass(frozen=True)
class ThesisRun:
    """Run from the thesis' start with sensors at -90° and -45°, z(0) off by what a seed draws, or not at all."""

    motion: str
    gains: ObserverGains
    seed: int
    seconds: int
    noisy: tuple[bool, bool] = (False, False)  # which of the two rays err
    true_start: bool = False


@dataclass(frozen=True)
class DrawnRun:
    """Run from a drawn, known start, as printed with one gain k = k_V = k_Q after the other."""

    sensors: str
    drive: str
    gains: tuple[float, ...]
    seed: int
    seconds: int
    period: float = 0.01  # [s] between readings


def mission_with(sensors: str, quality: RangeQuality, start: Array, period: float = 0.01) -> RangingMission:
    """Mission in the standard field with a start (3,) that is known."""
    angles = tuple(math.radians(angle) for angle in SENSORS[sensors])
    x_1, x_2, phi = start.tolist()
    return RangingMission(STANDARD, angles, ranging=quality, start=KnownStart((x_1, x_2, phi)), period=period)


def first_z(seed: int) -> tuple[Array, Array]:
    """z^(0) (3,) in the vicinity of Psi(x(0)), of which Phi is within the wall, and that pose (3,)."""
    rng, alpha = np.random.default_rng(seed), np.radians(SENSORS["2t"])
    rho, s = STANDARD.ranges(START, alpha)
    while True:
        z: Array = np.append(s, START[2]) + rng.uniform(-VICINITY, VICINITY, 3)
        x: Array = np.append(places(z, rho, alpha).mean(axis=0), z[2])
        if STANDARD.contains(x[:2]):
            return z, x


def places(z: Array, rho: Array, alpha: Array) -> Array:
    """v_i (..., l, 2) [m] of z (..., l + 1): where each ray says that the robot is."""
    beta = z[..., -1:] + alpha
    ray: Array = rho[..., None] * np.stack([np.cos(beta), np.sin(beta)], axis=-1)
    return STANDARD.points(z[..., :-1]) - ray


def from_thesis_start(asked: ThesisRun) -> ObserverRun:
    """Run the observer from the thesis' start."""
    rng = np.random.default_rng(asked.seed).spawn(1)[0]
    z, x = (None, START) if asked.true_start else first_z(asked.seed)
    quality = RangeQuality(NOISE if any(asked.noisy) else 0.0)
    exact = _thesis_truth(asked.motion, asked.seconds)
    run = dataclasses.replace(exact, mission=mission_with("2t", quality, x))
    if any(asked.noisy):
        run = _with_noise(run, np.where(asked.noisy, NOISE, 0.0), rng)
    return follow(run, asked.gains.config(() if z is None else tuple(z.tolist())))


def shown_run(asked: ThesisRun) -> ObserverRun:
    """Run the observer from the thesis' start, for a picture: without the readings."""
    seen = from_thesis_start(asked)
    return dataclasses.replace(seen, run=dataclasses.replace(seen.run, readings=()))


def thesis_verdict(asked: ThesisRun) -> RunErrors:
    """Errors of the observer over the last quarter of a run from the thesis' start."""
    return RunErrors.from_run(from_thesis_start(asked))


def drawn_verdicts(asked: DrawnRun) -> list[RunErrors]:
    """Errors of the observer at each gain."""
    start = drawn_start(STANDARD, np.random.default_rng(asked.seed))
    mission = mission_with(asked.sensors, RangeQuality(), start, asked.period)
    run = exact_run(mission, start, DRIVES[asked.drive], float(asked.seconds))
    return [RunErrors.from_run(follow(run, ObserverGains("none", k, k).config())) for k in asked.gains]


def averaged(asked: ThesisRun) -> tuple[float, float]:
    """[m] RMS error of the position by the mean of all rays, and by those that err alone, from the same z."""
    seen = from_thesis_start(asked)
    rho = np.array([readings[0].value for readings in seen.run.readings[::STRIDE]])
    v = places(seen.z, rho, seen.run.mission.alpha)[seen.last]
    truth = seen.truth[seen.last, None, :2]
    by_mean, by_faulty = v.mean(axis=1, keepdims=True) - truth, v[:, np.array(asked.noisy)] - truth
    return _rms_length(by_mean), _rms_length(by_faulty)


def _rms_length(error: Array) -> float:
    return rms(np.hypot(error[..., 0], error[..., 1]))


@lru_cache(maxsize=8)
def _thesis_truth(motion: str, seconds: int) -> ExactRun:
    return exact_run(mission_with("2t", RangeQuality(), START), START, MOTIONS[motion], float(seconds))


def _with_noise(run: ExactRun, relative: Array, rng: np.random.Generator) -> ExactRun:
    """Scale every range (l,) by a Gaussian of ``relative`` (l,)."""
    factors = 1.0 + relative * rng.standard_normal((len(run.t), len(relative)))
    readings = tuple(
        (Measurement(ranges.name, ranges.t, factor * ranges.value), *rest)
        for factor, (ranges, *rest) in zip(factors, run.readings, strict=True)
    )
    return dataclasses.replace(run, readings=readings)
