"""A quadrotor flies through a canyon: safe, in time, within its bound, the same every time; and what is refused."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from mathnavi.models.quadrotor.entity import REACH
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.metrics.quadrotor import point, tilts
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.fault_fields import AerialFaults
from mathnavi.sim.scenarios.quadrotor_canyon import QuadrotorCanyon
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorCanyonConfig, QuadrotorMismatch
from mathnavi.studies.flight import hostile_parts

GUSTS = AerialFaults(gust_rms=0.6, gust_limit=1.5, solver_failure_rate=0.2)
HEAVY = QuadrotorMismatch(mass=1.1, motor_lag=1.15)
SHORT = {"start": (300.0, 275.0, 1232.0), "target": (204.0, 303.0, 1232.0)}  # in canyon 0, a spur between them


def flown(seed: int = 0, **fields: Any) -> RunData:
    return QuadrotorCanyon.build(QuadrotorCanyonConfig(**{**SHORT, **fields}), seed).run()


@pytest.fixture(scope="module")
def outcome() -> RunData:
    return flown(faults=GUSTS, mismatch=HEAVY)


def test_in_gusts_heavier_than_modelled_with_failing_solvers_it_arrives_safely_and_in_time(outcome: RunData) -> None:
    summary = outcome.summary
    assert outcome.success, summary
    assert summary["arrival_time_s"] <= summary["deadline_s"]
    assert summary["min_clearance_m"] >= 4.0
    assert summary["ground_contacts"] == summary["tracking_breaches"] == summary["guarantee_lost"] == 0
    assert summary["solver_failures"] > 0
    assert summary["speed_max_m_s"] <= 14.0


def test_its_figures_are_those_of_the_log(outcome: RunData) -> None:
    summary, x = outcome.summary, outcome.arrays["truth.x"]
    assert x.shape[1] == 13
    assert outcome.arrays["command.u"].shape == (len(x), 4)
    assert summary["tilt_max_deg"] == pytest.approx(np.degrees(tilts(x).max()))
    assert summary["speed_max_m_s"] == pytest.approx(np.linalg.norm(x[:, 7:10], axis=1).max())
    np.testing.assert_array_equal(point(x)[:, 3:], x[:, 7:10])
    bound = outcome.config["mission"]["tracking_bound"]
    assert summary["tracking_bound_m"] == pytest.approx(math.hypot(bound["horizontal"], bound["vertical"]))
    assert 0.0 < summary["tracking_error_rms_m"] < summary["tracking_error_max_m"] < summary["tracking_bound_m"]
    assert 0.3 < summary["thrust_mean_share"] < summary["thrust_max_share"] <= 1.0
    assert all(label(key)[0] for key in summary)


def test_estimates_are_compared_with_the_centre(outcome: RunData) -> None:
    x, truth = outcome.arrays["estimate.x"], outcome.arrays["truth.x"]
    errors = QuadrotorCanyon.errors(QuadrotorCanyonConfig(), x, truth)
    assert list(errors) == ["x [m]", "y [m]", "z [m]", "v_x [m/s]", "v_y [m/s]", "v_z [m/s]"]
    assert all(np.abs(error).max() < 1e-9 for error in errors.values())  # its sensor has no noise


def test_the_clearance_is_that_of_the_whole_vehicle(outcome: RunData) -> None:
    """No point of a ball of its reach is ever lower over the ground around it."""
    x, ground = outcome.arrays["truth.x"][::15], load_terrain("canyon")
    rng = np.random.default_rng(0)
    ball = rng.standard_normal((200, 3))
    ball *= REACH / np.linalg.norm(ball, axis=1, keepdims=True)
    points = (x[:, None, :3] + ball).reshape(-1, 3)
    nearest = (points[:, 2] - ground.height(points[:, 0], points[:, 1])).min()
    centre = (x[:, 2] - ground.height(x[:, 0], x[:, 1])).min()
    assert outcome.summary["min_clearance_m"] <= nearest < centre


def test_the_same_seed_is_the_same_log(outcome: RunData) -> None:
    again = flown(faults=GUSTS, mismatch=HEAVY)
    assert again.arrays.keys() == outcome.arrays.keys()
    assert all(again.arrays[name].tobytes() == outcome.arrays[name].tobytes() for name in again.arrays)


def test_ends_are_drawn_on_the_floor_of_the_canyon_by_the_seed() -> None:
    ground = load_terrain("canyon:2")
    ends = []
    for seed in (0, 1):
        expected = QuadrotorCanyon.build(QuadrotorCanyonConfig(terrain="canyon:2"), seed).config
        assert expected["terrain"] == {"name": "canyon 2", "path": "canyon:2", "digest": ground.digest}
        start, target = expected["mission"]["start"], expected["mission"]["target"]
        for x, y, z in (start, target):
            low = float(ground.height(x, y))
            assert low <= ground.z.min() + 0.1 * np.ptp(ground.z) + 5.0
            assert 6.0 < z - low < 20.0
        assert 0.6 * 640.0 <= math.dist(start[:2], target[:2]) <= 0.95 * 640.0
        ends.append((start, target))
    assert ends[0] != ends[1]


def test_a_rotor_too_weak_for_the_bound_is_reported() -> None:
    """The effect of a rotor with half its thrust on the moments is in no bound."""
    summary = flown(mismatch=QuadrotorMismatch(rotor=0.5)).summary
    assert summary["tracking_breaches"] > 0
    assert summary["rebased_plans"] + summary["guarantee_lost"] > 0


@pytest.mark.refused("plug-in", "tracker of a quadrotor: a command that cannot be used")
@pytest.mark.refused("plug-in", "estimator of a quadrotor: an answer that cannot be used")
@pytest.mark.parametrize(
    ("stranger", "loss"), [("estimator", "the estimator has lost its sensors"), ("tracker", "RuntimeError: a bug")]
)
def test_without_its_estimator_or_its_tracker_it_flies_its_plan_as_well_as_that_is_known(
    stranger: str, loss: str
) -> None:
    """In still air, a prediction of the estimate, or the loop's own tracker in place of one that raises."""
    config = QuadrotorCanyonConfig(**SHORT)
    of_tracker, of_estimator = ("raises" if part == stranger else "none" for part in ("tracker", "estimator"))
    controller = PluginSpec.with_fields(hostile_parts.HostileQuadrotor, tracker_misdeed=of_tracker, share=1.0)
    estimator = PluginSpec.with_fields(hostile_parts.HostileQuadrotorState, misdeed=of_estimator, share=1.0)
    begun = dataclasses.replace(QuadrotorCanyon.build(config, 0, controller, estimator), duration=6.0)
    outcome = begun.run()
    assert np.linalg.norm(outcome.arrays["truth.x"][-1, 7:10]) > 3.0
    assert outcome.summary["tracking_error_max_m"] < 0.5
    told = [(event.t, event.kind) for event in outcome.events if event.kind.startswith("guarantee-")]
    assert told[-1] == (0.0, "guarantee-lost")
    assert any(event.kind == "guarantee-lost" and loss in event.message for event in outcome.events)


