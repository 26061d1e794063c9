"""The best of a stated grid of one field of an estimator, by how it does on a recorded run.

The measure is the root mean square of the length of the error of some components of the state, the velocities for one,
over all estimates from a time on, whatever their status is:

    sqrt(mean_t |x^_i(t) - x_i(t)|^2),    i in the components.

An estimator is tuned on a run of its own; what is then reported is another run, of another motion or with other noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mathnavi.sim.engine.log import Recording
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.protocols import Estimator, EstimatorPlugin
from mathnavi.sim.interfaces.signals import Array, Measurement, Status

_COUNTS = ("restarts", "refused")  # so far, in an estimate's ``extra``


@dataclass(frozen=True)
class RecordedCall:
    """One call of an estimator: what it is given, and what is true then."""

    t: float  # [s]
    measurements: tuple[Measurement, ...]
    command: Array  # (nu,) held since the call before
    truth: Array  # (nx,)


@dataclass(frozen=True, eq=False)
class ReplayedErrors:
    """Estimates of an estimator over a recorded run."""

    t: Array  # (n,) [s]
    error: Array  # (n,) |x^_i - x_i| in the unit of the components
    restarts: int  # where the estimator counts them
    refused: int  # readings refused, where the estimator counts them
    lost: int  # estimates that it says are lost

    def rms(self, begin: float) -> float:
        """From ``begin`` [s] on; ArgumentError if there is nothing."""
        late = self.error[self.t >= begin]
        if not len(late):
            raise ArgumentError(f"begin = {begin!r}; allowed: a time before the last call")
        return float(np.sqrt(np.mean(np.square(late))))

    def below_from(self, limit: float) -> float | None:
        """[s] from when on the error is never above a limit; None if it is at the end."""
        above = np.flatnonzero(~(self.error <= limit))
        if not len(above):
            return 0.0
        return float(self.t[above[-1]]) if above[-1] < len(self.t) - 1 else None


@dataclass(frozen=True)
class Tuning:
    """The error for each value of the grid."""

    field: str
    grid: tuple[float, ...]
    errors: tuple[float, ...]  # in the unit of the components

    @property
    def best(self) -> float:
        """The value with the least error; one that is not finite is the worst."""
        return self.grid[int(np.argmin(np.nan_to_num(self.errors, nan=np.inf)))]

    @property
    def at_edge(self) -> bool:
        """True if the best value is at an end of the grid, beyond which there may be a better one."""
        return self.best in (min(self.grid), max(self.grid))


def recorded_calls(recording: Recording, name: str, sensor: str) -> list[RecordedCall]:
    """A flight as calls of an estimator with the readings of one sensor, none of them lost."""
    agent, truth = recording.agents[name], recording.truths[name]
    readings = agent.readings[sensor]
    return [
        RecordedCall(
            float(t), (Measurement(sensor, float(t), readings[k]),), agent.commands[max(0, k - 1)], truth[k]
        )
        for k, t in enumerate(recording.t)
    ]  # fmt: skip


def replayed(estimator: Estimator, calls: Iterable[RecordedCall], components: slice) -> ReplayedErrors:
    """A fresh estimator over the calls."""
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
    """Error of a fresh estimator over the calls from ``begin`` [s] on; ValueError if there are none."""
    return replayed(estimator, calls, components).rms(begin)


def spread(grid: Sequence[float], most: int) -> tuple[float, ...]:
    """At most so many values of a grid, from its first to its last."""
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
    """The errors with values of the grid in a field of ``config``: every other one and both ends, then those beside the

    best of them. ArgumentError for an empty grid.
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
