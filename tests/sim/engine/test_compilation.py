"""Reports of numba's compilation, and the process that helps with it."""

from __future__ import annotations

import sys
import types
from typing import Any

import pytest

from mathnavi.sim.engine import compilation
from mathnavi.sim.interfaces import compiled


class Process:
    """Stand-in for a process that was started."""

    def __init__(self, started: list[Process], command: list[str], **options: Any) -> None:
        self.command, self.ended = command, list[str]()
        started.append(self)

    def kill(self) -> None:
        self.ended.append("kill")

    def wait(self) -> None:
        self.ended.append("wait")


class Kernel:
    """What stands in for a kernel; counts how often it was compiled."""

    def __init__(self) -> None:
        self.compiled: list[tuple[Any, ...]] = []

    def compile(self, arguments: tuple[Any, ...]) -> None:
        self.compiled.append(arguments)


@pytest.mark.parametrize("missing", [True, False])
def test_a_second_process_compiles_its_share_if_a_kernel_is_missing(
    missing: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[Process] = []
    own, helped = Kernel(), Kernel()
    lists = types.SimpleNamespace(OWN=((own, (1,)),), HELPED=((helped, (2,)),))
    monkeypatch.setitem(sys.modules, "helper", lists)
    monkeypatch.setattr(compilation.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(compiled, "any_missing", lambda kernels: missing and len(kernels) == 2)
    monkeypatch.setattr(compilation.subprocess, "Popen", lambda *given, **options: Process(started, *given, **options))
    compilation.compile_ahead(types.SimpleNamespace(kernels="helper"))
    compilation.compile_ahead(types.SimpleNamespace())
    assert own.compiled == [(1,)] * missing
    assert not helped.compiled
    assert [(each.command, each.ended) for each in started] == [
        ([sys.executable, "-P", "-m", "helper"], ["wait", "kill", "wait"])
    ] * missing
