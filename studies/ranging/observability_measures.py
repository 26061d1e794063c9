"""Measures of the study ``observability``: convergence by wall, indistinguishable states, ranks and Gramians.

Global convergence depends on the map. It is measured in families of walls,

    eccentricity   ellipses of c_1 / c_2 = 1.05, ..., 4
    symmetry       theta(s) = (1 + a cos ms) e^{is}, which m rotations map onto itself; an egg for m = 1
    asymmetry      an ellipse that becomes an egg: theta(s) = (a cos s, b sin s) + d (cos 2s, b / a sin 2s)
    sensors        the standard ellipse, and 1 to 8 sensors

all of the area of the standard field. From a drawn start the robot drives a figure of eight without noise; its
estimator starts from another drawn pose. ``isolation``, the least singular value of dy/dx, measures how well the
outputs y(x) of a whole figure of eight determine the state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.observability.continuation import trace_curve
from mathnavi.estimators.observability.feasible_set import feasible_set
from mathnavi.estimators.observability.lie_derivatives import (
    ControlAffineSystem,
    codistribution,
    range_system,
    rank,
    ray_ends,
    singular_values,
)
from mathnavi.estimators.observability.output_flow import (
    equal_rates,
    indistinguishable_states,
    intersection,
    mismatch,
    small_time,
)
from mathnavi.estimators.observability.range_outputs import Input, RangeOutputs, motion_under, pose_difference
from mathnavi.estimators.observability.region import ConvergenceCriterion, exact_run, region_of_convergence
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN, EGG, Coefficients, Curve, ellipse
from mathnavi.models.textbook.library import camera_and_flags
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.patterns import figure_eight
from mathnavi.models.unicycle.quality import RangeQuality
from mathnavi.sim.metrics.convergence import LAST
from mathnavi.sim.metrics.observability import EmpiricalGramian, empirical_gramian
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.scenarios.range_localisation import VEHICLE as ROBOT
from mathnavi.sim.scenarios.ranging_fields import WallFields
from mathnavi.sim.scenarios.safe_flight import VEHICLE as AIRCRAFT
from mathnavi.sim.scenarios.textbook import VEHICLE as CAMERA
from mathnavi.sim.sweep.trial import trial

HALF_AXES = WallFields().half_axes  # [m]
STANDARD = ellipse(*HALF_AXES)
SENSORS: dict[str, tuple[float, ...]] = {
    "1": (0.0,),
    "2s": (-60.0, 60.0),
    "2t": (-90.0, -45.0),
    "3": (0.0, 120.0, 240.0),
    "4": (0.0, 90.0, 180.0, 270.0),
    "8": tuple(45.0 * k for k in range(8)),
}
"""directions of the sensors relative to the heading [deg], by name of the set"""
THESIS_START = np.array([1.0, -1.0, 0.5 * math.pi])  # x(0) of C.5

CONVERGED = ConvergenceCriterion(POSITION, HEADING, LAST)
EXACT = ConvergenceCriterion(1e-3, 1e-3, LAST)  # of an observer that has found the state, not only come near
NEAR = (0.03, 0.03, 0.03)  # [m, m, rad] standard deviations of a first estimate that is nearly right
FIRST_ESTIMATES = 3  # that are tried at a pose to be found exactly
MARGIN = 0.3  # [m] that a run keeps from the wall
AMPLITUDE = 0.15  # a of the walls with a symmetry
EGG_BASE = (1.6, 1.0)  # half-axes of the ellipse that becomes an egg, before it is scaled
DEVIATION = 0.05  # of a reading, in its own unit, where all sensors of a scenario are alike
GRAMIAN_SEED = 2

ESTIMATORS: dict[str, tuple[str, Mapping[str, Any], RangeQuality]] = {
    "observer": ("range_observer", {"feedforward": "manifold"}, RangeQuality()),
    "fast observer": ("range_observer", {"feedforward": "manifold", "k_v": 100.0, "k_q": 100.0}, RangeQuality()),
    "EKF": ("range_ekf", {}, RangeQuality(relative=0.05)),
}
"""estimators by name: plug-in, fields, and the assumed quality of ranges; an EKF that assumes exact ranges, as they
are, trusts its first estimate too much to converge"""


def driving(t: float) -> tuple[float, float]:
    """Return commands (v, omega) [m/s, rad/s] of a figure of eight of 1.5 m by 0.55 m in 8 s."""
    return figure_eight(t, 0.5, 8.0)


def standing(t: float) -> tuple[float, float]:
    """Return the commands (v, omega) [m/s, rad/s] of a robot that stands still."""
    return 0.0, 0.0


def outputs_of(curve: Curve, sensors: str) -> RangeOutputs:
    """Return the ranges of a set of sensors within a wall."""
    return RangeOutputs(curve, tuple(math.radians(angle) for angle in SENSORS[sensors]))


@dataclass(frozen=True)
class MapCase:
    """A wall of a family, and a set of sensors."""

    family: str
    value: float  # where it stands in its family
    curve: Curve
    sensors: str

    @property
    def outputs(self) -> RangeOutputs:
        return outputs_of(self.curve, self.sensors)


def eccentric(ratio: float) -> Curve:
    """Return the ellipse with c_1 / c_2 = ratio and the standard area."""
    c_2 = math.sqrt(HALF_AXES[0] * HALF_AXES[1] / ratio)
    return ellipse(ratio * c_2, c_2)


def symmetric(m: int) -> Curve:
    """Return (1 + a cos ms) e^{is} of the standard area, m >= 2, with modes k = 1, 1 + m, 1 - m; an egg for m = 1."""
    if m == 1:
        return egged(0.5)
    return _of_standard_area({1: 1.0, 1 + m: 0.5 * AMPLITUDE, 1 - m: 0.5 * AMPLITUDE}, f"wall of order {m}")


def egged(d: float) -> Curve:
    """Return (a cos s, b sin s) + d (cos 2s, b / a sin 2s), of the standard area: the larger d, the less symmetric."""
    a, b = EGG_BASE
    mean, difference = 0.5 * (1.0 + b / a), 0.5 * (1.0 - b / a)
    return _of_standard_area(
        {1: a * mean, -1: a * difference, 2: d * mean, -2: d * difference}, f"ellipse and {d:g} of an egg"
    )


def _of_standard_area(c: Mapping[int, float], name: str) -> Curve:
    """Return theta_x + i theta_y = sum_k c_k e^{iks} with real c_k, scaled to the standard area."""
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
WALLS: dict[str, Curve] = {"ellipse": STANDARD, "egg": EGG, "bean": BEAN, "wall of order 3": symmetric(3)}
MOTIONS: dict[str, Array] = {
    "figure of eight": motion_under(driving, 8.0, 17),
    "straight on": motion_under(lambda t: (0.25, 0.0), 1.0, 5),
}


# ---- starts, and convergence from them


@cache
def driven_path() -> Array:
    """Return poses (n, 3) [m, m, rad] of one figure of eight."""
    return motion_under(driving, 8.0, 33)


def drawn_start(curve: Curve, rng: np.random.Generator) -> Array:
    """Draw a pose (3,) from which the figure of eight keeps the margin; ArgumentError if none is found."""
    for _ in range(10_000):
        x = curve.draw(rng, MARGIN)
        c, s = math.cos(x[2]), math.sin(x[2])
        places = x[:2] + driven_path()[:, :2] @ np.array([[c, s], [-s, c]])
        if all(curve.contains(place, MARGIN) for place in places):
            return x
    raise ArgumentError(f"{curve.name}: no figure of eight keeps {MARGIN} m from the wall; allowed: a larger field")


@cache
def spread(curve: Curve) -> tuple[float, float, float]:
    """Return the standard deviations [m, m, rad] of a pose that may be anywhere in the field."""
    rng = np.random.default_rng(0)
    x_1, x_2, phi = np.std([curve.draw(rng) for _ in range(500)], axis=0)
    return float(x_1), float(x_2), float(phi)


def converged(seed: int, case: MapCase, estimator: str, seconds: float) -> bool:
    """A job: whether an estimator finds the true state from anywhere; a seed draws the same for every estimator."""
    rng = np.random.default_rng(seed)
    start, estimate = drawn_start(case.curve, rng), case.curve.draw(rng)
    return bool(_found(case, estimator, start, driving, seconds, [estimate], spread(case.curve), CONVERGED)[0])


def share_converged(
    place: tuple[float, float], case: MapCase, estimator: str, start: Array, headings: int, seconds: float
) -> float:
    """A job: share of headings of a first estimate at a position [m] from which a run from ``start`` (3,) is found."""
    estimates = [np.array([*place, turn]) for turn in 2.0 * math.pi * np.arange(headings) / headings]
    return float(_found(case, estimator, start, driving, seconds, estimates, spread(case.curve), CONVERGED).mean())


def found_exactly(seed: int, sensors: str, drives: bool, seconds: float) -> bool:
    """A job: whether the fast observer finds a pose of the standard ellipse to 1 mm and 1 mrad.

    It must do so from most of several first estimates near the truth, for a single one may happen to lie that near on
    the feasible set, where it stays if nothing distinguishes the states.
    """
    case, rng = MapCase("ellipse", 0.0, STANDARD, sensors), np.random.default_rng(seed)
    start, u = drawn_start(case.curve, rng), driving if drives else standing
    estimates = [_near(case.curve, start, NEAR, rng) for _ in range(FIRST_ESTIMATES)]
    found = _found(case, "fast observer", start, u, seconds, estimates, NEAR, EXACT)
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
    """Tell (n,) whether an estimator finds the state of a run from each of the first estimates (n, 3)."""
    name, fields, quality = ESTIMATORS[estimator]
    run = exact_run(RangingMission(case.curve, case.outputs.angles, ranging=quality), start, u, seconds)
    plugin = _plugin(name)
    return region_of_convergence(plugin, plugin.Config(**fields), run, np.array(estimates), deviation, criterion)


def _near(curve: Curve, x: Array, deviation: tuple[float, float, float], rng: np.random.Generator) -> Array:
    """Draw a pose (3,) within the wall from a Gaussian about x (3,)."""
    while True:
        estimate: Array = x + deviation * rng.standard_normal(3)
        if curve.contains(estimate[:2]):
            return estimate


def isolation(case: MapCase) -> float:
    """A job: least singular value [m per m or rad] of the derivative of the readings of a figure of eight by the state.

    It is the root mean square over the readings, and the median over 20 starts.
    """
    values = []
    for seed in range(20):
        _, J = case.outputs.along(drawn_start(case.curve, np.random.default_rng(seed)), driven_path())
        values.append(np.linalg.svd(J, compute_uv=False)[-1] / math.sqrt(len(J)))
    return float(np.median(values))


# ---- states that read the same, Proposition C.1


def counted(seed: int, wall: str, sensors: str, motion: str, searches: int) -> tuple[int, int]:
    """A job: numbers of states with the same outputs, and of those that are images of the truth by the wall's symmetry.

    The search for them has ``searches`` starts.
    """
    rng, curve = np.random.default_rng(seed), WALLS[wall]
    x = drawn_start(curve, rng)
    states = indistinguishable_states(outputs_of(curve, sensors), x, [MOTIONS[motion]], rng, searches).states
    images = curve.images(x)
    known = sum(float(np.linalg.norm(pose_difference(images, state), axis=1).min()) < 1e-4 for state in states)
    return len(states), known


@dataclass(frozen=True)
class PropositionTrial:
    """Condition (C.1) at one state of the standard field under one input, and its consequence."""

    singleton: bool  # FS_y, OF and a neighbourhood have the state alone in common
    weakly_observable: bool  # small-time, under that input
    others: int  # states that the input distinguishes from it nowhere


def proposition_tried(seed: int, sensors: str) -> tuple[PropositionTrial, PropositionTrial]:
    """A job: tests of Proposition C.1 at a state, under a drawn input held for 0.3 s, and standing still."""
    rng, T, outputs = np.random.default_rng(seed), 0.3, outputs_of(STANDARD, sensors)
    x = drawn_start(STANDARD, rng)
    feasible = feasible_set(outputs, outputs.at(x)[0], step=0.03)

    def tried(u: tuple[float, float]) -> PropositionTrial:
        found = intersection(outputs, x, motion_under(lambda t: u, T), feasible)
        soon = (small_time(outputs, x, T / k, [lambda t: u], rng, starts=10) for k in (1, 10))
        return PropositionTrial(found.is_singleton, all(each.weakly_observable for each in soon), len(found.others))

    return tried((rng.uniform(0.1, 0.8), rng.uniform(-1.5, 1.5))), tried((0.0, 0.0))


def apart_with_equal_rates(seed: int, sensors: str) -> float:
    """A job: least difference [m] of the output flow over 0.3 s, on {Q = 0} farther than 0.1 from the true state.

    NaN if {Q = 0} does not reach that far.
    """
    outputs, u = outputs_of(STANDARD, sensors), (0.5, 0.5)
    x = drawn_start(STANDARD, np.random.default_rng(seed))
    curve = trace_curve(equal_rates(outputs, x, u), x, step=0.05, difference=pose_difference)
    motion = motion_under(lambda t: u, 0.3)
    images = STANDARD.images(x)
    far = [p for p in curve.points if np.linalg.norm(pose_difference(images, p), axis=1).min() > 0.1]
    return min((mismatch(outputs, p, x, motion) for p in far), default=math.nan)


# ---- ranks


def least_singular_value(seed: int, sensors: str) -> float:
    """A job: least singular value [m per m or rad] of h' (l, 3) at a state; zero if l < 3."""
    x = drawn_start(STANDARD, np.random.default_rng(seed))
    outputs = outputs_of(STANDARD, sensors)
    system = range_system(outputs)
    return float(singular_values(codistribution(system, system.fields, 0), x, ray_ends(outputs, x))[2])


