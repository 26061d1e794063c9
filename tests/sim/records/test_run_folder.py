"""A run's folder is read as it was written, and one that is broken or lacks a file is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array, Event
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.records.run_folder import ARRAYS, CONFIG, EVENTS, SUMMARY, read_log, read_state_names, write_run

T = np.array([0.0, 0.1, 0.2])
STATES = ("x [m]", "v [m/s]")


def written(folder: Path, x: Array) -> Path:
    """The folder of a run of three samples with the true states x (3, 2)."""
    events = [Event(0.1, "cart", "late", "a plan")]
    agent = AgentRecorder("cart", events, np.ones((3, 1)), {"ruler": x[:, :1] + 0.5})
    recording = Recording(T, {"cart": x}, {"cart": agent}, events, {"cart": STATES}, 3)
    write_run(folder, {"scenario": "rail", "seed": 4}, {"arrived": True}, recording)
    return folder


def test_what_was_written_is_read(tmp_path: Path) -> None:
    x = np.arange(6.0).reshape(3, 2)
    log = read_log(written(tmp_path, x))
    assert (log.title, log.summary["arrived"], log.events) == (
        "rail, seed 4",
        True,
        (Event(0.1, "cart", "late", "a plan"),),
    )
    np.testing.assert_array_equal(log.x, x)
    np.testing.assert_array_equal(log.arrays["measurement.ruler"], x[:, :1] + 0.5)
    assert read_state_names(tmp_path) == {"cart": STATES}


@pytest.mark.parametrize("name", [CONFIG, SUMMARY, EVENTS, ARRAYS])
def test_a_broken_file_is_named_and_a_missing_one_too(name: str, tmp_path: Path) -> None:
    written(tmp_path, np.zeros((3, 2)))
    (tmp_path / name).write_text("nothing", encoding="utf-8")
    with pytest.raises(RunFolderError, match=name):
        read_log(tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(FileNotFoundError, match=name):
        read_log(tmp_path)


def test_a_run_that_diverged_ends_with_its_last_finite_state_where_that_is_allowed(tmp_path: Path) -> None:
    x = np.array([[0.0, 1.0], [2.0, 3.0], [np.inf, 0.0]])
    written(tmp_path, x)
    with pytest.raises(RunFolderError, match=r"truth\.x is not finite"):
        read_log(tmp_path)
    log = read_log(tmp_path, may_diverge=True)
    np.testing.assert_array_equal(log.x, x[:2])
    assert len(log.arrays["truth.x"]) == 3
