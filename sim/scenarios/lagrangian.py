"""Parts that the scenarios of Paper D share: a Lagrangian system in the loop with an observer of its velocity.

position -> estimator -> controller -> forces
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Le

from mathnavi.interfaces.bounds import Positive, TickRate, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.manifold import Manifold, greatest_rate
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.ode_plant import OdePlant
from mathnavi.sim.metrics.lagrangian import VelocityErrors, errors_of, lagrangian_bound, lagrangian_summary
from mathnavi.sim.metrics.posterior_bound import PosteriorBound
from mathnavi.sim.records.missions import LagrangianRecord
from mathnavi.sim.scenarios.assembler import Assembler, VehicleStack
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.requirements import Requirement, evaluate
from mathnavi.sim.scenarios.task import Endurance, Inputs, Outcome, StageCost, Task, squared_error

TICK = 1e-3
"""physics tick [s] of the plants that have no file, which would state its own"""
_LONGEST = 600.0  # [s]
_FASTEST = 1e4  # [rad/s, m/s, 1/s] that a start may be given with

Figures = Callable[[Recording, str, Manifold, float], dict[str, Any]]
"""function (recording, vehicle, manifold, time from which errors count [s]) -> further figures of the summary"""


@configuration
class LagrangianFields:
    """Fields that all of these scenarios have."""

    tick: ClassVar[float | None] = TICK  # [s] of which the duration is a whole number; None for any duration

    reading: PositionQuality = field(default_factory=PositionQuality)
    """errors of the position readings"""
    rate: Annotated[float, TickRate(TICK)] = 1000.0
    """rate of readings, estimates and commands [Hz]"""
    duration: float = 10.0
    """duration of the run [s]"""
    speed_max: Annotated[Positive, Le(1e6)] = 100.0
    """largest rate of a joint or a body, by which estimators detect jumps and divergence [rad/s, m/s]"""
    settled: float = 2.0
    """time from which errors count [s]"""
    tolerance: Annotated[Positive, Le(1e6)] = 0.1
    """largest root mean square velocity error, after settled, that counts as converged [rad/s, m/s]"""

    def __post_init__(self) -> None:
        check(self.duration, "duration", 2.0 / self.rate, _LONGEST)
        if self.tick is not None and abs(self.duration / self.tick - round(self.duration / self.tick)) > 1e-6:
            raise FieldError(f"duration = {self.duration!r}; allowed: a whole number of ticks of {self.tick:g} s")
        check(self.settled, "settled", 0.0, self.duration)


def period_of(fields: LagrangianFields) -> float:
    """Time [s] between readings at ticks of ``TICK``."""
    return round(1.0 / (fields.rate * TICK)) * TICK


@dataclass(frozen=True)
class LagrangianCase:
    """System with its observer: the plant, the observer's knowledge, and the requirements on the run."""

    vehicle: str
    plant: Plant
    stack: VehicleStack
    mission: LagrangianMission  # of the observer
    truth: LagrangianMission  # the true one
    record: LagrangianRecord  # of the mission, in config.json
    figures: Figures | None = None  # further ones of the summary
    requirements: tuple[Requirement, ...] = ()  # on them, in addition to that on the velocity error
    inputs: Inputs | None = None  # with their bounds, if there are any
    cost: StageCost | None = None  # for commands from outside; that of the velocity error if not given
    cost_max: float | None = None  # largest cost, for a learner; speed_max^2, the error of no velocity, if not given
    resolved: LagrangianFields | None = None  # fields for config.json; the given ones if None

    @property
    def manifold(self) -> Manifold:
        """Manifold of the true positions."""
        return self.truth.system.manifold


def observed_loop(parts: Assembler, case: LagrangianCase) -> ClosedLoop:
    """Closed loop of one seed."""
    inputs = case.inputs or Inputs.within(tuple(case.mission.system.inputs))
    default = np.array(case.mission.system.constant, dtype=np.float64)
    ticks = math.ceil(parts.config.duration / case.plant.dt - 1e-6)
    return parts.closed_loop(
        parts.disturbed(case.plant, case.stack.planner.period, mass=1.0),
        {case.vehicle: case.stack.agent(len(default), command=default)},
        ticks * case.plant.dt,
        partial(finished, case),
        partial(summarise, case, parts.config, parts.seed),
        mission=case.record,
        resolved=case.resolved,
        task=Task(
            {case.vehicle: inputs}, case.cost or _velocity_cost(case), learning=partial(_terms, case, parts.config)
        ),
    )


