"""The plug-in ``flight``: receding-horizon planner, certificate and tracker for a FlightMission."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound, raised_ground
from mathnavi.controllers.flight.cost_to_go import FactoredCost, factored_cost
from mathnavi.controllers.flight.planner import Incorporation, RecedingHorizon, Solver
from mathnavi.controllers.flight.problem import Parameters, proportional
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.bounds import NonNegative, Positive, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField

Nodes = Annotated[int, Within(Interval(ge=2, le=121), allowed="2 to 121")]
GridNodes = Annotated[int, Within(Interval(ge=3, le=513), allowed="3 to 513")]
GridLayers = Annotated[int, Within(Interval(ge=2, le=65), allowed="2 to 65")]


_INSIDE = 1.0 - 1e-4  # the solver aims this far inside the bounds, so that its tolerance does not cost a plan
_UNEQUAL = 1000.0  # how many times as long as another an arc may be
_ROUNDING = 0.01  # of a control period: a period may be written with five digits


@configuration
class RecedingHorizonConfig:
    """Fields of the planner, common to all trackers."""

    kernels: ClassVar[str] = "mathnavi.controllers.flight.ahead"  # compiled before the first flight

    nodes: Nodes = 13
    """number N of nodes of the horizon"""
    horizon: Positive | None = None
    """length T_p of the horizon [s]; (nodes - 1) 5/3 if not given"""
    stretch: float = 1.0
    """ratio of each arc's length to the one before"""
    period: float | None = None
    """time between two plans [s]; the first arc's length, to whole control periods, if not given"""
    beta: Positive = 100.0
    """cost of a second against a squared acceleration [m^2/s^4]"""
    margin: NonNegative = 25.0
    """clearance that the optimiser keeps above h_min, softly [m]"""
    tolerance: Positive = 1e-6
    """relative gain at which the solver stops"""
    grid_nodes: GridNodes = 65
    """number of nodes of the cost-to-go's grid along the longer side of the map"""
    grid_layers: GridLayers = 9
    """number of layers of the cost-to-go's grid"""
    incorporation: Incorporation = "schedule"
    """form in which a requested time of arrival enters: a schedule, the constraint (A.13), or its penalty"""
    arrival_weight: Positive = 1000.0
    """weight of the arrival penalty, per squared second [m^2/s^5]"""

    def __post_init__(self) -> None:
        widest = _UNEQUAL ** (1.0 / max(1, self.nodes - 2))
        if not 1.0 / widest <= self.stretch <= widest:
            raise FieldError(
                f"stretch = {self.stretch!r}; allowed at nodes = {self.nodes}: {1.0 / widest:.4g} to {widest:.4g}, so "
                f"that no arc is more than {_UNEQUAL:g} times as long as another"
            )
        if self.period is not None and not 0.0 < self.period <= self.duration:
            raise FieldError(
                f"period = {self.period!r}; allowed: > 0 and at most the horizon of {self.duration:g} s, beyond which "
                "nothing is optimised"
            )

    @property
    def duration(self) -> float:
        """T_p [s]."""
        return self.horizon if self.horizon is not None else (self.nodes - 1) * 5.0 / 3.0

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths (nodes - 1,) [s] of the arcs."""
        return proportional([self.stretch**i for i in range(self.nodes - 1)], self.duration)

    def replan_period(self, control_period: float) -> float:
        """Replanning period [s] in use; FieldError if it is not a whole number of control periods [s]."""
        period = self.lengths[0] if self.period is None else self.period
        ticks = max(1, round(period / control_period))
        if self.period is not None and abs(period - ticks * control_period) > _ROUNDING * control_period:
            raise FieldError(
                f"period = {self.period!r}; allowed: a whole number of control periods of {control_period:.6g} s; the "
                f"nearest is {ticks * control_period:.6g}"
            )
        return ticks * control_period


@configuration
class FlightConfig(RecedingHorizonConfig):
    """Fields of ``--planner``."""

    bandwidth: Positive = 0.8
    """bandwidth of the tracker [rad/s]"""


class FlightController:
    """Receding horizon with a safety manoeuvre behind every plan, optimised online and certified."""

    Config = FlightConfig

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        return planner(config, mission, bound), CriticallyDamped(mission.control_period, config.bandwidth, bound)


def planner(config: RecedingHorizonConfig, mission: FlightMission, bound: TrackingBound) -> RecedingHorizon:
    """Build the planner over any tracker that keeps ``bound``."""
    certificate = Certificate.for_mission(mission, bound)
    parameters = Parameters(
        lengths=config.lengths,
        speed_max=certificate.speed_max * _INSIDE,
        acceleration_max=certificate.acceleration_max * _INSIDE,
        beta=config.beta,
        clearance=mission.clearance_min + config.margin,
    )

    def cost_to_go(knowledge: Knowledge) -> FactoredCost:
        # A cost-to-go that is learnt in flight is needed once.
        build = _cost_to_go if knowledge == mission.knowledge else _built
        ground = raised_ground(knowledge.terrain, certificate.across, certificate.rise)
        return build(knowledge, ground, config.grid_nodes, config.grid_layers)

    period = config.replan_period(mission.control_period)
    return RecedingHorizon(
        parameters, certificate, solver(config), cost_to_go, mission.knowledge, period,
        config.incorporation, config.arrival_weight,
    )  # fmt: skip


def solver(config: RecedingHorizonConfig) -> Solver:
    """The solver of the planner's problem."""
    return CondensedSqp(config.tolerance)


@lru_cache(maxsize=64)  # each vehicle of a fleet has its own target
def _cost_to_go(knowledge: Knowledge, ground: HeightField, nodes: int, layers: int) -> FactoredCost:
    return _built(knowledge, ground, nodes, layers)


def _built(knowledge: Knowledge, ground: HeightField, nodes: int, layers: int) -> FactoredCost:
    target = np.array(knowledge.target)
    return factored_cost(knowledge.terrain, target, knowledge.radars, nodes, layers, ground)
