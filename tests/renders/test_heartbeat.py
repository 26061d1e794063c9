"""Without a terminal a long step says now and then how far it is; on a terminal a bar does."""

from __future__ import annotations

import io
import time
from collections.abc import Callable

import pytest
from rich.console import Console

from mathnavi.renders.heartbeat import lines_of_progress


def working(console: Console, enough: Callable[[], bool]) -> None:
    """A long step that fails in the end."""
    with lines_of_progress(console, lambda: "[3] of 9", 0.01):
        until = time.monotonic() + 60.0
        while not enough() and time.monotonic() < until:
            time.sleep(0.01)
        raise RuntimeError


@pytest.mark.parametrize("terminal", [False, True])
def test_lines_come_while_a_step_takes_long_and_end_with_it(terminal: bool) -> None:
    out = io.StringIO()
    with pytest.raises(RuntimeError):
        working(Console(file=out, force_terminal=terminal), lambda: terminal or out.getvalue().count("[3] of 9\n") >= 2)
    said = out.getvalue()
    assert (said.count("[3] of 9\n") >= 2) is not terminal
    time.sleep(0.05)
    assert out.getvalue() == said
