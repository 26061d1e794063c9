"""The empirical observability Gramian of a scenario's sensors.

The plant is built repeatedly with the same seed, one component i of the vehicle's state is displaced a little, and the
same commands are replayed. With readings y^{i+} and y^{i-} from x_0 + delta_i e_i and x_0 - delta_i e_i,

    W_ij = sum_k (y_k^{i+} - y_k^{i-})^T R^{-1} (y_k^{j+} - y_k^{j-}) / (4 delta_i delta_j),

over every reading of every sensor. As the seed is the same, noise and disturbances cancel. For small delta it is the
Gramian of the linearisation along the run; R = diag(deviation^2) makes it Fisher's information about the start. A
direction that the sensors do not see is an eigenvector of W with eigenvalue zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array


@dataclass(frozen=True)
class EmpiricalGramian:
    """Empirical Gramian W over the displaced components, and the part of it from each sensor."""

    names: tuple[str, ...]  # (n,) of the components, with their units
    by_sensor: Mapping[str, Array]  # (n, n) each

    @property
    def total(self) -> Array:
        """Gramian W (n, n): the sum over all sensors."""
        return sum(self.by_sensor.values(), np.zeros((len(self.names), len(self.names))))

    def scaled(self, scales: Sequence[float] | Array) -> Array:
        """Gramian W (n, n) with component i in units of ``scales[i]``, so that its eigenvalues can be compared."""
        scaled: Array = self.total * np.outer(scales, scales)
        return scaled

    def unseen(self, scales: Sequence[float] | Array, tolerance: float = 1e-9) -> Array:
        """Orthonormal directions (k, n), in units of ``scales``, that the sensors do not see.

        Their eigenvalues are at most ``tolerance`` times the largest.
        """
        values, vectors = np.linalg.eigh(self.scaled(scales))
        hidden: Array = vectors.T[values <= tolerance * values[-1]]
        return hidden


def empirical_gramian(
    build: Callable[[], Plant],
    vehicle: str,
    commands: Mapping[str, Array],
    ticks: int,
    deltas: Mapping[str, float],
    deviations: Mapping[str, float] | None = None,
) -> EmpiricalGramian:
    """Empirical Gramian W at the initial state of ``vehicle`` in the plant of ``build``, over a replay of ``commands``.

    ``build`` makes the plant of one seed, for example ``lambda: trial(...).build().plant``. ``commands`` are (n, nu) by
    vehicle, each held for ``ticks`` physics ticks. ``deltas`` are the displacements of components of the state, by the
    plant's names of the components. ``deviations`` are standard deviations of sensors' readings, 1 for a sensor that is
    not named. Readings that were lost in any of the replays are left out.

    Raises ArgumentError unless the deltas are positive and of existing components, and the commands have one length.
    """
    names, sensors = build().state_names(vehicle), build().sensor_sizes(vehicle)
    if not deltas or set(deltas) - set(names) or not all(0.0 < delta < math.inf for delta in deltas.values()):
        raise ArgumentError(f"deltas = {dict(deltas)!r}; allowed: positive numbers for some of {list(names)}")
    if len({len(u) for u in commands.values()}) != 1 or ticks < 1:
        lengths = {name: len(u) for name, u in commands.items()}
        raise ArgumentError(f"commands of lengths {lengths}, ticks = {ticks}; allowed: one length, 1 tick or more")
    slopes = []
    for name, delta in deltas.items():
        i = names.index(name)
        ahead, behind = (_replayed(build(), vehicle, commands, ticks, i, side * delta) for side in (1.0, -1.0))
        slopes.append({at: (ahead[at] - behind[at]) / (2.0 * delta) for at in ahead.keys() & behind.keys()})
    by_sensor = {sensor: np.zeros((len(deltas), len(deltas))) for sensor in sensors}
    for sensor, tick in sorted(set.intersection(*(set(slope) for slope in slopes))):
        dy = np.column_stack([slope[sensor, tick] for slope in slopes])  # (m, n)
        dy = dy[np.isfinite(dy).all(axis=1)] / (deviations or {}).get(sensor, 1.0)
        by_sensor[sensor] += dy.T @ dy
    return EmpiricalGramian(tuple(deltas), by_sensor)


def _replayed(
    plant: Plant, vehicle: str, commands: Mapping[str, Array], ticks: int, component: int, offset: float
) -> dict[tuple[str, int], Array]:
    """Readings of one replay, by sensor and by tick."""
    x = plant.state(vehicle)
    x[component] += offset
    plant.place(vehicle, x)
    readings = list(plant.sense(vehicle))
    for inputs in zip(*commands.values(), strict=True):
        plant.step(dict(zip(commands, inputs, strict=True)), ticks)
        readings += plant.sense(vehicle)
    return {(reading.name, round(reading.t / plant.dt)): reading.value for reading in readings}
