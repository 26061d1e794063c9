"""Progress of a call to ``solve()``: what it does at the moment, for a function or for a line on a terminal."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TextIO, TypeAlias

from mathnavi.interfaces.errors import ProblemError

_PATIENCE = 1.0  # [s] before the line appears
_SELDOM = 0.1  # [s] between two lines
_WIDTH = 118  # characters of the longest line


@dataclass(frozen=True)
class SolveProgress:
    """Progress of a call to ``solve()``, at an iterate of the solver or where a stage begins."""

    stage: str  # "solving", "restart 2", "other start 1", "second-order condition", "finer meshes", ...
    method: str  # "hp, round 3", "redistribution, residual", "direct", ...
    mesh: str  # name of the transcription, such as "Radau IIA"; empty before the first one
    nodes: int  # N; 0 before the first mesh
    iteration: int  # of the solver on this mesh
    cost: float  # J of the iterate, with what smooths its controls; NaN before the first one
    violation: float  # largest violation of the programme's rows, over their scales; NaN before the first iterate
    miss: float  # of the last replay, over the states' scales; NaN before the first one
    elapsed: float  # [s] wall-clock time since the call began

    def __str__(self) -> str:
        """One line, without what is not known yet."""
        parts = [f"{self.stage}: {self.method}" if self.method else self.stage]
        if self.nodes:
            parts += [self.mesh, f"{self.nodes} nodes", f"iteration {self.iteration}"]
        if math.isfinite(self.cost):
            parts.append(f"J = {self.cost:.6g}")
        if math.isfinite(self.violation):
            parts.append(f"violation {self.violation:.1e}")
        if math.isfinite(self.miss):
            parts.append(f"replay miss {self.miss:.1e}")
        return ", ".join([*parts, f"{self.elapsed:.0f} s"])


Report: TypeAlias = Callable[[SolveProgress], object]
"""function that is called with the progress; where it returns True the call ends, as on Ctrl-C"""


class ProgressLine:
    """A line that says what a call does, written again and again over itself, and taken away at its end."""

    def __init__(self, terminal: TextIO) -> None:
        """Write to a terminal."""
        self._terminal, self._last = terminal, -math.inf

    def __call__(self, progress: SolveProgress) -> None:
        """Write the line, unless the call is young or the last line is."""
        if progress.elapsed >= max(_PATIENCE, self._last + _SELDOM):
            self._last = progress.elapsed
            self._terminal.write(f"\r{str(progress)[:_WIDTH]}\x1b[K")
            self._terminal.flush()

    def close(self) -> None:
        """Take the line away."""
        if self._last > 0.0:
            self._terminal.write("\r\x1b[K")
            self._terminal.flush()


def report_of(progress: bool | Report | None, *, printed: bool) -> Report | None:
    """The function that is called with the progress; None if absent.

    Args:
        progress: a function; False for none; None for a line on standard error if that is a terminal, True for that
            line wherever standard error goes.
        printed: True if the solver prints lines itself, among which there is no place for another one.

    Raises:
        ProblemError: for anything else.
    """
    if progress is None:
        shown = not printed and sys.stderr is not None and sys.stderr.isatty()
        return ProgressLine(sys.stderr) if shown else None
    if isinstance(progress, bool):
        return ProgressLine(sys.stderr) if progress else None
    if not callable(progress):
        raise ProblemError(
            f"progress = {progress!r:.80}; allowed: a function of a SolveProgress, True, False, or None for a line on "
            "a terminal"
        )
    return progress
