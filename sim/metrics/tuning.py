"""Tuning of one field of an estimator over a grid of values, by its errors on a recorded run.

The measure is the root mean square of the norm of the error of some components of the state, for example the
velocities, over all estimates from a time on, of any status:

    sqrt(mean_t |x^_i(t) - x_i(t)|^2),    i in the components.

An estimator is tuned on a separate run; results are then reported on another run, with another motion or other noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Estimator, EstimatorPlugin
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.sim.engine.log import Recording

_COUNTS = ("restarts", "refused")  # so far, in an estimate's ``extra``


@dataclass(frozen=True)
class RecordedCall:
    """One call of an estimator: its arguments, and the true state at that time."""

    t: float  # [s]
    measurements: tuple[Measurement, ...]
    command: Array  # (nu,) held since the call before
    truth: Array  # (nx,)


@dataclass(frozen=True, eq=False)
class ReplayedErrors:
    """Errors of an estimator over a recorded run."""

    t: Array  # (n,) [s]
    error: Array  # (n,) |x^_i - x_i| in the unit of the components
    restarts: int  # where the estimator counts them
    refused: int  # readings refused, where the estimator counts them
    lost: int  # number of estimates with the status LOST

    def rms(self, begin: float) -> float:
        """Root mean square error from ``begin`` [s] on; ArgumentError if there is no call after it."""
        late = self.error[self.t >= begin]
        if not len(late):
            raise ArgumentError(f"begin = {begin!r}; allowed: a time before the last call")
        return float(np.sqrt(np.mean(np.square(late))))

    def below_from(self, limit: float) -> float | None:
        """Time [s] after which the error is never above a limit; None if it is above it at the end."""
        above = np.flatnonzero(~(self.error <= limit))
        if not len(above):
            return 0.0
        return float(self.t[above[-1]]) if above[-1] < len(self.t) - 1 else None


@dataclass(frozen=True)
class Tuning:
    """Error for each value of the grid."""

    field: str
    grid: tuple[float, ...]
    errors: tuple[float, ...]  # in the unit of the components

    @property
    def best(self) -> float:
        """Value with the least error; an error that is not finite counts as the largest."""
        return self.grid[int(np.argmin(np.nan_to_num(self.errors, nan=np.inf)))]

    @property
    def at_edge(self) -> bool:
        """True if the best value is at an end of the grid, so that a better one may lie beyond."""
        return self.best in (min(self.grid), max(self.grid))


def recorded_calls(recording: Recording, name: str, sensor: str) -> list[RecordedCall]:
    """Calls of an estimator over a recorded run, with the readings of one sensor, none of them lost."""
    agent, truth = recording.agents[name], recording.truths[name]
    readings = agent.readings[sensor]
    return [
        RecordedCall(
            float(t), (Measurement(sensor, float(t), readings[k]),), agent.commands[max(0, k - 1)], truth[k]
        )
        for k, t in enumerate(recording.t)
    ]  # fmt: skip


def replayed(estimator: Estimator, calls: Iterable[RecordedCall], components: slice) -> ReplayedErrors:
    """Errors of a fresh estimator over the calls."""
    t: list[float] = []
    error: list[float] = []
    restarts = refused = lost = 0
    for call in calls:
        estimate = estimator.update(call.t, call.measurements, call.command)
        t.append(call.t)
        error.append(float(np.linalg.norm(estimate.x[components] - call.truth[components])))
        restarts, refused = (int(estimate.extra[name][0]) if name in estimate.extra else 0 for name in _COUNTS)
        lost += estimate.status == Status.LOST
    return ReplayedErrors(np.array(t), np.array(error), restarts, refused, lost)


def recorded_error(estimator: Estimator, calls: Iterable[RecordedCall], components: slice, begin: float) -> float:
    """Error of a fresh estimator over the calls from ``begin`` [s] on; ArgumentError if none exists."""
    return replayed(estimator, calls, components).rms(begin)


def spread(grid: Sequence[float], most: int) -> tuple[float, ...]:
    """Values of a grid, evenly chosen from its first to its last, ``most`` at most."""
    return tuple(grid[k] for k in sorted({round(k) for k in np.linspace(0, len(grid) - 1, min(most, len(grid)))}))


def tuned(
    plugin: type[EstimatorPlugin],
    config: Any,
    mission: Any,
    calls: Sequence[RecordedCall],
    field: str,
    grid: Sequence[float],
    components: slice,
    begin: float,
) -> Tuning:
    """Tune a ``field`` of ``config`` over a grid: try every other value and both ends, then the neighbours of the best.
    Raises ArgumentError for an empty grid.
    """
    if not grid:
        raise ArgumentError(f"grid = {grid!r}; allowed: at least one value of {field}")
    errors: dict[int, float] = {}

    def attempt(places: Iterable[int]) -> None:
        for k in sorted(set(places) - set(errors)):
            built = plugin.build(replace(config, **{field: grid[k]}), mission)
            error = recorded_error(built, calls, components, begin)
            errors[k] = error if np.isfinite(error) else np.inf

    attempt({*range(0, len(grid), 2), len(grid) - 1})
    best = min(errors, key=lambda k: errors[k])
    attempt({max(best - 1, 0), min(best + 1, len(grid) - 1)})
    tried = sorted(errors)
    return Tuning(field, tuple(grid[k] for k in tried), tuple(errors[k] for k in tried))
