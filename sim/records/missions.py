"""Records of missions in config.json, written by ``mathnavi.interfaces.fields.plain``, read by ``read_mission``.

Those of missile and robot, whose models take a while to import, are in ``missile_missions`` and ``range_missions``.

A field with a default may be missing from a folder that was written before the field existed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from mathnavi.interfaces.fields import instance
from mathnavi.models.aerial.beacons import FlightBeacons

Point = tuple[float, float, float]
MissionRecord = TypeVar("MissionRecord")


def read_mission(kind: type[MissionRecord], fields: Mapping[str, Any]) -> MissionRecord:
    """Return the mission in a run's config.json as a dataclass of this module; fields that it does not have are
    ignored.

    Raises FieldError for a missing field, and for a value of another type.
    """
    known = {each.name for each in dataclasses.fields(kind)}  # type: ignore[arg-type]
    given = {name: value for name, value in fields.items() if name in known}
    read: MissionRecord = instance(kind, given, "$.mission")
    return read


@dataclass(frozen=True)
class RadarRecord:
    """Radar, with its motion while it is on."""

    x: float  # [m] east, map frame
    y: float  # [m] north, map frame
    radius: float  # [m]
    weight: float  # [-]
    mast: float = 10.0  # [m]
    time: float = 0.0  # [s] when it is switched on
    velocity: tuple[float, float] = (0.0, 0.0)  # [m/s] east, north
    until: float | None = None  # [s] when it is switched off; None: never


@dataclass(frozen=True)
class FlightRecord:
    """Flight of a point mass."""

    start: Point  # [m] map frame
    target: Point  # [m] map frame
    clearance_min: float  # [m] h_min
    speed_max: float  # [m/s] v_max
    acceleration_max: float  # [m/s^2] a_max
    arrival_radius: float  # [m] r_f
    tracking_bound: dict[str, float | None] = field(default_factory=dict)  # horizontal, vertical [m], speed [m/s], ...
    deadline_factor: float | None = None  # gamma; None in a fleet, which has a common deadline


@dataclass(frozen=True)
class ChangingFlightRecord(FlightRecord):
    """Flight whose conditions change on the way."""

    radars: tuple[RadarRecord, ...] = ()
    charted_at: float | None = None  # [s] when the planner learns of hills that the map does not show
    target_path: tuple[tuple[float, float, float, float], ...] = ()  # t [s], x, y, z [m] of a target that moves
    beacons: FlightBeacons | None = None  # to which the vehicle reads ranges; None: it reads none


@dataclass(frozen=True)
class QuadrotorRecord(FlightRecord):
    """Flight of a quadrotor's centre, and its body."""

    reach: float = dataclasses.field(kw_only=True)  # [m] from the centre to the farthest part
    thrust_max: float = dataclasses.field(kw_only=True)  # [N] of a rotor


@dataclass(frozen=True)
class FleetRecord:
    """Flights of a fleet; ``vehicles`` holds ``start`` and ``target`` [m] of each vehicle, by name."""

    vehicles: dict[str, Any]
    clearance_min: float  # [m]
    separation: float  # [m] d_s
    speed_max: float  # [m/s]
    acceleration_max: float  # [m/s^2]
    arrival_radius: float  # [m]
    deadline: float  # [s] D
    radars: tuple[RadarRecord, ...] = ()
    charted_at: float | None = None  # [s]
    tracking_bound: dict[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class LagrangianRecord:
    """Lagrangian system whose velocity is observed."""

    manifold: str
    states: tuple[str, ...]  # (nx,) with units
    inputs: tuple[str, ...]  # (nu,) with units
    tolerance: float  # of the velocity [rad/s, m/s, 1/s]


@dataclass(frozen=True, kw_only=True)
class SpaceRecord(LagrangianRecord):
    """Rigid body, or a point on a space of constant curvature."""

    space: str


@dataclass(frozen=True, kw_only=True)
class MechanismRecord(LagrangianRecord):
    """Mechanism in MuJoCo."""

    mechanism: str  # as ``mathnavi.models.mechanism.entity.build_spec`` takes it


@dataclass(frozen=True)
class TextbookRecord:
    """System of the textbook."""

    title: str
    states: tuple[str, ...]  # (n,) with units
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    angles: tuple[int, ...]  # which states are angles
    tolerance: float | None = None
