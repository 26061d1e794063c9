"""``textbook-observer``: the systems by which the thesis explains observers, each with one in the loop (2.1 to 2.5).

    output -> estimator -> input signal -> ODE

The systems are Examples 2.1 and 2.2, Example C.2 (a camera and two flags), van der Pol's oscillator, whose error
dynamics are linear in the right coordinates, and a pendulum for the observer of Kazantzis and Kravaris.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Le

from mathnavi.interfaces.bounds import NonNegative, Positive, TickRate, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.textbook.library import SYSTEMS, camera_and_flags
from mathnavi.models.textbook.mission import TICK, TextbookMission
from mathnavi.models.textbook.system import System
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.ode_plant import OdePlant, OdeVehicle
from mathnavi.sim.metrics.convergence import decay_rate
from mathnavi.sim.metrics.planning import planner_share
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import TextbookRecord
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.requirements import Requirement, evaluate
from mathnavi.sim.scenarios.task import Endurance, Inputs, Outcome, Task, squared_error

VEHICLE = "system"
SystemName = Literal["example-2-1", "example-2-2", "camera-and-flags", "krener-isidori", "kazantzis-kravaris"]

_LONGEST = 600.0  # [s]
_LEAST_DEVIATION = 0.01  # of the start of each state, for an estimator
_LATE = 0.75  # of a run, after which the error counts


@configuration
class TextbookConfig:
    """Fields of the scenario."""

    system: SystemName = "example-2-2"
    """system that is observed"""
    distance_known: bool = True
    """whether the distance of the flags is known; if not, it is a state (camera-and-flags)"""
    start: NumberList = ()
    """initial value of each state; the system's default if not given"""
    start_error: NumberList = ()
    """initial error of each state's estimate; the system's default if not given"""
    noise: Annotated[NonNegative, Le(1e6)] = 0.0
    """standard deviation of the reading of each output"""
    rate: Annotated[float, TickRate(TICK)] = 100.0
    """rate of readings, estimates and commands [Hz]"""
    duration: float = 10.0
    """duration of the run [s]"""
    tolerance: Annotated[Positive, Le(1e6)] = 0.1
    """largest root mean square of the error's norm over the last quarter of a run that counts as converged"""

    def __post_init__(self) -> None:
        if not (self.distance_known or self.system == "camera-and-flags"):
            raise FieldError(f"distance_known = False; allowed: only of camera-and-flags, not of {self.system}")
        check(self.duration, "duration", 1.0 / self.rate, _LONGEST)
        if abs(self.duration / TICK - round(self.duration / TICK)) > 1e-6:
            raise FieldError(f"duration = {self.duration!r}; allowed: a whole number of ticks of {TICK:g} s")
        for name in ("start", "start_error"):
            self._of_each_state(name)

    def _of_each_state(self, name: str) -> Array:
        states, given = self.observed.states, getattr(self, name)
        if given and (len(given) != len(states) or not all(map(math.isfinite, given))):
            raise FieldError(f"{name} = {given!r}; allowed: {len(states)} finite numbers, of {', '.join(states)}")
        return np.array(given or getattr(self.observed, name), dtype=np.float64)

    @property
    def observed(self) -> System:
        """System of the configuration."""
        return SYSTEMS[self.system] if self.distance_known else camera_and_flags(distance_known=False)

    @property
    def start_state(self) -> Array:
        """Initial state x(0) (n,)."""
        return self._of_each_state("start")

    @property
    def mission(self) -> TextbookMission:
        """Mission of the observer, with its estimate of the start."""
        error = self._of_each_state("start_error")
        deviation = tuple(max(abs(each), _LEAST_DEVIATION) for each in error.tolist())
        believed = tuple((self.start_state + error).tolist())
        return TextbookMission(self.observed, believed, deviation, self.noise, round(1.0 / (self.rate * TICK)) * TICK)


_FARTHEST = 2.0  # times the norm of the initial state, or 1 if larger: the error at which a learner's cost is clipped