def finished(case: LagrangianCase, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the solution has escaped, or the state is no longer finite; ``truths`` (nx,) by vehicle."""
    escaped = isinstance(case.plant, OdePlant) and case.plant.escaped(case.vehicle) is not None
    return escaped or not np.isfinite(truths[case.vehicle]).all()


def summarise(
    case: LagrangianCase, fields: LagrangianFields, seed: int, recording: Recording, wall_seconds: float
) -> tuple[dict[str, Any], bool]:
    """Summary, and whether the velocity was found, the run did not end early, and any plan was flown."""
    vehicle, manifold = case.vehicle, case.manifold
    errors = VelocityErrors.from_recording(recording, vehicle, manifold)
    figures = lagrangian_summary(errors, recording, vehicle, manifold, fields.settled, seed, wall_seconds)
    if case.figures is not None:
        figures |= case.figures(recording, vehicle, manifold, fields.settled)
    bound = lagrangian_bound(recording, vehicle, case.truth)
    recording.cramer_rao[vehicle] = bound.deviation
    figures |= _efficiency(bound, errors, recording.t, fields.settled)
    figures["escaped"] = bool(recording.t[-1] < fields.duration - 0.5 * case.plant.dt)
    agent = recording.agents[vehicle]
    figures |= {"replans": agent.requests, "plans_adopted": len(agent.plans)}
    whole, found = Requirement("escaped", most=False), Requirement("velocity_rms", most=fields.tolerance)
    planned = [Requirement("plans_adopted", least=1)] if agent.requests else []  # no requests: commanded from outside
    return evaluate(figures, [whole, found, *planned, *case.requirements])


def _efficiency(
    bound: PosteriorBound, errors: VelocityErrors, t: Array, settled: float
) -> dict[str, float | str | None]:
    """Efficiency of the velocity estimate from ``settled`` [s] on, in components at the truth; samples t (n,) [s]."""
    newest = np.searchsorted(errors.t, t + TIME_TOLERANCE, side="right") - 1
    window = slice(int(np.searchsorted(t, settled - TIME_TOLERANCE)), None)
    return bound.figures(errors.components[newest], window, f"the run from {settled:g} s on")


def _velocity_cost(case: LagrangianCase) -> StageCost:
    """Stage cost L = |Delta v|^2, Delta v as in Theorem D.2, in the components of the summary's ``velocity_rms``."""
    return squared_error(case.vehicle, lambda x, truth: errors_of(case.manifold, truth, x)[1])


def _terms(case: LagrangianCase, fields: LagrangianFields) -> Endurance:
    """A learner's terms: the solution must not escape."""

    def ends(t: float, truths: Mapping[str, Array]) -> Outcome | None:
        return Outcome.DIVERGED if finished(case, t, truths) else None

    return Endurance(case.cost_max or fields.speed_max**2, fields.duration, ends)


def recorded_as(mission: LagrangianMission, fields: LagrangianFields) -> dict[str, Any]:
    """Fields of a ``LagrangianRecord``."""
    system = mission.system
    return {
        "manifold": system.manifold.name,
        "states": tuple(system.states),
        "inputs": tuple(system.inputs),
        "tolerance": fields.tolerance,
    }


def given_start(start: NumberList, mission: LagrangianMission) -> Array:
    """State (x, v) from these numbers, x projected exactly onto its space.

    Raises MissionError for one of another size or off the space, FieldError for one too fast.
    """
    system, size = mission.system, mission.system.manifold.size
    if len(start) != len(system.states):
        raise MissionError(f"start = {start!r}; allowed: {len(system.states)} numbers, of {', '.join(system.states)}")
    for value in start[size:]:
        check(value, "start", -_FASTEST, _FASTEST)
    try:
        x = system.manifold.check(np.array(start[:size]))
    except ValueError as error:
        raise MissionError(f"start: {error}") from None
    return np.concatenate([x, start[size:]])


def checked_speed(start: Array, mission: LagrangianMission) -> Array:
    """Start (x, v), unchanged; FieldError if it is faster than the mission's ``speed_max``."""
    manifold = mission.system.manifold
    speed = greatest_rate(manifold, manifold.components(start[: manifold.size], start[manifold.size :]))
    if not speed <= mission.speed_max * (1.0 + 1e-9):  # up to rounding
        raise FieldError(f"speed_max = {mission.speed_max!r}; allowed: at least {speed:.6g}, the rate of the start")
    return start


def velocity_errors(mission: LagrangianMission, x: Array, truth: Array) -> dict[str, Array]:
    """Errors of estimates (m, nx) to truths (m, nx): distance, and each component of Delta v, by name with unit."""
    manifold = mission.system.manifold
    rows = [errors_of(manifold, row, estimate) for row, estimate in zip(truth, x, strict=True)]
    velocity = np.array([row[1] for row in rows])
    names = mission.system.states[-manifold.dimension :]
    return {
        "distance [-]": np.array([row[0] for row in rows]),
        **{name: velocity[:, k] for k, name in enumerate(names)},
    }