def flags_ranks(poses: int) -> list[dict[str, Any]]:
    """A job: rows of Example C.2 with the rank of d(h, y', ..., y^(order)) under a constant input.

    The rank is the least over poses drawn off the flags' axis, and on it; for a robot at rest it is the largest. Rows
    also contain the least singular value that is not zero.
    """
    rows = []
    for known in (True, False):
        textbook = camera_and_flags(known)
        system = ControlAffineSystem.from_functions(textbook.f, textbook.h, len(textbook.states), len(textbook.inputs))
        for u in ((0.0, 0.0), (0.0, 0.6), (0.3, 0.0), (0.3, 0.6)):
            for order in (1, 2):
                differentials = codistribution(system, [system.held(u)], order)
                for on_axis in (False, True):
                    states = _flag_states(known, on_axis, poses)
                    ranks = [rank(differentials, x) for x in states]
                    chosen = int(np.argmin(ranks) if u[0] else np.argmax(ranks))
                    least = float(singular_values(differentials, states[chosen])[ranks[chosen] - 1])
                    rows.append({
                        "what": "two flags", "d_0_known": known, "on_axis": on_axis, "u_1": u[0], "u_2": u[1],
                        "order": order, "rank": ranks[chosen], "least_singular_value": least,
                    })  # fmt: skip
    return rows


