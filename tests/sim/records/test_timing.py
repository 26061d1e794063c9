"""Figures of the times of answers, by vehicle; the words where a component is slower than real time; their files."""

from __future__ import annotations

import json
from array import array
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.sim.engine.answer_times import COMPONENTS, AnswerTimes
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.records.files import write_json
from mathnavi.sim.records.timing import (
    DELAYS,
    TIMING,
    AnswerFigures,
    PlansTake,
    Timing,
    duration_text,
    read_delays,
    read_timing,
    slow_components,
    timing_table,
)


def timing(vehicles: dict[str, dict[str, tuple[float, Sequence[float]]]], plans_take: PlansTake = "no time") -> Timing:
    """Timing of vehicles whose components have (period [s], times of the answers [s])."""
    agents = {
        vehicle: AgentRecorder(
            vehicle, [], np.zeros((0, 3)), {},
            answer_times={name: AnswerTimes(period, array("d", seconds)) for name, (period, seconds) in parts.items()},
        )
        for vehicle, parts in vehicles.items()
    }  # fmt: skip
    return Timing.of(Recording(np.zeros(0), {}, agents, [], {}), COMPONENTS, plans_take)


@given(period=st.floats(1e-3, 10.0), seconds=st.lists(st.floats(0.0, 20.0), min_size=1, max_size=50))
def test_figures_are_those_of_the_answers(period: float, seconds: list[float]) -> None:
    found = AnswerFigures.of(AnswerTimes(period, array("d", seconds)))
    assert 0.0 <= found.median_s <= found.p99_s <= found.worst_s == max(seconds)
    assert found.answers == len(seconds)
    assert found.first_s == seconds[0]
    assert found.longer == sum(each > period for each in seconds)
    assert found.period_share == pytest.approx(sum(seconds) / (period * len(seconds)))


def test_a_planner_that_is_late_once_is_told_and_what_follows_from_it() -> None:
    seconds = [0.2] * 38 + [1.62, 1.1]
    told = (
        "2 of 40 answers took longer than the period of 1 s, worst 1.62 s; "
        "with --latency measured they are flown as late"
    )
    assert slow_components(timing({"vehicle": {"planner": (1.0, seconds)}})) == {"planner": told}
    assert slow_components(timing({"vehicle": {"planner": (1.0, seconds)}}), on_the_whole=True) == {}
    assert slow_components(timing({"vehicle": {"planner": (1.0, [1.0] * 40)}})) == {}
    first = slow_components(timing({"vehicle": {"planner": (1.0, [1.3, 0.2])}}, "measured"))
    assert "worst 1.3 s (its first)" in first["planner"]
    assert "--latency" not in first["planner"]


@pytest.mark.parametrize(("interrupted", "told"), [(50, False), (51, True)])
def test_other_components_are_told_of_where_interruptions_do_not_explain_it(interrupted: int, told: bool) -> None:
    seconds = [0.011] * interrupted + [0.001] * (100 - interrupted)
    assert ("estimator" in slow_components(timing({"vehicle": {"estimator": (0.01, seconds)}}))) == told
    once = {"tracker": (0.01, [2.0] + [0.0] * 99)}
    assert "tracker" in slow_components(timing({"vehicle": once})), "it cannot keep pace on the whole"


def test_vehicles_of_a_fleet_are_computers_of_their_own() -> None:
    fleet = timing(
        {
            "red": {"planner": (1.0, [0.5, 0.5]), "estimator": (0.1, [0.02])},
            "blue": {"planner": (1.0, [0.25, 1.5]), "estimator": (0.1, [0.01]), "coordinator": (0.1, [])},
        }
    )
    assert fleet.vehicles["red"]["planner"].period_share == pytest.approx(0.5)
    assert "coordinator" not in fleet.vehicles["blue"], "it gave no answer"
    headings, rows = timing_table(fleet)
    assert headings[1] == "vehicle"
    assert [row[:2] for row in rows] == [("planner", "blue"), ("estimator", "red")], "the busiest of each"
    assert slow_components(fleet)["planner"].startswith(
        "1 of 4 answers took longer than the period of 1 s, worst 1.5 s of blue"
    )
    assert all(len(row) == len(headings) for row in rows)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 µs"),
        (2.34e-6, "2.34 µs"),
        (9.9996e-4, "1 ms"),
        (0.0123, "12.3 ms"),
        (0.99999, "1 s"),
        (36e3, "36,000 s"),
    ],
)
def test_a_time_is_short(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    assert read_timing(tmp_path) is None
    made = timing({"vehicle": {"planner": (1.0, [0.2, 1.7])}})
    write_json(tmp_path / TIMING, asdict(made))
    assert read_timing(tmp_path) == made
    write_json(tmp_path / DELAYS, {"delays_s": {"vehicle": [0.1 + 0.2, 1 / 3]}})
    assert read_delays(tmp_path) == {"vehicle": (0.1 + 0.2, 1 / 3)}, "to the last bit"


@pytest.mark.parametrize(
    "text", ["", "[]", '{"delays_s": [1]}', '{"delays_s": {"v": [-0.1]}}', '{"delays_s": {"v": [NaN]}}', "{}"]
)
def test_broken_delays_are_refused_with_their_file(tmp_path: Path, text: str) -> None:
    (tmp_path / DELAYS).write_text(text)
    with pytest.raises(RunFolderError, match=DELAYS):
        read_delays(tmp_path)


numbers = st.integers(-3, 3) | st.floats() | st.text(max_size=3) | st.none()
components = st.dictionaries(st.sampled_from(["answers", "period_s", "median_s", "longer"]), numbers)


@settings(max_examples=40)
@given(vehicles=st.dictionaries(st.text(max_size=3), st.dictionaries(st.text(max_size=3), components) | numbers))
def test_any_other_timing_is_refused_with_its_file(tmp_path_factory: pytest.TempPathFactory, vehicles: object) -> None:
    folder = tmp_path_factory.getbasetemp()
    (folder / TIMING).write_text(json.dumps({"plans_take": "no time", "vehicles": vehicles}))
    if vehicles == {} or (isinstance(vehicles, dict) and all(each == {} for each in vehicles.values())):
        assert read_timing(folder) is not None
    else:
        with pytest.raises(RunFolderError, match=TIMING):
            read_timing(folder)
