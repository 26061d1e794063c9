"""Outlines around a pose on the floor, as points (n, 2) [m]."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.entity import RADIUS

_FINEST = 0.004  # [m] between two points of an ellipse
_MOST, _LEAST = 56, 10  # points of one
_STEP = math.radians(5.0)  # between two points of a fan's arc
_NOSE = math.radians(38.0)  # off the heading, where the outline of a robot leaves its circle for its nose
_REACH = 1.45  # radii from the middle to the tip of the nose


def outline(pose: Array) -> Array:
    """A robot at a pose (3,) from above: its bumper, pointed where it is headed."""
    angles = pose[2] + np.linspace(_NOSE, 2.0 * math.pi - _NOSE, 33)
    tip = _REACH * RADIUS * _towards(np.array([pose[2]]))
    return pose[:2] + np.vstack([tip, RADIUS * _towards(angles), tip])


def half_axes(covariance: Array, deviations: float) -> tuple[Array, float]:
    """Return the half-axes (2,) [m] and the direction [rad] of the first one, of an ellipse of some standard
    deviations.
    """
    values, vectors = np.linalg.eigh(0.5 * (covariance[:2, :2] + covariance[:2, :2].T))
    return deviations * np.sqrt(np.maximum(values, 0.0)), math.atan2(vectors[1, 0], vectors[0, 0])


def ellipse(place: Array, axes: Array, direction: float) -> Array:
    """The outline about a place (2,) with half-axes (2,) [m], the first at ``direction`` [rad]; closed."""
    around = 2.0 * math.pi * float(np.max(axes))
    angles = np.linspace(0.0, 2.0 * math.pi, 1 + int(np.clip(around / _FINEST, _LEAST, _MOST)))
    c, s = math.cos(direction), math.sin(direction)
    points = np.column_stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)])
    outline: Array = place + points @ np.array([[c, s], [-s, c]])
    return outline


def fan(pose: Array, half_angle: float, radius: float) -> Array:
    """The sector of headings within ``half_angle`` [rad] of a pose's (3,); a circle if that is all of them."""
    if half_angle >= math.pi:
        return ellipse(pose[:2], np.full(2, radius), 0.0)
    angles = pose[2] + np.linspace(-half_angle, half_angle, 2 + math.ceil(2.0 * half_angle / _STEP))
    return np.vstack([pose[:2], pose[:2] + radius * _towards(angles), pose[:2]])


def _towards(angles: Array) -> Array:
    """(n, 2) unit vectors."""
    return np.column_stack([np.cos(angles), np.sin(angles)])
