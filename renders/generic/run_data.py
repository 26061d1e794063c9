"""Data of a run whose scenario has no drawing: its log by vehicle, and its scene if it has one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array, Event, Status
from mathnavi.renders.generic.scene_data import SceneData, scene_data
from mathnavi.sim.records.run_folder import (
    NothingToDrawError,
    RunLog,
    last_at,
    read_fleet,
    read_log,
    read_scene,
    read_state_names,
)


@dataclass(frozen=True, eq=False)
class GenericRun:
    """The run of one vehicle or more."""

    directory: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    events: tuple[Event, ...]  # in order of time
    vehicles: Mapping[str, RunLog]
    states: Mapping[str, tuple[str, ...]]  # (nx,) names with units, by vehicle
    scene: SceneData | None

    @property
    def t(self) -> Array:
        """(n,) [s] the times of the samples."""
        return next(iter(self.vehicles.values())).t

    @property
    def duration(self) -> float:
        """[s] from the start to the last sample."""
        return float(self.t[-1])

    @property
    def title(self) -> str:
        """Scenario and seed."""
        return f"{self.config['scenario']}, seed {self.config['seed']}"

    def status(self, t: float) -> str:
        """Status of the estimators at ``t`` [s]: the first that is not OK, or nothing."""
        for name, log in self.vehicles.items():
            if (status := log.status(t)) is not Status.OK:
                return f"estimate {status.name.lower()}" + (f" ({name})" if len(self.vehicles) > 1 else "")
        return ""


@dataclass(frozen=True, eq=False)
class RecordedEstimates:
    """Estimates with the truth, of a vehicle whose estimator estimates its state."""

    t: Array  # (k,) [s]
    x: Array  # (k, nx)
    error: Array  # (k, nx) estimate less truth


def estimates(log: RunLog) -> RecordedEstimates | None:
    """Return the estimates of a vehicle; None without estimates, or if they are not of its states."""
    t, x = log.arrays.get("estimate.t"), log.arrays.get("estimate.x")
    if t is None or x is None or x.shape[1:] != log.x.shape[1:] or not len(t):
        return None
    rows = np.clip(np.searchsorted(log.t, t + 1e-9, side="right") - 1, 0, len(log.t) - 1)
    return RecordedEstimates(t, x, x - log.x[rows])


def load_run(directory: str | Path) -> GenericRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    folder, states = Path(directory), read_state_names(directory)
    if len(states) > 1:
        fleet = read_fleet(folder)
        config, summary, events, vehicles = fleet.config, fleet.summary, fleet.events, dict(fleet.vehicles)
    else:
        log = read_log(folder, may_diverge=True)
        config, summary, events, vehicles = log.config, log.summary, log.events, {next(iter(states)): log}
    if len(next(iter(vehicles.values())).t) < 2:
        raise NothingToDrawError(f"{str(folder)!r}: the run ended at its first sample")
    arrays = read_scene(folder)
    scene = None if arrays is None else scene_data(arrays, str(folder))
    return GenericRun(folder, config, summary, events, vehicles, states, scene)


def index(times: Array, t: float) -> int:
    """Index of the last of the times (n,) [s] at or before ``t`` [s]; 0 before the first."""
    return max(last_at(times, t), 0)


def camera_name(name: str) -> str:
    """Return the name of a camera of the model on the command line and in files: "skiff/bow" is "skiff-bow"."""
    return name.replace("/", "-")
