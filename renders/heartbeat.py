"""Lines of progress where there is no terminal for a bar: one every few seconds, however long a step takes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console

SELDOM = 5.0  # [s] between two lines


@contextmanager
def lines_of_progress(console: Console, line: Callable[[], str], interval: float = SELDOM) -> Iterator[None]:
    """Print ``line()`` every ``interval`` [s] in here, where the console is no terminal."""
    if console.is_terminal:
        yield
        return
    ended = threading.Event()

    def report() -> None:
        while not ended.wait(interval):
            console.print(line(), markup=False, highlight=False, soft_wrap=True)

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
