"""Ctrl-C and SIGTERM end a command at once, however it is busy, and a second one does not disturb that."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mathnavi.commands.interruption import (
    Interrupted,
    exit_code,
    interrupted_line,
    interruptible,
    when_interrupted,
)
from tests.sim.sweep.test_jobs import LATE

ARGV = ("sweep", "safe-flight", "--store", "my results.db")


def ask(number: int) -> None:
    os.kill(os.getpid(), number)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_raised_once_and_its_handler_is_the_former_one_again(number: int, code: int) -> None:
    former = signal.getsignal(number)
    unwound = []

    def unwind() -> None:
        try:
            ask(number)
        finally:
            ask(signal.SIGINT)
            ask(signal.SIGTERM)
            unwound.append(True)

    with pytest.raises(Interrupted) as raised, interruptible(ARGV):
        unwind()
    assert unwound
    assert exit_code(raised.value) == code
    assert signal.getsignal(number) is former


def test_an_error_that_follows_from_a_signal_is_an_interruption() -> None:
    def load() -> None:
        try:
            ask(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("half a module") from None

    with pytest.raises(Interrupted), interruptible(ARGV):
        load()


def test_an_error_without_a_signal_is_that_error() -> None:
    with pytest.raises(ImportError), interruptible(ARGV):
        raise ImportError


def test_the_line_says_what_is_kept_and_quotes_the_command() -> None:
    command = "mathnavi sweep safe-flight --store 'my results.db'"
    with interruptible(ARGV):
        assert interrupted_line(ARGV) == f"mathnavi: interrupted, nothing was written; to begin again: {command}"
        when_interrupted(lambda: "3 of 8 trials stored; to go on")
        assert interrupted_line(ARGV) == f"mathnavi: interrupted, 3 of 8 trials stored; to go on: {command}"


def test_a_callback_of_a_library_that_swallows_it_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    """As those of the compiler do, while it looks for kernels."""
    callback = ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.SIGTERM))
    with interruptible(ARGV):
        callback()
    assert capfd.readouterr().err == ""


STUBBORN = """
import sys, threading, time
from mathnavi.commands.interruption import interruptible
from mathnavi.sim.sweep.child import Worker, module_path
from mathnavi.sim.sweep.job import job
from tests.sim.sweep.computations import noted_and_asleep
task = job(noted_and_asleep, sys.argv[1])
threading.Thread(target=Worker(module_path()).run, args=(task, task.content), daemon=True).start()
with interruptible(["study", "a b"], whole_process=True):
    while True:
        try:
            time.sleep(60.0)
        except KeyboardInterrupt:
            pass
"""


def test_a_process_that_does_not_end_is_ended_with_its_children(tmp_path: Path) -> None:
    note = tmp_path / "note"
    with subprocess.Popen([sys.executable, "-c", STUBBORN, str(note)], stderr=subprocess.PIPE, text=True) as process:
        child = int(waited_for(note))
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate()
    assert process.returncode == 143
    assert error == "mathnavi: interrupted, nothing was written; to begin again: mathnavi study 'a b'\n"
    while runs(child):  # it was killed
        time.sleep(0.01)


def waited_for(place: Path) -> str:
    until = time.monotonic() + LATE
    while not (place.exists() and place.read_text(encoding="utf-8")):
        assert time.monotonic() < until
        time.sleep(0.05)
    return place.read_text(encoding="utf-8")


def runs(pid: int) -> bool:
    """Return whether a process runs; one that has ended without being waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
