"""The run of a textbook system, as it is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from mathnavi.models.angles import wrapped
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.missions import TextbookRecord, read_mission
from mathnavi.sim.records.run_log import LoggedRun, RunLog, last_at, read_log


@dataclass(frozen=True, eq=False)
class TextbookRun(LoggedRun):
    """Truth and estimates of n states."""

    t_estimate: Array  # (k,) [s]
    estimate: Array  # (k, n)
    states: tuple[str, ...]  # (n,) with units
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    y: Array  # (looks, m) the readings
    angles: tuple[int, ...]
    title: str  # of the system

    @property
    def has_flags(self) -> bool:
        """Whether it is the robot with its camera in the plane of the flags."""
        return bool(self.log.config["fields"]["system"] == "camera-and-flags")

    @cached_property
    def escape_time(self) -> float | None:
        """[s] at which the solution escaped; None if it did not."""
        return next((event.t for event in self.log.events if event.kind == "escaped"), None)

    @cached_property
    def error(self) -> Array:
        """(k, n) estimate less truth, angles within half a turn."""
        off = self.estimate - self.log.x[np.searchsorted(self.log.t, self.t_estimate - 1e-9)]
        for k in self.angles:
            off[:, k] = wrapped(off[:, k])
        return off

    def looks(self, t: float) -> int:
        """How many looks there were up to ``t`` [s]."""
        return last_at(self.log.t, t) + 1

    def estimates(self, t: float) -> int:
        """How many estimates there were up to ``t`` [s]."""
        return last_at(self.t_estimate, t) + 1


def load_run(directory: str | Path) -> TextbookRun:
    """Read a run's folder; FileNotFoundError where something is missing, ValueError where something is broken."""
    log = read_log(directory)
    with np.load(log.directory / "log.npz", allow_pickle=False) as arrays:
        try:
            return _described(log, read_mission(TextbookRecord, log.config["mission"]), dict(arrays))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{str(log.directory)!r} does not hold the run of a textbook system: {error!r}") from None


def _described(log: RunLog, mission: TextbookRecord, arrays: Mapping[str, Array]) -> TextbookRun:
    states, outputs = mission.states, mission.outputs
    t, x = arrays["estimate.t"], arrays["estimate.x"]
    if x.shape != (len(t), len(states)) or log.x.shape[1] != len(states):
        raise ValueError(f"estimate.x {x.shape} and truth.x {log.x.shape} are not of {len(states)} states")
    nothing = np.full((len(log.t), len(outputs)), np.nan)
    y = arrays.get("measurement.output", nothing)
    return TextbookRun(log, t, x, states, mission.inputs, outputs, y, mission.angles, mission.title)
