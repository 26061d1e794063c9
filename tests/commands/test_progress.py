"""The bar of a sweep."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from mathnavi.commands import progress
from mathnavi.commands.progress import sweep_progress
from mathnavi.sim.sweep.execution import Progress


def drawn(*states: Progress, terminal: bool = True) -> str:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=terminal, width=200)
    with sweep_progress(console, "coins") as update:
        for state in states:
            update(state)
    return screen.getvalue()


def test_it_tells_rate_time_left_and_failures() -> None:
    states = [Progress(60, 10, done, 2, 3, False) for done in (10, 20)]
    shown = drawn(*states)
    for expected in ("coins", "20 of 60", "10 found", "/s", "0:00:0", "left", "2 failed, 3 unsuccessful"):
        assert expected in shown


@pytest.mark.parametrize("done", [0, 5])
def test_it_says_that_kernels_are_compiled_until_the_first_trial_has_ended(done: int) -> None:
    assert ("compiling the numerical kernels" in drawn(Progress(60, 0, done, 0, 0, True))) == (done == 0)


def test_where_there_is_no_terminal_a_line_is_printed_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    states = [Progress(60, 10, done, 0, 0, False) for done in (10, 15, 20)]
    assert not drawn(*states, terminal=False)
    monkeypatch.setattr(progress, "SELDOM", 0.0)
    lines = drawn(*states, terminal=False).splitlines()
    assert [line.partition(",")[0] for line in lines] == [f"coins: {done} of 60" for done in (10, 15, 20)]
