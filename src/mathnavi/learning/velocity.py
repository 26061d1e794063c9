"""Flights as a learner finds them easy: observations of order 1 with the target ahead, and velocities as actions.

East, north and up say little to a policy; towards the target, to its left and up say much. All vectors are turned about
the vertical into that frame, lengths go through logarithms, and a policy chooses a velocity v_c, each part of it as a
share of the fastest one. A proportional controller accelerates towards it,

    a = (v_c - v) / τ.

What a policy may choose is thereby always a manner of flying, and never one push after another.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

FEATURES = 42
"""number of features of a flight"""
_PARTS = ("time_left", "velocity", "target", "clearance", "clearance_ahead", "slope_ahead", "horizon")
_SPEED, _LENGTH, _TIME = 100.0, 100.0, 150.0  # [m/s], [m], [s] that stand for 1
_NEAR, _HIGH, _LEVEL = 500.0, 300.0, 50.0  # [m] from the target: distance, height, small height
_HURRY = 3.0  # times ``_SPEED`` from which on the speed that is needed does not matter


@configuration
class VelocityControl:
    """Control of a velocity: the fastest that is chosen along each axis, and the response of the controller."""

    ahead: Positive = 220.0  # [m/s] greatest speed towards the target, and away from it
    aside: Positive = 160.0  # [m/s] greatest speed to the left of that, and to the right
    up: Positive = 100.0  # [m/s] greatest speed up and down
    response: Positive = 2.0  # [s] τ, in which a difference of velocities falls to a third

    @property
    def fastest(self) -> Array:
        """Greatest speeds (3,) [m/s]."""
        return np.array([self.ahead, self.aside, self.up])

    def accelerations(self, actions: Array, observation: Mapping[str, Array]) -> Array:
        """Accelerations (n, 3) [m/s²] in ENU for actions (n, 3) from -1 to 1: velocities over the fastest.

        Raises ArgumentError for an observation that is not one of n flights.
        """
        _check(observation)
        chosen = turned(self.fastest * np.asarray(actions, float), observation["target"], ahead=False)
        found: Array = (chosen - observation["velocity"]) / self.response
        return found

    def actions(self, velocities: Array, observation: Mapping[str, Array]) -> Array:
        """Actions (n, 3) from -1 to 1 that choose velocities (n, 3) [m/s] in ENU, clipped to the fastest."""
        _check(observation)
        return np.clip(turned(velocities, observation["target"], ahead=True) / self.fastest, -1.0, 1.0)


def features(observation: Mapping[str, Array]) -> Array:
    """Features (n, 42) of order 1, float32, of the observations of n flights.

    In turn: velocity (3), distance (2), height of the target (2), speed that is needed to be there in time (1), time
    that is left (1), heights over the ground below (1), ahead (4) and around (24), and slopes ahead (4). All vectors
    are in the frame in which the target lies ahead. ArgumentError for an observation that is not one of n flights.
    """
    _check(observation)
    target = observation["target"]
    distance = np.hypot(target[:, 0], target[:, 1])[:, np.newaxis]
    needed = distance / np.maximum(observation["time_left"], 1.0)
    heights = (
        observation["clearance"],
        observation["clearance_ahead"],
        observation["horizon"].reshape(len(target), -1),
    )
    return np.concatenate(
        [
            turned(observation["velocity"], target, ahead=True) / _SPEED,
            np.log1p(distance / _LENGTH) / 3.0,
            np.tanh(distance / _NEAR),
            target[:, 2:] / _HIGH,
            np.tanh(target[:, 2:] / _LEVEL),
            np.clip(needed / _SPEED, 0.0, _HURRY),
            observation["time_left"] / _TIME,
            *(np.arcsinh(height / _LENGTH) for height in heights),
            observation["slope_ahead"],
        ],
        axis=1,
    ).astype(np.float32)


def turned(vectors: Array, target: Array, *, ahead: bool) -> Array:
    """Vectors (n, 3) turned about the vertical: from ENU into the frame with ``target`` (n, 3) ahead, or back."""
    angle = (-1.0 if ahead else 1.0) * np.arctan2(target[:, 1], target[:, 0])
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = vectors.T
    return np.stack([c * x - s * y, s * x + c * y, z], axis=1)


def _check(observation: Mapping[str, Array]) -> None:
    """Raise ArgumentError for what is not an observation of n flights."""
    missing = [name for name in _PARTS if name not in observation]
    if missing or np.ndim(observation["target"]) != 2 or np.shape(observation["target"])[1] != 3:
        what = f"without {', '.join(missing)}" if missing else f"with target {np.shape(observation['target'])}"
        raise ArgumentError(f"observation {what}; allowed: {', '.join(_PARTS)} of n flights, with target (n, 3)")
