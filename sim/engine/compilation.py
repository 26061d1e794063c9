"""Compilation by numba of kernels that its cache lacks: reports of it, and two processes that share it.

    python -m mathnavi.sim.engine.compilation CLAIMS MODULE ... [--first]

is the second process (``compile_ahead``), which begins with the last kernel, or with the first.
"""

from __future__ import annotations

import gc
import importlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mathnavi.interfaces.compiled import Signature


@contextmanager
def compilation_reported(report: Callable[[bool], None]) -> Iterator[None]:
    """Call ``report(True)`` when numba begins to compile within the block, and ``report(False)`` when it has ended."""
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


def compile_ahead(*configs: object) -> None:
    """Compile the ``kernels`` of configurations, each a module with a list ``KERNELS``, by two processes.

    The second process takes the kernels from the end of the list, this one from its start, until none is left:
    neighbours, which share inner kernels, are compiled by the same one. Nothing happens if all are cached already.
    A failure of the second process only costs time: kernels that are missing afterwards are compiled when they are
    called.
    """
    modules = dict.fromkeys(name for config in configs if isinstance(name := getattr(config, "kernels", None), str))
    if not modules or (os.cpu_count() or 1) < 2:
        return
    from mathnavi.interfaces.compiled import any_missing  # numba takes a while to import

    kernels = listed(modules)
    if not any_missing(kernels):
        return
    quiet = subprocess.DEVNULL
    with tempfile.TemporaryDirectory(prefix="mathnavi-kernels-") as claims:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, claims, *modules], stdin=quiet, stdout=quiet, stderr=quiet
        )
        try:
            compile_unclaimed(list(enumerate(kernels)), Path(claims))
            process.wait()
        finally:
            process.kill()
            process.wait()


def listed(modules: Iterable[str]) -> list[Signature]:
    """Return the kernels of modules, each once."""
    return list(dict.fromkeys(each for module in modules for each in importlib.import_module(module).KERNELS))


def compile_unclaimed(kernels: Sequence[tuple[int, Signature]], claims: Path) -> None:
    """Compile numbered kernels that no other process has claimed by a file with that number."""
    collecting = gc.isenabled()
    gc.disable()  # it would search all objects of numba's compiler again and again
    try:
        for number, (kernel, arguments) in kernels:
            with suppress(FileExistsError):
                (claims / str(number)).touch(exist_ok=False)
                kernel.compile(arguments)
    finally:
        if collecting:
            gc.enable()


@dataclass
class CompilationClock:
    """Clock of the time that compilation has taken so far."""

    seconds: float = 0.0  # [s]


@contextmanager
def compilation_timed() -> Iterator[CompilationClock]:
    """Yield a clock of the compilation within the block. If numba has not been imported yet, nothing is timed."""
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


if __name__ == "__main__":
    folder, *named = (word for word in sys.argv[1:] if word != "--first")
    numbered = list(enumerate(listed(named)))
    compile_unclaimed(numbered if "--first" in sys.argv else numbered[::-1], Path(folder))
