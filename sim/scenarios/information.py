"""Changes during a flight, and the times at which the planner is informed: radars, target, ground not on the map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge

from mathnavi.interfaces.bounds import FINITE, TWO_FINITE_NUMBERS, NonNegative, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.signals import Array, Message
from mathnavi.models.aerial.knowledge import RADARS, TARGET, TERRAIN
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import hills_of, with_hills
from mathnavi.models.terrain.visibility import Radar, RadarTrack
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.records.missions import Point, RadarRecord

_SOONEST = 0.1  # [s] between reports
_LATEST = 36_000.0  # [s] of a target's path


@configuration
class ChangeFields:
    """Fields of changes on the way: radars, and ground that is not on the map."""

    radar: tuple[tuple[float, float, float, float], ...] = ()
    """radar X Y RADIUS WEIGHT [m, m, m, -]; may be given several times"""
    radar_time: NonNegative = 0.0
    """time at which the radars are switched on and the planner is informed of them [s]"""
    radar_until: float | None = None
    """time at which the radars are switched off [s]; never if not given"""
    radar_velocity: Annotated[tuple[float, float], TWO_FINITE_NUMBERS] = (0.0, 0.0)
    """velocity of the radars, east and north [m/s], from when they are switched on, up to the map's edge"""
    radar_known: bool = True
    """whether the planner is informed of the radars at all"""
    report_period: Annotated[float, Ge(_SOONEST), FINITE] = 5.0
    """time between two reports of moving radars or targets [s]; each report requires a new cost-to-go"""
    uncharted: tuple[tuple[float, float, float, float], ...] = ()
    """hill X Y RADIUS HEIGHT [m] that the map does not show; may be given several times"""
    uncharted_time: NonNegative = 0.0
    """time at which the planner is informed of the true ground [s]"""

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
        """Radars over time; raises ValueError for one off the map."""
        until = math.inf if self.radar_until is None else self.radar_until
        tracks = tuple(RadarTrack(Radar(*each), self.radar_time, until, self.radar_velocity) for each in self.radar)
        for track in tracks:
            track.radar.position(terrain)
        return tracks

    def radars_at(self, t: float, terrain: HeightField) -> tuple[Radar, ...]:
        """Radars that the planner knows of at ``t`` [s]."""
        known = self.tracks(terrain) if self.radar_known else ()
        return tuple(radar for track in known if (radar := track.at(t, terrain)) is not None)

    def radar_messages(self, terrain: HeightField, duration: float) -> list[Message]:
        """Messages to the planner on radars after the start, before ``duration`` [s]."""
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
        """True terrain, with the hills that the map does not show; raises MissionError for a hill off the map."""
        try:
            return with_hills(charted, hills_of(self.uncharted))
        except ValueError as error:
            raise MissionError(f"uncharted: {error}") from None

    def messages(self, charted: HeightField, duration: float) -> list[Message]:
        """All messages to the planner after the start, on radars and on the ground, before ``duration`` [s]."""
        survey = [Message(self.uncharted_time, "survey", TERRAIN, self.ground(charted))] if self.uncharted else []
        return [*self.radar_messages(charted, duration), *survey]

    def radar_records(self, terrain: HeightField) -> tuple[RadarRecord, ...]:
        """Records of the radars in config.json; raises the errors of ``tracks``."""
        return tuple(
            RadarRecord(
                **dataclasses.asdict(track.radar), time=track.time, velocity=track.velocity,
                until=track.until if math.isfinite(track.until) else None,
            )
            for track in self.tracks(terrain)
        )  # fmt: skip

    @property
    def charted_at(self) -> float | None:
        """Time [s] at which the planner is informed of the hills that the map does not show; None without any."""
        return self.uncharted_time if self.uncharted else None


@dataclass(frozen=True)
class TargetTrack:
    """Motion of the target: from ``target`` on straight lines through the points of ``path``, and at rest at the last
    one.

    Its height above ground is never less than at first: between points it follows the slopes.
    """

    target: Point
    terrain: HeightField
    path: tuple[tuple[float, float, float, float], ...] = ()  # t [s], x, y, z [m]

    def at(self, t: float) -> Point:
        """Place (x, y, z) [m] of the target at ``t`` [s]; off the map z is that of its path."""
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
        """Time [s] from which the target stays at rest."""
        return self.path[-1][0] if self.path else 0.0

    def reported(self, period: float) -> list[tuple[float, Point]]:
        """Reports (time [s], place [m]) of the target: every ``period`` [s], and at every point of its path."""
        times = sorted({*_reports(0.0, self.ends, period), *(point[0] for point in self.path)} - {0.0})
        return [(t, self.at(t)) for t in times]

    def messages(self, period: float) -> list[Message]:
        """Messages to the planner, whenever the target has moved since the report before."""
        messages, before = [], self.target
        for t, place in self.reported(period):
            if place != before:
                messages.append(Message(t, "target watch", TARGET, place))
            before = place
        return messages


def check_target_path(path: Sequence[tuple[float, float, float, float]]) -> None:
    """Raise FieldError for points that are not finite or whose times do not increase."""
    before = 0.0
    for point in path:
        if not (all(map(math.isfinite, point)) and before < point[0] <= _LATEST):
            raise FieldError(
                f"target_path = {point!r}; allowed: four finite numbers, times > 0, increasing and <= {_LATEST:g}"
            )
        before = point[0]


def check_track(track: TargetTrack, period: float, check_place: Callable[[str, Point], None]) -> None:
    """Call ``check_place`` with each point of the target's path, and with each place that is reported on its way."""
    for t, x, y, z in track.path:
        check_place(f"target_path: place at {t:g} s", (x, y, z))
    for message in track.messages(period):
        check_place(f"target_path: place at {message.t:g} s", message.payload)


def _reports(begin: float, end: float, period: float) -> Array:
    """Times (n,) [s] every ``period`` [s] from ``begin``, before ``end`` [s]."""
    count = max(0, math.ceil((end - begin) / period - TIME_TOLERANCE))
    return begin + period * np.arange(count, dtype=np.float64)
