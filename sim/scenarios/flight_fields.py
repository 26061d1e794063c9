"""Fields of ``safe-flight``: the mission, what changes on the way, and the faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from mathnavi.models.aerial.dynamics import CONTROL_TICKS, TICK
from mathnavi.sim.interfaces.checks import check, check_rate
from mathnavi.sim.scenarios.fault_fields import LARGEST, FlightFaults
from mathnavi.sim.scenarios.flight_parts import FlightNoise, Point
from mathnavi.sim.scenarios.information import ChangeFields, check_target_path

_DIAGONAL = 1.5  # beyond that of a square map, in shares of its side


@dataclass(frozen=True)
class MissionFields:
    """From where to where over which ground, and within which bounds."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    start: Point | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    target: Point | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    drawn_heights: tuple[float, float] = (50.0, 450.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_separation: tuple[float, float] = (0.8, 1.5)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    clearance_min: float = 50.0
    """h_min, least height above ground [m]"""
    speed_max: float = 300.0
    """v_max [m/s]"""
    acceleration_max: float = 40.0
    """a_max [m/s^2]"""
    deadline_factor: float = 1.3
    """gamma: the deadline over the duration of the first plan"""
    arrival_radius: float = 50.0
    """r_f, how near to the target counts as arrived [m]"""
    control_rate: float = 1.0 / (CONTROL_TICKS * TICK)
    """of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""

    def __post_init__(self) -> None:
        for name in ("start", "target"):
            point = getattr(self, name)
            if point is not None and not all(math.isfinite(c) for c in point):
                raise ValueError(f"{name} = {point!r}; allowed: three finite numbers")
        for name, largest in (("drawn_heights", LARGEST), ("drawn_separation", _DIAGONAL)):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high <= largest:
                raise ValueError(
                    f"{name} = {(low, high)!r}; allowed: two finite numbers, 0 <= low <= high <= {largest:g}"
                )
        check(self.clearance_min, "clearance_min", 0.0, LARGEST)
        for name in ("speed_max", "acceleration_max", "arrival_radius"):
            check(getattr(self, name), name, 0.0, LARGEST, open_low=True)
        check(self.deadline_factor, "deadline_factor", 1.0, LARGEST)
        check_rate(self.control_rate, "control_rate", TICK)


@dataclass(frozen=True)
class SafeFlightConfig(ChangeFields, MissionFields):
    """Fields of the scenario."""

    target_path: tuple[tuple[float, float, float, float], ...] = ()
    """T X Y Z [s, m, m, m] where the target is at a time, and on its way to evenly, as high above ground as at first or
    higher; may be given several times"""
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: FlightFaults = field(default_factory=FlightFaults)

    def __post_init__(self) -> None:
        MissionFields.__post_init__(self)
        ChangeFields.__post_init__(self)
        check_target_path(self.target_path)
