"""Runner of a scenario whose actuators are commanded from outside, instead of by planner and tracker, in episodes.

The sensors, the estimator, the disturbances and the faults are those of a run of the same seed. A command is held for
the tracker's period. The observation is the newest estimate, never the truth:

    t            [s] at which the estimate is valid
    x            (nx,) the state, as the scenario's estimator has it
    covariance   (nx, nx) if the estimator has one; zeros without one that is finite and of its size
    status       0 ok, 1 initialising, 2 lost, 3 degraded
    attitude, rate of a quadrotor: the parts of its estimate that it cannot be flown without

Of a fleet, each of these and the command have a row for each vehicle.

**Mission and seeds.** The random part of a mission, for example start and target of a flight, is drawn once, from the
seed of the environment; everything else that a scenario draws, noise, gusts and the start of a robot that must localise
itself, is drawn from the seed of the episode. So terrain, models and cost-to-go are built once, and an episode is a run
of these fields and this seed.

A copy, by ``pickle`` or ``copy.deepcopy``, is rebuilt from the specification: it has the mission and no episode.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from mathnavi.interfaces.boundary import Unusable, answered
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import Loop, whole_ticks
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.assembler import Assembler, RandomStreams
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.task import Inputs, LearningTerms, Outcome, ProposalFilter, Sample, Task

STATUSES = (Status.OK, Status.INITIALISING, Status.LOST, Status.DEGRADED)
"""status of an estimate, by the number that is observed"""

Observation = dict[str, Any]

_SEEDS = 2**31
_FIRST_SAMPLES = 100  # within which an estimator that will have a covariance has one, or is still initialising


@dataclasses.dataclass(frozen=True)
class EpisodeStep:
    """Observation and reward after a command."""

    observation: Observation
    reward: float  # minus the integral of the stage cost
    terminated: bool  # the vehicle has arrived, touched something, or left every bound: the mission is over
    truncated: bool  # the time is up, and the episode could have gone on
    info: dict[str, Any]  # "outcome", "clearance" and "events", see ``EpisodeRunner.info``

    @property
    def last(self) -> bool:
        """True if no step comes after this one."""
        return self.terminated or self.truncated


def checked_numbers(action: Any, shape: tuple[int, ...], what: str = "action has", meaning: str = "") -> Array:
    """Return an action as an array of the episode's own; ArgumentError for one of another shape, or of no numbers.

    ``what`` begins the messages, and ``meaning`` ends that on a shape.
    """
    u = answered(lambda: np.array(action))
    if isinstance(u, Unusable):
        raise ArgumentError(f"{what} type {type(action).__name__} ({u.reason}); allowed: an array of shape {shape}")
    if u.shape != shape:
        raise ArgumentError(f"{what} shape {u.shape}; allowed: {shape}{meaning}")
    if u.dtype.kind not in "biuf":
        raise ArgumentError(f"{what} elements of {u.dtype}; allowed: numbers")
    return u.astype(np.float64, copy=False)


def finite_squares(u: Array) -> bool:
    """Return True if the sum of the squares is finite."""
    with np.errstate(over="ignore"):
        return bool(np.isfinite(np.square(u).sum()))


def drawn_seed(rng: np.random.Generator) -> int:
    """Draw a seed for the next episode."""
    return int(rng.integers(_SEEDS))


class EpisodeRunner:
    """Runner of one mission of a scenario, episode by episode."""

    def __init__(self, spec: RunSpec) -> None:
        """Build the mission of a run.

        Raises ValueError for a mission that cannot be flown, and for a scenario that has nothing to command.
        """
        if getattr(spec.config, "filter", False):
            raise ArgumentError(
                "filter = True is for a run; allowed for an environment: SafetyFilterWrapper or FilteredEnvironment "
                "around it"
            )
        self._given = spec
        first = spec.build()
        self._task, self._terms = _commanded(spec.scenario, first)
        self._spec = dataclasses.replace(spec, config=dataclasses.replace(spec.config, **self._task.mission))
        self.mission: dict[str, Any] = first.config["mission"]
        """mission of the scenario, as in a run's config.json"""
        self.names = tuple(first.agents)
        """names of the vehicles, in the order of the rows"""
        self._steps = _steps_per_command(spec.scenario, first)
        self.period = first.agents[self.names[0]].tracker.period
        """time [s] for which a command is held"""
        self.plant = first.plant
        """plant with the model of the mission"""
        self.start = self.rows([first.plant.state(name) for name in self.names])
        """true state (nx,) or (n, nx) at the start of the mission as drawn"""
        self._loop = Loop(first.plant, first.agents, first.duration)
        self.outcome: Outcome | None = None
        """outcome of the mission; None while it goes on"""
        self._sizes: dict[str, tuple[int, ...]] = {}  # of the covariances, once they are known
        self.has_covariance = self._finds_covariance()
        """whether the estimators have a covariance"""
        self.example = self._observation()
        """example of an observation, for the shapes"""
        self._closed_loop: ClosedLoop | None = None

    def __reduce__(self) -> tuple[type[EpisodeRunner], tuple[RunSpec]]:
        return EpisodeRunner, (self._given,)

    def __deepcopy__(self, _: dict[int, Any]) -> EpisodeRunner:
        return EpisodeRunner(self._given)

    @property
    def config(self) -> Any:
        """Fields of the scenario, with those of the mission as drawn."""
        return self._spec.config

    def streams(self, seed: int) -> RandomStreams:
        """Return the random streams of the episode of a seed."""
        spec = self._spec
        parts = spec.scenario_class, spec.config, seed, spec.controller, spec.estimator
        return Assembler.for_scenario(*parts).streams

    @property
    def inputs(self) -> Inputs:
        """Inputs of each vehicle, with their bounds."""
        return self._task.inputs[self.names[0]]

    @property
    def t(self) -> float:
        """Time [s] of the last sample."""
        return self._loop.t

    @property
    def estimates(self) -> Mapping[str, Estimate]:
        """The newest estimate of each vehicle."""
        return self._sample.estimates

    def filters(self) -> Mapping[str, ProposalFilter]:
        """Return new safety filters, one for each vehicle; ArgumentError for a scenario that defines none."""
        if self._task.filters is None:
            raise ArgumentError(
                f"scenario = {self._spec.scenario!r} defines no safety filter; allowed: safe-flight, "
                "simultaneous-arrival, quadrotor-canyon"
            )
        return self._task.filters()

    @property
    def proposals(self) -> Inputs:
        """Inputs for the commands that are proposed to the safety filter of each vehicle, with their bounds."""
        return self._task.proposals[self.names[0]]

    @property
    def recording(self) -> Recording:
        """Return the log of the episode so far, including the truth; ValueError before the first one."""
        self._begun()
        return dataclasses.replace(self._loop.recording).end()

    def rows(self, of_vehicles: list[Any]) -> Array:
        """Stack one array for each vehicle as rows; return it unchanged if there is one vehicle."""
        return np.array(of_vehicles if len(self.names) > 1 else of_vehicles[0])

    def begin(self, seed: int) -> Observation:
        """Begin a new episode, with new components."""
        closed_loop = self._spec.with_seed(seed).build()
        self._loop = Loop(closed_loop.plant, closed_loop.agents, closed_loop.duration, closed_loop.network)
        self._closed_loop = closed_loop
        self._task, self._terms = _commanded(self._spec.scenario, closed_loop)
        self._loop.observe()
        with self._spec.failures("an episode"):
            self._finished = bool(closed_loop.finished(self._loop.t, self._loop.truths))
            self._sample = self._sampled()
            self.outcome = None
            self._referee()
        return self._observation()

    def check_goes_on(self) -> None:
        """Raise ArgumentError if no episode has begun or it is over."""
        self._begun()
        if self._loop.over or self._finished:
            raise ArgumentError(f"step() at {self._loop.t:.6g} s: the episode is over; allowed: after reset()")

    def step(self, command: Any) -> EpisodeStep:
        """Hold a command (nu,), of a fleet (n, nu), for a period.

        Raises ValueError for a command of another shape or not finite, and if no episode has begun or it is over. The
        plant clips commands to the bounds of the inputs, as in any run. A control step without a finite cost, because
        the physics has diverged, costs nothing.
        """
        self.check_goes_on()
        loop, commands = self._loop, self.checked(command, self.inputs)
        cost, events = 0.0, len(loop.recording.events)
        for _ in range(self._steps):
            cost += self.advance(commands)
            if self._finished or loop.over:
                break
        over = loop.over and not self._finished
        if over and self.outcome is None and self._terms is not None:
            self.outcome = self._terms.at_deadline
        return EpisodeStep(self._observation(), 0.0 - cost, self._finished, over, self.info(events))

    def advance(self, commands: Mapping[str, Array]) -> float:
        """Make one control step under the commands (nu,) by vehicle; return its stage cost."""
        closed_loop, loop = self._begun(), self._loop
        for name, u in commands.items():
            loop.command(name, u)
        loop.advance()
        loop.observe()
        before, self._sample = self._sample, self._sampled()
        with self._spec.failures("an episode"):
            self._finished = loop.diverged or bool(closed_loop.finished(loop.t, loop.truths))
            self._referee()
            return self._cost(before, commands)

    def _referee(self) -> None:
        """Set the outcome once the mission has ended; a vehicle that arrives past its deadline is late."""
        terms = self._terms
        if terms is None or self.outcome is not None:
            return
        if self._loop.diverged:
            self.outcome = Outcome.DIVERGED
            return
        self.outcome = terms.outcome(self._loop.t, self._loop.truths)
        if self.outcome is Outcome.ARRIVED and self._loop.t > terms.deadline + TIME_TOLERANCE:
            self.outcome = Outcome.LATE

    def info(self, since: int) -> dict[str, Any]:
        """Return information in addition to the observation: the "outcome", "" while the mission goes on; the
        "clearance" [m] of the true state, if there is something to touch; and the kinds of the "events" from number
        ``since`` on.
        """
        loop, terms = self._loop, self._terms
        info: dict[str, Any] = {
            "outcome": "" if self.outcome is None else self.outcome.value,
            "events": tuple(event.kind for event in loop.recording.events[since:]),
        }
        clearance = None if terms is None else terms.clearance(loop.t, loop.truths)
        return info if clearance is None else info | {"clearance": clearance}

    @property
    def present_plant(self) -> Plant:
        """Return the plant of the present episode with its disturbances; ValueError before the first one."""
        return self._begun().plant

    @property
    def events(self) -> int:
        """Number of the events so far."""
        return len(self._loop.recording.events)

    @property
    def truths(self) -> Mapping[str, Array]:
        """Return the true states (nx,) at the last sample, for a reward and never for an observation."""
        return self._loop.truths

    @property
    def control_steps(self) -> int:
        """Number of control steps, each with a sample, in the tracker's period."""
        return self._steps

    @property
    def terms(self) -> LearningTerms:
        """Return the learning terms of the present episode; ArgumentError for a scenario that defines none."""
        if self._terms is None:
            raise ArgumentError(
                f"scenario = {self._spec.scenario!r} defines no learning terms; allowed: one whose Task has learning"
            )
        return self._terms

    def _cost(self, before: Sample, commands: Mapping[str, Array]) -> float:
        """Return the stage cost from the previous sample to the present one; 0 where it is not finite."""
        if not all(np.isfinite(x).all() for x in self._sample.truths.values()):
            return 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            cost = self._task.cost(before, self._sample, commands)
        return cost if math.isfinite(cost) else 0.0

    def _begun(self) -> ClosedLoop:
        if self._closed_loop is None:
            raise ArgumentError("no episode has begun; allowed: after reset()")
        return self._closed_loop

    def checked(self, command: Any, inputs: Inputs) -> dict[str, Array]:
        """Return the command (nu,) of each vehicle to these inputs; ArgumentError for one of another shape or not
        finite.
        """
        size = len(inputs.names)
        shape = (len(self.names), size) if len(self.names) > 1 else (size,)
        u = checked_numbers(command, shape, meaning=f", of {', '.join(inputs.names)}")
        if not finite_squares(u):
            raise ArgumentError(f"action = {u.tolist()}; allowed: finite numbers, whose squares are finite too")
        return dict(zip(self.names, u.reshape(len(self.names), size), strict=True))

    def _sampled(self) -> Sample:
        return Sample(self._loop.t, self._loop.truths, _estimates(self._spec.scenario, self._loop))

    def _finds_covariance(self) -> bool:
        """Return True if the estimators have a covariance, found by letting them observe without commands while they
        are initialising.

        One that is still initialising after some samples is assumed to have one.
        """
        for _ in range(_FIRST_SAMPLES):
            self._loop.observe()
            self._sample = self._sampled()
            estimates = self._sample.estimates.values()
            if any(estimate.covariance is not None for estimate in estimates):
                self._sizes = {
                    name: estimate.covariance.shape
                    for name, estimate in self._sample.estimates.items()
                    if estimate.covariance is not None
                }
                return True
            if self._loop.over or all(estimate.status is not Status.INITIALISING for estimate in estimates):
                return False
            self._loop.advance()
        return True

    def _observation(self) -> Observation:
        """Return the observation in new arrays, which nothing that follows changes."""
        estimates = [self._sample.estimates[name] for name in self.names]
        observation: Observation = {
            "t": self.rows([estimate.t for estimate in estimates]),
            "x": self.rows([estimate.x for estimate in estimates]),
            "status": self.status,
        }
        if self.has_covariance:
            observation["covariance"] = self.covariance
        return observation | {
            name: self.rows([estimate.extra[name] for estimate in estimates]) for name in self._task.observed
        }

    @property
    def status(self) -> Any:
        """Return the index of the estimate's status in ``STATUSES``, of a fleet (n,)."""
        return self.rows([_number(self._sample.estimates[name].status) for name in self.names])[()]

    @property
    def covariance(self) -> Array:
        """Return the covariance (nx, nx) of the estimate, of a fleet (n, nx, nx)."""
        return self.rows([_covariance(self._sample.estimates[name], self._sizes.get(name)) for name in self.names])


