"""Fields of ``simultaneous-arrival``: the fleet, its task, its radio and its faults."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval, Le

from mathnavi.interfaces.bounds import (
    THREE_FINITE_NUMBERS,
    Each,
    Fraction,
    NonNegative,
    Within,
    configuration,
)
from mathnavi.interfaces.checks import check, check_names
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.fields import with_fields
from mathnavi.interfaces.input_files import PluginName
from mathnavi.interfaces.reading.files import parsed
from mathnavi.models.aerial.dynamics import HULL_RADIUS
from mathnavi.models.fleet.graph import Graph
from mathnavi.models.terrain.library import TerrainPlace
from mathnavi.sim.engine.network import (
    DelayedLinks,
    IdealNetwork,
    LossyLinks,
    Network,
    Partition,
    partitioned,
    within_range,
)
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.fault_fields import AerialFaults, PositiveMagnitude
from mathnavi.sim.scenarios.flight_fields import (
    Datum,
    DeadlineFactor,
    DrawnHeights,
    FinitePoint,
    FlightNoise,
    LimitFields,
    MissionFields,
    Rate,
)
from mathnavi.sim.scenarios.information import ChangeFields
from mathnavi.sim.scenarios.redraw import ChanceFields

GraphName = Literal["line", "ring", "complete", "random"]
SlotAssignment = Literal["least_squares", "in_order"]
SeparationRuleName = Literal["agreement", "delay_check"]

EXCHANGE_PERIOD = 1.0 / 12.0  # [s] between two exchanges of messages, also of the consensus
_MOST = 256
_FARTHEST, _FASTEST = 20.0, 0.01  # [s] of a clock, and of its drift
HullSeparation = Annotated[
    PositiveMagnitude,
    Within(Ge(2.0 * HULL_RADIUS), allowed=f">= {2.0 * HULL_RADIUS:g} m, the radii of two vehicles' hulls together"),
]
_NAME = re.compile(r"[A-Za-z0-9_-]+")


@configuration(prefix="radio.")
class Radio:
    """Radio between the vehicles: range, delays, losses and cuts."""

    range: PositiveMagnitude | None = None
    """distance up to which two vehicles receive each other's messages [m]; unlimited if not given"""
    delay: tuple[float, float] = (0.0, 0.0)
    """least and largest delay of a message [s]"""
    loss: Fraction = 0.0
    """fraction of the messages that are lost"""
    duplication: Fraction = 0.0
    """fraction of the arriving messages that arrive twice"""
    partition: tuple[float, float] = (0.0, 0.0)
    """times from which and until which the two halves of the fleet do not receive each other's messages [s]"""

    def __post_init__(self) -> None:
        for name in ("delay", "partition"):
            low, high = getattr(self, name)
            check(low, f"radio.{name}", 0.0)
            check(high, f"radio.{name}", low)

    def network(self, names: Sequence[str], rng: np.random.Generator, distance: Callable[[str, str], float]) -> Network:
        """Network between these vehicles, which draws delays and losses from ``rng``.

        ``distance(one, other)`` [m] is the present distance between two of them.
        """
        delays, losses = rng.spawn(2)
        network: Network = IdealNetwork(names)
        if self.delay[1] > 0.0:
            network = DelayedLinks(network, *self.delay, delays)
        if self.loss > 0.0 or self.duplication > 0.0:
            network = LossyLinks(network, self.loss, self.duplication, losses)
        if self.range is not None:
            network = within_range(network, distance, self.range)
        if self.partition[1] > self.partition[0]:
            network = partitioned(network, [Partition(*self.partition, frozenset(names[: len(names) // 2]))])
        return network


@configuration(prefix="clocks.")
class Clocks:
    """Clocks of the vehicles; without an offset and a drift they have a common clock."""

    offset: Annotated[NonNegative, Le(_FARTHEST)] = 0.0
    """half-width of each clock's initial error [s]"""
    drift: Annotated[NonNegative, Le(_FASTEST)] = 0.0
    """half-width of each clock's drift [s per second]"""
    error: Annotated[NonNegative, Le(_FARTHEST)] = 0.0
    """largest error of a corrected clock, which enlarges the distance that vehicles keep [s]"""
    settling: NonNegative = 5.0
    """initial time in which the vehicles only synchronise their clocks [s]"""

    def __post_init__(self) -> None:
        if not self.agree and self.error == 0.0:
            raise FieldError(
                f"clocks.error = {self.error!r} with clocks.offset = {self.offset:g} and clocks.drift = "
                f"{self.drift:g}; allowed: > 0, for corrected clocks are not exact"
            )

    @property
    def agree(self) -> bool:
        """True if there is a common clock."""
        return self.offset == 0.0 and self.drift == 0.0


@configuration
class FleetEndFields:
    """Vehicles of a fleet, their starts and targets, and the ground below."""

    terrain: TerrainPlace = MissionFields.terrain
    """name of a terrain, or an .npz file"""
    vehicles: Annotated[int, Interval(ge=2, le=_MOST)] = 4
    """number of vehicles"""
    name: tuple[str, ...] = ()
    """name of a vehicle, given once for each; vehicle_1, vehicle_2, ... if not given"""
    start: Annotated[tuple[Point, ...], Each(THREE_FINITE_NUMBERS)] = ()
    """start x, y, z [m] of a vehicle, given once for each; drawn from the seed if not given"""
    target: FinitePoint | None = None
    """middle x, y, z [m] of the slots; drawn from the seed if not given"""
    slot_spacing: PositiveMagnitude = 1500.0
    """distance between neighbouring slots on their ring [m]"""
    slot_assignment: SlotAssignment = "least_squares"
    """assignment of slots: by least squares of the distances from the starts, or the k-th to the k-th vehicle"""
    separation: HullSeparation = 200.0
    """least distance d_s between the centres of two vehicles [m]"""
    drawn_heights: DrawnHeights = MissionFields.drawn_heights
    """heights above h_min between which starts and the target are drawn [m]"""
    drawn_distance: DrawnHeights = (0.4, 0.9)
    """shares of the map's side between which the distances of drawn starts from the target lie"""
    datum: Datum = MissionFields.datum
    """surface from which the heights of starts and targets are measured: the map's, or one that the map must state"""


@configuration
class FleetFields(LimitFields, FleetEndFields):
    """Vehicles of a fleet, their starts and targets, the ground, their bounds, and their agreement."""

    deadline_factor: DeadlineFactor = 1.5
    """ratio gamma of the fleet's deadline to the duration of the longest first plan"""
    arrival_radius: PositiveMagnitude = LimitFields.arrival_radius
    """distance r_f from its slot within which a vehicle has arrived [m]"""
    spread: PositiveMagnitude = 5.0 / 3.0
    """largest spread of the arrival times that counts as one time [s]"""
    graph: GraphName = "ring"
    """graph of the vehicles that agree on the arrival time (a ring of two is a line); plans go to all"""
    edge: tuple[tuple[str, str, float], ...] = ()
    """edge NAME NAME WEIGHT [-] of a user-defined graph, in place of --graph; may be given several times"""
    consensus: Annotated[str, PluginName(partial(load, "consensus"))] = "maximum"
    """consensus plug-in that agrees on the arrival time"""
    consensus_with: tuple[str, ...] = ()
    """field FIELD=VALUE of the consensus plug-in; may be given several times"""
    separation_rule: SeparationRuleName = "agreement"
    """rule that keeps plans apart: flown if all others agree, or (RMADER) if no plan received meanwhile conflicts"""
    delay_check: NonNegative = 0.5
    """duration delta_DC of RMADER's check of received plans [s]; vehicles keep apart if no message takes longer"""
    control_rate: Rate = MissionFields.control_rate
    """rate of estimator, tracker and log [Hz]; the physics runs at 300 Hz"""

    def __post_init__(self) -> None:
        if self.start and len(self.start) != self.vehicles:
            raise FieldError(f"start = {len(self.start)} points; allowed: {self.vehicles}, one for each vehicle")
        if self.slot_spacing < self.separation:
            raise FieldError(
                f"separation = {self.separation!r}; allowed: <= slot_spacing = {self.slot_spacing!r}, because "
                "vehicles at their slots keep it too"
            )
        if self.name and len(self.name) != self.vehicles:
            raise FieldError(f"name = {self.name!r}; allowed: {self.vehicles}, one for each vehicle")
        try:
            check_names(self.names)
        except FieldError as error:
            raise FieldError(f"name: {error}") from None
        for name in self.names:
            if not _NAME.fullmatch(name):
                raise FieldError(f"name = {name!r}; allowed: letters, digits, _ and -")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return self.name or tuple(f"vehicle_{k + 1}" for k in range(self.vehicles))

    def network_graph(self, rng: np.random.Generator) -> Graph:
        """Graph of communication; FieldError for impossible edges, or edges that leave a vehicle out."""
        if self.edge:
            edges: dict[tuple[str, str], float] = {}
            for one, other, weight in self.edge:
                if (one, other) in edges or (other, one) in edges:
                    raise FieldError(f"edge = {(one, other, weight)!r}; allowed: each pair of vehicles once")
                edges[one, other] = weight
            try:
                return Graph.from_edges(self.names, edges).checked_connected()
            except ValueError as error:
                raise FieldError(f"edge: {error}") from None
        if self.graph == "random":
            return Graph.random_connected(self.names, 0.3, rng)
        graph = "line" if self.vehicles == 2 else self.graph
        return {"line": Graph.line, "ring": Graph.ring, "complete": Graph.complete}[graph](self.names)

    def consensus_config(self, plugin: Any) -> Any:
        """Configuration of the consensus; FieldError for a field that it does not have, or a value that it refuses."""
        fields: dict[str, Any] = {}
        for each in self.consensus_with:
            name, equals, value = each.partition("=")
            if not (name and equals):
                raise FieldError(f"consensus_with = {each!r}; allowed: FIELD=VALUE")
            if name == "period":
                raise FieldError(
                    f"consensus_with = {each!r}; allowed: any field but the period, which is {EXCHANGE_PERIOD:.4g} s"
                )
            try:
                fields[name] = parsed(value, name, FieldError)
            except FieldError:
                fields[name] = value
        config = plugin.Config()
        if hasattr(config, "period"):
            config = dataclasses.replace(config, period=EXCHANGE_PERIOD)
        try:
            return with_fields(config, fields)
        except ValueError as error:
            raise FieldError(f"consensus_with: {error}") from None


@configuration
class SimultaneousArrivalConfig(ChangeFields, ChanceFields, FleetFields):
    """Fields of the scenario."""

    kernels: ClassVar[str] = "mathnavi.controllers.arrival.separation"  # compiled before the first run

    radio: Radio = field(default_factory=Radio)
    clocks: Clocks = field(default_factory=Clocks)
    noise: FlightNoise = field(default_factory=FlightNoise)
    faults: AerialFaults = field(default_factory=AerialFaults)

    def __post_init__(self) -> None:
        FleetFields.__post_init__(self)
        ChangeFields.__post_init__(self)
        if self.faults.position_jump > 0.0:
            raise FieldError(f"faults.position_jump = {self.faults.position_jump!r}; allowed in a fleet: 0")