def _flag_states(known: bool, on_axis: bool, poses: int) -> list[Array]:
    """Return states (3,) or (4,) from which both flags are ahead, so that the tangents of the outputs have no poles."""
    states = []
    for rng in np.random.default_rng(0).spawn(poses):
        d_0 = 4.0
        if on_axis:
            x = np.array([rng.uniform(-4.0, -0.5), 0.0, 0.0])
        else:
            place = np.array([rng.uniform(-1.0, 5.0), rng.uniform(-5.0, -1.0)])
            ahead = np.array([0.5 * d_0, 0.0]) - place
            x = np.array([*place, math.atan2(ahead[1], ahead[0]) + rng.uniform(-0.2, 0.2)])
        states.append(x if known else np.append(x, d_0))
    return states


# ---- empirical Gramians of scenarios


@dataclass(frozen=True)
class GramianCase:
    """Scenario of an empirical Gramian, with its commands and the perturbed components of its state."""

    scenario: str
    described: str  # as in a table
    estimator: str  # whose sensors are carried
    fields: Mapping[str, Any]
    vehicle: str
    input_at: Callable[[float], Sequence[float]]  # t [s] to u (nu,)
    period: float  # [s] over which an input is held
    duration: float  # [s]
    deltas: Mapping[str, float]  # by component of the state
    deviations: Mapping[str, float]  # by sensor

    def gramian(self) -> EmpiricalGramian:
        """Return the Gramian W of the readings over the run, in units of their standard deviations."""
        wanted = trial(self.scenario, GRAMIAN_SEED, estimator=self.estimator, fields=self.fields)
        n = round(self.duration / self.period)
        commands = np.array([self.input_at((k + 0.5) * self.period) for k in range(n)])
        return empirical_gramian(
            lambda: wanted.build().plant,
            self.vehicle,
            {self.vehicle: commands},
            round(self.period / wanted.build().plant.dt),
            self.deltas,
            self.deviations,
        )