def test_before_there_is_a_plan_it_hovers() -> None:
    """Its estimate is wrong from the beginning, and from there no plan is certified."""
    estimator = PluginSpec.with_fields(hostile_parts.HostileQuadrotorState, misdeed="jumps", share=1.0)
    begun = dataclasses.replace(QuadrotorCanyon.build(QuadrotorCanyonConfig(**SHORT), 0, None, estimator), duration=0.4)
    outcome = begun.run()
    assert "plan.t" not in outcome.arrays
    assert [event.kind for event in outcome.events if "guarantee" in event.kind] == ["guarantee-lost"]
    np.testing.assert_allclose(outcome.arrays["truth.x"][-1, :3], SHORT["start"], atol=1e-3)


def test_an_estimator_of_something_else_is_refused() -> None:
    """full_state hands on all thirteen states, which no tracker takes."""
    config = QuadrotorCanyonConfig(**SHORT)
    with pytest.raises(ValueError, match=r"estimator = 'full_state': .*allowed: 6 finite numbers"):
        QuadrotorCanyon.build(config, 0, estimator=PluginSpec.with_fields(load("estimators", "full_state")))


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"start": (180.0, 290.0, 1100.0)}, r"start = .* is under ground"),
        ({"start": (300.0, 275.0, 1218.0)}, r"start = .* is below the least clearance"),
        ({"target": (900.0, 290.0, 1240.0)}, r"target = .* is off the map"),
        ({"target": SHORT["start"]}, r"target = .* is where the mission starts"),
        ({"start": (math.nan, 0.0, 0.0)}, r"start = .*; allowed: three finite numbers"),
        ({"terrain": "canyon:x"}, r"terrain 'canyon:x': allowed"),
        ({"terrain": "valley"}, r"terrain = 'valley': not known; allowed: canyon"),
        ({"speed_max": 0.2}, r"speed_max = 0.2 leaves nothing to plan with"),
        ({"arrival_radius": 0.1}, r"arrival_radius = 0\.1 leaves nothing"),
        ({"control_rate": 70.0}, r"control_rate = 70\.0"),
        ({"control_rate": 50.0}, r"attitude_bandwidth = 14\.0; allowed"),
        ({"drawn_heights": (5.0, 1.0)}, r"drawn_heights = \(5\.0, 1\.0\)"),
        ({"start": None, "drawn_separation": (1.4, 1.5)}, r"drawn_separation = .*; allowed: other shares"),
        ({"faults": AerialFaults(gust_rms=30.0, gust_limit=90.0)}, r"gust rms = 30\.0"),
    ],
)
def test_bad_input_names_the_culprit(fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        QuadrotorCanyon.build(QuadrotorCanyonConfig(**{**SHORT, **fields}), 0)


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda: QuadrotorMismatch(mass=4.0), r"mismatch\.mass = 4\.0; allowed: < 3\.058"),
        (lambda: QuadrotorMismatch(rotor=1.2), r"mismatch\.rotor = 1\.2"),
        (
            lambda: QuadrotorCanyonConfig(faults=AerialFaults(position_jump=1.0)),
            r"position_jump = 1\.0; allowed for a quad",
        ),
    ],
)
def test_a_mismatch_or_fault_that_cannot_be_is_refused(build: Any, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        build()
