"""Figures of a quadrotor's flight: those of any flight, and those of tilt and thrust."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import ATTITUDE, POSITION, VELOCITY
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.flight import Bound, flight_summary, references

_FULL = 1e-3  # share of a rotor's greatest thrust: nearer to a bound it counts as saturated


def point(x: Array) -> Array:
    """Position [m] and velocity [m/s] (n, 6) of states (n, 13) of ``mathnavi.models.quadrotor.dynamics``."""
    return np.hstack([x[:, POSITION], x[:, VELOCITY]])


def tilts(x: Array) -> Array:
    """Tilts (n,) [rad] between the thrust and the vertical at states (n, 13)."""
    _, across, along, _ = x[:, ATTITUDE].T
    angle: Array = np.arccos(np.clip(1.0 - 2.0 * (across**2 + along**2), -1.0, 1.0))
    return angle


def quadrotor_summary(
    recording: Recording,
    name: str,
    mission: QuadrotorMission,
    bound: Bound,
    deadline: float,
    seed: int,
    wall_seconds: float,
) -> dict[str, Any]:
    """Flat summary of one quadrotor's flight, with SI units in the names.

    The figures of any flight are those of ``flight_summary`` over ``mission.flight``. Its clearance is exact for arcs
    of constant acceleration between two samples; a quadrotor's jerk of 100 m/s^3 causes a deviation of 3e-6 m from
    those at 150 samples a second.
    """
    x, t = recording.truths[name], recording.t
    seen = dataclasses.replace(recording, truths={**recording.truths, name: point(x)})
    figures = flight_summary(seen, name, mission.flight, (), bound, deadline, seed, wall_seconds)
    del figures["control_effort"], figures["radar_exposure_s"]  # inputs are thrusts here, and there are no radars
    error = np.linalg.norm((point(x) - references(t, recording.agents[name].plans))[:, :3], axis=1)
    asked = recording.agents[name].commands[: max(1, recording.length - 1)] / mission.vehicle.thrust_max
    return {
        **figures,
        "tracking_error_rms_m": float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else 0.0,
        "tracking_bound_horizontal_m": bound.horizontal,
        "tracking_bound_vertical_m": bound.vertical,
        "tilt_max_deg": float(np.degrees(tilts(x).max())),
        "thrust_mean_share": float(asked.mean()),
        "thrust_max_share": float(asked.max()),
        "saturated_share": float(((asked <= _FULL) | (asked >= 1.0 - _FULL)).mean()),
    }
