"""States that no input distinguishes, counted, and states that none distinguishes soon (Definitions C.1, C.8).

What the robot reads under several inputs is stacked, and every pose that reads the same is searched: least squares
from many starts, drawn all over the field, and what fits is clustered. As many poses as are found are indistinguishable
*under these inputs*; the more they excite, the less they leave. In a field that m rotations map onto itself m always
remain.

Definition C.8 asks of a state x_1 that for any x_2 and T > 0 an input distinguishes the two by T. As printed x_2 =
x_1 is not excepted, and no input does; here it is. Weakly, x_2 is searched in a neighbourhood of x_1 only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.observability.range_outputs import (
    DEFICIENT,
    Input,
    RangeOutputs,
    different_poses,
    motion_under,
    pose_difference,
)
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.signals import Array, Integers

_SAME = 1e-4  # clusters are farther apart


@dataclass(frozen=True)
class Indistinguishable:
    """The states that read the same as one of them."""

    states: Array  # (k, 3), that one first
    hits: Integers  # (k,) from how many of the starts each was found: one that is hardly hit may have missed peers


@dataclass(frozen=True)
class SmallTime:
    """Small-time observability at one state and for one T (Definition C.8)."""

    others: Array  # (k, 3) states that none of the inputs distinguishes from x_1 by T
    nearest: float  # to the nearest of them; infinite without one, zero where they reach x_1

    @property
    def observable(self) -> bool:
        """Small-time observable, x_2 = x_1 excepted."""
        return self.nearest == math.inf

    @property
    def weakly_observable(self) -> bool:
        """Weakly small-time observable: no state near x_1 reads the same."""
        return self.nearest > 0.0


def indistinguishable_states(
    outputs: RangeOutputs, x: Array, motions: Sequence[Array], rng: np.random.Generator, starts: int = 200
) -> Indistinguishable:
    """States that read the same as x (3,) [m, m, rad] along every one of ``motions`` (K_j, 3) (Definition C.1).

    Where they are not isolated, in a circle or standing still, each of the starts may end at another one. Raises
    ArgumentError where a motion from x leaves the field.
    """
    motion = np.vstack(motions)
    y, _ = outputs.along(x, motion)
    if not np.isfinite(y).all():
        raise ArgumentError(f"x = {np.asarray(x).tolist()}: a motion leaves the field; allowed: ones within it")
    found = [pose for _ in range(starts) if (pose := outputs.fit(y, outputs.curve.draw(rng), motion)) is not None]
    states = different_poses(np.array([np.asarray(x, np.float64), *found]), _SAME)
    hits = np.zeros(len(states), dtype=np.int64)
    for pose in found:
        hits[np.argmin(np.linalg.norm(pose_difference(states, pose), axis=1))] += 1
    return Indistinguishable(states, hits)


def small_time(
    outputs: RangeOutputs,
    x: Array,
    T: float,
    inputs: Sequence[Input],
    rng: np.random.Generator,
    starts: int = 200,
) -> SmallTime:
    """Definition C.8 at x (3,), its input chosen among ``inputs``: which states none of them distinguishes by T [s].

    Two states that read the same under each of them have a largest difference of zero, so it is they that are searched
    for. That x is not isolated among them is read off the outputs' derivative: its least singular value is zero.
    """
    motions = [motion_under(u, T) for u in inputs]
    isolation = np.linalg.svd(outputs.along(x, np.vstack(motions))[1], compute_uv=False)[-1]
    others = indistinguishable_states(outputs, x, motions, rng, starts).states[1:]
    if isolation < DEFICIENT:
        return SmallTime(others, 0.0)
    nearest = min((float(np.linalg.norm(pose_difference(other, x))) for other in others), default=math.inf)
    return SmallTime(others, nearest)
