"""A call to ``solve()`` says what it does, and ends early with the best that it has: on Ctrl-C, and for its time."""

from __future__ import annotations

import io
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.ocp import interruption
from mathnavi.controllers.ocp.backend import Options
from mathnavi.controllers.ocp.call import CURRENT
from mathnavi.controllers.ocp.methods import by_name
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.progress import ProgressLine, SolveProgress
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.interfaces.errors import ProblemError
from mathnavi.models.buffered_function import BufferedFunction
from mathnavi.models.solver_process import cpu_time
from tests.controllers.ocp.statements import growing_problem


def cart() -> OptimalControlProblem:
    """From rest to rest against the drag of the air; two rounds of hp refinement, and none of its parts is long."""
    ocp = OptimalControlProblem("cart")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(2.5)
    ocp.minimise(running=u**2 + 0.1 * v**4)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u - 0.1 * v**3)
    ocp.start(x, 0.0), ocp.start(v, 0.0), ocp.end(x, 1.0), ocp.end(v, 0.0)
    return ocp


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """Signals of one test are not the second ones of another, and Ctrl-C is Python's before and after."""
    interruption._last[0] = -math.inf
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert CURRENT.get() is None


def at_first(wanted: Callable[[SolveProgress], bool], act: Callable[[], Any]) -> Callable[[SolveProgress], Any]:
    """A function of the progress that acts once, where it is first wanted."""
    done: list[bool] = []

    def report(progress: SolveProgress) -> Any:
        if not done and wanted(progress):
            done.append(True)
            return act()
        return None

    return report


def interrupted() -> None:
    """Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


def test_the_progress_is_shown_from_the_first_solve_to_the_last_and_changes_no_bit() -> None:
    seen: list[SolveProgress] = []
    shown, silent = cart().solve(progress=seen.append), cart().solve(progress=False)
    for name in ("x", "u", "costates", "inner"):
        assert getattr(shown, name).tobytes() == getattr(silent, name).tobytes()
    assert (shown.message, shown.cost, shown.iterations) == (silent.message, silent.cost, silent.iterations)
    assert all(0.0 <= a.elapsed <= b.elapsed for a, b in pairwise(seen))
    stages = list(dict.fromkeys(each.stage for each in seen))
    assert stages == ["solving", "other starts", "other start 1", "other start 2", "second-order condition",
                      "finer meshes"]  # fmt: skip
    assert "hp, round 2" in [each.method for each in seen]
    last = [each for each in seen if each.method == "hp, round 2"][-1]
    assert (last.nodes, last.mesh, last.iteration) == (shown.nodes, shown.scheme.name, shown.iterations + 1)
    assert last.cost == pytest.approx(shown.cost, rel=1e-9)
    assert shown.replay is not None
    assert seen[-1].miss == shown.replay.miss


@pytest.mark.parametrize(
    ("stage", "method", "iteration", "flies"),
    [("solving", "hp", 3, False), ("solving", "hp, round 2", 2, True), ("other start 1", "coarse mesh", 2, True),
     ("second-order condition", "", 0, True), ("finer meshes", "", 2, True)],
)  # fmt: skip
@pytest.mark.parametrize("how", [interrupted, lambda: True])
def test_a_call_that_is_interrupted_returns_the_best_that_it_has(
    stage: str, method: str, iteration: int, flies: bool, how: Callable[[], Any]
) -> None:
    def there(now: SolveProgress) -> bool:
        return (now.stage, now.method) == (stage, method) and now.iteration >= iteration

    found = cart().solve(progress=at_first(there, how))
    assert found.status is SolverOutcome.INTERRUPTED
    assert not found.ok
    assert found.solved is flies
    assert "interrupted in the stage '" in found.message
    assert (found.method, found.nodes) == ("hp", 13)
    assert np.isfinite(found.x).all()
    if flies:
        assert found.replay is not None
        assert found.cost == pytest.approx(cart().solve(progress=False).cost, rel=1e-2)
        assert "when it is replayed" in found.message
    whole = cart().solve(guess=found, progress=False)  # the way to go on
    assert whole.ok


def test_a_second_interruption_ends_at_once() -> None:
    def twice() -> None:
        interrupted(), interrupted()

    with pytest.raises(KeyboardInterrupt):
        cart().solve(progress=at_first(lambda now: now.iteration == 3, twice))


def test_an_interruption_within_casadi_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """CasADi sees the signal while it evaluates; CPython then says that a result has an exception set."""

    def seen(self: BufferedFunction) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr("mathnavi.models.nlp_solver.BufferedFunction.__call__", seen)
    with pytest.raises(KeyboardInterrupt):
        cart().solve(progress=False)


def test_a_script_that_solves_again_and_again_ends_on_two_interruptions_within_a_second() -> None:
    def report(now: SolveProgress) -> None:
        if now.iteration == 1:
            interrupted()

    assert cart().solve(progress=report).status is SolverOutcome.INTERRUPTED
    with pytest.raises(KeyboardInterrupt):
        cart().solve(progress=report)


SCRIPT = """
import sys
from tests.controllers.ocp.test_ending_early import cart
def report(now):
    print(now.stage, flush=True)
    if now.stage == sys.argv[1]:
        sys.stdin.readline()
