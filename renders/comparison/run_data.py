"""Data of a finished run for a comparison: its request, its results, states and estimates over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.fields import flattened
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records.field_names import recorded_fields
from mathnavi.sim.records.run_folder import RunLog, read_fleet, read_log, read_state_names


@dataclass(frozen=True, eq=False)
class StateHistory:
    """True and estimated states of one vehicle over time."""

    t: Array  # (n,) [s]
    x: Array  # (n, nx) the true state
    t_estimate: Array  # (m,) [s]
    estimate: Array  # (m, nx), with no row where an estimate is not of the state

    @property
    def error(self) -> Array:
        """(m, nx) of the estimate; the truth is linear between samples."""
        true = np.column_stack([np.interp(self.t_estimate, self.t, column) for column in self.x.T])
        error: Array = self.estimate - true
        return error


@dataclass(frozen=True, eq=False)
class ComparedRun:
    """Data of a finished run for a comparison."""

    folder: Path
    config: Mapping[str, Any]
    summary: Mapping[str, Any]
    states: tuple[str, ...]  # (nx,) names with units
    histories: Mapping[str, StateHistory]  # by vehicle

    @property
    def fields(self) -> dict[str, Any]:
        """Return all requested fields by their names on the command line, with the terrain and the versions."""
        terrain = {"terrain's digest": self.config["terrain"]["digest"]} if "terrain" in self.config else {}
        return (
            {"seed": self.config["seed"]}
            | recorded_fields(self.config)
            | terrain
            | flattened(self.config.get("versions", {}), "version of ")
            | flattened(self.config.get("machine", {}))
        )


def read_run(folder: Path) -> ComparedRun:
    """The run in a folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    states = read_state_names(folder)
    logs = read_fleet(folder).vehicles if len(states) > 1 else {"": read_log(folder, may_diverge=True)}
    histories = {name: _history(log) for name, log in logs.items()}
    any_log, names = next(iter(logs.values())), next(iter(states.values()), ())
    return ComparedRun(folder, any_log.config, any_log.summary, names, histories)


def _history(log: RunLog) -> StateHistory:
    t, estimate = np.empty(0), np.empty((0, log.x.shape[1]))
    if "estimate.x" in log.arrays:
        found = log.arrays["estimate.x"]
        if found.shape[1:] == log.x.shape[1:]:
            t, estimate = log.arrays["estimate.t"], found
            seen = t <= log.t[-1]  # the truth may have ended as no number
            t, estimate = t[seen], estimate[seen]
    return StateHistory(log.t, log.x, t, estimate)
