"""A call to ``solve()``: what it does, the best that it has so far, and whether it has to end.

A call solves many programmes, and replays, checks and simulates between them. Each of these places says what it does
(``at``), hands over what it found (``kept``), and asks whether the call has to end (``check``) because its time is
spent or because it was interrupted. ``check`` then raises ``CallEnded``, which passes through all methods, and
``solve()`` returns the best solution that was kept. Until there is one the call goes on: a solve that has to end stops
at its first iterate. The call is a context variable, so that no method carries it; without one all of this does
nothing.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

import numpy as np

from mathnavi.controllers.ocp.progress import Report, SolveProgress
from mathnavi.interfaces.signals import Array
from mathnavi.models.solver_process import cpu_time

if TYPE_CHECKING:
    from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
    from mathnavi.controllers.ocp.solution import Solution

_LATE = 1.25  # times the seconds of a call, after which it is ended wherever it is
_CLOSING = 0.25  # of these seconds, and
_AT_MOST = 5.0  # [s] of CPU time, for the last replay


class CallEnded(Exception):  # noqa: N818  it is no error
    """Request that a call to ``solve()`` ends where it is."""


class SolveCall:
    """A call to ``solve()`` of a problem with parameters (np,), for ``seconds`` of CPU time."""

    def __init__(self, problem: ProblemFunctions, parameters: Array, seconds: float, report: Report | None) -> None:
        """Begin to count the time."""
        self._problem, self._parameters, self._report = problem, parameters, report
        self._seconds, self._late = seconds, _LATE * seconds
        self._began, self._cpu = time.perf_counter(), cpu_time()
        self._stages, self._now = ["solving"], SolveProgress("", "", "", 0, 0, math.nan, math.nan, math.nan, 0.0)
        self.interrupted = False
        self.failure: BaseException | None = None  # of the function that is called with the progress
        self.best: Solution | None = None
        self.ended_in = ""  # stage in which the call was asked to end

    @property
    def stage(self) -> str:
        """Description of the present stage, with its method."""
        return ": ".join(filter(None, (self._stages[-1], self._now.method)))

    @property
    def stopped(self) -> bool:
        """True if the call has to end."""
        return self.interrupted or self.failure is not None or cpu_time() - self._cpu > self._late

    def check(self) -> None:
        """Raise ``CallEnded`` if the call has to end, and has something to return or an error to raise."""
        if (self.best is not None or self.failure is not None) and self.stopped:
            self.ended_in = self.stage
            raise CallEnded

    def keep(self, solution: Solution) -> None:
        """Keep a solution if it is at least as good as the best so far, and one of this problem."""
        if solution.replay is not None:
            self._now = dataclasses.replace(self._now, miss=solution.replay.miss)
        own = solution.problem is self._problem and np.array_equal(solution.parameters, self._parameters)
        if own and (self.best is None or _rank(solution) >= _rank(self.best)):
            named = self._now.method.partition(", round")[0]
            known = solution.method != "direct" or not named or named == "auto"
            self.best = solution if known else dataclasses.replace(solution, method=named)

    def close(self) -> None:
        """Give the call the time of a last replay, without a report of progress."""
        self.interrupted, self._report = False, None
        self._late = cpu_time() - self._cpu + min(_CLOSING * self._seconds, _AT_MOST)

    # progress

    @contextmanager
    def at(self, stage: str | None, method: str | None) -> Iterator[None]:
        """Say what is done within the block."""
        former = self._now.method
        if stage is not None:
            self._stages.append(stage)
        self._now = dataclasses.replace(self._now, method=former if method is None else method)
        self.check()
        self._tell()
        try:
            yield
        finally:
            if stage is not None:
                self._stages.pop()
            self._now = dataclasses.replace(self._now, method=former)

    def mesh(self, name: str, nodes: int) -> None:
        """Say on which mesh the next programme is solved."""
        self.check()
        self._now = dataclasses.replace(self._now, mesh=name, nodes=nodes, iteration=0, violation=math.nan)
        self._tell()

    def iterated(self, cost: float, violation: float) -> bool:
        """Take note of an iterate; True if the solve has to end there."""
        if self._report is None:
            return self.stopped
        self._now = dataclasses.replace(self._now, iteration=self._now.iteration + 1, cost=cost, violation=violation)
        self._tell()
        return self.stopped

    def _tell(self) -> None:
        if self._report is None or self.failure is not None:
            return
        elapsed = time.perf_counter() - self._began
        try:
            wanted = self._report(dataclasses.replace(self._now, stage=self._stages[-1], elapsed=elapsed))
        except Exception as error:  # somebody else's function, whose error is raised where the call ends
            self.failure = error
        else:
            self.interrupted = self.interrupted or wanted is True


def _rank(solution: Solution) -> tuple[int, float]:
    """Rank of a solution, the larger the better; of two that are no more than solved the later one is the finer one."""
    replay = solution.replay
    if replay is not None and solution.solved:
        return (3, -solution.cost) if replay.error <= solution.tolerance else (2, -replay.error)
    return int(solution.solved), 0.0


CURRENT: ContextVar[SolveCall | None] = ContextVar("solve_call", default=None)


@contextmanager
def at(stage: str | None = None, method: str | None = None) -> Iterator[None]:
    """Say what the current call does within the block; None for no change."""
    call = CURRENT.get()
    if call is None:
        yield
        return
    with call.at(stage, method):
        yield


def check() -> None:
    """Raise ``CallEnded`` if the current call has to end."""
    if (call := CURRENT.get()) is not None:
        call.check()


def kept(solution: Solution) -> Solution:
    """Hand a solution over to the current call, and return it."""
    if (call := CURRENT.get()) is not None:
        call.keep(solution)
        call.check()
    return solution


@dataclasses.dataclass(frozen=True)
class ScaledCosts:
    """Watch of a solve whose f is J over a scale, for a call."""

    call: SolveCall
    scale: float  # NaN where f is no cost

    def iterated(self, f: float, violation: float) -> bool:
        """Take note of an iterate; True if the solve has to end there."""
        return self.call.iterated(self.scale * f, violation)

    @property
    def stopped(self) -> bool:
        """True if the solve has to end."""
        return self.call.stopped


def watch(scale: float) -> ScaledCosts | None:
    """Watch of the next solve, whose f is J over a scale; None outside of a call."""
    call = CURRENT.get()
    return None if call is None else ScaledCosts(call, scale)
