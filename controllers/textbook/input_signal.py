"""The plug-in ``input_signal``: u(t) = constant + amplitude sin(frequency t), independent of the estimate.

A plan has the signal's values, each held over one period of the mission, and the states they lead to from the estimate;
none for a system whose motion does not follow from its state and its input alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

_PERIODS = 100  # of the mission, from one plan to the next


class DrivenSystem(Protocol):
    """Interface of a system as an input signal needs it."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Name and unit (nu,) of each input."""
        ...

    @property
    def constant(self) -> tuple[float, ...]:
        """Default constant (nu,) of the signal."""
        ...

    @property
    def amplitude(self) -> tuple[float, ...]:
        """Default amplitude (nu,) of the signal."""
        ...

    @property
    def flow(self) -> Callable[[Array, Array, float], Array]:
        """Flow of the system: the state after an input (nu,) was held from a state on for a time [s]."""
        ...


@runtime_checkable
class DrivenMission(Protocol):
    """A system that an input drives, and the period over which an input is held."""

    @property
    def system(self) -> DrivenSystem:
        """System that is driven."""
        ...

    @property
    def period(self) -> float:
        """Period [s] over which an input is held."""
        ...


@configuration
class InputSignalConfig:
    """Fields of ``--planner``."""

    constant: NumberList = ()
    """constant part of each input; the system's default if not given"""
    amplitude: NumberList = ()
    """amplitude of the sine on each input; the system's default if not given"""
    frequency: Positive = 1.0
    """frequency of the sine [rad/s]"""


class InputSignal:
    """A constant and a sine on every input, independent of the estimate."""

    Config = InputSignalConfig

    @staticmethod
    def build(config: InputSignalConfig, mission: DrivenMission) -> tuple[Planner, Tracker]:
        """Build planner and tracker of one run.

        Raises ValueError for a signal with another number of inputs than the system has.
        """
        signal = Signal(
            _of_each_input(config.constant, mission.system.constant, mission, "constant"),
            _of_each_input(config.amplitude, mission.system.amplitude, mission, "amplitude"),
            config.frequency,
        )
        return SignalPlanner(signal, mission), PlanHolder(mission.period)


@dataclass(frozen=True, eq=False)
class Signal:
    """The signal u(t) (nu,)."""

    constant: Array  # (nu,)
    amplitude: Array  # (nu,)
    frequency: float  # [rad/s]

    def __call__(self, t: float) -> Array:
        return self.constant + self.amplitude * math.sin(self.frequency * t)


class SignalPlanner:
    """Planner of the signal's next values."""

    def __init__(self, signal: Signal, mission: DrivenMission) -> None:
        self.period = _PERIODS * mission.period
        self._signal, self._mission = signal, mission
        self._is_predicted = not getattr(mission.system, "unmodelled", "")

    def plan(self, request: PlanRequest) -> Plan:
        """Plan of the signal's next values, with the states that they lead to from the estimate."""
        began = time.thread_time()
        if not np.isfinite(request.estimate.x).all():
            return Plan.failure(Status.NOT_FINITE, f"the estimate is {request.estimate.x.tolist()}")
        h, flow = self._mission.period, self._mission.system.flow
        lead = round((request.t_start - request.t) / h)  # periods until it takes over
        t: Array = request.t + h * np.arange(lead + 2 * _PERIODS + 1, dtype=np.float64)
        # The signal is held at its value in the middle of a period, which is the nearest to it.
        u = np.array([self._signal(at + 0.5 * h) for at in t[:-1]])
        x = [np.array(request.estimate.x) if self._is_predicted else np.empty(0)]
        for held in u:
            x.append(flow(x[-1], held, h) if self._is_predicted else x[0])
        phase = np.full(len(u), OPTIMISED, dtype=np.int64)
        solve_ms = 1e3 * (time.thread_time() - began)
        return Plan(t[lead:], np.array(x[lead:]), u[lead:], phase[lead:], solve_ms=solve_ms)


class PlanHolder:
    """Tracker that returns the input that the plan holds now."""

    def __init__(self, period: float) -> None:
        self.period = period

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """Input (nu,) that the plan holds at t [s]."""
        arc = int(np.searchsorted(plan.t, t + TIME_TOLERANCE, side="right")) - 1
        held: Array = plan.u[min(max(arc, 0), len(plan.u) - 1)]
        return held


def _of_each_input(given: tuple[float, ...], own: tuple[float, ...], mission: DrivenMission, name: str) -> Array:
    inputs = mission.system.inputs
    if given and len(given) != len(inputs):
        raise FieldError(f"{name} = {given!r}; allowed: one number for each of {', '.join(inputs) or 'no inputs'}")
    return np.array(given or own, dtype=np.float64)
