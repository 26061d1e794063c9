"""Worst runs are called by what differs among them; a run whose model MuJoCo refuses is bad input."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import pytest

from mathnavi.commands.errors import BadInputError
from mathnavi.commands.recorded_run import reading_run
from mathnavi.commands.worst_runs import run_names


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ([(0, {"a": 1}), (3, {"a": 1})], ["seed 0", "seed 3"]),
        ([(0, {"a": 1, "b": 2}), (0, {"a": 5, "b": 2})], ["a 1", "a 5"]),
        ([(0, {"a": 1}), (0, {"a": 5}), (1, {"a": 1})], ["seed 0, a 1", "seed 0, a 5", "seed 1, a 1"]),
        ([(0, {"a": 1}), (0, {"a": 1})], ["seed 0, 1 of 2", "seed 0, 2 of 2"]),
        ([(7, {"a": 1})], ["seed 7"]),
    ],
)
def test_runs_are_called_by_what_differs_among_them(
    runs: list[tuple[int, Mapping[str, Any]]], names: list[str]
) -> None:
    records: list[Any] = [SimpleNamespace(seed=seed, fields=fields) for seed, fields in runs]
    assert run_names(records, sorted({name for _, fields in runs for name in fields})) == names


def test_a_run_whose_model_mujoco_refuses_is_bad_input(tmp_path: Path) -> None:
    """It ends the command with exit code 2 and one line, where it was an error that was not foreseen."""
    with (
        pytest.raises(BadInputError, match="cannot be drawn: MuJoCo refuses its model"),
        reading_run(tmp_path, False, {}),
    ):
        raise mujoco.FatalError("mass and inertia of moving bodies must be larger than mjMINVAL")
