"""A run that compiles in its beginning is flown again, and the clock leaves out what compiles later."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
import pytest

from mathnavi.sim.engine import compilation
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.scenarios import closed_loop as module
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.textbook import TextbookObserver


class Compiling:
    """A textbook run of four planning periods whose referee "compiles" at given times, in these periods, once each."""

    def __init__(self, *times: float) -> None:
        self.times = list(times)
        self.clock = compilation.CompilationClock()
        self.flown: list[float] = []  # times at which the referees were asked
        self.wall: list[float] = []  # [s] that summaries were given

    def build(self) -> ClosedLoop:
        loop = TextbookObserver.build(TextbookObserver.Config(), seed=0)
        ((_, agent),) = loop.agents.items()
        period = agent.planner.period  # [s]

        def finished(t: float, truths: Any) -> bool:
            self.flown.append(t)
            if self.times and t >= self.times[0] * period:
                self.times.pop(0)
                self.clock.seconds += 1000.0
            return False

        def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
            self.wall.append(wall_seconds)
            return {}, True

        return dataclasses.replace(loop, duration=4.0 * period, finished=finished, summarise=summarise)

    @contextmanager
    def timed(self) -> Any:
        self.clock.seconds = 0.0
        yield self.clock


@pytest.fixture
def compiling(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Compiling]:
    def make(*times: float) -> Compiling:
        made = Compiling(*times)
        timed: Callable[[], AbstractContextManager[Any]] = made.timed
        monkeypatch.setattr(module, "compilation_timed", timed)
        return made

    return make


def starts(times: list[float]) -> int:
    return times.count(0.0)


def test_a_run_that_compiles_in_its_beginning_is_flown_again(compiling: Callable[..., Compiling]) -> None:
    made = compiling(0.0)
    again = made.build().run(again=made.build)
    assert starts(made.flown) == 2
    assert len(made.wall) == 1
    assert 0.0 <= made.wall[0] < 1000.0
    plain = compiling().build().run()
    for name, values in plain.arrays.items():
        np.testing.assert_array_equal(again[name], values, err_msg=name)


def test_a_run_without_compilation_is_flown_once(compiling: Callable[..., Compiling]) -> None:
    made = compiling()
    made.build().run(again=made.build)
    assert starts(made.flown) == 1


def test_what_compiles_later_is_left_out_of_the_clock(compiling: Callable[..., Compiling]) -> None:
    made = compiling(3.5)
    began = time.perf_counter()
    made.build().run(again=made.build)
    assert starts(made.flown) == 1
    assert made.wall[0] <= time.perf_counter() - began - 1000.0


def test_without_a_second_build_a_run_goes_on(compiling: Callable[..., Compiling]) -> None:
    made = compiling(0.0)
    made.build().run()
    assert starts(made.flown) == 1


def test_compilation_by_numba_is_timed() -> None:
    numba = pytest.importorskip("numba")
    with compilation.compilation_timed() as clock:
        assert numba.njit(lambda x: x + 1)(1) == 2
    assert clock.seconds > 0.0
    with compilation.compilation_timed() as second:
        pass
    assert second.seconds == 0.0
