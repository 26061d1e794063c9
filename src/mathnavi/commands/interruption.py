"""Ctrl-C and SIGTERM: a command ends within two seconds, keeps what is stored, and prints how to go on.

The first signal raises ``Interrupted`` in the main thread; while it unwinds, finished results are committed and child
processes are ended. Further signals are ignored meanwhile. The main thread may be in a library that does not
return, or that swallows the exception: a second thread, which is notified of the signal at once
(``signal.set_wakeup_fd``), ends the process if it still runs after ``GRACE``. Stores and files are consistent at any
time.
"""

from __future__ import annotations

import os
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

from mathnavi.commands.errors import one_line

SIGNALS = (signal.SIGINT, signal.SIGTERM)
GRACE = 1.0  # [s] to unwind


def nothing_written() -> str:
    """Return the note on what is kept of a command that writes its result at its end."""
    return "nothing was written; to begin again"


_words: Callable[[], str] = nothing_written  # of the command that runs


class Interrupted(KeyboardInterrupt):
    """Request by a signal that the process ends."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def when_interrupted(words: Callable[[], str]) -> None:
    """Set the function whose text says what is kept, and what the command printed after it does, if a signal ends this
    one: "3 of 8 trials stored; to go on".

    The function may be called from another thread than this one.
    """
    global _words
    _words = words


def interrupted_line(argv: Sequence[str]) -> str:
    """Return the line for standard error that says that a command was interrupted, and how it goes on."""
    return one_line(f"mathnavi: interrupted, {_words()}: {shlex.join(['mathnavi', *argv])}")


def exit_code(error: KeyboardInterrupt) -> int:
    """Return the exit code that a shell has for a process that ended by the signal: 130 or 143."""
    return 128 + (error.number if isinstance(error, Interrupted) else signal.SIGINT)


@contextmanager
def interruptible(argv: Sequence[str], whole_process: bool = False) -> Iterator[None]:
    """Handle the signals within the block, in which the command ``argv`` runs.

    With ``whole_process``, further signals stay ignored after the first one: the process only has to end. Outside the
    main thread, where Python allows no signal handlers, this changes nothing.
    """
    when_interrupted(nothing_written)
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard, woken = os.pipe()
    os.set_blocking(woken, False)
    done = threading.Event()
    threading.Thread(target=_end_in_time, args=(heard, done, argv), daemon=True).start()
    asked: int | None = None

    def answer(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked is None and not done.is_set():
            asked = number
            raise Interrupted(number)

    def unraisable(fault: Any) -> None:
        if not isinstance(fault.exc_value, Interrupted):  # a compiler's callback has swallowed it; ``GRACE`` ends it
            former_hook(fault)

    former_hook, sys.unraisablehook = sys.unraisablehook, unraisable
    former = {number: signal.signal(number, answer) for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN}
    waker = signal.set_wakeup_fd(woken, warn_on_full_buffer=False)
    try:
        yield
    except Exception as error:
        if asked is None:
            raise
        raise Interrupted(asked) from error  # an import that is interrupted fails, say
    finally:
        done.set()
        signal.set_wakeup_fd(waker)
        sys.unraisablehook = former_hook
        if asked is None or not whole_process:
            for number, handler in former.items():
                signal.signal(number, handler)
        os.close(woken)


def _end_in_time(heard: int, done: threading.Event, argv: Sequence[str]) -> None:
    """Wait for a signal, and end the process if it still runs after ``GRACE``."""
    with open(heard, "rb", buffering=0) as numbers:
        number = next((each[0] for each in iter(lambda: numbers.read(1), b"") if each[0] in SIGNALS), None)
    if number is not None and not done.wait(GRACE):
        end(128 + number, argv)


def end(code: int, argv: Sequence[str]) -> NoReturn:
    """End the process and its child processes at once; print how the command goes on."""
    if "mathnavi.sim.sweep.child" in sys.modules:
        from mathnavi.sim.sweep.child import kill_children

        kill_children()
    os.write(2, f"{interrupted_line(argv)}\n".encode())
    os._exit(code)
