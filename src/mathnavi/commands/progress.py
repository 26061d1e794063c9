"""Progress bar of trials (number, rate, remaining time, failures) and of a flight."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.engine.compilation import compilation_reported

if TYPE_CHECKING:  # a single flight does not wait for what sweeps import
    from mathnavi.sim.sweep.execution import Progress as Done

SELDOM = 30.0  # [s] between lines where there is no terminal
COMPILING = "compiling the numerical kernels, once on this machine for each kind of planner"
DURATION = "10 s to a minute"


@contextmanager
def sweep_progress(errors: Console, name: str) -> Iterator[Callable[[Done], None]]:
    """Return a function for the ``progress`` of ``run_trials``.

    It moves a bar, or prints a line from time to time if ``errors`` is not a terminal.
    """
    bar = Progress(
        TextColumn(name), BarColumn(bar_width=12), TextColumn("{task.fields[status]}"),
        console=errors, disable=not errors.is_terminal, transient=True,
    )  # fmt: skip
    began = reported = time.perf_counter()

    def update(progress: Done) -> None:
        nonlocal began, reported
        now = time.perf_counter()
        if progress.done == progress.found:  # a study runs several lists of trials
            began = now
        bar.update(task, total=progress.total, completed=progress.done, status=_status(progress, began))
        if not errors.is_terminal and now - reported >= SELDOM:
            reported = now
            errors.print(f"{name}: {_status(progress, began)}", highlight=False, soft_wrap=True)

    with bar:
        task = bar.add_task(name, total=None, status="")
        yield update


@contextmanager
def compilation_announced(errors: Console) -> Iterator[None]:
    """Print one line when numba begins to compile within the block."""
    announced = False

    def announce(compiling: bool) -> None:
        nonlocal announced
        if compiling and not announced:
            errors.print(f"{COMPILING} ({DURATION})", highlight=False)
        announced = True

    with compilation_reported(announce):
        yield


@contextmanager
def flight_progress(errors: Console) -> Iterator[Callable[[float, float], None]]:
    """Yield a function of the simulated time and its limit [s], which moves a bar over the flight.

    Kernels that numba compiles within the block are announced by a line, and the bar shows their number and time.
    """
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[status]}"),
        console=errors, disable=not errors.is_terminal, transient=True,
    )  # fmt: skip
    kernels, compiled, begun = 0, 0.0, 0.0  # number, [s], [s]
    flown, flying = (0.0, 0.0), False  # simulated time and clock where the flight began, [s]

    def announce(compiling: bool) -> None:
        nonlocal kernels, compiled, begun
        if compiling:
            begun = time.perf_counter()
            if not kernels:
                errors.print(f"{COMPILING} ({DURATION})", highlight=False)
        else:
            kernels, compiled = kernels + 1, compiled + time.perf_counter() - begun
            bar.update(task, description="compiling", total=None, status=f"{kernels} kernels in {compiled:.0f} s")

    def fly(t: float, duration: float) -> None:
        nonlocal flown, flying
        now = time.perf_counter()
        if not flying or t < flown[0]:  # the flight begins, or begins again after a rehearsal
            flown, flying = (t, now), True
        pace = f"{(t - flown[0]) / (now - flown[1]):.1f} x real time" if t > flown[0] else ""
        bar.update(
            task,
            description="flying",
            total=duration,
            completed=t,
            status=f"{t:.0f} s of at most {duration:.0f} s {pace}",
        )

    with compilation_reported(announce), bar:
        task = bar.add_task("building", total=None, status="")
        yield fly
    if kernels:
        errors.print(
            f"compiled {counted(kernels, 'kernel')} in {compiled:.0f} s, outside the clock of the run",
            highlight=False,
        )


def _status(progress: Done, began: float) -> str:
    run = progress.done - progress.found
    parts = [f"{progress.done} of {progress.total}"]
    if progress.found:
        parts.append(f"{progress.found} found")
    if run:
        rate = run / (time.perf_counter() - began)  # [1/s]
        left = round((progress.total - progress.done) / rate)  # [s]
        parts.append(f"{rate:.3g} /s")
        parts.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left")
    elif progress.compiling:
        parts.append(COMPILING)
    parts.append(f"{progress.failed} failed, {progress.unsuccessful} unsuccessful")
    return ", ".join(parts)