def observability_gramian(number: int) -> dict[str, Any]:
    """A job: row of the Gramian of one of ``GRAMIANS``, with the number of unobservable directions of the start.

    Without any it contains the standard deviation along the least observable direction; an unobservable direction has
    the eigenvalue zero.
    """
    case = GRAMIANS[number]
    gramian = case.gramian()
    scales = np.ones(len(gramian.names))
    values, vectors = np.linalg.eigh(gramian.scaled(scales))
    unseen = len(gramian.unseen(scales))
    return {
        "what": "empirical Gramian", "scenario": case.scenario, "run": case.described, "unseen": unseen,
        "largest_deviation": None if unseen else float(1.0 / np.sqrt(values[0])),
        "worst": _named(vectors[:, 0], gramian.names),
    }  # fmt: skip


def _named(direction: Array, names: Sequence[str]) -> str:
    """Return the larger components of a direction, as text."""
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    large = [(sign * float(part), name.partition(" ")[0]) for part, name in zip(direction, names, strict=True)]
    return " ".join(f"{part:+.2f} {name.removeprefix('position_')}" for part, name in large if abs(part) > 0.1)


def _robot(sensors: str, moves: bool) -> GramianCase:
    deltas = {"position_x_1 [m]": 1e-4, "position_x_2 [m]": 1e-4, "position_phi [rad]": 1e-4}
    return GramianCase(
        "range-localisation",
        f"{len(SENSORS[sensors])} range sensor{'s' if len(SENSORS[sensors]) > 1 else ''}, "
        f"{'figure of eight' if moves else 'standing still'}, 2 s",
        "range_observer",
        {"sensors": SENSORS[sensors]},
        ROBOT,
        driving if moves else standing,
        0.01,
        2.0,
        deltas,
        {"ranges": DEVIATION},
    )


