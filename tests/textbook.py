"""A textbook system that runs and is read: what tests feed to its estimators."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.system import System

PERIOD = 0.01  # [s]


@dataclass(frozen=True)
class Step:
    """One call of an estimator: what it is given, and what is true then."""

    t: float
    measurements: tuple[Measurement, ...]
    command: Array  # (p,) held since the last call
    truth: Array  # (n,)


def mission(system: System, start_error: Sequence[float] | None = None, noise: float = 0.0) -> TextbookMission:
    """With a start that is off by so much, by the system's own error if not given."""
    error = np.array(system.start_error if start_error is None else start_error)
    return TextbookMission(
        system, tuple(np.array(system.start) + error), tuple(np.maximum(np.abs(error), 0.01)), noise, PERIOD
    )


def steps(system: System, duration: float, start: Sequence[float] | None = None) -> Iterator[Step]:
    """The system under its own input, held over each period at its value in the middle, and read without noise."""
    x, u = np.array(system.start if start is None else start), np.zeros(len(system.inputs))
    for k in range(round(duration / PERIOD) + 1):
        t = k * PERIOD
        yield Step(t, (Measurement("output", t, system.output(x, u)),), u, x)
        u = np.array(system.constant) + np.array(system.amplitude) * math.sin(t + 0.5 * PERIOD)
        x = system.flow(x, u, PERIOD)


def replayed(estimator: Estimator, given: Sequence[Step]) -> list[Estimate]:
    return [estimator.update(step.t, step.measurements, step.command) for step in given]
