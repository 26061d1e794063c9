"""A bar for trials: how many, how fast, how long still, what has failed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from sim.sweep.execution import Progress as Done


@contextmanager
def sweep_progress(errors: Console, name: str) -> Iterator[Callable[[Done], None]]:
    """What ``run_trials`` tells how far it is; nothing is drawn where ``errors`` is no terminal."""
    bar = Progress(
        TextColumn(name), BarColumn(bar_width=12), TextColumn("{task.fields[told]}"),
        console=errors, disable=not errors.is_terminal, transient=True,
    )  # fmt: skip
    began = time.perf_counter()

    def update(progress: Done) -> None:
        nonlocal began
        if progress.done == progress.found:  # a study runs several lists of trials
            began = time.perf_counter()
        bar.update(task, total=progress.total, completed=progress.done, told=_told(progress, began))

    with bar:
        task = bar.add_task(name, total=None, told="")
        yield update


def _told(progress: Done, began: float) -> str:
    run = progress.done - progress.found
    told = [f"{progress.done} of {progress.total}"]
    if progress.found:
        told.append(f"{progress.found} found")
    if run:
        rate = run / (time.perf_counter() - began)  # [1/s]
        left = round((progress.total - progress.done) / rate)  # [s]
        told.append(f"{rate:.3g} /s")
        told.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left")
    elif progress.compiling:
        told.append("compiling the numerical kernels, once on this machine")
    told.append(f"{progress.failed} failed, {progress.unsuccessful} unsuccessful")
    return ", ".join(told)
