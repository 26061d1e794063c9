"""The fields of ``quadrotor-canyon``."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.quadrotor.dynamics import NOMINAL, Quadrotor
from mathnavi.sim.interfaces.checks import check, check_rate
from mathnavi.sim.scenarios.fault_fields import LARGEST, FlightFaults
from mathnavi.sim.scenarios.flight_parts import FlightNoise, Point

_DIAGONAL = 1.5  # beyond that of a square map, in shares of its side


@dataclass(frozen=True)
class QuadrotorMismatch:
    """The true quadrotor over the declared one; the tracking bound allows for a tenth of mass and a quarter of drag."""

    mass: float = 1.0
    """factor of the mass"""
    motor_lag: float = 1.0
    """factor of the time constant of the rotors"""
    drag: float = 1.0
    """factor of the drag"""
    rotor: float = 1.0
    """factor of what the front left rotor gives, as thrust and as moment"""

    def __post_init__(self) -> None:
        for name in ("mass", "motor_lag", "drag"):
            check(getattr(self, name), f"mismatch.{name}", 0.1, 10.0)
        check(self.rotor, "mismatch.rotor", 0.1, 1.0)
        if NOMINAL.hover_thrust * self.mass >= NOMINAL.thrust_max:
            most = NOMINAL.thrust_max / NOMINAL.hover_thrust
            raise ValueError(f"mismatch.mass = {self.mass!r}; allowed: < {most:.4g}, which the rotors lift")

    @property
    def vehicle(self) -> Quadrotor:
        """The one that flies, but for its front left rotor."""
        x, y, z = NOMINAL.drag
        return dataclasses.replace(
            NOMINAL,
            mass=self.mass * NOMINAL.mass,
            motor_lag=self.motor_lag * NOMINAL.motor_lag,
            drag=(self.drag * x, self.drag * y, self.drag * z),
        )


@dataclass(frozen=True)
class QuadrotorCanyonConfig:
    """Fields of the scenario; without any given there is no wind, and the vehicle is as declared."""

    terrain: str = "canyon"
    """name of a terrain, canyon:3 for another canyon, or an .npz file"""
    start: Point | None = None
    """x, y, z [m] of the vehicle's centre; drawn from the seed if not given"""
    target: Point | None = None
    """x, y, z [m] of the vehicle's centre; drawn from the seed if not given"""
    drawn_heights: tuple[float, float] = (2.0, 10.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_lowest: float = 0.1
    """share of the map's range of heights, from below, over which a start or target is drawn: the floor of a canyon"""
    drawn_separation: tuple[float, float] = (0.6, 0.95)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    clearance_min: float = 4.0
    """h_min, least height of every part of the vehicle above ground [m]"""
    speed_max: float = 14.0
    """v_max [m/s]"""
    acceleration_max: float = 2.5
    """a_max [m/s^2]; plans use no more of it than the rotors have the moments for"""
    deadline_factor: float = 1.5
    """gamma: the deadline over the duration of the first plan, which rests on the way over the plateau"""
    arrival_radius: float = 2.5
    """r_f, how near to the target counts as arrived [m]"""
    control_rate: float = 150.0
    """of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: FlightFaults = field(default_factory=FlightFaults)
    mismatch: QuadrotorMismatch = field(default_factory=QuadrotorMismatch)

    def __post_init__(self) -> None:
        for name in ("start", "target"):
            place = getattr(self, name)
            if place is not None and not all(math.isfinite(c) for c in place):
                raise ValueError(f"{name} = {place!r}; allowed: three finite numbers")
        for name, largest in (("drawn_heights", LARGEST), ("drawn_separation", _DIAGONAL)):
            low, high = getattr(self, name)
            if not 0.0 <= low <= high <= largest:
                raise ValueError(
                    f"{name} = {(low, high)!r}; allowed: two finite numbers, 0 <= low <= high <= {largest:g}"
                )
        check(self.drawn_lowest, "drawn_lowest", 0.0, 1.0, open_low=True)
        check(self.clearance_min, "clearance_min", 0.0, LARGEST)
        for name in ("speed_max", "acceleration_max", "arrival_radius"):
            check(getattr(self, name), name, 0.0, LARGEST, open_low=True)
        check(self.deadline_factor, "deadline_factor", 1.0, LARGEST)
        check_rate(self.control_rate, "control_rate", TICK)
        if self.faults.position_jump > 0.0:
            raise ValueError(
                f"faults.position_jump = {self.faults.position_jump!r}; allowed for a quadrotor: 0, for beside "
                "its plan it has no certificate"
            )