class TextbookObserver:
    """A textbook system with an observer in the loop."""

    Config = TextbookConfig
    name = "textbook-observer"
    drawing = "mathnavi.renders.textbook.drawing"
    controller = "input_signal"
    estimator = "textbook_ekf"

    @staticmethod
    def build(
        config: TextbookConfig, seed: int, controller: PluginSpec | None = None, estimator: PluginSpec | None = None
    ) -> ClosedLoop:
        """Closed loop of one seed. Raises ValueError for an observer that does not fit the system."""
        parts = Assembler.for_scenario(TextbookObserver, config, seed, controller, estimator)
        stack = parts.stack(config.mission)
        vehicle = OdeVehicle(config.observed, config.start_state, stack.sensors)
        plant = OdePlant({VEHICLE: vehicle}, TICK, parts.streams.root)
        # L = |x^ - x|^2, the error of Definition 2.2, whose root mean square a run is evaluated by.
        cost = squared_error(VEHICLE, config.observed.difference)
        largest = _FARTHEST**2 * max(1.0, float(np.square(config.start_state).sum()))
        terms = partial(Endurance, largest, config.duration, partial(_ends, plant))
        return parts.closed_loop(
            parts.disturbed(plant, stack.planner.period, mass=1.0),
            {VEHICLE: stack.agent(len(config.observed.inputs))},
            config.duration,
            partial(finished, plant),
            partial(summarise, config, seed),
            mission=_record(config),
            task=Task({VEHICLE: Inputs.within(config.observed.inputs)}, cost, learning=terms),
        )

    @staticmethod
    def errors(config: TextbookConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Error of each state, named with its unit, of estimates (n, nx) to truths (n, nx)."""
        error = config.observed.difference(x, truth)
        return {name: error[:, k] for k, name in enumerate(config.observed.states)}


def finished(plant: OdePlant, t: float, truths: Mapping[str, Array]) -> bool:
    """True if the solution has escaped; ``t`` [s], ``truths`` (n,) by vehicle."""
    return plant.escaped(VEHICLE) is not None


def _ends(plant: OdePlant, t: float, truths: Mapping[str, Array]) -> Outcome | None:
    lost = finished(plant, t, truths) or not np.isfinite(truths[VEHICLE]).all()
    return Outcome.DIVERGED if lost else None


def summarise(
    config: TextbookConfig, seed: int, recording: Recording, wall_seconds: float
) -> tuple[dict[str, Any], bool]:
    """Flat summary of a run, and whether its estimate converged and its solution did not escape.

    ``error_*`` are norms of x^ - x; ``decay_rate_per_s`` is that of an exponential through them.
    """
    agent = recording.agents[VEHICLE]
    t = np.array([estimate.t for estimate in agent.estimates])
    x = np.array([estimate.x for estimate in agent.estimates])
    samples = np.searchsorted(recording.t, t - 0.5 * TICK)
    escapes = [event.t for event in recording.events if event.kind == "escaped"]
    lived = t <= min(escapes, default=math.inf)
    errors = config.observed.difference(x, recording.truths[VEHICLE][samples])[lived]
    error = np.linalg.norm(errors, axis=1)
    late = t[lived] >= _LATE * t[lived][-1]
    rms = float(np.sqrt(np.mean(np.square(error[late]))))
    statuses = [estimate.status for estimate in agent.estimates]
    figures = {
        "converged": rms <= config.tolerance,
        "error_start": float(error[0]),
        "error_rms": rms,
        "error_end": float(error[-1]),
        "error_max": float(error.max()),
        "decay_rate_per_s": decay_rate(t[lived], error),
        **{
            f"error_rms_{name.partition(' ')[0]}": float(np.sqrt(np.mean(np.square(errors[late, k]))))
            for k, name in enumerate(config.observed.states)
        },
        "escaped": bool(escapes),
        "escape_time_s": escapes[0] if escapes else None,
        "lost_s": statuses.count(Status.LOST) * config.mission.period,
        "degraded_s": statuses.count(Status.DEGRADED) * config.mission.period,
        "planner_share": planner_share(0.0, float(recording.t[-1]), agent.plans),
        "run_time_s": float(recording.t[-1]),
        "real_time_factor": float(recording.t[-1]) / wall_seconds,
        "seed": seed,
    }
    return evaluate(figures, [Requirement("error_rms", most=config.tolerance), Requirement("escaped", most=False)])


def _record(config: TextbookConfig) -> TextbookRecord:
    """Record of the mission in config.json."""
    system = config.observed
    return TextbookRecord(
        title=system.title,
        states=system.states,
        inputs=system.inputs,
        outputs=system.outputs,
        angles=system.angles,
        tolerance=config.tolerance,
    )
