"""Data of a finished run of a fleet for pictures: a flight for each vehicle, and quantities between them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Event
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.flight.run_data import FlightRun, flight_of
from mathnavi.renders.palette import Colour, vehicle_colour
from mathnavi.sim.metrics.fleet import arrival_time
from mathnavi.sim.records.missions import FleetRecord, read_mission
from mathnavi.sim.records.run_folder import CONFIG, last_at, read_fleet

AGREED = re.compile(r"arrival time from .*: (\S+)")  # the message in a vehicle's log of the time that it has agreed to
_SAME = 0.5  # [s] from which on two times of arrival count as different


@dataclass(frozen=True, eq=False)
class FleetRun:
    """The run of a fleet; its vehicles are in the order of config.json."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # of all, in order of time
    vehicles: Mapping[str, FlightRun]
    separation: float  # [m] what vehicles keep between them

    @cached_property
    def flights(self) -> tuple[FlightRun, ...]:
        """The vehicles' flights."""
        return tuple(self.vehicles.values())

    @property
    def terrain(self) -> HeightField:
        return self.flights[0].terrain

    @property
    def t(self) -> Array:
        """(n,) [s] the times of the log."""
        return self.flights[0].t

    @property
    def duration(self) -> float:
        """[s] of flight."""
        return self.flights[0].duration

    @property
    def title(self) -> str:
        """Scenario, number of vehicles, terrain and seed."""
        seed = self.config["seed"]
        return f"{self.config['scenario']} of {len(self.flights)} over {self.terrain.name}, seed {seed}"

    @cached_property
    def colours(self) -> tuple[Colour, ...]:
        """Colours of the vehicles."""
        return tuple(vehicle_colour(k) for k in range(len(self.flights)))

    @cached_property
    def slots(self) -> Array:
        """(vehicles, 3) [m] where each is to arrive."""
        return np.array([flight.mission.target for flight in self.flights])

    @cached_property
    def course(self) -> Array:
        """(3,) [m] from the starts to the slots, on average."""
        course: Array = self.slots.mean(axis=0) - np.mean([flight.mission.start for flight in self.flights], axis=0)
        return course

    @cached_property
    def arrivals(self) -> Array:
        """(vehicles,) [s] when each first came within its arrival radius; NaN if it did not."""
        return np.array([arrival_time(f.t, f.x, f.mission.target, f.mission.arrival_radius) for f in self.flights])

    @cached_property
    def everybody_arrived(self) -> bool:
        return bool(np.isfinite(self.arrivals).all())

    @property
    def spread(self) -> float:
        """[s] between the first and the last arrival; NaN unless all arrived."""
        return float(np.ptp(self.arrivals))

    def arrived(self, t: float) -> int:
        """Number of vehicles that have arrived by ``t`` [s]."""
        return int(np.count_nonzero(self.arrivals <= t + 1e-9))

    def positions(self, t: float) -> Array:
        """(vehicles, 3) [m] at ``t`` [s]."""
        return np.array([flight.state(t)[:3] for flight in self.flights])

    def nearest(self, t: float) -> float:
        """[m] between the two vehicles that are nearest to each other at ``t`` [s]."""
        return float(np.nanmin(_distances(self.positions(t))))

    @cached_property
    def neighbours(self) -> Array:
        """(vehicles, n) [m] from each vehicle to the nearest other one."""
        places = np.array([flight.x[:, :3] for flight in self.flights])
        found = np.full(places.shape[:2], np.inf)
        for k in range(len(places)):
            for other in range(k + 1, len(places)):
                distance = np.linalg.norm(places[k] - places[other], axis=1)
                found[k], found[other] = np.minimum(found[k], distance), np.minimum(found[other], distance)
        return found

    @cached_property
    def _agreements(self) -> tuple[tuple[Array, Array], ...]:
        """Return for each vehicle the times [s] at which it received a time of arrival, and those arrivals [s]."""
        found = []
        for flight in self.flights:
            messages = [
                (event.t, AGREED.fullmatch(event.message)) for event in flight.events if event.kind == "message"
            ]
            known = [(t, float(match[1])) for t, match in messages if match]
            found.append((np.array([t for t, _ in known]), np.array([arrival for _, arrival in known])))
        return tuple(found)

    def agreed(self, t: float) -> Array:
        """(vehicles,) [s] the time of arrival by which each flies at ``t`` [s]; NaN where it knows of none."""
        return np.array(
            [arrivals[k] if (k := last_at(times, t)) >= 0 else np.nan for times, arrivals in self._agreements]
        )

    @cached_property
    def agreements(self) -> tuple[tuple[float, float], ...]:
        """(when, arrival) [s]: at what times all had agreed to another time of arrival than before."""
        found: list[tuple[float, float]] = []
        for t in np.unique(np.concatenate([times for times, _ in self._agreements])):
            agreed = self.agreed(float(t))
            if np.ptp(agreed) <= _SAME and not (found and abs(agreed.max() - found[-1][1]) <= _SAME):
                found.append((float(t), float(agreed.max())))
        return tuple(found)


def _distances(places: Array) -> Array:
    """(n, n) between points (n, 3); NaN from each to itself."""
    distance: Array = np.linalg.norm(places[:, None] - places[None], axis=-1)
    distance[np.diag_indices(len(places))] = np.nan
    return distance


def _mission_of(name: str) -> Callable[[Mapping[str, Any]], Mapping[str, Any]]:
    """A function that picks a vehicle's mission from the fleet's: its start and target, and all that is shared."""
    return lambda fleet: {**fleet, **fleet["vehicles"][name]}


def load_run(directory: str | Path) -> FleetRun:
    """Read a fleet's run; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_fleet(directory)
    path = log.directory / CONFIG
    try:
        mission = read_mission(FleetRecord, log.config["mission"])
        names, separation = tuple(mission.vehicles), mission.separation
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"{str(path)!r} does not describe the flight of a fleet: {error!r}") from None
    if set(names) != set(log.vehicles) or len(names) < 2:
        raise RunFolderError(
            f"{str(path)!r} has the vehicles {', '.join(names) or 'none'}, log.npz {', '.join(log.vehicles)}; allowed: "
            "the same in both, two at least"
        )
    vehicles = {name: flight_of(log.vehicles[name], _mission_of(name), f"{name}.") for name in names}
    return FleetRun(log.directory, log.config, log.summary, log.events, vehicles, separation)
