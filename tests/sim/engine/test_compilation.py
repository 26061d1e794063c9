"""Reports of numba's compilation, and the process that helps with it."""

from __future__ import annotations

import gc
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from mathnavi.interfaces import compiled
from mathnavi.sim.engine import compilation
from tests.programs import program

ROOT = Path(__file__).resolve().parents[3]


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
    kernels = [Kernel() for _ in range(3)]
    monkeypatch.setitem(sys.modules, "one", types.SimpleNamespace(KERNELS=tuple((k, (1,)) for k in kernels[:2])))
    monkeypatch.setitem(sys.modules, "two", types.SimpleNamespace(KERNELS=tuple((k, (1,)) for k in kernels[1:])))
    monkeypatch.setattr(compilation.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(compiled, "any_missing", lambda kernels: missing and len(kernels) == 3)

    def second(command: list[str], **options: Any) -> Process:
        """A process that has claimed the last kernel."""
        (Path(command[4]) / "2").touch()
        return Process(started, command, **options)

    monkeypatch.setattr(compilation.subprocess, "Popen", second)
    compilation.compile_ahead(types.SimpleNamespace(kernels="one"), types.SimpleNamespace(kernels="two"))
    compilation.compile_ahead(types.SimpleNamespace())
    assert [kernel.compiled for kernel in kernels] == [[(1,)] * missing, [(1,)] * missing, []]
    assert [each.ended for each in started] == [["wait", "kill", "wait"]] * missing
    assert [[*each.command[:4], *each.command[5:]] for each in started] == [
        [sys.executable, "-P", "-m", "mathnavi.sim.engine.compilation", "one", "two"]
    ] * missing


def test_a_kernel_is_compiled_by_the_process_that_claims_it(tmp_path: Path) -> None:
    kernels = [Kernel() for _ in range(3)]
    numbered = [(number, (kernel, (1,))) for number, kernel in enumerate(kernels)]
    compilation.compile_unclaimed(numbered[1:][::-1], tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["1", "2"]
    compilation.compile_unclaimed(numbered, tmp_path)
    assert [kernel.compiled for kernel in kernels] == [[(1,)]] * 3
    assert gc.isenabled()


def test_a_flight_past_a_radar_uses_no_kernel_but_those_that_are_compiled_before_it() -> None:
    """What ``make fly`` has compiled when it begins is all that it needs."""
    script = """if True:
        import sys
        from numba.core.dispatcher import Dispatcher
        from mathnavi.sim.engine.compilation import listed
        from tests.kernels import flight

        def compiled():
            values = [each for name, module in [*sys.modules.items()] if name.startswith("mathnavi")
                      for each in vars(module).values() if isinstance(each, Dispatcher)]
            return {f"{each.__module__}.{each.__name__}{types}" for each in values for types in each.overloads}

        for kernel, arguments in listed(sys.argv[1:]):
            kernel.compile(arguments)
        before = compiled()
        flight()
        print(*sorted(compiled() - before), sep="\\n", end="")
    """
    command = [sys.executable, "-c", script, *program(".ci/install.py").KERNELS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == ""
