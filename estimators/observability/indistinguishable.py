"""Search for states that no input distinguishes, at all or within a time T (Definitions C.1, C.8).

The readings under several inputs are stacked, and the poses with the same readings are searched for: by least squares
from many starts, drawn all over the field; poses that fit are clustered. The poses found are indistinguishable *under
these inputs*; the more exciting the inputs, the fewer poses remain. In a field that m rotations map onto itself m
always remain.

Definition C.8 requires of a state x_1 that for any x_2 and T > 0 an input distinguishes the two by T. As printed it
does not except x_2 = x_1, which no input distinguishes; here x_2 = x_1 is excepted. For the weak property x_2 is in a
neighbourhood of x_1 only.
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
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Integers

_SAME = 1e-4  # clusters are farther apart


@dataclass(frozen=True)
class Indistinguishable:
    """States with the same readings as a given one."""

    states: Array  # (k, 3), that one first
    hits: Integers  # (k,) number of starts from which each was found: if few, others may have been missed


@dataclass(frozen=True)
class SmallTime:
    """Small-time observability at one state and for one T (Definition C.8)."""

    others: Array  # (k, 3) states that none of the inputs distinguishes from x_1 by T
    nearest: float  # to the nearest of them; infinite without one, zero where they reach x_1

    @property
    def observable(self) -> bool:
        """True if x_1 is small-time observable, x_2 = x_1 excepted."""
        return self.nearest == math.inf

    @property
    def weakly_observable(self) -> bool:
        """True if x_1 is weakly small-time observable: no state near x_1 reads the same."""
        return self.nearest > 0.0


def indistinguishable_states(
    outputs: RangeOutputs, x: Array, motions: Sequence[Array], rng: np.random.Generator, starts: int = 200
) -> Indistinguishable:
    """States that read the same as x (3,) [m, m, rad] along every one of ``motions`` (K_j, 3) (Definition C.1).

    If they are not isolated, as in a circle or at rest, each start may end at another one. Raises
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
    """Small-time observability at x (3,) (Definition C.8), and the states that none of ``inputs`` distinguishes from x
    by T [s].

    These are the states that read the same as x under each of the inputs. If x is not isolated among them, the least
    singular value of the outputs' derivative is zero.
    """
    motions = [motion_under(u, T) for u in inputs]
    isolation = np.linalg.svd(outputs.along(x, np.vstack(motions))[1], compute_uv=False)[-1]
    others = indistinguishable_states(outputs, x, motions, rng, starts).states[1:]
    if isolation < DEFICIENT:
        return SmallTime(others, 0.0)
    nearest = min((float(np.linalg.norm(pose_difference(other, x))) for other in others), default=math.inf)
    return SmallTime(others, nearest)
