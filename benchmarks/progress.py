"""Progress of a measurement: a bar on a terminal, elsewhere a line every ten seconds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

LINE_EVERY = 10.0  # [s]


class Report(Protocol):
    """Callback that reports how much is done, and what is being done now."""

    def __call__(self, done: int, doing: str = "") -> None: ...


@contextmanager
def progress(console: Console, what: str, total: int) -> Iterator[Report]:
    """Show the reported progress out of ``total``."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    began = reported = time.monotonic()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)

        def report(done: int, doing: str = "") -> None:
            nonlocal reported
            description = f"{what}: {doing}" if doing else what
            bar.update(task, completed=done, total=max(total, done), description=description)
            if not console.is_terminal and time.monotonic() - reported > LINE_EVERY:
                reported = time.monotonic()
                console.print(f"{description}: {done} of {max(total, done)}", highlight=False)

        if not console.is_terminal:
            console.print(f"{what}: {total}", highlight=False)
        yield report
    console.print(f"{what}: done in {time.monotonic() - began:.0f} s", highlight=False)