def _camera(distance_known: bool, u: tuple[float, float], described: str) -> GramianCase:
    deltas = {"x_1 [m]": 1e-4, "x_2 [m]": 1e-4, "phi [rad]": 1e-4} | ({} if distance_known else {"d_0 [m]": 1e-4})
    return GramianCase(
        "textbook-observer",
        f"Example C.2, d_0 {'known' if distance_known else 'unknown'}, {described}, 2 s",
        "textbook_ekf",
        {"system": "camera-and-flags", "distance_known": distance_known},
        CAMERA,
        lambda t: u,
        0.01,
        2.0,
        deltas,
        {"output": DEVIATION},
    )


def _aircraft(estimator: str, described: str, deviations: Mapping[str, float]) -> GramianCase:
    names = [f"{what}_{axis} [{unit}]" for what, unit in (("position", "m"), ("velocity", "m/s")) for axis in "xyz"]
    return GramianCase(
        "safe-flight",
        f"{described}, gusts, 20 s",
        estimator,
        {"noise.position": 5.0, "faults.gust_rms": 1.0},
        AIRCRAFT,
        lambda t: (0.0, 0.0, 0.0),
        1.0 / 60.0,
        20.0,
        dict.fromkeys(names, 1.0),
        deviations,
    )


GRAMIANS: tuple[GramianCase, ...] = (
    *(_robot(sensors, moves) for sensors in ("1", "2s", "3") for moves in (False, True)),
    *(
        _camera(known, u, described)
        for known in (True, False)
        for u, described in (((0.0, 0.6), "turning on the spot"), ((0.3, 0.0), "straight on"))
    ),
    _aircraft("kalman", "position fixes of 5 m, 10 a second", {"position": 5.0}),
)
