"""The scenarios of Paper D: they run, the same seed twice alike, and bad input ends in one clear error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.controllers.intrinsic.law import ReferencePlanner
from mathnavi.interfaces.signals import Plan, Status
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.mission import PositionQuality
from mathnavi.sim.metrics.lagrangian import VelocityErrors, errors_of
from mathnavi.sim.plugin.registry import PluginSpec, load
from mathnavi.sim.scenarios.arm_velocity import ArmVelocity, ArmVelocityConfig
from mathnavi.sim.scenarios.attitude_tracking import AttitudeTrackingFields, AttitudeTrackingScenario
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.sphere_observer import VEHICLE, SphereObserver, SphereObserverConfig

SHORT: dict[str, Any] = {"duration": 1.5, "settled": 1.0, "rate": 500.0}


def flown(space: str = "body", seed: int = 1, **fields: Any) -> RunData:
    config = SphereObserverConfig(**{**SHORT, "space": space, **fields})
    return SphereObserver.build(config, seed).run()


@pytest.mark.parametrize("space", ["body", "sphere", "hyperbolic-plane"])
def test_the_observer_finds_the_velocity_in_the_loop(space: str) -> None:
    outcome = flown(space, force="none" if space == "body" else "linear")
    assert outcome.success, outcome.summary
    assert outcome.summary["velocity_error_start"] > 2.0
    assert outcome.summary["velocity_rms"] < 0.1
    assert outcome.summary["lost_s"] == 0.0


def test_the_same_seed_is_the_same_log() -> None:
    brief = {"duration": 0.5, "settled": 0.3}
    one, other = flown(**brief).arrays, flown(**brief).arrays
    assert one.keys() == other.keys()
    assert all(one[name].tobytes() == other[name].tobytes() for name in one)
    assert flown(seed=2, **brief).arrays["truth.x"].tobytes() != one["truth.x"].tobytes()


def test_a_mechanism_is_observed_and_kept_on_its_reference() -> None:
    outcome = ArmVelocity.build(ArmVelocityConfig(duration=1.5), 0).run()
    assert outcome.success, outcome.summary
    plan = outcome.recording.agents["mechanism"].plans[-1][1]
    assert outcome.recording.truths["mechanism"][-1] == pytest.approx(
        plan.x[int(np.argmin(np.abs(plan.t - outcome.recording.t[-1])))], abs=0.05
    )


def test_an_arm_with_servos_is_observed_and_kept_on_its_reference() -> None:
    outcome = ArmVelocity.build(ArmVelocityConfig(mechanism="servo-six", duration=0.8, settled=0.4, load=1.5), 0).run()
    assert outcome.success, outcome.summary
    assert outcome.summary["plans_adopted"] == 8
    assert outcome.summary["speed_max"] > 0.5


def test_a_run_without_a_plan_did_not_do_what_it_should(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ReferencePlanner, "plan", lambda self, request: Plan.failure(Status.RAISED, "no plan"))
    outcome = ArmVelocity.build(ArmVelocityConfig(duration=0.2, settled=0.1), 0).run()
    assert not outcome.success
    assert "plans adopted 0 < 1" in outcome.summary["shortfall"]


def test_a_body_is_brought_to_its_reference_without_a_gyro() -> None:
    config = AttitudeTrackingFields(duration=4.0, settled=3.0)
    outcome = AttitudeTrackingScenario.build(config, 3).run()
    assert outcome.success, outcome.summary
    assert 0.5 < outcome.summary["settled_at_s"] < 3.0


def test_a_body_with_three_moments_of_inertia_is_brought_to_its_reference() -> None:
    config = AttitudeTrackingFields(duration=4.0, settled=3.0, principal_inertia=(0.01, 0.05, 0.055))
    outcome = AttitudeTrackingScenario.build(config, 3).run()
    assert outcome.success, outcome.summary


def test_without_readings_the_estimate_is_lost_and_finite() -> None:
    outcome = flown(reading=PositionQuality(dropout=0.999), duration=3.0)
    estimates = outcome.recording.agents[VEHICLE].estimates
    assert np.isfinite([estimate.x for estimate in estimates]).all()
    statuses = {estimate.status for estimate in estimates}
    assert statuses & {Status.LOST, Status.INITIALISING}
    assert not outcome.success


@pytest.mark.parametrize("estimator", ["riemannian_observer", "high_gain", "lagrangian_ekf", "filtered_differences"])
def test_readings_that_jump_leave_it_finite(estimator: str) -> None:
    config = SphereObserverConfig(**SHORT, reading=PositionQuality(noise=0.01, jump=0.02, jump_size=1.0))
    outcome = SphereObserver.build(config, 0, estimator=PluginSpec.with_fields(load("estimators", estimator))).run()
    assert np.isfinite(outcome.arrays["estimate.x"]).all()
    assert outcome.summary["velocity_rms"] < 1.0


def test_a_state_that_diverges_at_once_is_a_run_without_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a step that MuJoCo cannot take: the run is written, judged, and said to have nothing to be drawn."""
    step = mujoco.mj_step

    def diverging(model: Any, data: Any, nstep: int = 1) -> None:
        step(model, data, nstep)
        data.qvel[:] = np.nan

    monkeypatch.setattr(mujoco, "mj_step", diverging)
    expected = ["--duration", "1", "--settled", "0.5", "--report", "--video", "--out", str(tmp_path / "run")]
    assert main(["run", "sphere-observer", *expected]) == 1
    printed = capsys.readouterr()
    assert "at 0.001 s the simulation diverged in the joint 'attitude': a velocity that is not" in " ".join(
        printed.out.split()
    )
    for kind in ("video", "report"):
        assert f"no {kind}: " in printed.err
    assert not list((tmp_path / "run").glob("*.html"))
    assert (tmp_path / "run" / "summary.json").is_file()


