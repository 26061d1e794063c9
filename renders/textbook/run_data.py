"""Data of the run of a textbook system, for drawing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.renders.logged_run import LoggedRun
from mathnavi.sim.records.missions import TextbookRecord, read_mission
from mathnavi.sim.records.run_folder import RunLog, last_at, read_log


@dataclass(frozen=True, eq=False)
class TextbookRun(LoggedRun):
    """Truth and estimates of n states."""

    t_estimate: Array  # (k,) [s]
    estimate: Array  # (k, n)
    states: tuple[str, ...]  # (n,) with units
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    y: Array  # (n, m) the readings
    angles: tuple[int, ...]
    title: str  # of the system
    tolerance: float | None  # of the length of the error; None where it is not recorded

    @property
    def has_flags(self) -> bool:
        """True for the robot with its camera in the plane of the flags."""
        return bool(self.log.config.get("fields", {}).get("system") == "camera-and-flags")

    @cached_property
    def escape_time(self) -> float | None:
        """[s] at which the solution escaped; None if it did not."""
        return next((event.t for event in self.log.events if event.kind == "escaped"), None)

    @cached_property
    def error(self) -> Array:
        """(k, n) estimate less truth, angles within half a turn."""
        error = self.estimate - self.log.x[np.searchsorted(self.log.t, self.t_estimate - 1e-9)]
        for k in self.angles:
            error[:, k] = wrapped(error[:, k])
        return error

    def sample_count(self, t: float) -> int:
        """Number of samples up to ``t`` [s]."""
        return last_at(self.log.t, t) + 1

    def estimate_count(self, t: float) -> int:
        """Number of estimates up to ``t`` [s]."""
        return last_at(self.t_estimate, t) + 1


def load_run(directory: str | Path) -> TextbookRun:
    """Read a run's folder; FileNotFoundError if a file is missing, RunFolderError if one is broken."""
    log = read_log(directory)
    try:
        return _described(log, read_mission(TextbookRecord, log.config["mission"]), log.arrays)
    except RunFolderError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise RunFolderError(f"{str(log.directory)!r} does not hold the run of a textbook system: {error!r}") from None


def _described(log: RunLog, mission: TextbookRecord, arrays: Mapping[str, Array]) -> TextbookRun:
    states, outputs = mission.states, mission.outputs
    t, x = arrays["estimate.t"], arrays["estimate.x"]
    if x.shape != (len(t), len(states)) or log.x.shape[1] != len(states):
        raise RunFolderError(
            f"{str(log.directory)!r}: estimate.x {x.shape} and truth.x {log.x.shape} are not of {len(states)} states"
        )
    nothing = np.full((len(log.t), len(outputs)), np.nan)
    y = arrays.get("measurement.output", nothing)
    return TextbookRun(log, t, x, states, mission.inputs, outputs, y, mission.angles, mission.title, mission.tolerance)
