"""Memory that a piece of work takes, as Linux counts it."""

from __future__ import annotations

import math
from pathlib import Path
from types import TracebackType

_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_RESET_PEAK = "5"  # proc(5): the peak becomes what is resident now


class PeakMemory:
    """Context in which the memory of this process is watched: ``grown`` [MB] is how far its peak rose above the start.

    NaN where the system does not say, outside Linux for one.
    """

    def __init__(self) -> None:
        self.grown = math.nan
        self._before = math.nan

    def __enter__(self) -> PeakMemory:
        try:
            _RESET.write_text(_RESET_PEAK)
            self._before = _megabytes("VmRSS")
        except OSError:
            self._before = math.nan
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if not math.isnan(self._before):
            self.grown = _megabytes("VmHWM") - self._before


def _megabytes(name: str) -> float:
    rows = (row.split() for row in _STATUS.read_text().splitlines())
    return next(float(row[1]) for row in rows if row[:1] == [f"{name}:"]) / 1024.0
