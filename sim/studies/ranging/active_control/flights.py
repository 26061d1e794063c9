"""Runs of the study ``active-control``, and their measures.

Every mode of active sensing drives the same robot from the same starts: two sensors at ±60°, 5 % range noise, and an
EKF that knows the start with standard deviations of .3 m and .3 rad. Starts are drawn uniformly among the poses from
which every fixed pattern keeps the margin for as long as is flown; the start, its known part and the noise are those of
the seed, whatever drives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from mathnavi.controllers.active_sensing.plugin import PATTERNS, ActiveSensing
from mathnavi.controllers.active_sensing.policies import path
from mathnavi.controllers.active_sensing.then_track import ReferencePath
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.ranging import RangingErrors, rms
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.scenarios.range_localisation import VEHICLE
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig, WallFields
from mathnavi.sim.sweep.trial import Trial, trial

WALL = WallFields().curve()
LIMIT = 0.15  # [m] of the position error
LIMITS = (LIMIT, 0.1)  # [m] of the root mean square position error, with the pose known
SLOW, FAST = 0.15, 1.0  # [rad/s] bounds of the turn rate
START_ERROR = (0.3, 0.3, math.degrees(0.3))  # [m, m, deg] of what is known of the start
OFTEN = 0.2  # [s] between what is kept of a run
MODES = ("active", "singular-value", "circle", "figure-eight", "straight", "random", "still")
COMPARED = ("active", "circle", "random")  # that the target speaks of
AT_ONCE, SENSES_FIRST = "tracks at once", "senses first"
TRACKS = (AT_ONCE, SENSES_FIRST)

PATH: dict[str, Any] = {"then": "figure-eight", "speed": 0.3, "cycle": 16.0}  # [m/s], [s]: what is kept

_DRIVEN: Mapping[str, Mapping[str, float]] = {"figure-eight": {"speed": 0.08}, "straight": {"speed": 0.5, "cycle": 4.0}}
_CIRCLES = {SLOW: 0.1, FAST: 0.5}  # [m/s]: of radii .67 m and .5 m, the field being 2.83 m wide
_EIGHT_SPAN = 15.111  # [rad] cycle times turn rate of a figure of eight, a little more than 2 pi times J_0's first zero
_SLIPPERY: Mapping[str, float] = {"friction": 0.1, "speed_max": 0.6, "turn_rate_max": 1.2}
_NEVER_UNSURE = 100.0, math.pi  # [m, rad]
_STEP = 0.05  # [s] between poses at which a pattern's clearance is evaluated


def fields_of(mode: str, turn_rate: float) -> dict[str, float]:
    """Fields of the planner: the patterns turn as fast as the robot can, the line comes back every 4 s."""
    if mode == "circle":
        return {"speed": _CIRCLES[turn_rate], "cycle": 2.0 * math.pi / turn_rate}
    if mode == "figure-eight":
        return {**_DRIVEN[mode], "cycle": _EIGHT_SPAN / turn_rate}
    return dict(_DRIVEN.get(mode, {}))


@dataclass(frozen=True)
class LocalisationRun:
    """A run of a robot that drives by one mode."""

    mode: str
    turn_rate: float  # [rad/s]
    seed: int
    seconds: float

    @property
    def trial(self) -> Trial:
        planner = {"mode": self.mode, **fields_of(self.mode, self.turn_rate)}
        if self.mode == "random":
            planner["seed"] = 1 + self.seed
        fields = {
            "turn_rate_max": self.turn_rate,
            "duration": self.seconds,
            "start": start(self.turn_rate, self.seconds, self.seed),
            "start_known": True,
            "start_error": START_ERROR,
            **{f"planner.{name}": value for name, value in planner.items()},
        }
        return trial(
            "range-localisation", self.seed, estimator="range_ekf", fields=fields, measure=f"{__name__}:course"
        )


def tracking(kind: str, seed: int, seconds: float) -> Trial:
    """A differential drive on a slippery floor that is to keep a figure of eight, from a start it does not know."""
    sure = {} if kind == SENSES_FIRST else dict(zip(("sure_position", "sure_heading"), _NEVER_UNSURE, strict=True))
    planner = {f"planner.{name}": value for name, value in {**PATH, **sure}.items()}
    fields = {"drive": "differential", **_SLIPPERY, "duration": seconds, **planner}
    return trial("range-localisation", seed, fields=fields, measure=f"{__name__}:tracked")


@cache
def start(turn_rate: float, seconds: float, seed: int) -> tuple[float, float, float]:
    """X Y HEADING [m, m, deg]."""
    margin, rng = RangeLocalisationConfig().margin, np.random.default_rng(seed)
    paths = _pattern_paths(turn_rate, seconds)
    while True:
        x, y, phi = WALL.draw(rng, margin)
        c, s = math.cos(phi), math.sin(phi)
        places = paths @ np.array([[c, s], [-s, c]]) + [x, y]
        if all(WALL.contains(place, margin) for place in places):
            return float(x), float(y), math.degrees(phi)


@cache
def _pattern_paths(turn_rate: float, seconds: float) -> Array:
    """(n, 2) places to which the fixed patterns lead from the origin, from the farthest to the nearest."""
    steps = round(seconds / _STEP) + 1
    pattern = (PATTERNS[m](ActiveSensing.Config(mode=m, **fields_of(m, turn_rate))) for m in MODES if m in PATTERNS)  # type: ignore[arg-type]
    places = np.vstack([path(one, np.zeros(3), _STEP)[:steps:4, :2] for one in pattern])
    farthest: Array = places[np.argsort(-np.linalg.norm(places, axis=1))]
    return farthest


def course(outcome: RunResult) -> dict[str, Any]:
    """A measure: the last instant with an error above the limit, and error and place every fifth of a second."""
    errors = _errors(outcome)
    above = np.flatnonzero(~(errors.position <= LIMIT))
    kept = _kept(outcome)
    return {
        "last_above_s": float(errors.t[above[-1]]) if len(above) else 0.0,
        "errors_m": errors.position[kept].tolist(),
        "places_m": outcome.recording.truths[VEHICLE][kept, :2].tolist(),
    }


def tracked(outcome: RunResult) -> dict[str, Any]:
    """A measure of a run that keeps a path: how far off it is, and how far the wheels slipped."""
    recording = outcome.recording
    fields, mission = outcome.config["controller"]["fields"], RangingMission(WALL, (0.0,))
    reference = ReferencePath(PATTERNS[fields["then"]](ActiveSensing.Config(**fields)), mission).poses[:, :2]
    truth = recording.truths[VEHICLE]
    error = np.array([np.linalg.norm(reference - place, axis=1).min() for place in truth[:, :2]])
    errors, kept = _errors(outcome), _kept(outcome)
    joined = [event.t for event in recording.events if event.kind == "tracking"]
    return {
        "tracking_from_s": joined[0] if joined else None,
        "joins": len(joined),
        "off_path_rms_m": rms(error[errors.last]),
        "slip_m": _slip(recording.agents[VEHICLE].readings["odometry"][: len(truth), 0], truth),
        "off_path_m": error[kept].tolist(),
        "errors_m": errors.position[kept].tolist(),
        "places_m": truth[kept, :2].tolist(),
    }


def _errors(outcome: RunResult) -> RangingErrors:
    """Modulo the wall's symmetry, which is all that a mission says of them."""
    return RangingErrors.from_recording(outcome.recording, VEHICLE, RangingMission(WALL, (0.0,)))


def _kept(outcome: RunResult) -> slice:
    t = outcome.recording.t
    return slice(0, None, max(1, round(OFTEN / float(t[1] - t[0]))) if len(t) > 1 else 1)


def _slip(measured: Array, truth: Array) -> float:
    """[m] by which the wheels' way, from their speed (n,) [m/s], differs from the robot's, added up over OFTEN."""
    period = RangingMission(WALL, (0.0,)).period
    every = round(OFTEN / period)
    blocks = (len(truth) - 1) // every
    wheels = np.nan_to_num(measured[1 : 1 + blocks * every]).reshape(blocks, every).sum(axis=1) * period
    step = np.diff(truth[:, :2], axis=0)[: blocks * every]
    heading = truth[: blocks * every, 2]
    forwards = (step[:, 0] * np.cos(heading) + step[:, 1] * np.sin(heading)).reshape(blocks, every).sum(axis=1)
    return float(np.abs(wheels - forwards).sum())
