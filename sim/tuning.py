"""The best of a stated grid of one field of an estimator, by how it does on a recorded run.

The measure is the root mean square of the length of the error of some components of the state, the velocities for one,
over all estimates from a time on, whatever their status is:

    sqrt(mean_t |x^_i(t) - x_i(t)|^2),    i in the components.

An estimator is tuned on a run of its own; what is then reported is flown with other noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sim.protocols import Estimator, EstimatorPlugin
from sim.signals import Array, Measurement


@dataclass(frozen=True)
class RecordedCall:
    """One call of an estimator: what it is given, and what is true then."""

    t: float  # [s]
    measurements: tuple[Measurement, ...]
    command: Array  # (nu,) held since the call before
    truth: Array  # (nx,)


@dataclass(frozen=True)
class Tuning:
    """What each value of the grid came to."""

    field: str
    grid: tuple[float, ...]
    errors: tuple[float, ...]  # in the unit of the components

    @property
    def best(self) -> float:
        """The value with the least error; one that is not finite is the worst."""
        return self.grid[int(np.argmin(np.nan_to_num(self.errors, nan=np.inf)))]

    @property
    def at_edge(self) -> bool:
        """Whether that is the least or the greatest of the grid, beyond which there may be a better one."""
        return self.best in (min(self.grid), max(self.grid))


def recorded_error(estimator: Estimator, calls: Iterable[RecordedCall], components: slice, begin: float) -> float:
    """Of a fresh estimator, over the calls from ``begin`` [s] on; ValueError if there are none."""
    squares: list[float] = []
    for call in calls:
        estimate = estimator.update(call.t, call.measurements, call.command)
        if call.t >= begin:
            off = estimate.x[components] - call.truth[components]
            squares.append(float(off @ off))
    if not squares:
        raise ValueError(f"begin = {begin!r}; allowed: a time before the last call")
    return float(np.sqrt(np.mean(squares)))


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
    """The errors with each value of the grid in a field of ``config``; ValueError for an empty grid."""
    if not grid:
        raise ValueError(f"grid = {grid!r}; allowed: at least one value of {field}")
    errors = [
        recorded_error(plugin.build(replace(config, **{field: value}), mission), calls, components, begin)
        for value in grid
    ]
    return Tuning(field, tuple(grid), tuple(errors))
