"""Data of a finished flight for pictures: the path, the ground, the plans.

Everything comes from the run's folder (``mathnavi.sim.records.run_folder``) and from the terrain that config.json
names; its digest shows whether that is still the terrain that was flown over.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import Hill, hills_of, with_hills
from mathnavi.models.terrain.library import load_terrain
from mathnavi.models.terrain.visibility import Radar, RadarTrack
from mathnavi.renders.logged_run import LoggedRun
from mathnavi.sim.records.missions import ChangingFlightRecord, RadarRecord, read_mission
from mathnavi.sim.records.run_folder import ARRAYS, CONFIG, RunLog, read_log

MISSION_NUMBERS = ("clearance_min", "speed_max", "acceleration_max", "arrival_radius")


@dataclass(frozen=True, eq=False)
class FlownMission:
    """The mission as config.json records it."""

    start: Array  # (3,) [m] map frame
    target: Array  # (3,) [m] map frame
    clearance_min: float  # [m]
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    arrival_radius: float  # [m]
    radars: tuple[RadarTrack, ...]
    target_path: Array = field(default_factory=lambda: np.empty((0, 4)))  # t [s], x, y, z [m] of a target that moves
    hills: tuple[Hill, ...] = ()  # that the map did not show
    charted_at: float = 0.0  # [s] when the map was updated with them
    beacons: Array = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) [m] to which the vehicle reads ranges

    def target_at(self, t: float) -> Array:
        """(3,) [m] where the target is at ``t`` [s]."""
        path = np.vstack([[0.0, *self.target], self.target_path])
        return np.array([np.interp(t, path[:, 0], path[:, axis]) for axis in (1, 2, 3)])


@dataclass(frozen=True, eq=False)
class FlightRun(LoggedRun):
    """The run of a single vehicle."""

    mission: FlownMission
    terrain: HeightField

    @property
    def x(self) -> Array:
        """(n, 6) true position [m] and velocity [m/s], map frame."""
        return self.log.x

    @property
    def u(self) -> Array:
        """(n, 3) [m/s^2] commanded acceleration, held over [t_i, t_i+1), map frame."""
        return self.log.u

    @property
    def title(self) -> str:
        """Scenario, terrain and seed."""
        return f"{self.config['scenario']} over {self.terrain.name}, seed {self.config['seed']}"

    @cached_property
    def above_ground(self) -> Array:
        """(n,) [m] height above the ground; NaN off the map."""
        above: Array = self.x[:, 2] - self.terrain.height(self.x[:, 0], self.x[:, 1])
        return above

    @cached_property
    def travelled(self) -> Array:
        """(n,) [m] length of the path flown."""
        travelled: Array = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.x[:, :3], axis=0), axis=1))])
        return travelled

    def state(self, t: float) -> Array:
        """(6,) true state at ``t`` [s], linear between samples; the first and last state beyond them."""
        return self.interpolated(self.x, t)


def load_run(directory: str | Path) -> FlightRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory)
    return flight_of(log, lambda mission: mission)


def flight_of(log: RunLog, mission_of: Callable[[Mapping[str, Any]], Mapping[str, Any]], prefix: str = "") -> FlightRun:
    """The flight in a log.

    Args:
        log: of the vehicle.
        mission_of: picks the vehicle's mission from that of config.json.
        prefix: of the names of the vehicle's arrays, for messages.

    Raises:
        RunFolderError: the log is not that of a flight, or is over a terrain that has changed since.
    """
    folder, config = log.directory, log.config
    try:
        place = config["terrain"]
        hills = hills_of(place.get("hills", ()))
        terrain = terrain_of(place)
        mission = mission_of_record(read_mission(ChangingFlightRecord, mission_of(config["mission"])), hills)
    except (KeyError, TypeError, AttributeError, FieldError) as error:
        reason = f": {error}" if isinstance(error, FieldError) else f" does not describe a flight: {error!r}"
        raise RunFolderError(f"{str(folder / CONFIG)!r}{reason}") from None
    if place.get("digest", terrain.digest) != terrain.digest:
        raise RunFolderError(
            f"terrain {place['name']!r} is no longer the one that run {str(folder)!r} flew over: its digest is "
            f"{terrain.digest[:12]}..., the run's {str(place['digest'])[:12]}..."
        )
    if log.x.shape[1] != 6 or log.u.shape[1] != 3:
        raise RunFolderError(
            f"{str(folder / ARRAYS)!r}: {prefix}truth.x {log.x.shape} and {prefix}command.u {log.u.shape} are not "
            "(n, 6) and (n, 3)"
        )
    return FlightRun(log, mission, terrain)


def terrain_of(place: Mapping[str, Any]) -> HeightField:
    """Return the ground at the time of the run, from the terrain in config.json."""
    return with_hills(load_terrain(place.get("path") or place["name"]), hills_of(place.get("hills", ())))


def mission_of_record(record: ChangingFlightRecord, hills: tuple[Hill, ...]) -> FlownMission:
    """The mission of a record."""
    return FlownMission(
        np.array(record.start),
        np.array(record.target),
        **{name: getattr(record, name) for name in MISSION_NUMBERS},
        radars=tuple(_track(radar) for radar in record.radars),
        target_path=np.array(record.target_path).reshape(-1, 4),
        hills=hills,
        charted_at=record.charted_at or 0.0,
        beacons=np.empty((0, 3)) if record.beacons is None else record.beacons.array,
    )


def _track(radar: RadarRecord) -> RadarTrack:
    site = Radar(radar.x, radar.y, radar.radius, radar.weight)
    return RadarTrack(site, radar.time, np.inf if radar.until is None else radar.until, radar.velocity)
