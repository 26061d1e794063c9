"""Reports of compilation by numba, which happens only where its cache holds nothing."""

from __future__ import annotations

import importlib
import os
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


def compile_ahead(config: object) -> None:
    """Compile what a plug-in's configuration names as its ``kernels``, a module as ``compile_in_two`` takes it."""
    module = getattr(config, "kernels", None)
    if isinstance(module, str):
        compile_in_two(module)


def compile_in_two(module: str) -> None:
    """Compile the kernels ``OWN`` of a module in here while a second process, ``python -m module``, does its others.

    Nothing happens where they are all kept already. Whether the second process succeeds changes nothing but the time:
    what is missing afterwards is compiled where it is called.
    """
    from mathnavi.sim.interfaces.compiled import any_missing, compile_all  # numba takes a while to import

    lists = importlib.import_module(module)
    if (os.cpu_count() or 1) < 2 or not any_missing((*lists.OWN, *lists.HELPED)):
        return
    quiet = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, "-P", "-m", module], stdin=quiet, stdout=quiet, stderr=quiet)
    try:
        compile_all(lists.OWN)
        process.wait()
    finally:
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
