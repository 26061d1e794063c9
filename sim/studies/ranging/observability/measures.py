"""Measures of observability itself: states that read the same, Proposition C.1, ranks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.observability.continuation import trace_curve
from mathnavi.estimators.observability.feasible_set import feasible_set
from mathnavi.estimators.observability.indistinguishable import indistinguishable_states, small_time
from mathnavi.estimators.observability.lie_derivatives import ControlAffineSystem, codistribution, rank, singular_values
from mathnavi.estimators.observability.output_flow import equal_rates, intersection, mismatch
from mathnavi.estimators.observability.range_outputs import RangeOutputs, motion_under, pose_difference
from mathnavi.estimators.observability.range_system import range_system, ray_ends
from mathnavi.models.field.curve import BEAN, EGG, Curve
from mathnavi.models.textbook.camera_and_flags import camera_and_flags
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.ranging.observability.maps import STANDARD, MapCase, drawn_start, driving, symmetric

WALLS: dict[str, Curve] = {"ellipse": STANDARD, "egg": EGG, "bean": BEAN, "wall of order 3": symmetric(3)}
MOTIONS: dict[str, Array] = {
    "figure of eight": motion_under(driving, 8.0, 17),
    "straight on": motion_under(lambda t: (0.25, 0.0), 1.0, 5),
}


@dataclass(frozen=True)
class Counting:
    """A wall, a set of sensors, a motion, and a true state."""

    wall: str
    sensors: str
    motion: str
    seed: int
    searches: int  # starts of a search for the states that read the same


def counted(counting: Counting) -> tuple[int, int]:
    """Count the states that read the same, and those of them that are images of the truth by the wall's symmetry."""
    rng = np.random.default_rng(counting.seed)
    case = MapCase(counting.wall, 0.0, WALLS[counting.wall], counting.sensors)
    x = drawn_start(case.curve, rng)
    states = indistinguishable_states(case.outputs, x, [MOTIONS[counting.motion]], rng, counting.searches).states
    images = case.curve.images(x)
    known = sum(float(np.linalg.norm(pose_difference(images, state), axis=1).min()) < 1e-4 for state in states)
    return len(states), known


# ---- Proposition C.1


@dataclass(frozen=True)
class PropositionTrial:
    """Condition (C.1) at one state of the standard field under one input, and what it promises."""

    singleton: bool  # FS_y, OF and a neighbourhood have the state alone in common
    weakly_observable: bool  # small-time, under that input
    others: int  # states that the input distinguishes from it nowhere


@dataclass(frozen=True)
class DrawnState:
    """A state of the standard field, and sensors."""

    sensors: str
    seed: int

    @property
    def outputs(self) -> RangeOutputs:
        return MapCase("ellipse", 0.0, STANDARD, self.sensors).outputs


def proposition_tried(drawn: DrawnState) -> tuple[PropositionTrial, PropositionTrial]:
    """Try Proposition C.1 at a state, under an input that is drawn, held for 0.3 s, and standing still."""
    rng, T, outputs = np.random.default_rng(drawn.seed), 0.3, drawn.outputs
    x = drawn_start(STANDARD, rng)
    feasible = feasible_set(outputs, outputs.at(x)[0], step=0.03)

    def tried(u: tuple[float, float]) -> PropositionTrial:
        found = intersection(outputs, x, motion_under(lambda t: u, T), feasible)
        soon = (small_time(outputs, x, T / k, [lambda t: u], rng, starts=10) for k in (1, 10))
        return PropositionTrial(found.is_singleton, all(each.weakly_observable for each in soon), len(found.others))

    return tried((rng.uniform(0.1, 0.8), rng.uniform(-1.5, 1.5))), tried((0.0, 0.0))


def apart_with_equal_rates(drawn: DrawnState) -> float:
    """[m] by how much the output flow over 0.3 s differs, at least, on {Q = 0} farther than 0.1 from the true state.

    NaN where {Q = 0} does not reach as far.
    """
    outputs, u = drawn.outputs, (0.5, 0.5)
    x = drawn_start(STANDARD, np.random.default_rng(drawn.seed))
    curve = trace_curve(equal_rates(outputs, x, u), x, step=0.05, difference=pose_difference)
    motion = motion_under(lambda t: u, 0.3)
    images = STANDARD.images(x)
    far = [p for p in curve.points if np.linalg.norm(pose_difference(images, p), axis=1).min() > 0.1]
    return min((mismatch(outputs, p, x, motion) for p in far), default=math.nan)


# ---- ranks


def least_singular_value(drawn: DrawnState) -> float:
    """[m per m or rad] of h' (l, 3) at a state; nought where l < 3."""
    x = drawn_start(STANDARD, np.random.default_rng(drawn.seed))
    system = range_system(drawn.outputs)
    return float(singular_values(codistribution(system, system.fields, 0), x, ray_ends(drawn.outputs, x))[2])


@dataclass(frozen=True)
class FlagsRank:
    """Example C.2: the rank of d(h, y', ..., y^(order)) under an input that is held."""

    distance_known: bool
    on_axis: bool
    u: tuple[float, float]
    order: int
    rank: int
    least: float  # singular value of those that are not nought


def flags_ranks(poses: int) -> list[FlagsRank]:
    """Ranks at poses drawn off the flags' axis, and on it: the least; the largest where the robot stands."""
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
                    rows.append(FlagsRank(known, on_axis, u, order, ranks[chosen], least))
    return rows


def _flag_states(known: bool, on_axis: bool, poses: int) -> list[Array]:
    """States (3,) or (4,) from which both flags are ahead, where the tangents of the outputs have no poles."""
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
