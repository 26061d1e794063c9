"""The missions of the study ``updates``: each as it was, and with each change, by the path that it had."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.terrain.height_field import HeightField
from models.terrain.hill import Hill, with_hills
from sim.signals import Array
from sim.studies.study import VEHICLE
from sim.sweep.trial import Trial, trial

RADIUS, WEIGHT = 8000.0, 10.0  # [m, -] of the radars
ASIDE = 12_000.0, 0.2  # [m, of the map's side] at most: from where a radar drives into the way, the target's own way
HILL_RADIUS, ABOVE = 5000.0, 300.0  # [m] of the hills, and of their tops above the path
MEASURE = "sim.studies.updates:announced"
_WAY, _TOLD, _HILL = 0.6, 0.3, 0.55  # of the time of flight: where the radars are, when they appear, where the hill is
_INSIDE = 0.06  # of the map's side that the target stays from the border


def hill_name(notice: float) -> str:
    return f"hill told {notice:g} s ahead"


@dataclass(frozen=True)
class Asked:
    """A mission of which variations are wanted: all that a worker needs."""

    terrain: str
    ground: HeightField
    seed: int
    notices: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Flown:
    """A mission without a change."""

    t: Array  # (n,) [s]
    x: Array  # (n, 6)
    target: Array  # (3,) [m]

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def at(self, share: float) -> Array:
        """(6,) at a share of the time."""
        state: Array = self.x[np.searchsorted(self.t, share * self.t[-1])]
        return state

    @property
    def across(self) -> Array:
        """(2,) to the left of the way, of unit length."""
        vx, vy = self.at(_WAY)[3:5]
        left: Array = np.array([-vy, vx]) / max(float(np.hypot(vx, vy)), 1e-9)
        return left


def varied_mission(asked: Asked) -> dict[str, Trial]:
    """A mission as it was, and with each change, by the path that it had."""
    outcome = trial("safe-flight", asked.seed, fields={"terrain": asked.terrain}).build().run()
    mission = outcome.config["mission"]
    flown = Flown(outcome.recording.t, outcome.recording.truths[VEHICLE], np.array(mission["target"]))
    place = {"terrain": asked.terrain, "start": mission["start"], "target": mission["target"]}
    varied = {
        "as it was": {},
        **_radars(flown, asked.ground),
        "target moves": {"target_path": _path(flown, asked.ground)},
        **_hills(flown, asked.ground, asked.notices),
    }
    return {
        name: trial("safe-flight", asked.seed, fields={**place, **fields}, measure=MEASURE)
        for name, fields in varied.items()
    }


def _aside(ground: HeightField) -> float:
    """[m] `ASIDE` on this map."""
    return min(ASIDE[0], ASIDE[1] * min(ground.width, ground.depth))


def _radars(flown: Flown, ground: HeightField) -> dict[str, dict[str, Any]]:
    """One that appears in the way, one that drives into it, and one that vanishes before it is reached."""
    way, told = flown.at(_WAY)[:2], _TOLD * flown.duration
    aside = _aside(ground) * flown.across
    if not ground.contains(*(way + aside)):
        aside = -aside
    begin = np.clip(way + aside, 0.0, [ground.width, ground.depth])
    velocity = (way - begin) / (_WAY * flown.duration)
    appears = {"radar": ((*way.tolist(), RADIUS, WEIGHT),), "radar_time": told}
    drives = {"radar": ((*begin.tolist(), RADIUS, WEIGHT),), "radar_velocity": tuple(velocity.tolist())}
    return {
        "radar appears": appears,
        "radar appears, not told": {**appears, "radar_known": False},
        "radar drives": drives,
        "radar drives, not told": {**drives, "radar_known": False},
        "radar vanishes": {"radar": appears["radar"], "radar_until": told},
    }


def _path(flown: Flown, ground: HeightField) -> tuple[tuple[float, ...], ...]:
    """The target moves to the side, or, at the border, towards the middle of the map."""
    here, size = flown.target[:2], np.array([ground.width, ground.depth])
    there, inside = here + _aside(ground) * flown.across, _INSIDE * float(size.min())
    if np.any(there < inside) or np.any(there > size - inside):
        inwards = 0.5 * size - here
        there = here + _aside(ground) * inwards / float(np.linalg.norm(inwards))
    height = float(flown.target[2])
    return ((0.4 * flown.duration, *here.tolist(), height), (0.7 * flown.duration, *there.tolist(), height))


def _hills(flown: Flown, ground: HeightField, notices: Sequence[float]) -> dict[str, dict[str, Any]]:
    """A hill through which the path would lead."""
    top = flown.at(_HILL)
    height = float(top[2] - ground.height(*top[:2])) + ABOVE
    hill = (float(top[0]), float(top[1]), HILL_RADIUS, height)
    higher = with_hills(ground, (Hill(*hill),))
    hit = float(flown.t[np.argmax(flown.x[:, 2] < higher.height(flown.x[:, 0], flown.x[:, 1]))])
    return {hill_name(notice): {"uncharted": (hill,), "uncharted_time": max(hit - notice, 0.0)} for notice in notices}
