"""The map decides global convergence: families of walls, and from how many starts an observer converges in them.

    eccentricity   ellipses of c_1 / c_2 = 1.05, ..., 4
    symmetry       theta(s) = (1 + a cos ms) e^{is}, which m rotations map onto itself; an egg for m = 1
    asymmetry      an ellipse that becomes an egg: theta(s) = (a cos s, b sin s) + d (cos 2s, b / a sin 2s)
    sensors        the standard ellipse, and 1 to 8 sensors

all of the area of the standard field. From a start that is drawn the robot drives a figure of eight, its estimator
given another pose that is drawn, without any noise. How well the outputs y(x) of a whole figure of eight fix the state
is measured by ``isolation``, the least singular value of dy/dx.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.observability.range_outputs import Input, RangeOutputs, motion_under
from mathnavi.estimators.observability.region import ConvergenceCriterion, exact_run, region_of_convergence
from mathnavi.models.field.curve import Coefficients, Curve, ellipse
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.models.unicycle.quality import RangeQuality
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.scenarios.ranging_fields import WallFields

HALF_AXES = WallFields().half_axes  # [m]
STANDARD = WallFields().curve()
SENSORS: dict[str, tuple[float, ...]] = {
    "1": (0.0,),
    "2s": (-60.0, 60.0),
    "2t": (-90.0, -45.0),
    "3": (0.0, 120.0, 240.0),
    "4": (0.0, 90.0, 180.0, 270.0),
    "8": tuple(45.0 * k for k in range(8)),
}
"""directions of the sensors off the heading [deg]"""

CONVERGED = ConvergenceCriterion(POSITION, HEADING, LAST)
EXACT = ConvergenceCriterion(1e-3, 1e-3, LAST)  # of an observer that has found the state, not only come near
NEAR = (0.03, 0.03, 0.03)  # [m, m, rad] standard deviations of a first estimate that is nearly right
FIRST_ESTIMATES = 3  # that are tried at a pose to be found exactly
MARGIN = 0.3  # [m] that a run keeps from the wall
AMPLITUDE = 0.15  # a of the walls with a symmetry
EGG_BASE = (1.6, 1.0)  # half-axes of the ellipse that becomes an egg, before it is scaled

ESTIMATORS: dict[str, tuple[str, Mapping[str, Any], RangeQuality]] = {
    "observer": ("range_observer", {"feedforward": "manifold"}, RangeQuality()),
    "fast observer": ("range_observer", {"feedforward": "manifold", "k_v": 100.0, "k_q": 100.0}, RangeQuality()),
    "EKF": ("range_ekf", {}, RangeQuality(relative=0.05)),
}
"""by name: plug-in, fields, and the quality that it believes ranges to have; an EKF that knows the truth, that they are
exact, believes its first guess too much to move"""


def driving(t: float) -> tuple[float, float]:
    """Commands (v, omega) [m/s, rad/s] of a figure of eight of 1.5 m by .55 m in 8 s."""
    return figure_eight(t, 0.5, 8.0)


def standing(t: float) -> tuple[float, float]:
    """Commands of a robot that stands still."""
    return 0.0, 0.0


@dataclass(frozen=True)
class MapCase:
    """A wall of a family, and a set of sensors."""

    family: str
    value: float  # where it stands in its family
    curve: Curve
    sensors: str

    @property
    def outputs(self) -> RangeOutputs:
        return RangeOutputs(self.curve, tuple(math.radians(angle) for angle in SENSORS[self.sensors]))


def eccentric(ratio: float) -> Curve:
    """The ellipse with c_1 / c_2 = ratio and the standard area."""
    c_2 = math.sqrt(HALF_AXES[0] * HALF_AXES[1] / ratio)
    return ellipse(ratio * c_2, c_2)


def symmetric(m: int) -> Curve:
    """(1 + a cos ms) e^{is}, of the standard area, m >= 2: k = 1 + m and 1 - m beside k = 1. An egg for m = 1."""
    if m == 1:
        return egged(0.5)
    return _of_standard_area({1: 1.0, 1 + m: 0.5 * AMPLITUDE, 1 - m: 0.5 * AMPLITUDE}, f"wall of order {m}")


def egged(d: float) -> Curve:
    """(a cos s, b sin s) + d (cos 2s, b / a sin 2s), of the standard area: the larger d, the less symmetric."""
    a, b = EGG_BASE
    mean, difference = 0.5 * (1.0 + b / a), 0.5 * (1.0 - b / a)
    return _of_standard_area(
        {1: a * mean, -1: a * difference, 2: d * mean, -2: d * difference}, f"ellipse and {d:g} of an egg"
    )


def _of_standard_area(c: Mapping[int, float], name: str) -> Curve:
    """theta_x + i theta_y = sum_k c_k e^{iks} with real c_k, scaled."""
    table = np.zeros((max(abs(k) for k in c) + 1, 4))
    for k, value in c.items():
        table[abs(k)] += [value, 0.0, 0.0, value if k > 0 else -value if k < 0 else 0.0]
    scale = math.sqrt(STANDARD.area / Curve(_rows(table), name).area)
    return Curve(_rows(scale * table), name)


def _rows(table: Array) -> Coefficients:
    return tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in table)


FAMILIES: dict[str, tuple[MapCase, ...]] = {
    "eccentricity": tuple(
        MapCase("eccentricity", ratio, eccentric(ratio), sensors)
        for sensors in ("2s", "2t")
        for ratio in (1.05, 1.1, 1.25, 1.5, 2.0, HALF_AXES[0] / HALF_AXES[1], 4.0)
    ),
    "symmetry": tuple(MapCase("symmetry", m, symmetric(m), "2s") for m in (1, 2, 3, 4, 5, 6)),
    "asymmetry": tuple(MapCase("asymmetry", d, egged(d), "2s") for d in (0.0, 0.01, 0.03, 0.1, 0.25, 0.5)),
    "sensors": tuple(MapCase("sensors", len(SENSORS[name]), STANDARD, name) for name in ("1", "2s", "3", "4", "8")),
}


@cache
def driven_path() -> Array:
    """(n, 3) one figure of eight."""
    return motion_under(driving, 8.0, 33)


def drawn_start(curve: Curve, rng: np.random.Generator) -> Array:
    """A pose (3,) from which the figure of eight keeps the margin; ArgumentError if there seems to be none."""
    for _ in range(10_000):
        x = curve.draw(rng, MARGIN)
        c, s = math.cos(x[2]), math.sin(x[2])
        places = x[:2] + driven_path()[:, :2] @ np.array([[c, s], [-s, c]])
        if all(curve.contains(place, MARGIN) for place in places):
            return x
    raise ArgumentError(f"{curve.name}: no figure of eight keeps {MARGIN} m from the wall; allowed: a larger field")


@cache
def spread(curve: Curve) -> tuple[float, float, float]:
    """Standard deviations [m, m, rad] of a pose that may be anywhere."""
    rng = np.random.default_rng(0)
    x_1, x_2, phi = np.std([curve.draw(rng) for _ in range(500)], axis=0)
    return float(x_1), float(x_2), float(phi)


@dataclass(frozen=True)
class Attempt:
    """A start in one map with one estimator."""

    case: MapCase
    estimator: str
    seed: int
    seconds: float  # of the run


def converged(attempt: Attempt) -> bool:
    """Tell whether an estimator finds the true state from anywhere; a seed draws the same for every estimator."""
    case, rng = attempt.case, np.random.default_rng(attempt.seed)
    start, estimate = drawn_start(case.curve, rng), case.curve.draw(rng)
    found = _found(case, attempt.estimator, start, driving, attempt.seconds, [estimate], spread(case.curve), CONVERGED)
    return bool(found[0])


@dataclass(frozen=True)
class NearAttempt:
    """A pose in one map, several first estimates that are nearly right, and whether the robot drives."""

    case: MapCase
    estimator: str
    seed: int
    drives: bool
    seconds: float  # of the run


def found_exactly(attempt: NearAttempt) -> bool:
    """Tell whether the pose is found to 1 mm and 1 mrad, from most of the first estimates.

    One alone may happen to be as near as that on the feasible set, where it stays if nothing distinguishes its states.
    """
    case, rng = attempt.case, np.random.default_rng(attempt.seed)
    start, u = drawn_start(case.curve, rng), driving if attempt.drives else standing
    estimates = [_near(case.curve, start, NEAR, rng) for _ in range(FIRST_ESTIMATES)]
    found = _found(case, attempt.estimator, start, u, attempt.seconds, estimates, NEAR, EXACT)
    return int(found.sum()) > FIRST_ESTIMATES // 2


@cache
def _plugin(name: str) -> Any:
    return load("estimators", name)


def _found(
    case: MapCase,
    estimator: str,
    start: Array,
    u: Input,
    seconds: float,
    estimates: Sequence[Array],
    deviation: tuple[float, float, float],
    criterion: ConvergenceCriterion,
) -> NDArray[np.bool_]:
    """(n,) whether an estimator finds the state of a run from each of the first estimates (n, 3)."""
    name, fields, quality = ESTIMATORS[estimator]
    run = exact_run(RangingMission(case.curve, case.outputs.angles, ranging=quality), start, u, seconds)
    plugin = _plugin(name)
    return region_of_convergence(plugin, plugin.Config(**fields), run, np.array(estimates), deviation, criterion)


@dataclass(frozen=True)
class RegionAttempt:
    """A place of the first estimate, with headings all round, for one run."""

    case: MapCase
    estimator: str
    start: tuple[float, float, float]
    place: tuple[float, float]  # [m]
    headings: int
    seconds: float  # of the run


def share_converged(attempt: RegionAttempt) -> float:
    """Share of the headings at that place from which the true state is found."""
    case, start = attempt.case, np.array(attempt.start)
    turns = 2.0 * math.pi * np.arange(attempt.headings) / attempt.headings
    estimates = [np.array([*attempt.place, turn]) for turn in turns]
    deviation = spread(case.curve)
    found = _found(case, attempt.estimator, start, driving, attempt.seconds, estimates, deviation, CONVERGED)
    return float(found.mean())


def isolation(case: MapCase) -> float:
    """[m per m or rad] the least singular value of a reading's derivative by the state, over a figure of eight.

    The root mean square over the readings; the median over 20 starts.
    """
    values = []
    for seed in range(20):
        _, J = case.outputs.along(drawn_start(case.curve, np.random.default_rng(seed)), driven_path())
        values.append(np.linalg.svd(J, compute_uv=False)[-1] / math.sqrt(len(J)))
    return float(np.median(values))


def _near(curve: Curve, x: Array, deviation: tuple[float, float, float], rng: np.random.Generator) -> Array:
    """A pose (3,) within the wall, off by a Gaussian."""
    while True:
        estimate: Array = x + deviation * rng.standard_normal(3)
        if curve.contains(estimate[:2]):
            return estimate
