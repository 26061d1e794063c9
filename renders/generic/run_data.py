"""Data of a run whose scenario has no drawing: its log by vehicle, and its scene if it has one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signal_names import SignalNames, difference
from mathnavi.interfaces.signals import Array, Event, Status
from mathnavi.renders.generic.scene_data import SceneData, scene_data
from mathnavi.sim.records.documents import LOG_SCENARIO
from mathnavi.sim.records.log_arrays import DEVIATION, ESTIMANDS
from mathnavi.sim.records.run_folder import (
    NothingToDrawError,
    RunLog,
    last_at,
    read_fleet,
    read_log,
    read_scene,
    read_signal_names,
)

TRUTH_WORD, REFERENCE_WORD = "truth", "reference"


@dataclass(frozen=True, eq=False)
class GenericRun:
    """The run of one vehicle or more."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # in order of time
    vehicles: Mapping[str, RunLog]
    signals: Mapping[str, SignalNames]  # by vehicle
    scene: SceneData | None

    @property
    def t(self) -> Array:
        """(n,) [s] the times of the samples."""
        return next(iter(self.vehicles.values())).t

    @property
    def states(self) -> dict[str, tuple[str, ...]]:
        """(nx,) names of the states with units, by vehicle."""
        return {name: each.states for name, each in self.signals.items()}

    @property
    def duration(self) -> float:
        """[s] from the start to the last sample."""
        return float(self.t[-1])

    @property
    def is_log(self) -> bool:
        """True for a recorded log: nothing was simulated, no mission was flown."""
        return str(self.config["scenario"]) == LOG_SCENARIO

    @property
    def title(self) -> str:
        """Scenario and seed; of a log its file, and the estimator that ran over it."""
        if not self.is_log:
            return f"{self.config['scenario']}, seed {self.config['seed']}"
        file = Path(str(self.config.get("fields", {}).get("file", self.directory))).name
        return ", ".join([file, *([] if self.estimator is None else [self.estimator])])

    @property
    def estimator(self) -> str | None:
        """Name of the estimator; None without one, as of a log over which none has run."""
        record = self.config.get("estimator")
        return str(record["name"]) if isinstance(record, Mapping) and "name" in record else None

    @property
    def truth_word(self) -> str:
        """Name of what estimates are compared with: that of a log is what another system found."""
        return REFERENCE_WORD if self.is_log else TRUTH_WORD

    @property
    def final_status(self) -> Status | None:
        """Status of the last estimate of a single vehicle; None without any."""
        log = next(iter(self.vehicles.values()))
        times = log.arrays.get("estimate.t", np.empty(0))
        return log.status(float(times[-1])) if len(times) else None

    @cached_property
    def usable_share(self) -> float:
        """Share of the estimates of a single vehicle that may be used; 0 without any."""
        log = next(iter(self.vehicles.values()))
        times = log.arrays.get("estimate.t", np.empty(0))
        return float(usable(log, times).mean()) if len(times) else 0.0

    def status(self, t: float) -> str:
        """Status of the estimators at ``t`` [s]: the first that is not OK, or nothing."""
        for name, log in self.vehicles.items():
            if (status := log.status(t)) is not Status.OK:
                return f"estimate {status.name.lower()}" + (f" ({name})" if len(self.vehicles) > 1 else "")
        return ""


@dataclass(frozen=True, eq=False)
class RecordedEstimates:
    """Estimates of a vehicle with the truth, as far as known: of its whole state, or of a part of it."""

    t: Array  # (k,) [s]
    x: Array  # (k, m)
    names: tuple[str, ...]  # (m,) with units
    truth: Array  # (n, m) at the samples of the log; NaN where it is not known
    error: Array  # (k, m) estimate less truth, angles of a log or a part of the state from -pi to pi
    deviation: Array | None  # (k, m) by its covariance; None if it has none
    whole: bool  # whether its numbers are the states


def estimates(log: RunLog, signals: SignalNames) -> RecordedEstimates | None:
    """Return the estimates of a vehicle; None without any. Of a log there is no error while one may not be used."""
    t, x = log.arrays.get("estimate.t"), log.arrays.get("estimate.x")
    if t is None or x is None or x.ndim != 2 or not x.size:
        return None
    size, rows = x.shape[1], np.clip(np.searchsorted(log.t, t + 1e-9, side="right") - 1, 0, len(log.t) - 1)
    names = signals.of_estimate(size) or tuple(f"estimate {k + 1}" for k in range(size))
    if names == signals.states:
        error = x - log.x[rows]
        if log.config["scenario"] == LOG_SCENARIO:  # the reference of an angle may be a turn off
            error = np.column_stack([difference(name, x[:, k], log.x[rows, k]) for k, name in enumerate(names)])
            error[~usable(log, t)] = np.nan
        return RecordedEstimates(t, x, names, log.x, error, _deviation(log, x), True)
    known = {name: log.x[:, k] for k, name in enumerate(signals.states)}
    estimands = log.arrays.get(ESTIMANDS)
    if estimands is not None and estimands.shape[1] == len(signals.estimands):
        known |= {name: estimands[: len(log.t), k] for k, name in enumerate(signals.estimands)}
    truth = np.column_stack([known.get(name, np.full(len(log.t), np.nan)) for name in names])
    error = np.column_stack([difference(name, x[:, k], truth[rows, k]) for k, name in enumerate(names)])
    if log.config["scenario"] == LOG_SCENARIO:
        error[~usable(log, t)] = np.nan
    return RecordedEstimates(t, x, names, truth, error, _deviation(log, x), False)


def usable(log: RunLog, t: Array) -> NDArray[np.bool_]:
    """True (k,) where the estimates at t (k,) [s] may be used."""
    return np.array([log.status(each).usable for each in t.tolist()], dtype=bool)


def _deviation(log: RunLog, x: Array) -> Array | None:
    """(k, m) standard deviations of the estimates x (k, m); None if none is recorded."""
    found = log.arrays.get(DEVIATION)
    covariance = log.arrays.get("estimate.covariance")
    if found is None and covariance is not None and covariance.shape == (*x.shape, x.shape[1]):
        found = np.sqrt(np.maximum(np.einsum("kii->ki", covariance), 0.0))
    return found if found is not None and found.shape == x.shape and np.isfinite(found).any() else None


def load_run(directory: str | Path) -> GenericRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    folder, signals = Path(directory), read_signal_names(directory)
    if len(signals) > 1:
        fleet = read_fleet(folder)
        config, summary, events, vehicles = fleet.config, fleet.summary, fleet.events, dict(fleet.vehicles)
    else:
        log = read_log(folder, may_diverge=True)
        config, summary, events, vehicles = log.config, log.summary, log.events, {next(iter(signals)): log}
    if len(next(iter(vehicles.values())).t) < 2:
        raise NothingToDrawError(f"{str(folder)!r}: the run ended at its first sample")
    arrays = read_scene(folder)
    scene = None if arrays is None else scene_data(arrays, str(folder))
    return GenericRun(folder, config, summary, events, vehicles, signals, scene)


def index(times: Array, t: float) -> int:
    """Index of the last of the times (n,) [s] at or before ``t`` [s]; 0 before the first."""
    return max(last_at(times, t), 0)


def camera_name(name: str) -> str:
    """Return the name of a camera of the model on the command line and in files: "skiff/bow" is "skiff-bow"."""
    return name.replace("/", "-")
