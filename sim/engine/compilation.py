"""Reports of compilation by numba, which happens only where its cache holds nothing."""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
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


@contextmanager
def compiled_ahead(package: str, module: str) -> Iterator[None]:
    """Have a second process run ``module``, which compiles, as soon as a kernel of ``package`` is compiled in here.

    The process ends with what is in here at the latest; whether it succeeds changes nothing but the time.
    """
    event: Any = importlib.import_module("numba.core.event")  # takes a while to import
    processes: list[subprocess.Popen[bytes]] = []

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            if not processes and event.data["dispatcher"].py_func.__module__.startswith(f"{package}."):
                command = [sys.executable, "-P", "-m", module]
                quiet = subprocess.DEVNULL
                processes.append(subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet))

        def on_end(self, event: Any) -> None:
            pass

    try:
        with event.install_listener("numba:compile", Listener()):
            yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


@dataclass
class CompilationClock:
    """Time that compilation has taken so far."""

    seconds: float = 0.0  # [s]


@contextmanager
def compilation_timed() -> Iterator[CompilationClock]:
    """A clock of the compilation in here. Where nothing has imported numba yet, nothing is timed."""
    clock, began = CompilationClock(), 0.0

    def report(compiling: bool) -> None:
        nonlocal began
        if compiling:
            began = time.perf_counter()
        else:
            clock.seconds += time.perf_counter() - began

    if "numba" not in sys.modules:
        yield clock
        return
    with compilation_reported(report):
        yield clock
