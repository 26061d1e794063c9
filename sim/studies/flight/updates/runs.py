"""The missions of the study ``updates``: each as it was, and with each change, by the path that it had."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import Hill, with_hills
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.studies.framework.study import VEHICLE, TerrainReference
from mathnavi.sim.sweep.trial import Trial, trial

WEIGHT = 10.0  # of the radars
RADIUS, ASIDE = 0.1, 0.15  # of the map's side: of the radars, from where one drives into the way, the target's own way
HILL_RADIUS, ABOVE = 0.06, 300.0  # of the map's side, and [m] of the hills' tops above the path
MEASURE = "mathnavi.sim.studies.flight.updates.study:announced"
_WAY, _ANNOUNCED, _HILL = (
    0.6,
    0.3,
    0.55,
)  # of the time of flight: place of radars, their time, place of the hill
_INSIDE = 0.06  # of the map's side that the target stays from the border


def hill_name(notice: float) -> str:
    """Name of a mission with a hill that becomes known ``notice`` [s] ahead."""
    return f"hill announced {notice:g} s ahead"


@dataclass(frozen=True)
class MissionToVary:
    """A mission of which variations are wanted."""

    place: TerrainReference
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


def varied_mission(mission: MissionToVary) -> dict[str, Trial]:
    """A mission as it was, and with each change, by the path that it had."""
    terrain, ground = mission.place.terrain, mission.place.ground
    outcome = trial("safe-flight", mission.seed, fields={"terrain": terrain}).flown()
    drawn = outcome.config["mission"]
    flown = Flown(outcome.recording.t, outcome.recording.truths[VEHICLE], np.array(drawn["target"]))
    place = {"terrain": terrain, "start": drawn["start"], "target": drawn["target"]}
    varied = {
        "as it was": {},
        **_radars(flown, ground),
        "target moves": {"target_path": _path(flown, ground)},
        **_hills(flown, ground, mission.notices),
    }
    return {
        name: trial("safe-flight", mission.seed, fields={**place, **fields}, measure=MEASURE)
        for name, fields in varied.items()
    }


def side_of(ground: HeightField) -> float:
    """[m] the shorter one."""
    return min(ground.width, ground.depth)


def _radars(flown: Flown, ground: HeightField) -> dict[str, dict[str, Any]]:
    """Fields of a radar that appears in the way, of one that drives into it, and of one that vanishes before."""
    way, announced = flown.at(_WAY)[:2], _ANNOUNCED * flown.duration
    radius, aside = RADIUS * side_of(ground), ASIDE * side_of(ground) * flown.across
    if not ground.contains(*(way + aside)):
        aside = -aside
    begin = np.clip(way + aside, 0.0, [ground.width, ground.depth])
    velocity = (way - begin) / (_WAY * flown.duration)
    appears = {"radar": ((*way.tolist(), radius, WEIGHT),), "radar_time": announced}
    drives = {"radar": ((*begin.tolist(), radius, WEIGHT),), "radar_velocity": tuple(velocity.tolist())}
    return {
        "radar appears": appears,
        "radar appears, not announced": {**appears, "radar_known": False},
        "radar drives": drives,
        "radar drives, not announced": {**drives, "radar_known": False},
        "radar vanishes": {"radar": appears["radar"], "radar_until": announced},
    }


def _path(flown: Flown, ground: HeightField) -> tuple[tuple[float, ...], ...]:
    """The target moves to the side, or, at the border, towards the middle of the map."""
    here, size = flown.target[:2], np.array([ground.width, ground.depth])
    there, inside = here + ASIDE * side_of(ground) * flown.across, _INSIDE * side_of(ground)
    if np.any(there < inside) or np.any(there > size - inside):
        inwards = 0.5 * size - here
        there = here + ASIDE * side_of(ground) * inwards / float(np.linalg.norm(inwards))
    height = float(flown.target[2])
    return ((0.4 * flown.duration, *here.tolist(), height), (0.7 * flown.duration, *there.tolist(), height))


def _hills(flown: Flown, ground: HeightField, notices: Sequence[float]) -> dict[str, dict[str, Any]]:
    """A hill through which the path would lead."""
    top = flown.at(_HILL)
    height = float(top[2] - ground.height(*top[:2])) + ABOVE
    hill = (float(top[0]), float(top[1]), HILL_RADIUS * side_of(ground), height)
    higher = with_hills(ground, (Hill(*hill),))
    hit = float(flown.t[np.argmax(flown.x[:, 2] < higher.height(flown.x[:, 0], flown.x[:, 1]))])
    return {hill_name(notice): {"uncharted": (hill,), "uncharted_time": max(hit - notice, 0.0)} for notice in notices}
