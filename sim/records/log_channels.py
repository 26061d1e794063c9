"""Log of a run as channels: rows of fields at their own times, every number as recorded.

| channel | times | fields |
|---|---|---|
| ``truth`` | every sample | ``x``, ``activation`` of actuators with their own states, ``estimands`` if declared |
| ``input`` | every sample | ``u``, held until the next |
| ``readings/NAME`` | samples at which the sensor was read | ``value``; NaN for single values that were lost |
| ``estimate`` | those of the estimates | ``x``, and what else the estimator reports, as ``covariance`` |
| ``plan`` | when each plan was adopted | ``times``, ``x``, ``u``, ``phase`` of its breakpoints, ``cost`` |
| ``cramer_rao`` | every sample | ``deviation``, where the metrics define a bound |

What writes a log in another format writes these (``mathnavi.renders.export``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.log_arrays import (
    ACTIVATION,
    COMMAND,
    CRAMER_RAO,
    ESTIMANDS,
    ESTIMATED,
    PLANNED,
    SAMPLED,
    TIME,
    TRUTH,
)
from mathnavi.sim.records.run_folder import RunLog

_PLAN_FIELDS = {"times": "t", "x": "x", "u": "u", "phase": "phase"}  # arrays with a row for each breakpoint


@dataclass(frozen=True, eq=False)
class Field:
    """Values of one array of the log, row by row."""

    name: str
    array: str  # its name in log.npz, without the prefix of a vehicle
    rows: Array | Sequence[Array]  # of each time: of the shape of a row; of plans (b, ...), b breakpoints
    columns: tuple[str, ...] = ()  # "name [unit]" of each number of a row, if they are known

    @property
    def dtype(self) -> str:
        """Type of the numbers."""
        return str(np.asarray(self.rows[0] if len(self.rows) else self.rows).dtype)

    @property
    def shape(self) -> tuple[int, ...] | None:
        """Shape of a row; None for a plan's, which have as many numbers as it has breakpoints."""
        return self.rows.shape[1:] if isinstance(self.rows, np.ndarray) else None


@dataclass(frozen=True, eq=False)
class Channel:
    """Fields that change at the same times."""

    vehicle: str  # "" for a single one
    name: str
    t: Array  # (n,) [s]
    fields: tuple[Field, ...]  # each with n rows

    @property
    def path(self) -> tuple[str, ...]:
        """Vehicle of a fleet, and the parts of the name."""
        return (*([self.vehicle] if self.vehicle else []), *self.name.split("/", 1))


def channels_of(
    vehicles: Mapping[str, RunLog],
    signals: Mapping[str, SignalNames],
    activations: Mapping[str, tuple[str, ...]],
) -> list[Channel]:
    """Return the channels of a run by its logs and the names of signals and activations, each by vehicle."""
    several = len(vehicles) > 1
    return [
        channel
        for name, log in vehicles.items()
        for channel in _of_vehicle(name if several else "", log.arrays, signals[name], activations.get(name, ()))
    ]


def _of_vehicle(
    vehicle: str, arrays: Mapping[str, Array], signals: SignalNames, activations: tuple[str, ...]
) -> Iterator[Channel]:
    t = arrays[TIME]
    truth = [Field("x", TRUTH, arrays[TRUTH], signals.states)]
    if ACTIVATION in arrays:
        truth.append(Field("activation", ACTIVATION, arrays[ACTIVATION], activations))
    if ESTIMANDS in arrays:
        truth.append(Field("estimands", ESTIMANDS, arrays[ESTIMANDS], signals.estimands))
    yield Channel(vehicle, "truth", t, tuple(truth))
    yield Channel(vehicle, "input", t, (Field("u", COMMAND, arrays[COMMAND], signals.inputs),))
    for name, rows in arrays.items():
        if name.startswith(SAMPLED):
            read = ~np.isnan(rows).all(axis=1)
            sensor = name.removeprefix(SAMPLED)
            value = Field("value", name, rows[read], signals.readings.get(sensor, ()))
            yield Channel(vehicle, f"readings/{sensor}", t[read], (value,))
    if "estimate.t" in arrays:
        yield Channel(vehicle, "estimate", arrays["estimate.t"], tuple(_estimate_fields(arrays, signals)))
    if "plan.offsets" in arrays:
        offsets = list(pairwise(arrays["plan.offsets"].tolist()))
        fields = [
            Field(name, f"{PLANNED}{part}", [arrays[f"{PLANNED}{part}"][a:b] for a, b in offsets])
            for name, part in _PLAN_FIELDS.items()
        ]
        yield Channel(
            vehicle, "plan", arrays["plan.adopted"], (*fields, Field("cost", "plan.cost", arrays["plan.cost"]))
        )
    if CRAMER_RAO in arrays and arrays[CRAMER_RAO].size:  # no columns stand for no bound
        yield Channel(vehicle, "cramer_rao", t, (Field("deviation", CRAMER_RAO, arrays[CRAMER_RAO]),))


def _estimate_fields(arrays: Mapping[str, Array], signals: SignalNames) -> Iterator[Field]:
    x = arrays["estimate.x"]
    yield Field("x", "estimate.x", x, signals.of_estimate(x.shape[1]))
    for name, rows in arrays.items():
        if name.startswith(ESTIMATED) and name not in ("estimate.t", "estimate.x"):
            yield Field(name.removeprefix(ESTIMATED), name, rows)