def test_errors_are_those_of_the_transported_velocity() -> None:
    manifold, truth = Attitude(), np.array([1.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.1])
    theta, velocity_error, speed, lyapunov = errors_of(manifold, truth, truth)
    assert theta == speed == 0.0
    assert np.array_equal(velocity_error, np.zeros(3))
    turned = np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0, 0.3, 0.0, 0.1])
    theta, velocity_error, speed, lyapunov = errors_of(manifold, truth, turned)
    assert theta == pytest.approx(0.1)
    assert lyapunov[1] == pytest.approx(0.005)
    assert velocity_error[0] == pytest.approx(0.0, abs=1e-12)  # about the axis of the turn nothing changes
    assert speed == pytest.approx(0.5 * float(np.linalg.norm(velocity_error)))


def test_opposite_states_are_infinitely_off() -> None:
    manifold, truth = Attitude(), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    theta, velocity_error, speed, lyapunov = errors_of(manifold, truth, np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert theta == manifold.injectivity_radius
    assert np.isinf(velocity_error).all()
    assert np.isnan(lyapunov).all()
    assert speed == np.inf


def test_v_is_w_at_the_truth_and_both_fall() -> None:
    outcome = flown(reading=PositionQuality())
    errors = VelocityErrors.from_recording(outcome.recording, VEHICLE, Attitude())
    V, W = errors.V(100.0), errors.W(100.0)
    assert V[0] == pytest.approx(W[0])
    assert V[-1] < 1e-4 * V[0]
    assert W[-1] < 1e-4 * W[0]


def test_what_leaves_the_hyperbolic_plane_s_bounds_is_reported_and_estimates_stay_finite() -> None:
    outcome = flown("hyperbolic-plane", force="none", duration=4.0, rate=200.0)
    assert not outcome.success
    assert outcome.recording.events[-1].kind == "escaped"
    assert 2.0 < outcome.recording.t[-1] < 3.0  # cosh(6 t) reaches 1e6 at 2.4 s from the origin
    assert np.isfinite(outcome.arrays["estimate.x"]).all()
    assert flown("hyperbolic-plane", force="by-space").success
