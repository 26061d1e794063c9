"""Planner and autopilots in MuJoCo: with a body that is not as modelled, and a target that moves."""

from __future__ import annotations

from typing import Any

import pytest

from mathnavi.sim.sweep.trial import trial

ROUGH = {
    **{"mismatch.mass": 1.1, "mismatch.inertia": 1.1, "mismatch.force": 0.95},
    **{"gust.force": (400.0, 0.0, 0.0), "gust.torque": (0.0, 20.0, 0.0)},
}


def summary(**fields: Any) -> dict[str, Any]:
    """Summary of a flight of five seconds in CasADi's virtual machine, named with two underscores for a dot."""
    named = {name.replace("__", "."): value for name, value in fields.items()}
    known = {"case": "SM2", "target": (300.0, 0.0, 0.0), "planner.backend": "fatrop"}
    return dict(trial("missile-guidance", 0, fields={**known, **named}).build().run().summary)


@pytest.mark.parametrize(("autopilot", "miss", "aspect"), [("feedback-linearisation", 0.05, 0.1), ("tvlqr", 0.15, 0.2)])
def test_an_autopilot_makes_up_for_mass_thrust_and_wind(autopilot: str, miss: float, aspect: float) -> None:
    found = summary(planner__autopilot=autopilot, planner__replan_period=1e3, **ROUGH)
    assert found["miss_m"] <= miss
    assert found["aspect_error_deg"] <= aspect


def test_without_an_autopilot_the_same_flight_misses_by_far() -> None:
    assert summary(planner__autopilot="open-loop", planner__replan_period=1e3, **ROUGH)["miss_m"] > 10.0


def test_the_plans_inputs_alone_hit_where_everything_is_as_modelled() -> None:
    found = summary(planner__autopilot="open-loop", planner__replan_period=1e3, control_rate=1000.0)
    assert found["miss_m"] <= 0.02


def test_a_replanned_open_loop_is_a_closed_one() -> None:
    assert summary(planner__autopilot="open-loop", **{"mismatch.mass": 1.1})["miss_m"] < 5.0


@pytest.mark.parametrize("speed", [30.0, -30.0])
def test_a_moving_target_is_met_where_it_will_be(speed: float) -> None:
    assert summary(target_velocity=(speed, 0.0, 0.0))["miss_m"] <= 0.1


def test_when_plans_fail_the_last_one_is_flown_on() -> None:
    found = summary(faults__solver_failure_rate=0.8, **ROUGH)
    assert found["solver_failures"] > 20
    assert found["hit"]
    assert found["miss_m"] < 0.1


def test_in_space_pitch_and_yaw_planners_meet_a_target_that_moves_across() -> None:
    found = summary(dimension="spatial", start_heading=20.0, target_velocity=(0.0, 30.0, 0.0))
    assert found["miss_m"] < 0.01
    assert found["aspect_error_deg"] < 0.1
