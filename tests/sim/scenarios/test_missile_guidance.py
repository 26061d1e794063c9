"""The scenario of the missile: it hits its announced target under model errors, and reports when it does not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.missile.plugin import MissileController
from mathnavi.estimators.missile_kalman import MissileKalman
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.missile_fields import (
    MissileFaults,
    MissileGuidanceConfig,
    MissileGust,
    MissileMismatch,
    MissileNoise,
    Thrusters,
)
from mathnavi.sim.scenarios.missile_guidance import MissileGuidance
from tests import missile
from tests.missile import glide

NEAR, FAR = (240.0, 0.0, 0.0), (700.0, 0.0, 0.0)
ACROSS: dict[str, Any] = {"start": (0.0, 40.0, 10.0), "start_heading": -10.0, "target_velocity": (10.0, -15.0, 0.0)}
WIND = MissileGust(force=(400.0, 0.0, 0.0), torque=(0.0, -20.0, 0.0))


def fly(seed: int = 0, **fields: Any) -> RunData:
    """A flight to a target that is near enough to be short."""
    return missile.fly(seed, **{"target": (450.0, 0.0, 0.0), **fields})


@pytest.fixture(scope="module")
def calm() -> RunData:
    """In the pitch plane, nothing in the way."""
    return fly()


def kinds(outcome: RunData) -> list[str]:
    return [event.kind for event in outcome.recording.events]


def test_undisturbed_it_hits_as_planned(calm: RunData) -> None:
    assert calm.success
    summary = calm.summary
    assert summary["hit"] is True
    assert summary["miss_m"] < 0.01
    assert summary["aspect_error_deg"] < 0.01
    assert summary["impact_time_s"] == pytest.approx(summary["planned_time_s"], abs=0.01)
    assert summary["impact_speed_m_s"] == pytest.approx(120.0, abs=0.1)
    assert summary["saturated_s"] == summary["inputs_clipped"] == summary["late_plans"] == 0


def test_the_flight_ends_with_the_sample_that_finds_the_target_passed(calm: RunData) -> None:
    heights = calm.recording.truths["missile"][:, 1]
    assert heights[-1] <= 0.0 < heights[-2]


@pytest.mark.parametrize(
    "fields",
    [
        {"mismatch": MissileMismatch(1.1, 1.1, 0.95), "gust": WIND},
        {"dimension": "spatial", **ACROSS},
        {"actuator": Thrusters(delay=0.008)},
        {"gust": MissileGust(force_rms=300.0, torque_rms=15.0)},
        {"faults": MissileFaults(solver_failure_rate=0.5, late_plan_rate=0.5)},
        {"target": (450.0, 0.0, 60.0), "aspect_angle": -45.0},
    ],
    ids=["mismatch and gust", "space", "delay", "random gusts", "planner faults", "raised target"],
)
def test_feedback_brings_it_home(fields: dict[str, Any]) -> None:
    outcome = fly(**fields)
    assert outcome.success, outcome.summary
    assert outcome.summary["miss_m"] < 0.5


def test_what_is_not_as_declared_matters(calm: RunData) -> None:
    other = fly(controller=glide(omega=2.0), mismatch=MissileMismatch(mass=1.1), gust=WIND)
    assert other.summary["miss_m"] > 20.0 * calm.summary["miss_m"]
    assert other.config["mission"] == calm.config["mission"]  # not announced


def test_a_moving_target_is_hit_if_it_is_announced_and_missed_if_not() -> None:
    known, expected, blind = (
        fly(target=FAR, target_velocity=(20.0, 0.0, 0.0), target_announcement_delay=when) for when in (0.0, 2.0, 1e3)
    )
    assert known.success
    assert expected.success
    assert "message" in kinds(expected)
    assert "message" not in kinds(known)
    assert not blind.success
    assert blind.summary["miss_m"] > 100.0


def test_a_target_that_rises_past_the_missile_while_far_away_is_not_passed() -> None:
    outcome = fly(target_velocity=(0.0, 0.0, 50.0))
    assert outcome.recording.t[-1] > 0.8 * outcome.summary["planned_time_s"]


def test_a_target_that_turns_is_announced_and_hit() -> None:
    changes = ((2.0, -20.0, 0.0, 0.0), (4.0, 0.0, 0.0, 0.0))
    outcome = fly(target=FAR, target_velocity=(20.0, 0.0, 0.0), target_change=changes)
    assert kinds(outcome).count("message") == 2
    assert outcome.success
    assert outcome.recording.truths["missile"][-1, 0] == pytest.approx(700.0 + 40.0 - 40.0, abs=0.5)


def test_thrusters_at_their_limit_are_reported_and_counted() -> None:
    outcome = fly(actuator=Thrusters(normal=4000.0))
    assert not outcome.success
    assert kinds(outcome).count("input-clipped") == outcome.summary["inputs_clipped"] >= 1
    assert outcome.summary["saturated_s"] > 1.0


def test_a_filter_makes_noisy_readings_usable() -> None:
    noise = MissileNoise(position=1.0, velocity=0.5, angle=0.5, rate=0.5, dropout_rate=0.2)
    raw, filtered = fly(noise=noise), fly(noise=noise, estimator=PluginSpec.with_fields(MissileKalman))
    assert filtered.success
    assert filtered.summary["inputs_clipped"] == 0 < raw.summary["inputs_clipped"]
    assert filtered.summary["cost"] < 0.5 * raw.summary["cost"]
    assert outcome_lost(filtered) == pytest.approx(0.2, abs=0.05)


def outcome_lost(outcome: RunData) -> float:
    """Share of the readings that were lost."""
    return float(np.isnan(outcome.arrays["measurement.full_state"][:, 0]).mean())


def test_the_same_seed_gives_the_same_log_and_another_one_another() -> None:
    fields: dict[str, Any] = {
        "target": NEAR,
        "noise": MissileNoise(0.5, 0.2, 0.2, 0.2, 0.1),
        "gust": MissileGust(force_rms=200.0, torque_rms=10.0),
        "faults": MissileFaults(solver_failure_rate=0.3, late_plan_rate=0.3),
    }
    one, again, other = (fly(seed, estimator=PluginSpec.with_fields(MissileKalman), **fields) for seed in (3, 3, 4))
    for name, values in one.arrays.items():
        np.testing.assert_array_equal(values, again.arrays[name])
    assert not np.array_equal(one.arrays["truth.x"][:500], other.arrays["truth.x"][:500])


def test_a_flight_takes_at_most_twice_the_planned_time(calm: RunData) -> None:
    closed_loop = MissileGuidance.build(MissileGuidanceConfig(target=(450.0, 0.0, 0.0)), 0, glide())
    assert closed_loop.duration == pytest.approx(2.0 * calm.summary["planned_time_s"], abs=0.002)


def test_a_mission_without_a_first_plan_is_refused() -> None:
    with pytest.raises(
        ValueError,
        match=r"target = .*out of reach: .*700 m is too far.*at most 4\d\d(\.\d)? m away",
    ):
        fly(controller=glide(reach=500.0), target=(700.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"target = .*allowed: 300 s"):
        fly(target=(40_000.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("expected", "fields"),
    [
        ("start: its y", {"start": (0.0, 5.0, 10.0)}),
        ("start_heading", {"start_heading": 5.0}),
        ("target_change: its y", {"target_change": ((1.0, 0.0, 5.0, 0.0),)}),
        ("gust.force: its y", {"gust": MissileGust(force=(0.0, 5.0, 0.0))}),
        ("gust.torque: its x or z", {"gust": MissileGust(torque=(5.0, 0.0, 0.0))}),
    ],
)
def test_what_leads_out_of_the_plane_is_refused_there_and_not_in_space(expected: str, fields: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=rf"{expected} = 5.0 .*allowed: 0, or dimension = spatial"):
        MissileGuidanceConfig(**fields)
    MissileGuidanceConfig(dimension="spatial", **fields)


@pytest.mark.parametrize(
    ("expected", "make"),
    [
        ("start: its height z", lambda: MissileGuidanceConfig(start=(0.0, 0.0, -1.0))),
        ("target", lambda: MissileGuidanceConfig(target=(0.0, 0.0, 10.0))),
        ("aspect_angle", lambda: MissileGuidanceConfig(aspect_angle=-100.0)),
        ("start_heading", lambda: MissileGuidanceConfig(dimension="spatial", start_heading=190.0)),
        ("target_change", lambda: MissileGuidanceConfig(target_change=((-1.0, 0.0, 0.0, 0.0),))),
        ("control_rate", lambda: MissileGuidanceConfig(control_rate=300.0)),
        ("mismatch.mass", lambda: MissileMismatch(mass=0.0)),
        ("gust.torque_rms", lambda: MissileGust(torque_rms=-1.0)),
        ("actuator.delay", lambda: Thrusters(delay=0.0015)),
        ("actuator.declared_delay", lambda: Thrusters(declared_delay=0.0015)),
        ("noise.angle", lambda: MissileNoise(angle=-1.0)),
        ("faults.late_plan_rate", lambda: MissileFaults(late_plan_rate=-0.1)),
    ],
)
def test_fields_out_of_range_are_refused_by_their_names(expected: str, make: Any) -> None:
    with pytest.raises(ValueError, match=rf"{expected}.*= .*allowed"):
        make()


def test_a_missile_that_hits_the_ground_short_says_so() -> None:
    outcome = fly(controller=glide(omega=0.0), gust=MissileGust(force=(0.0, 0.0, -4000.0)))
    assert not outcome.success
    assert outcome.summary["hit_ground"] is True
    assert "hit ground" in outcome.summary["shortfall"]
    (event,) = [event for event in outcome.recording.events if event.kind == "ground-impact"]
    assert event.t == outcome.recording.t[-1]
    assert f"{outcome.summary['miss_m']:.4g} m" in event.message


def test_a_heading_across_the_singular_axis_is_flown() -> None:
    controller = PluginSpec.with_fields(MissileController, backend="fatrop", replan_period=1.0)
    outcome = fly(controller=controller, dimension="spatial", case="FAST", start_heading=-135.0)
    assert outcome.success, outcome.summary
    assert outcome.summary["miss_m"] < 0.05
    assert abs(outcome.config["mission"]["start"][6]) < math.radians(81.0)


def test_wind_is_that_of_the_world_whatever_the_frame() -> None:
    east, west = (
        fly(
            gust=MissileGust(force=(force, 0.0, 0.0)),
            dimension="spatial",
            start_heading=heading,
            target=target,
        )
        for force, heading, target in ((300.0, 0.0, (450.0, 0.0, 0.0)), (-300.0, 180.0, (-450.0, 0.0, 0.0)))
    )
    np.testing.assert_allclose(east.recording.truths["missile"], west.recording.truths["missile"], atol=1e-9)
