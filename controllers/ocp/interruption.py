"""A call to ``solve()`` that may be ended early: by Ctrl-C, by its function of the progress, or by its time.

The first Ctrl-C asks the call to end, and ``solve()`` returns the best that it has; a second one during the same call,
or within a second, is a KeyboardInterrupt, as everywhere in Python. Where Ctrl-C does something else already, as in
mathnavi's commands, it is left alone.
"""

from __future__ import annotations

import contextlib
import dataclasses
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from mathnavi.controllers.ocp.call import CURRENT, CallEnded, SolveCall
from mathnavi.controllers.ocp.methods.angles import unwound
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.progress import ProgressLine, Report
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.interfaces.signals import Array

_TWICE = 1.0  # [s] between two signals that end a script which calls again and again
_last = [float("-inf")]  # time [s] of the last Ctrl-C that ended a call


def ending_early(
    solved: Callable[[], Solution],
    problem: ProblemFunctions,
    parameters: Array,
    tolerance: float,
    seconds: float,
    report: Report | None,
) -> Solution:
    """Call a method; where the call has to end before the method does, return the best that it has.

    Args:
        solved: the method.
        problem: the problem as compiled functions.
        parameters: (np,) values of the problem's parameters.
        tolerance: of the last replay.
        seconds: CPU time [s] of the call.
        report: function that is called with the progress; None for silence.

    Returns:
        What the method returns or, of a call that had to end, the best so far: INTERRUPTED, or for its time CONVERGED
        if it solves its programme, else LIMIT. The message says where the call was.

    Raises:
        KeyboardInterrupt: on a second Ctrl-C.
        Exception: what ``report`` raises.
    """
    call = SolveCall(problem, parameters, seconds, report)
    token = CURRENT.set(call)
    try:
        with _interruptible(call):
            try:
                found = solved()
            except CallEnded:
                found = _best(call, tolerance)
            else:
                if call.stopped:  # at its last step, or before it had anything else to return
                    call.keep(found)
                    found = _best(call, tolerance) if not found.ok else found
            if call.failure is not None:
                raise call.failure
            return found
    finally:
        CURRENT.reset(token)
        if isinstance(report, ProgressLine):
            report.close()


def _best(call: SolveCall, tolerance: float) -> Solution:
    """The best of a call that has to end, with a replay if that takes no long time."""
    if call.failure is not None:
        raise call.failure
    best, stage, interrupted = call.best, call.ended_in or call.stage, call.interrupted
    assert best is not None
    call.close()
    if best.solved and best.replay is None:
        with contextlib.suppress(CallEnded):  # its time is over: the best as it is
            best = replayed(unwound(best), tolerance)
    ended = f"the stage '{stage}'"
    why = f"interrupted in {ended}" if interrupted else f"stopped in {ended}, for its seconds are spent"
    late = SolverOutcome.CONVERGED if best.solved else SolverOutcome.LIMIT
    message = best.message if best.solved else ""
    return dataclasses.replace(
        best,
        status=SolverOutcome.INTERRUPTED if interrupted else late,
        message="; ".join(filter(None, (message, why))),
        solved_programme=None,
    )


@contextmanager
def _interruptible(call: SolveCall) -> Iterator[None]:
    """Handle Ctrl-C within the block unless it is handled already."""
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def answer(number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if now - _last[0] < _TWICE:
            raise KeyboardInterrupt
        _last[0], call.interrupted = now, True

    signal.signal(signal.SIGINT, answer)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
