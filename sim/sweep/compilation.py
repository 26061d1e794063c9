"""Reports of compilation by numba, which happens only where its cache holds nothing."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def compilation_reported(report: Callable[[bool], None]) -> Iterator[None]:
    """Call ``report(True)`` when numba begins to compile in here, and ``report(False)`` when it has ended."""
    event: Any = importlib.import_module("numba.core.event")  # takes a while to import

    class Listener(event.Listener):
        depth = 0  # one function's compilation is part of another's

        def on_start(self, event: Any) -> None:
            self.depth += 1
            if self.depth == 1:
                report(True)

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                report(False)

    with event.install_listener("numba:compile", Listener()):
        yield
