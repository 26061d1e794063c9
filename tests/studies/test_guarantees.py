"""Tuning of the planners that study ``guarantees`` compares."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from mathnavi.sim.records.store import Record
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.flight import guarantees
from mathnavi.studies.flight.guarantees import PLANNERS, SETTINGS, TUNING_SEED, GuaranteesConfig


def flight(time: float, *, arrived: bool = True, violated: bool = False) -> Record:
    summary = {"flight_time_s": time, "arrived": arrived, "violated": violated}
    return Record("", "safe-flight", {}, 0, "", "ok", arrived, summary)


def test_the_fastest_of_the_settings_that_spoil_the_fewest_missions_is_flown() -> None:
    slow = [flight(20.0), flight(22.0)]
    fast = [flight(12.0), flight(10.0)]
    low = [flight(5.0), flight(5.0, violated=True)]
    lost = [flight(5.0), flight(5.0, arrived=False)]
    assert guarantees.best_setting([slow, low, fast, lost]) == 2
    assert guarantees.best_setting([low, slow]) == 1
    assert guarantees.best_setting([()]) == 0


def test_every_planner_is_tuned_under_every_condition_on_missions_that_are_not_judged() -> None:
    flown: dict[Any, Any] = {}
    setup: Any = SimpleNamespace(
        place=SimpleNamespace(terrain="here"),
        compute=lambda function, wanted: [{"start": (each.seed, 0.0, 0.0)} for each in wanted],
        trial=lambda seed, **named: SimpleNamespace(seed=seed, **named),
        fly_groups=lambda groups: flown.update(groups) or groups,
    )
    guarantees.fly_settings(GuaranteesConfig(tuning=2, settings=2), setup)
    assert set(flown) == {(planner, k) for planner in PLANNERS for k in range(2)}
    for (planner, k), missions in flown.items():
        assert {mission.controller for mission in missions} == {planner}
        assert {mission.seed for mission in missions} == {TUNING_SEED, TUNING_SEED + 1}
        assert len(missions) == 2 * len(guarantees.CONDITIONS)
        setting = SETTINGS[planner][k]
        assert all(mission.fields.items() >= setting.items() for mission in missions)
        assert all(mission.fields["start"][0] == mission.seed for mission in missions)


def test_every_setting_is_one_that_its_planner_has_and_as_many_are_tried_of_each() -> None:
    for planner in PLANNERS:
        assert len(SETTINGS[planner]) == GuaranteesConfig().settings
        for setting in SETTINGS[planner]:
            trial("safe-flight", controller=planner, fields=setting)
