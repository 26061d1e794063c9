"""A sweep's page shows every rate with its limits, every median with its band and every failure, for any scenario."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.commands.evidence import verdict
from mathnavi.renders.sweep_report import MOST_PANELS, report, write_sweep_report
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.metrics.planning import NEVER_ANSWERED
from mathnavi.sim.records.figure_names import PLANNER_STATUS
from mathnavi.sim.records.statistics import median_band, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import Sweep, TrialGroup, format_numbers
from tests.renders.reading import Page, check_identifiers, check_stands_alone, lines_named
from tests.renders.synthetic import ridges

COMMAND = "mathnavi sweep safe-flight --trials 20 --store <a.db>"
TRACEBACK = "Traceback (most recent call last):\n  File <x>\nValueError: a < b"


def flight(seed: int, nodes: int, gust: float, **other: Any) -> Record:
    """A made-up mission; it came the nearer to the ground, the harder the wind."""
    rng = np.random.default_rng([seed, nodes])
    config = {"terrain": "ridges", "clearance_min": 50.0, "faults": {"gust_rms": gust}}
    parameters = {
        "config": config,
        "controller": {"name": "flight", "fields": {"nodes": nodes}},
        "estimator": {"name": "kalman", "fields": {}},
    }
    summary = {
        "arrived": True, "arrival_time_s": 100.0 + rng.uniform(0.0, 9.0), "deadline_s": 200.0,
        "min_clearance_m": 120.0 - 20.0 * gust + rng.uniform(0.0, 5.0), "ground_contacts": 0, "replans": 40 + seed,
    }  # fmt: skip
    successful = {"status": "ok", "success": True, "summary": summary, "timings": {"trial_wall_s": 1.0 + 0.1 * seed}}
    return Record(f"{seed}-{nodes}-{gust}", "safe-flight", parameters, seed, "0.1.0+abc", **{**successful, **other})


def broken(seed: int, nodes: int, gust: float = 0.0) -> Record:
    return flight(seed, nodes, gust, status="raised", success=None, summary={}, error=TRACEBACK)


LISTED = [flight(seed, nodes, gust) for seed in range(8) for nodes in (4, 13) for gust in (0.0, 2.0)]
DRAWN = [flight(seed, 13, float(np.random.default_rng(seed).uniform(0.0, 4.0))) for seed in range(40)]


def test_groups_are_the_combinations_of_the_listed_values_in_order() -> None:
    sweep = Sweep(LISTED, ["planner.nodes", "faults.gust_rms"])
    assert [group.values for group in sweep.groups] == [(4, 0.0), (4, 2.0), (13, 0.0), (13, 2.0)]
    assert [group.name for group in sweep.groups] == [f"nodes {n}, gust rms {g}" for n in (4, 13) for g in (0, 2)]
    assert {len(group.records) for group in sweep.groups} == {8}
    assert sweep.continuous == []


def test_without_a_listed_field_all_trials_are_one_group() -> None:
    assert [len(group.records) for group in Sweep(LISTED, []).groups] == [len(LISTED)]


def test_a_field_of_many_values_or_drawn_afresh_for_every_seed_is_continuous() -> None:
    assert Sweep(DRAWN, ["faults.gust_rms"]).continuous == ["faults.gust_rms"]
    assert Sweep(DRAWN[:3], ["faults.gust_rms"]).continuous == ["faults.gust_rms"]
    one_seed = [flight(0, nodes, 0.0) for nodes in range(2, 6)]
    assert Sweep(one_seed, ["planner.nodes"]).continuous == []
    assert Sweep([flight(0, nodes, 0.0) for nodes in range(2, 16)], ["planner.nodes"]).continuous == ["planner.nodes"]


def test_a_field_that_one_sweep_drew_and_another_left_alone_is_continuous_too() -> None:
    alone = [flight(seed, 13, 0.0) for seed in range(6)]
    assert Sweep([*DRAWN[:10], *alone], ["faults.gust_rms"]).continuous == ["faults.gust_rms"]


@pytest.mark.parametrize(("count", "sizes"), [(40, [10] * 4), (20, [10] * 2), (29, [10, 19]), (7, [7])])
def test_bins_share_the_trials_evenly_in_the_order_of_the_field(count: int, sizes: list[int]) -> None:
    bins = Sweep(DRAWN[:count], ["faults.gust_rms"]).bins("faults.gust_rms")
    assert [len(part.records) for part in bins] == sizes
    assert [part.name.rpartition(" (")[2] for part in bins] == [f"n = {size})" for size in sizes]
    values = [record.fields["faults.gust_rms"] for part in bins for record in part.records]
    assert values == sorted(values)


def test_trials_of_one_value_are_in_one_bin() -> None:
    records = [flight(seed, nodes, 0.5 * (seed // 6)) for seed in range(18) for nodes in (4, 13)]
    bins = Sweep(records, ["planner.nodes", "faults.gust_rms"]).bins("faults.gust_rms")
    assert [part.name for part in bins] == ["0 (n = 12)", "0.5 (n = 12)", "1 (n = 12)"]


def test_too_few_trials_have_a_median_without_a_band() -> None:
    for count, known in ((5, False), (6, True)):
        band = TrialGroup("some", (), DRAWN[:count]).band("arrival_time_s")
        assert band is not None
        assert math.isnan(band.low) is not known


def test_numbers_that_are_computed_to_be_the_same_are_shown_the_same() -> None:
    assert format_numbers(0.9999999999999978, 0.9999999999999978, 1.0) == ["1", "1", "1"]
    assert format_numbers(0.1 + 0.2, 0.3) == ["0.3000", "0.3000"]
    assert format_numbers(0.999999, 1.0) == ["0.9999990", "1"]


@given(st.lists(st.floats(-1e7, 1e7).map(lambda value: round(value, 2)), min_size=2, max_size=3))
def test_numbers_have_digits_enough_to_tell_them_apart(values: list[float]) -> None:
    shown = format_numbers(*values)
    assert (shown[values.index(max(values))] != shown[values.index(min(values))]) == (max(values) > min(values))
    for value, words in zip(values, shown, strict=True):
        assert float(words.replace(",", "")) == pytest.approx(value, rel=1e-2, abs=1e-2 * max(map(abs, values)))


def test_a_ratio_near_one_is_not_rounded_to_nothing() -> None:
    ratios = (0.9993, 1.0001, 1.0009, 1.0012, 1.0031, 1.0049)
    records = [
        flight(k, 13, 0.0, summary={**LISTED[0].summary, "path_length_m": 1e4 * ratio, "straight_line_m": 1e4})
        for k, ratio in enumerate(ratios)
    ]
    page = Page(report(Sweep(records, []), None, [], COMMAND))
    band = median_band(ratios, np.random.default_rng(0))
    assert f"{band.median:.4f} [{band.low:.4f}, {band.high:.4f}]" in page.words


def test_only_rates_that_are_neither_none_nor_all_are_drawn() -> None:
    def drawings(records: list[Record]) -> int:
        page = Page(report(Sweep(records, ["planner.nodes"]), None, [], COMMAND))
        return sum(tag == "svg" and "Rates" in (a["aria-label"] or "") for tag, a in page.attributes)

    assert drawings(LISTED) == 0
    assert drawings([*LISTED, broken(90, 4)]) == 1


def test_a_mission_without_success_says_what_it_did_not_do() -> None:
    missed = flight(77, 4, 0.0, success=False, summary={**LISTED[0].summary, "shortfall": "not arrived"})
    assert "not arrived" in Page(report(Sweep([*LISTED, missed], []), None, [], COMMAND)).words


def test_a_trial_without_a_result_is_no_success_and_says_nothing_of_clearances() -> None:
    sweep = Sweep([*LISTED, broken(90, 4)], [])
    (group,) = sweep.groups
    assert group.rate(sweep.events["success"]) == rate(32, 33)
    assert group.rate(sweep.events["no result"]) == rate(1, 33)
    assert group.rate(sweep.events["below h_min"]) == rate(0, 32)
    assert group.rate(sweep.events["any ground contacts"]) == rate(0, 32)


def test_too_low_late_and_unknown_clearances_are_violations() -> None:
    base = LISTED[0].summary
    odd = [
        flight(1, 4, 0.0, summary={**base, "min_clearance_m": 49.9}),
        flight(2, 4, 0.0, summary={**base, "min_clearance_m": None}),
        flight(3, 4, 0.0, summary={**base, "arrival_time_s": 201.0}),
        flight(4, 4, 0.0, summary={**base, "arrived": False, "arrival_time_s": None}),
    ]
    sweep = Sweep([LISTED[0], *odd], [])
    (group,) = sweep.groups
    assert group.rate(sweep.events["below h_min"]) == rate(2, 5)
    assert group.rate(sweep.events["late or not arrived"]) == rate(2, 5)
    assert group.rate(sweep.events["arrived"]) == rate(4, 5)


def test_missions_in_which_the_planner_had_no_part_are_counted_and_named(tmp_path: Path) -> None:
    flown = [flight(seed, 13, 0.0) for seed in range(3)]
    alone = replace(flown[0], key="alone", summary={**flown[0].summary, PLANNER_STATUS: NEVER_ANSWERED})
    assert "planner without a part" not in Sweep(flown, []).events
    sweep = Sweep([*flown, alone], [])
    (group,) = sweep.groups
    found = group.rate(sweep.events["planner without a part"])
    assert found is not None
    assert (found.events, found.trials) == (1, 4)
    assert verdict([*flown, alone]) == "4 trials: 4 succeeded, 1 flown without the planner"
    text = write_sweep_report(tmp_path / "sweep.html", [*flown, alone], [], None, [], COMMAND).read_text()
    assert "Every mission succeeded." not in text
    assert "1 of the missions was flown without the planner." in text
    assert re.search(
        r"<h1>safe-flight: [0-9] of 4 trials succeeded; least clearance [0-9.]+ m \(seed [0-9]+\)</h1>", text
    )
    assert NEVER_ANSWERED in text


@pytest.mark.usefixtures("laid_out")
def test_everything_that_was_found_is_shown(tmp_path: Path) -> None:
    missed = flight(91, 13, 2.0, success=False)
    records = [*LISTED, broken(90, 4), missed]
    track = Track("lowest", np.array([[1e3, 1e3, 2500.0], [9e3, 8e3, 2600.0]]), "#c2183b")
    varied = ["planner.nodes", "faults.gust_rms"]
    path = write_sweep_report(tmp_path / "a.html", records, varied, ridges(33), [track], COMMAND)
    assert [file.name for file in tmp_path.iterdir()] == ["a.html"]
    source = path.read_text(encoding="utf-8")
    check_stands_alone(source)
    check_identifiers(source)
    page = Page(source)
    sweep = Sweep(records, varied)
    for group in sweep.groups:
        assert any(group.name in word for word in page.words)
        for happened in sweep.events.values():
            found = group.rate(happened)
            assert found is not None
            assert found.text() in page.words
    assert {COMMAND, "ValueError: a < b", TRACEBACK, "90", "91", "raised"} <= set(page.words)
    assert "0.1.0+abc" in page.text
    assert "trial wall [s]" in page.words
    assert len(lines_named(page.scenes[0], "lowest")) == len(page.scenes[0]["lines"]) == 1
    assert len(source.encode()) < 2e6


def test_medians_have_their_bands_and_count_the_trials_that_have_none() -> None:
    records = [flight(0, 4, 0.0, summary={**LISTED[0].summary, "arrived": False, "arrival_time_s": None}), *LISTED]
    times = [record.summary["arrival_time_s"] for record in LISTED]
    band = median_band(times, np.random.default_rng(0))
    shown = f"{band.median:.1f} [{band.low:.1f}, {band.high:.1f}] (n = 32)"
    assert shown in Page(report(Sweep(records, []), None, [], COMMAND)).words


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("records", "varied"), [(LISTED, "planner.nodes"), (DRAWN, "faults.gust_rms")])
def test_a_vehicle_that_left_the_map_counts_among_the_clearances(records: list[Record], varied: str) -> None:
    lost = [flight(k, 13, 1.0, summary={**LISTED[0].summary, "min_clearance_m": -math.inf}) for k in range(50, 95)]
    sweep = Sweep([*records, *lost], [varied])
    band = TrialGroup("all", (), sweep.records).band("min_clearance_m")
    assert band is not None
    assert (band.n, band.median) == (len(sweep.records), -math.inf)
    page = Page(report(sweep, None, [], COMMAND))
    assert "; a vehicle left the map in 45 (as with seed 50, " in page.text  # the title, not the least of the others
    assert "the smallest of all is -inf m" in page.text
    assert f"left the map, as in 45 of {len(sweep.records)} trials" in page.text
    assert "What is infinite stands at the edge." in page.text
    assert any("-inf" in word and "[" in word for word in page.words)


def test_a_mission_without_success_has_its_ratio_of_lengths() -> None:
    summary = {**LISTED[0].summary, "path_length_m": 1300.0, "straight_line_m": 1000.0}
    missed = flight(77, 4, 0.0, success=False, summary=summary)
    page = Page(report(Sweep([LISTED[0], missed], []), None, [], COMMAND))
    row = page.words[page.words.index("77") :]
    assert "1.30" in row[:MOST_PANELS]


def test_figures_are_drawn_over_a_continuous_field() -> None:
    page = Page(report(Sweep(DRAWN, ["faults.gust_rms"]), None, [], COMMAND))
    assert "Over faults.gust_rms" in page.words
    labels = [attributes["aria-label"] or "" for tag, attributes in page.attributes if tag == "svg"]
    assert sum("faults.gust_rms" in label for label in labels) == 2


def test_another_scenario_with_other_words_is_reported_too() -> None:
    records = [
        Record(
            str(seed), "my.module:Chase", {"config": {"gain": gain}}, seed, "0.1.0", "ok", True,
            {"caught": seed % 2 == 0, "miss_m": 0.5 * seed, "note": "fine", "lost": None}, {},
        )
        for seed in range(6) for gain in ("high", "low")
    ]  # fmt: skip
    page = Page(report(Sweep(records, ["gain"]), None, [], COMMAND))
    assert {"caught", "miss [m]", rate(3, 6).text()} <= set(page.words)
    assert "lost" not in page.words
    assert page.scenes == []
    assert page.scripts == []


def test_a_sweep_in_which_nothing_ran_is_a_report_too() -> None:
    page = Page(report(Sweep([broken(k, 4, 0.5 * k) for k in range(20)], ["faults.gust_rms"]), None, [], COMMAND))
    assert rate(20, 20).text() in page.words
    assert "Recorded failures (20)" in page.words


def test_a_single_trial_has_medians_without_a_band() -> None:
    assert not math.isnan(LISTED[0].summary["arrival_time_s"])
    page = Page(report(Sweep(LISTED[:1], ["planner.nodes"]), None, [], COMMAND))
    assert rate(1, 1).text() in page.words


def test_no_records_and_fields_that_no_trial_has_are_refused() -> None:
    with pytest.raises(ValueError, match="records"):
        Sweep([], [])
    with pytest.raises(ValueError, match=r"planner\.knots.*planner\.nodes"):
        Sweep(LISTED, ["planner.knots"])
