"""Fields of ``safe-flight``: the mission, what changes on the way, and the faults."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated

from annotated_types import Interval

from mathnavi.models.aerial.dynamics import CONTROL_TICKS, TICK
from mathnavi.sim.interfaces.bounds import FINITE, TickRate, configuration
from mathnavi.sim.scenarios.fault_fields import LARGEST, AerialFaults, Magnitude, PositiveMagnitude
from mathnavi.sim.scenarios.flight_parts import FinitePoint, FlightNoise, drawn_between
from mathnavi.sim.scenarios.information import ChangeFields, check_target_path
from mathnavi.sim.scenarios.redraw import ChanceFields

_DIAGONAL = 1.5  # beyond that of a square map, in shares of its side


@configuration
class MissionFields:
    """From where to where over which ground, and within which bounds."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    start: FinitePoint | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    target: FinitePoint | None = None
    """x, y, z [m] on the map; drawn from the seed if not given"""
    drawn_heights: Annotated[tuple[float, float], drawn_between(LARGEST)] = (50.0, 450.0)
    """heights above h_min between which a start or target is drawn [m]"""
    drawn_separation: Annotated[tuple[float, float], drawn_between(_DIAGONAL)] = (0.8, 1.5)
    """shares of the map's side between which the distance of a drawn start and target lies"""
    clearance_min: Magnitude = 50.0
    """h_min, least height above ground [m]"""
    speed_max: PositiveMagnitude = 300.0
    """v_max [m/s]"""
    acceleration_max: PositiveMagnitude = 40.0
    """a_max [m/s^2]"""
    deadline_factor: Annotated[float, Interval(ge=1.0, le=LARGEST), FINITE] = 1.3
    """gamma: the deadline over the duration of the first plan"""
    arrival_radius: PositiveMagnitude = 50.0
    """r_f, how near to the target counts as arrived [m]"""
    control_rate: Annotated[float, TickRate(TICK)] = 1.0 / (CONTROL_TICKS * TICK)
    """of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""


@configuration
class SafeFlightConfig(ChangeFields, ChanceFields, MissionFields):
    """Fields of the scenario."""

    target_path: tuple[tuple[float, float, float, float], ...] = ()
    """T X Y Z [s, m, m, m] where the target is at a time, and on its way to evenly, as high above ground as at first or
    higher; may be given several times"""
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: AerialFaults = field(default_factory=AerialFaults)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_target_path(self.target_path)
