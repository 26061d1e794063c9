"""The fields of ``quadrotor-canyon``."""

from __future__ import annotations

import dataclasses
from dataclasses import field
from typing import Annotated

from annotated_types import Interval, Lt

from mathnavi.interfaces.bounds import FINITE, PositiveFraction, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.models.quadrotor.dynamics import NOMINAL, Quadrotor
from mathnavi.models.terrain.library import TerrainPlace
from mathnavi.sim.scenarios.fault_fields import AerialFaults, Factor, Magnitude, PositiveMagnitude
from mathnavi.sim.scenarios.flight_fields import (
    Datum,
    DeadlineFactor,
    DrawnHeights,
    DrawnSeparation,
    FinitePoint,
    FlightNoise,
    Rate,
)
from mathnavi.sim.scenarios.redraw import ChanceFields

_HEAVIEST = NOMINAL.thrust_max / NOMINAL.hover_thrust
LiftedFactor = Annotated[Factor, Within(Lt(_HEAVIEST), allowed=f"< {_HEAVIEST:.4g}, which the rotors lift")]


@configuration(prefix="mismatch.")
class QuadrotorMismatch:
    """Mismatch of the true quadrotor to the declared one; the tracking bound allows for a tenth of mass, a quarter of
    drag.
    """

    mass: LiftedFactor = 1.0
    """factor of the mass"""
    motor_lag: Factor = 1.0
    """factor of the time constant of the rotors"""
    drag: Factor = 1.0
    """factor of the drag"""
    rotor: Annotated[float, Interval(ge=0.1, le=1.0), FINITE] = 1.0
    """factor of the front left rotor's thrust and moment"""

    @property
    def vehicle(self) -> Quadrotor:
        """True quadrotor, without the mismatch of its front left rotor."""
        x, y, z = NOMINAL.drag
        return dataclasses.replace(
            NOMINAL,
            mass=self.mass * NOMINAL.mass,
            motor_lag=self.motor_lag * NOMINAL.motor_lag,
            drag=(self.drag * x, self.drag * y, self.drag * z),
        )


@configuration
class QuadrotorCanyonConfig(ChanceFields):
    """Fields of the scenario; by default there is no wind, and the vehicle is as declared."""

    terrain: TerrainPlace = "canyon"
    """name of a terrain, canyon:3 for another canyon, or an .npz file"""
    start: FinitePoint | None = None
    """start x, y, z [m] of the vehicle's centre; drawn from the seed if not given"""
    target: FinitePoint | None = None
    """target x, y, z of the vehicle's centre [m]; drawn from the seed if not given"""
    drawn_heights: DrawnHeights = (2.0, 10.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_lowest: PositiveFraction = 0.1
    """share of the map's range of heights, from the lowest, over which starts and targets are drawn (the floor)"""
    drawn_separation: DrawnSeparation = (0.6, 0.95)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    datum: Datum = "map"
    """surface from which the heights of start and target are measured: the map's, or one that the map must state"""
    clearance_min: Magnitude = 4.0
    """least height h_min of every part of the vehicle above ground [m]"""
    speed_max: PositiveMagnitude = 14.0
    """largest speed v_max [m/s]"""
    acceleration_max: PositiveMagnitude = 2.5
    """largest acceleration a_max [m/s^2]; plans use no more than the rotors' moments permit"""
    deadline_factor: DeadlineFactor = 1.5
    """ratio gamma of the deadline to the duration of the first plan, which is based on the way over the plateau"""
    arrival_radius: PositiveMagnitude = 2.5
    """distance r_f from the target that counts as arrived [m]"""
    control_rate: Rate = 150.0
    """rate of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: AerialFaults = field(default_factory=AerialFaults)
    mismatch: QuadrotorMismatch = field(default_factory=QuadrotorMismatch)

    def __post_init__(self) -> None:
        if self.faults.position_jump > 0.0:
            raise FieldError(
                f"faults.position_jump = {self.faults.position_jump!r}; allowed for a quadrotor: 0, because off "
                "its plan it has no certificate"
            )
