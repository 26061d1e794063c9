"""The closed loop and what it is compared with do the same work."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.loop_overhead import Flight, bare_steps, dm_control_steps, fly
from mathnavi.models.aerial.dynamics import CONTROL_TICKS, TICK
from tests.flight import mountains, save

SECONDS = 1.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly(save(mountains(), Path(tmp_path_factory.mktemp("terrain")) / "mountains.npz"), SECONDS)


def test_the_idle_planners_plan_is_flown(flight: Flight) -> None:
    assert flight.seconds == pytest.approx(SECONDS)
    assert len(flight.commands) == round(SECONDS / (CONTROL_TICKS * TICK))
    assert np.linalg.norm(flight.end[3:]) > 10.0


@pytest.mark.parametrize("replay", [bare_steps, dm_control_steps])
def test_its_commands_lead_everyone_to_the_same_end(flight: Flight, replay: Callable[[Flight], float]) -> None:
    assert replay(flight) > 0.0


@pytest.mark.parametrize("replay", [bare_steps, dm_control_steps])
def test_who_does_other_work_is_not_compared(flight: Flight, replay: Callable[[Flight], float]) -> None:
    with pytest.raises(RuntimeError, match="not the same work"):
        replay(dataclasses.replace(flight, commands=flight.commands[:-1]))
