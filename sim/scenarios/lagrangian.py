"""What the scenarios of Paper D share: a Lagrangian system in the loop with an observer of its velocity.

position -> estimator -> controller -> forces
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from annotated_types import Le

from mathnavi.models.manifold.manifold import Manifold
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import PositionQuality
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.ode_plant import OdePlant
from mathnavi.sim.interfaces.bounds import Positive, TickRate, configuration
from mathnavi.sim.interfaces.checks import check
from mathnavi.sim.interfaces.errors import FieldError
from mathnavi.sim.interfaces.number_lists import NumberList
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.lagrangian import errors_of, lagrangian_summary
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller, checked_estimator
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, recorded
from mathnavi.sim.scenarios.requirements import Requirement, judged
from mathnavi.sim.scenarios.task import Inputs, StageCost, Task, squared_error

TICK = 1e-3
"""[s] of the plants"""
_LONGEST = 600.0  # [s]
_FASTEST = 1e4  # [rad/s, m/s, 1/s] that a start may be told with


@configuration
class LagrangianFields:
    """Fields that every one of these scenarios has."""

    reading: PositionQuality = field(default_factory=PositionQuality)
    """how the position errs"""
    rate: Annotated[float, TickRate(TICK)] = 1000.0
    """readings, estimates and commands a second [Hz]"""
    duration: float = 10.0
    """[s]"""
    speed_max: Annotated[Positive, Le(1e6)] = 30.0
    """what |v|_g = sqrt(2 T) is at most, T being the kinetic energy, by which some estimators tell jumps [-]"""
    settled: float = 2.0
    """from when on errors count [s]"""
    tolerance: Annotated[Positive, Le(1e6)] = 0.1
    """root mean square of the velocity error after that, which counts as converged [rad/s, m/s]"""

    def __post_init__(self) -> None:
        check(self.duration, "duration", 2.0 / self.rate, _LONGEST)
        if abs(self.duration / TICK - round(self.duration / TICK)) > 1e-6:
            raise FieldError(f"duration = {self.duration!r}; allowed: a whole number of ticks of {TICK:g} s")
        check(self.settled, "settled", 0.0, self.duration)

    @property
    def period(self) -> float:
        """[s] between readings."""
        return round(1.0 / (self.rate * TICK)) * TICK


@dataclass(frozen=True)
class Loop:
    """What a scenario makes of its fields: the plant, what an observer knows, and what a figure is told with."""

    name: str  # of the scenario
    vehicle: str
    plant: Plant
    mission: LagrangianMission  # as it is believed
    truth: LagrangianMission  # as it is
    told: Mapping[str, Any]  # beside the fields, for the drawings
    figures: Callable[[Recording, str, Manifold, float], dict[str, Any]] | None = None  # further ones of the summary
    requirements: tuple[Requirement, ...] = ()  # of them, beside that of the velocity error
    inputs: Inputs | None = None  # with their bounds, where there are any
    cost: StageCost | None = None  # for whoever commands the inputs; that of the velocity error if not given

    def closed_loop(
        self, fields: LagrangianFields, seed: int, controller: PluginSpec, estimator: PluginSpec
    ) -> ClosedLoop:
        """The closed loop of one seed."""
        planner, tracker = checked_controller(controller, self.mission)
        observer = checked_estimator(estimator, self.mission)
        manifold = self.truth.system.manifold

        def finished(t: float, truths: Mapping[str, Array]) -> bool:
            escaped = isinstance(self.plant, OdePlant) and self.plant.escaped(self.vehicle) is not None
            return escaped or not np.isfinite(truths[self.vehicle]).all()

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            figures = lagrangian_summary(recording, self.vehicle, manifold, fields.settled, seed, wall_seconds)
            if self.figures is not None:
                figures |= self.figures(recording, self.vehicle, manifold, fields.settled)
            figures["escaped"] = bool(recording.t[-1] < fields.duration - 0.5 * TICK)
            whole, found = Requirement("escaped", most=False), Requirement("velocity_rms", most=fields.tolerance)
            return judged(figures, [whole, found, *self.requirements])

        agent = Agent(observer, planner, tracker, len(self.mission.system.inputs))
        record = recorded(
            self.name, "mathnavi.renders.lagrangian.drawing", seed, fields, controller, estimator,
            mission={
                "manifold": manifold.name,
                "states": self.truth.system.states,
                "inputs": self.truth.system.inputs,
                "tolerance": fields.tolerance,
                **self.told,
            },
        )  # fmt: skip
        inputs = self.inputs or Inputs.within(tuple(self.mission.system.inputs))
        task = Task({self.vehicle: inputs}, self.cost or self._velocity_error())
        return ClosedLoop(self.plant, {self.vehicle: agent}, fields.duration, finished, summarise, record, task=task)

    def _velocity_error(self) -> StageCost:
        """L = |Delta v|^2, Delta v as in Theorem D.2, in the components that the summary's ``velocity_rms`` is of."""
        manifold = self.truth.system.manifold
        return squared_error(self.vehicle, lambda x, truth: errors_of(manifold, truth, x)[1])


def given_start(start: NumberList, mission: LagrangianMission) -> Array:
    """The state (x, v) of these numbers, x put exactly on its space.

    Raises ValueError for one of another size, off the space, not finite or too fast.
    """
    system, size = mission.system, mission.system.manifold.size
    if len(start) != len(system.states):
        raise ValueError(f"start = {start!r}; allowed: {len(system.states)} numbers, of {', '.join(system.states)}")
    for value in start[size:]:
        check(value, "start", -_FASTEST, _FASTEST)
    return np.concatenate([system.manifold.check(np.array(start[:size])), start[size:]])


def checked_speed(start: Array, mission: LagrangianMission) -> Array:
    """The start (x, v); ValueError for one faster than the mission says that the system ever is."""
    manifold = mission.system.manifold
    speed = manifold.norm(start[: manifold.size], start[manifold.size :])
    if not speed <= mission.speed_max * (1.0 + 1e-9):  # a body's is half its rate, but for rounding
        raise ValueError(f"speed_max = {mission.speed_max!r}; allowed: at least |v|_g = {speed:.6g} of the start")
    return start


def velocity_errors(mission: LagrangianMission, x: Array, truth: Array) -> dict[str, Array]:
    """Of estimates (m, nx): the distance, and each component of Delta v, by name with unit."""
    manifold = mission.system.manifold
    rows = [errors_of(manifold, row, estimate) for row, estimate in zip(truth, x, strict=True)]
    off = np.array([row[1] for row in rows])
    names = mission.system.states[-manifold.dimension :]
    return {
        "distance [-]": np.array([row[0] for row in rows]),
        **{name: off[:, k] for k, name in enumerate(names)},
    }