def _commanded(scenario: str, closed_loop: ClosedLoop) -> tuple[Task, LearningTerms | None]:
    """Return the task of a closed loop, and a learner's terms of one episode of it."""
    if closed_loop.task is None:
        raise ArgumentError(f"scenario = {scenario!r} defines no stage cost; allowed: one whose ClosedLoop has a task")
    if idle := [name for name, inputs in closed_loop.task.inputs.items() if not inputs.names]:
        raise ArgumentError(
            f"scenario = {scenario!r}: {idle[0]!r} has no actuators, so there is nothing to command; allowed: one with "
            "inputs"
        )
    return closed_loop.task, None if closed_loop.task.learning is None else closed_loop.task.learning()


def _steps_per_command(scenario: str, closed_loop: ClosedLoop) -> int:
    periods = {agent.tracker.period for agent in closed_loop.agents.values()}
    if len(periods) > 1:
        raise ArgumentError(
            f"scenario = {scenario!r}: the trackers' periods are {sorted(periods)}; allowed: one for all"
        )
    stride = Loop(closed_loop.plant, closed_loop.agents, closed_loop.duration).stride
    return whole_ticks(periods.pop(), closed_loop.plant.dt, "the tracker's period") // stride


def _estimates(scenario: str, loop: Loop) -> dict[str, Estimate]:
    found = {name: runner.estimate for name, runner in loop.runners.items()}
    if blind := [name for name, estimate in found.items() if estimate is None]:
        complaints = [event.message for event in loop.recording.events if event.kind == "estimate-unusable"]
        raise ArgumentError(
            f"scenario = {scenario!r}: {blind[0]!r} has no estimate at {loop.t:.6g} s: {complaints[-1]}"
        )
    return {name: estimate for name, estimate in found.items() if estimate is not None}


def _number(status: Status) -> int:
    """Return the observed number of a status; one that has none is lost."""
    return STATUSES.index(status) if status in STATUSES else STATUSES.index(Status.LOST)


def _covariance(estimate: Estimate, size: tuple[int, ...] | None) -> Array:
    n, P = len(estimate.x), estimate.covariance
    if P is None or P.shape != (size or P.shape) or not np.isfinite(P).all():
        return np.zeros(size or (n, n))
    return P.copy()