while True:
    found = cart().solve(progress=report)
    print("RESULT", found.status.name, found.solved, flush=True)
"""


def test_ctrl_c_in_a_terminal_ends_one_call_and_a_second_one_the_script() -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, "finer meshes"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    with child:
        assert child.stdout is not None
        assert child.stdin is not None
        assert child.stderr is not None
        while (line := child.stdout.readline()).strip() != "finer meshes":
            assert line, child.stderr.read()
        child.send_signal(signal.SIGINT)
        child.stdin.write("\n")
        child.stdin.flush()
        while not (line := child.stdout.readline()).startswith("RESULT"):
            assert line, child.stderr.read()
        assert line.split() == ["RESULT", "INTERRUPTED", "True"]
        child.send_signal(signal.SIGINT)
        child.stdin.close()
        assert "KeyboardInterrupt" in child.stderr.read()
        assert child.wait(20.0) == -signal.SIGINT


def test_who_handles_ctrl_c_already_goes_on_handling_it() -> None:
    heard = []
    former = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        found = cart().solve(progress=at_first(lambda now: now.stage == "finer meshes", interrupted))
    finally:
        signal.signal(signal.SIGINT, former)
    assert heard == [signal.SIGINT]
    assert found.ok


def test_without_a_replay_ctrl_c_is_that_of_python(monkeypatch: pytest.MonkeyPatch) -> None:
    def handled(*_: object) -> Solution:
        raise AssertionError

    monkeypatch.setattr(by_name, "ending_early", handled)
    assert cart().solve(21, replay=False).solved


@pytest.mark.parametrize("seconds", [1e-6, 0.05, 0.1, 0.2, 0.4])
def test_the_time_of_a_call_is_that_of_all_it_does(seconds: float) -> None:
    began = cpu_time()
    found = cart().solve(options=Options(tolerance=1e-11, seconds=seconds), progress=False)
    spent = cpu_time() - began
    assert spent <= 1.5 * seconds + 0.25  # what is between two looks at the clock: a programme is built, say
    if not found.ok:
        assert found.status in (SolverOutcome.LIMIT, SolverOutcome.CONVERGED)
        assert (found.status is SolverOutcome.CONVERGED) == found.solved


@pytest.mark.parametrize("stage", ["other start 1", "second-order condition", "finer meshes"])
def test_a_call_whose_time_is_up_says_in_which_stage(stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock jumps by an hour where the stage begins."""
    late = [0.0]
    monkeypatch.setattr("mathnavi.controllers.ocp.call.cpu_time", lambda: time.process_time() + late[0])

    def report(now: SolveProgress) -> None:
        if now.stage == stage:
            late[0] = 3600.0

    found = cart().solve(progress=report)
    assert found.status is SolverOutcome.CONVERGED
    assert found.solved
    assert "stopped in the stage" in found.message
    assert found.message.endswith("for its seconds are spent")


