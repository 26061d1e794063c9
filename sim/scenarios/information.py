"""What changes while a vehicle flies, and when it is told: radars, the target, ground that is not on the map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from mathnavi.models.aerial.knowledge import RADARS, TARGET, TERRAIN
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import hills_of, with_hills
from mathnavi.models.terrain.visibility import Radar, RadarTrack
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.interfaces.bounds import FINITE, TWO_FINITE_NUMBERS, NonNegative, configuration
from mathnavi.sim.interfaces.checks import check
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.signals import Array, Message
from mathnavi.sim.scenarios.flight_parts import Point

_SOONEST = 0.1  # [s] between reports
_LATEST = 36_000.0  # [s] of a target's path


@configuration
class ChangeFields:
    """Fields of what changes on the way: radars, and ground that is not on the map."""

    radar: tuple[tuple[float, float, float, float], ...] = ()
    """X Y RADIUS WEIGHT [m, m, m, -] of a radar; may be given several times"""
    radar_time: NonNegative = 0.0
    """when the radars are switched on [s]; the planner learns of them then"""
    radar_until: float | None = None
    """when they are switched off [s]; never if not given"""
    radar_velocity: Annotated[tuple[float, float], TWO_FINITE_NUMBERS] = (0.0, 0.0)
    """of the radars, from when they are switched on [m/s east, north]; where they reach the map's edge they stay"""
    radar_known: bool = True
    """whether the planner is told of the radars at all"""
    report_period: Annotated[float, Ge(_SOONEST), FINITE] = 5.0
    """between two reports of where what moves is now [s]; each means a new cost-to-go"""
    uncharted: tuple[tuple[float, float, float, float], ...] = ()
    """X Y RADIUS HEIGHT [m] of a hill that the map does not show; may be given several times"""
    uncharted_time: NonNegative = 0.0
    """when the planner is told of the ground as it is [s]"""

    def __post_init__(self) -> None:
        if self.radar_until is not None:
            check(self.radar_until, "radar_until", self.radar_time, open_low=True)
        for radar in self.radar:
            Radar(*radar)
        idle = {
            "radar_time": self.radar_time,
            "radar_until": self.radar_until,
            "radar_velocity": any(self.radar_velocity),
        }
        for name, given in idle.items():
            if given and not self.radar:
                raise FieldError(f"{name} = {getattr(self, name)!r}; allowed: with a radar only")
        if self.uncharted_time and not self.uncharted:
            raise FieldError(f"uncharted_time = {self.uncharted_time!r}; allowed: with an uncharted hill only")
        try:
            hills_of(self.uncharted)
        except ValueError as error:
            raise FieldError(f"uncharted: {error}") from None

    def tracks(self, terrain: HeightField) -> tuple[RadarTrack, ...]:
        """The radars over time; ValueError for one that is off the map."""
        until = math.inf if self.radar_until is None else self.radar_until
        tracks = tuple(RadarTrack(Radar(*each), self.radar_time, until, self.radar_velocity) for each in self.radar)
        for track in tracks:
            track.radar.position(terrain)
        return tracks

    def radars_at(self, t: float, terrain: HeightField) -> tuple[Radar, ...]:
        """What the planner is told that there is at ``t`` [s]."""
        known = self.tracks(terrain) if self.radar_known else ()
        return tuple(radar for track in known if (radar := track.at(t, terrain)) is not None)

    def radar_messages(self, terrain: HeightField, duration: float) -> list[Message]:
        """What the planner is told of radars after the start."""
        if not (self.radar and self.radar_known):
            return []
        end = min(duration, math.inf if self.radar_until is None else self.radar_until)
        times = {self.radar_time, end}
        if any(self.radar_velocity):
            times |= set(_reports(self.radar_time, end, self.report_period))
        return [
            Message(t, "radar warning", RADARS, self.radars_at(t, terrain)) for t in sorted(times) if 0.0 < t < duration
        ]

    def ground(self, charted: HeightField) -> HeightField:
        """The terrain as it is, with the hills that the map does not show."""
        try:
            return with_hills(charted, hills_of(self.uncharted))
        except ValueError as error:
            raise ValueError(f"uncharted: {error}") from None

    def messages(self, charted: HeightField, duration: float) -> list[Message]:
        """All that the planner is told after the start, of radars and of the ground."""
        survey = [Message(self.uncharted_time, "survey", TERRAIN, self.ground(charted))] if self.uncharted else []
        return [*self.radar_messages(charted, duration), *survey]

    def recorded(self, terrain: HeightField) -> dict[str, Any]:
        """What a run's mission holds of them."""
        return {
            "radars": [
                {
                    **dataclasses.asdict(track.radar), "time": track.time, "velocity": track.velocity,
                    "until": track.until if math.isfinite(track.until) else None,
                }
                for track in self.tracks(terrain)
            ],
            "charted_at": self.uncharted_time if self.uncharted else None,
        }  # fmt: skip


@dataclass(frozen=True)
class TargetTrack:
    """Where the target is: at ``target`` first, on the straight way between points, and at rest at the last.

    It never comes nearer to the ground than it is at first: between points it follows the slopes.
    """

    target: Point
    terrain: HeightField
    path: tuple[tuple[float, float, float, float], ...] = ()  # t [s], x, y, z [m]

    def at(self, t: float) -> Point:
        """Its place [m] at ``t`` [s]; off the map as high as it is told."""
        if not self.path:
            return self.target
        times = [0.0, *(point[0] for point in self.path)]
        places = np.array([self.target, *(point[1:] for point in self.path)])
        x, y, z = (float(np.interp(t, times, places[:, axis])) for axis in range(3))
        if not self.terrain.contains(x, y):
            return x, y, z
        above = self.target[2] - float(self.terrain.height(*self.target[:2]))
        return x, y, max(z, float(self.terrain.height(x, y)) + above)

    @property
    def ends(self) -> float:
        """[s] when it is at rest for good."""
        return self.path[-1][0] if self.path else 0.0

    def reported(self, period: float) -> list[tuple[float, Point]]:
        """When [s] and where it is reported: every ``period`` [s], and wherever it turns."""
        times = sorted({*_reports(0.0, self.ends, period), *(point[0] for point in self.path)} - {0.0})
        return [(t, self.at(t)) for t in times]

    def messages(self, period: float) -> list[Message]:
        """What the planner is told: where it is, if that is elsewhere than before."""
        told, before = [], self.target
        for t, place in self.reported(period):
            if place != before:
                told.append(Message(t, "target watch", TARGET, place))
            before = place
        return told


def check_target_path(path: Sequence[tuple[float, float, float, float]]) -> None:
    """ValueError for points that are not finite or whose times do not increase."""
    before = 0.0
    for point in path:
        if not (all(map(math.isfinite, point)) and before < point[0] <= _LATEST):
            raise ValueError(
                f"target_path = {point!r}; allowed: four finite numbers, times > 0, increasing and <= {_LATEST:g}"
            )
        before = point[0]


def check_track(track: TargetTrack, period: float, check_place: Callable[[str, Point], None]) -> None:
    """``check_place`` of the target where it is told to be, and wherever it is reported on its way."""
    for t, x, y, z in track.path:
        check_place(f"target_path: place at {t:g} s", (x, y, z))
    for message in track.messages(period):
        check_place(f"target_path: place at {message.t:g} s", message.payload)


def _reports(begin: float, end: float, period: float) -> Array:
    """(n,) [s] every ``period`` from ``begin``, before ``end``."""
    count = max(0, math.ceil((end - begin) / period - TIME_TOLERANCE))
    return begin + period * np.arange(count, dtype=np.float64)
