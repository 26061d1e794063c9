"""The measures of the study ``range-observer``."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.models.unicycle.kernels import integrate
from mathnavi.studies.ranging import range_observer_runs as runs
from mathnavi.studies.ranging.observability_measures import SENSORS, STANDARD, THESIS_START
from mathnavi.studies.ranging.range_observer import DRAWN, OBSERVERS, PRINTED_START, SETS, falls
from mathnavi.studies.ranging.range_observer_runs import ThesisRun, complex_step, follow, identities

OURS, AS_PRINTED = OBSERVERS["s"], OBSERVERS["none"]
STEP = 1e-4  # [s]


@given(st.sampled_from(SETS), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_the_complex_step_is_the_derivative_of_what_rays_read(sensors: str, seed: int) -> None:
    rng, alpha = np.random.default_rng(seed), np.radians(SENSORS[sensors])
    x, u = STANDARD.draw(rng, 0.3), rng.uniform((-1.0, -2.0), (1.0, 2.0))
    (rho_0, s_0), (rho_1, s_1) = (STANDARD.ranges(integrate(x, u[0], u[1], t), alpha) for t in (-STEP, STEP))
    rho_dot, s_dot = complex_step(x, u, alpha)
    turned = (s_1 - s_0 + math.pi) % (2.0 * math.pi) - math.pi
    np.testing.assert_allclose(rho_dot, (rho_1 - rho_0) / (2.0 * STEP), rtol=0, atol=1e-4)
    np.testing.assert_allclose(s_dot, turned / (2.0 * STEP), rtol=0, atol=1e-4)


@pytest.mark.parametrize("sensors", SETS)
def test_on_the_truth_nothing_is_left_but_what_heun_leaves(sensors: str) -> None:
    residuals = identities((sensors, 1, 20))
    for name in ("Q", "s", "rho_dot", "manifold"):
        assert residuals[name].shape == (20,)
        assert residuals[name].max() <= 1e-12
    for name in ("heun_s", "heun_rho_dot"):
        assert residuals[name].min() > 0.0
        assert residuals[name].max() <= 1e-3


def test_the_first_estimates_are_in_the_vicinity_of_the_thesis_start() -> None:
    alpha = np.radians(SENSORS["2t"])
    for seed in range(20):
        z, x = runs.first_z(seed)
        error = (z - PRINTED_START + math.pi) % (2.0 * math.pi) - math.pi
        assert np.abs(error).max() <= runs.VICINITY + 1e-4
        assert STANDARD.contains(x[:2])
        np.testing.assert_array_equal(z, runs.first_z(seed)[0])
    rho, s = STANDARD.ranges(THESIS_START, alpha)
    np.testing.assert_allclose(
        runs.places(np.append(s, THESIS_START[2]), rho, alpha), [THESIS_START[:2]] * 2, atol=1e-12
    )


@pytest.mark.parametrize("noisy", [(True, True), (True, False), (False, True), (False, False)])
def test_only_the_rays_that_are_said_to_err_do_and_by_five_per_cent(noisy: tuple[bool, bool]) -> None:
    seen = runs.from_thesis_start(ThesisRun("circle", OURS, 3, 4, noisy)).run
    exact = np.array([STANDARD.ranges(pose, seen.mission.alpha)[0] for pose in seen.truth])
    read = np.array([readings[0].value for readings in seen.readings])
    deviation = (read / exact - 1.0).std(axis=0)
    np.testing.assert_allclose(deviation, np.where(noisy, runs.NOISE, 0.0), rtol=0.15, atol=1e-12)


def test_an_estimate_on_the_image_of_the_truth_is_not_off() -> None:
    """The half-turn of the ellipse, in X and in Z."""
    asked = ThesisRun("circle", OURS, 0, 2, true_start=True)
    run = runs.from_thesis_start(asked).run
    image = STANDARD.images(THESIS_START)[1]
    turned = dataclasses.replace(run, mission=runs.mission_with("2t", run.mission.ranging, image))
    seen = follow(turned, OURS)
    assert np.linalg.norm(seen.x[:, :2] - seen.truth[:, :2], axis=1).min() > 1.0
    assert max(seen.position.max(), seen.in_z.max()) <= 1e-3


def test_turning_from_the_thesis_start_the_print_loses_lock_and_the_feed_forward_does_not() -> None:
    printed, ours = (runs.thesis_errors(ThesisRun("circle", observer, 0, 8)) for observer in (AS_PRINTED, OURS))
    assert not printed["keeps_lock"]
    assert not printed["keeps_lock_in_z"]
    assert ours["keeps_lock"]
    assert ours["keeps_lock_in_z"]
    assert ours["position_rms_m"] < 1e-3


def test_the_mean_of_a_true_and_a_faulty_ray_errs_less_than_the_faulty_one() -> None:
    mean, faulty = runs.averaged(ThesisRun("circle", OURS, 1, 4, (True, False)))
    assert 0.0 < mean < faulty


def test_an_error_falls_only_where_lock_is_kept_at_both_gains() -> None:
    near, nearer, lost = (0.2, True), (0.02, True), (0.9, False)
    rows = [
        {"what": DRAWN, "sensors": "2s", "motion": "standard", "k_v": k, "position_rms_m": error, "keeps_lock": kept}
        for k, runs_at_k in ((1.0, (near, lost, near)), (10.0, (nearer, nearer, lost)))
        for error, kept in runs_at_k
    ]
    assert falls(rows) == falls(rows, sensors="2s", motion="standard") == [pytest.approx(10.0)]
