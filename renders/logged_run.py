"""Run of a single vehicle for its drawing: the log, and the state at any time between its samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array, Event, Plan, Status
from mathnavi.sim.records.run_folder import RunLog, last_at


@dataclass(frozen=True, eq=False)
class LoggedRun:
    """Log, to which each drawing adds the other data that it needs."""

    log: RunLog

    @property
    def directory(self) -> Path:
        return self.log.directory

    @property
    def config(self) -> Mapping[str, Any]:
        return self.log.config

    @property
    def summary(self) -> Mapping[str, Any]:
        return self.log.summary

    @property
    def events(self) -> tuple[Event, ...]:
        """Events in order of time."""
        return self.log.events

    @property
    def t(self) -> Array:
        """(n,) [s] the times of the samples."""
        return self.log.t

    @property
    def duration(self) -> float:
        """[s] from the start to the last sample."""
        return float(self.log.t[-1])

    def index(self, t: float) -> int:
        """Index of the last sample at or before ``t`` [s]; of the first before that."""
        return max(last_at(self.t, t), 0)

    def between(self, t: float) -> tuple[int, float]:
        """Index i and share s with t = (1 - s) t_i + s t_(i+1); s is 0 or 1 beyond the ends of the run."""
        i = min(self.index(t), len(self.t) - 2)
        return i, float(np.clip((t - self.t[i]) / (self.t[i + 1] - self.t[i]), 0.0, 1.0))

    def interpolated(self, rows: Array, t: float) -> Array:
        """(m,) a row of ``rows`` (n, m) at ``t`` [s], linear between samples; the first and last one beyond them."""
        i, share = self.between(t)
        row: Array = (1.0 - share) * rows[i] + share * rows[i + 1]
        return row

    def plan(self, t: float) -> Plan | None:
        """The plan that is followed at ``t`` [s]; None before the first."""
        i = last_at(self.log.adopted, t)
        return self.log.plans[i] if i >= 0 else None

    def status(self, t: float) -> Status:
        """Status of the newest estimate at ``t`` [s]."""
        return self.log.status(t)
