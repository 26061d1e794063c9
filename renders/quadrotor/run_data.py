"""Data of a finished flight of a quadrotor for pictures: the flight of its centre, and the attitude of its body."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from mathnavi.interfaces.errors import ArgumentError, RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import ATTITUDE, ROTOR_COUNT, STATE_SIZE
from mathnavi.renders.flight.run_data import FlightRun, flight_of
from mathnavi.sim.metrics.flight import references
from mathnavi.sim.metrics.quadrotor import point, tilts
from mathnavi.sim.records.missions import QuadrotorRecord, read_mission
from mathnavi.sim.records.run_folder import ARRAYS, CONFIG, read_log


@dataclass(frozen=True, eq=False)
class QuadrotorRun:
    """The run of one quadrotor."""

    flight: FlightRun  # of its centre; u is the acceleration that was flown, not a command
    truth: Array  # (n, 13) states of mathnavi.models.quadrotor.dynamics
    thrusts: Array  # (n, 4) [N] commanded of the rotors, held over [t_i, t_i+1)
    reach: float  # [m] from the centre to the farthest part of the vehicle
    thrust_max: float  # [N] of a rotor
    bound: Mapping[str, float]  # what the tracker keeps: horizontal, vertical [m]

    @property
    def duration(self) -> float:
        """[s] of flight."""
        return self.flight.duration

    @cached_property
    def tilt(self) -> Array:
        """(n,) [degrees] between the thrust and the vertical."""
        angle: Array = np.degrees(tilts(self.truth))
        return angle

    @cached_property
    def clearance(self) -> Array:
        """(n,) [m] of the part of the vehicle that is nearest to the ground, or a little less; NaN off the map."""
        ground = self.flight.terrain.inflated(self.reach, self.reach)
        x = self.flight.x
        above: Array = x[:, 2] - ground.height(x[:, 0], x[:, 1])
        return above

    @cached_property
    def tracking_error(self) -> Array:
        """(n, 2) [m] distance of the centre from the plan being flown, across and along the vertical."""
        plans = list(zip(self.flight.log.adopted.tolist(), self.flight.log.plans, strict=True))
        error = self.flight.x - references(self.flight.t, plans)
        return np.column_stack([np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])])

    def pose(self, t: float) -> tuple[Array, Array]:
        """Position (3,) [m] and quaternion (4,) at ``t`` [s], linear between samples."""
        i, share = self.flight.between(t)
        one, other = self.truth[i, ATTITUDE], self.truth[i + 1, ATTITUDE]
        between = (1.0 - share) * one + share * (other if one @ other >= 0.0 else -other)
        return self.flight.state(t)[:3], between / np.linalg.norm(between)


def load_run(directory: str | Path) -> QuadrotorRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory)
    if log.x.shape[1] != STATE_SIZE or log.u.shape[1] != ROTOR_COUNT:
        raise RunFolderError(
            f"{str(log.directory / ARRAYS)!r}: truth.x {log.x.shape} and command.u {log.u.shape} are not "
            f"(n, {STATE_SIZE}) and (n, {ROTOR_COUNT})"
        )
    centre = point(log.x)
    flown = np.gradient(centre[:, 3:], log.t, axis=0)
    flight = flight_of(dataclasses.replace(log, x=centre, u=flown), lambda mission: mission)
    try:
        mission = read_mission(QuadrotorRecord, log.config["mission"])
        horizontal, vertical = (mission.tracking_bound[name] for name in ("horizontal", "vertical"))
        if horizontal is None or vertical is None:
            raise ArgumentError("its tracking bound has no distances")
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"{str(log.directory / CONFIG)!r} does not describe a quadrotor: {error!r}") from None
    return QuadrotorRun(
        flight, log.x, log.u, mission.reach, mission.thrust_max, {"horizontal": horizontal, "vertical": vertical}
    )
