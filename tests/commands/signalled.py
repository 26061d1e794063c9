"""A command in a process of its own that sends itself a signal at one of its commits, which depends on no clock."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).parents[2]  # where tests.sim.sweep.scenarios is found
SIGNALLED = """
import os, sys
from contextlib import contextmanager
from mathnavi.commands.cli import main
from mathnavi.sim.records.store import Store

number, place, rows = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
committed = Store._transaction

def reached(store):
    global rows
    if len(store.keys()) + len(store.job_endings()) >= rows:
        rows = float("inf")  # once
        os.kill(os.getpid(), number)

@contextmanager
def transaction(store):
    with committed(store):
        yield
        if place == "within":
            reached(store)
    if place == "after":
        reached(store)

Store._transaction = transaction
sys.exit(main(sys.argv[4:]))
"""


def signalled(
    number: signal.Signals, place: Literal["within", "after"], rows: int, *argv: str
) -> subprocess.CompletedProcess[str]:
    """Run a command that is hit within or after the commit with which its store has so many results."""
    command = [sys.executable, "-c", SIGNALLED, str(int(number)), place, str(rows), *argv]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
