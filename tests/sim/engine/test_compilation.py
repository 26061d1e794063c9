"""Reports of numba's compilation, and the process that helps with it."""

from __future__ import annotations

import sys
from typing import Any

import numba
import pytest

from mathnavi.sim.engine import compilation


class Process:
    """Stand-in for a process that was started."""

    def __init__(self, started: list[Process], command: list[str], **options: Any) -> None:
        self.command, self.ended = command, list[str]()
        started.append(self)

    def kill(self) -> None:
        self.ended.append("kill")

    def wait(self) -> None:
        self.ended.append("wait")


def test_one_process_helps_once_a_kernel_of_the_package_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[Process] = []
    monkeypatch.setattr(compilation.subprocess, "Popen", lambda *given, **options: Process(started, *given, **options))

    def compile_one() -> None:
        numba.njit(lambda x: x).compile((numba.float64,))

    with compilation.compiled_ahead(f"{__name__}s", "helper"):
        compile_one()
    assert not started
    with compilation.compiled_ahead(__name__.rpartition(".")[0], "helper"):
        assert not started
        compile_one()
        compile_one()
    assert [(each.command, each.ended) for each in started] == [
        ([sys.executable, "-P", "-m", "helper"], ["kill", "wait"])
    ]
