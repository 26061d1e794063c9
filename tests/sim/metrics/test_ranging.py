"""Metrics of a ranging run: convergence, its time, and the consistency of the covariance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.ranging import RangingErrors, ranging_summary, rms
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS, is_wall_clock, label
from tests.localisation import run
from tests.unicycle import STANDARD

MISSION = RangingMission(STANDARD, (0.0, 1.0))
TRUTH = np.array([1.0, 0.3, 0.4])


def recording(
    error: Callable[[float], Array],
    covariance: Array | None = None,
    status: Callable[[float], Status] = lambda t: Status.OK,
    every: int = 1,
) -> Recording:
    """20 s at rest at ``TRUTH``, sampled ten times a second, with an estimate at every so many samples."""
    t = np.linspace(0.0, 20.0, 201)
    truths = np.tile(np.concatenate([TRUTH, np.zeros(7)]), (len(t), 1))
    estimates = [Estimate(at, TRUTH + error(at), covariance, status(at)) for at in t[::every].tolist()]
    agent = AgentRecorder("robot", [], np.zeros((len(t), 2)), {"ranges": np.zeros((len(t), 2))}, estimates)
    return Recording(t, {"robot": truths}, {"robot": agent}, [], {"robot": ()}, len(t))


def summary(*arguments: object, **named: object) -> dict[str, object]:
    return ranging_summary(recording(*arguments, **named), "robot", MISSION, 3, 2.0)  # type: ignore[arg-type]


def step_at(when: float, before: float, after: float) -> Callable[[float], Array]:
    """An error of position that is another one from ``when`` on."""
    return lambda t: np.array([0.0, before if t < when - 1e-9 else after, 0.0])


def test_the_time_of_convergence_is_the_last_instant_above_the_limit() -> None:
    found = summary(step_at(6.0, 1.0, 0.1))
    assert found["converged"] is True
    assert found["convergence_time_s"] == pytest.approx(5.9)
    assert found["position_error_max_m"] == pytest.approx(0.1)
    assert found["position_rms_m"] == pytest.approx(0.1)
    assert found["heading_error_max_deg"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("when", "converged"), [(14.9, True), (15.6, False)])
def test_it_is_judged_by_the_last_quarter(when: float, converged: bool) -> None:
    assert summary(step_at(when, 1.0, 0.0))["converged"] is converged


def test_a_late_peak_does_not_undo_convergence_and_is_reported() -> None:
    peak = summary(lambda t: np.array([0.4 if 17.95 < t < 18.05 else 0.05, 0.0, 0.0]))
    assert peak["converged"] is True
    assert peak["convergence_time_s"] == pytest.approx(18.0)


@pytest.mark.parametrize("error", [[0.31, 0.0, 0.0], [0.0, 0.0, 0.21], [0.0, -0.4, 0.0]])
def test_either_error_can_spoil_it(error: list[float]) -> None:
    found = summary(lambda t: np.array(error))
    assert found["converged"] is False
    assert found["convergence_time_s"] is None
    assert found["position_error_max_m"] is None


def test_the_turned_pose_counts_as_the_truth_in_an_ellipse() -> None:
    other = STANDARD.images(TRUTH)[1] - TRUTH
    assert summary(lambda t: other)["position_rms_m"] == pytest.approx(0.0, abs=1e-12)


def test_a_covariance_that_is_right_has_a_nees_of_three() -> None:
    rng = np.random.default_rng(0)
    spread = np.array([0.03, 0.05, 0.02])
    honest = summary(lambda t: spread * rng.standard_normal(3), np.diag(spread**2))
    assert honest["nees_mean"] == pytest.approx(3.0, abs=1.0)
    sure = summary(lambda t: spread * rng.standard_normal(3), np.diag(0.01 * spread**2))
    assert sure["nees_mean"] == pytest.approx(300.0, rel=0.4)


@pytest.mark.parametrize("covariance", [None, np.zeros((3, 3))])
def test_without_a_covariance_of_use_there_is_no_nees(covariance: Array | None) -> None:
    assert summary(step_at(0.0, 0.0, 0.1), covariance)["nees_mean"] is None


def test_times_in_a_status_are_counted() -> None:
    found = summary(
        step_at(0.0, 0.0, 0.0),
        status=lambda t: (
            Status.INITIALISING
            if t < 0.45
            else Status.LOST
            if 5.0 <= t < 7.0
            else Status.DEGRADED
            if 7.0 <= t < 8.0
            else Status.OK
        ),
    )
    assert found["initialising_s"] == pytest.approx(0.5)
    assert found["lost_s"] == pytest.approx(2.0)
    assert found["degraded_s"] == pytest.approx(1.0)


def test_an_old_estimate_is_compared_with_what_is_true_now() -> None:
    log = recording(step_at(0.0, 0.0, 0.0), every=50)
    log.truths["robot"][:, 0] += 0.01 * log.t
    errors = RangingErrors.from_recording(log, "robot", MISSION)
    assert errors.position[49] == pytest.approx(0.01 * 4.9)
    assert errors.position[50] == pytest.approx(0.01 * 5.0)


def test_a_run_without_an_estimate_has_not_converged() -> None:
    log = recording(step_at(0.0, 0.0, 0.0))
    log.agents["robot"].estimates.clear()
    found = ranging_summary(log, "robot", MISSION, 0, 1.0)
    assert found["converged"] is False
    assert found["nees_mean"] is None
    assert np.isnan(found["position_rms_m"])


def test_lost_ranges_are_those_that_did_not_arrive() -> None:
    log = recording(step_at(0.0, 0.0, 0.0))
    log.agents["robot"].readings["ranges"][:50, 0] = np.nan
    log.agents["robot"].readings["ranges"][:10, 1] = np.nan
    assert ranging_summary(log, "robot", MISSION, 0, 1.0)["lost_ranges"] == pytest.approx(60 / 402)


def test_the_last_instant_above_takes_other_limits_too() -> None:
    errors = RangingErrors.from_recording(recording(step_at(6.0, 0.2, 0.1)), "robot", MISSION)
    assert errors.last_above() == 0.0
    assert errors.last_above(0.15, np.inf) == pytest.approx(5.9)
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))


def test_every_figure_of_the_summary_has_a_place_in_its_tables() -> None:
    known = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    found = run(duration=0.2).summary
    assert found.keys() - known == {"seed", "real_time_factor", "shortfall"}  # it is too short to converge
    assert is_wall_clock("real_time_factor")
    assert label("heading_rms_deg") == ("heading rms", "deg")