def test_a_replay_that_takes_too_long_is_ended_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock jumps by an hour where the flight is to be integrated step by step."""
    late = [0.0]
    monkeypatch.setattr("mathnavi.controllers.ocp.call.cpu_time", lambda: time.process_time() + late[0])
    monkeypatch.setattr("mathnavi.controllers.ocp.replay.flight", lambda *_, **__: late.__setitem__(0, 3600.0))
    found = cart().solve(31, progress=False)
    assert found.status is SolverOutcome.CONVERGED
    assert found.message.endswith("for its seconds are spent")


def test_fatrop_that_does_not_come_back_is_stopped_in_its_own_process() -> None:
    options = Options("fatrop", seconds=60.0)
    ctrl_c, began = threading.Timer(0.5, interrupted), time.perf_counter()
    ctrl_c.start()
    found = growing_problem(5.0).solve(6, options=options, progress=False)
    ctrl_c.join()
    assert 0.5 <= time.perf_counter() - began < 10.0
    assert found.status is SolverOutcome.INTERRUPTED
    assert growing_problem(0.0).solve(6, options=options, progress=False).solved


def test_an_error_of_the_function_of_the_progress_is_raised() -> None:
    def failing() -> None:
        raise IndexError("of the notebook")

    with pytest.raises(IndexError, match="of the notebook"):
        cart().solve(progress=at_first(lambda now: now.iteration == 2, failing))
    with pytest.raises(IndexError, match="of the notebook"):
        cart().solve(progress=at_first(lambda now: now.stage == "finer meshes", failing))


class Terminal(io.StringIO):
    """Standard error as a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("progress", "terminal", "written"),
    [(None, True, True), (None, False, False), (False, True, False), (True, False, True)],
)
def test_a_terminal_has_a_line_and_nothing_is_left_of_it(
    progress: bool | None, terminal: bool, written: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("_PATIENCE", "_SELDOM"):
        monkeypatch.setattr(f"mathnavi.controllers.ocp.progress.{name}", 0.0)
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    assert cart().solve(progress=progress).ok
    lines = stream.getvalue().split("\r")
    assert bool(lines[0] or lines[1:]) is written
    if written:
        assert lines[-1] == "\x1b[K"
        assert any(line.startswith("solving: hp, Radau IIA of order 5, 13 nodes, iteration") for line in lines)


def test_the_line_is_no_longer_than_a_terminal_is_wide_and_waits_a_second() -> None:
    stream = Terminal()
    line = ProgressLine(stream)
    now = SolveProgress("s" * 200, "hp", "Radau", 13, 4, 1.0, 1e-3, 1e-6, 0.5)
    line(now)
    line.close()
    assert stream.getvalue() == ""
    line(SolveProgress(**{**vars(now), "elapsed": 1.5}))
    line(SolveProgress(**{**vars(now), "elapsed": 1.55}))
    assert stream.getvalue() == f"\r{'s' * 118}\x1b[K"


@pytest.mark.parametrize("wrong", [1, "yes", [print]])
def test_what_cannot_be_called_is_refused(wrong: Any) -> None:
    with pytest.raises(ProblemError, match=r"^progress = .*; allowed: a function"):
        cart().solve(progress=wrong)


def test_an_iteration_is_told_by_name() -> None:
    now = SolveProgress("solving", "hp", "Radau", 13, 4, 1.25, 1e-3, math.nan, 2.0)
    assert str(now) == "solving: hp, Radau, 13 nodes, iteration 4, J = 1.25, violation 1.0e-03, 2 s"
