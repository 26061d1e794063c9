"""The extended Kalman filter over textbook systems."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.textbook.extended_kalman import TextbookEkf, TextbookEkfConfig
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.textbook.library import EXAMPLE_2_1, EXAMPLE_2_2, KRENER_ISIDORI, camera_and_flags
from tests.textbook import mission, replayed, steps

CONFIG = TextbookEkfConfig()


def test_it_is_the_kalman_filter_where_the_system_is_linear() -> None:
    """The third state of Example 2.2 is unobservable and decays; the others are found."""
    given = list(steps(EXAMPLE_2_2, 4.0))
    estimates = replayed(TextbookEkf.build(CONFIG, mission(EXAMPLE_2_2)), given)
    error = np.abs(estimates[-1].x - given[-1].truth)
    assert error[:2].max() < 1e-4
    assert error[2] == pytest.approx(np.exp(-4.0), rel=1e-3)


@pytest.mark.parametrize("known", [True, False], ids=["distance known", "distance unknown"])
def test_the_robot_finds_itself_between_its_flags(known: bool) -> None:
    system = camera_and_flags(known)
    given = list(steps(system, 10.0))
    estimates = replayed(TextbookEkf.build(CONFIG, mission(system)), given)
    start, end = (np.linalg.norm(system.difference(estimates[k].x, given[k].truth)) for k in (0, -1))
    assert end < 0.25 * start


def test_linearising_again_is_better_than_once() -> None:
    system = camera_and_flags(distance_known=False)
    given = list(steps(system, 3.0))
    once, again = (
        replayed(TextbookEkf.build(TextbookEkfConfig(iterations=k), mission(system)), given)[-1].x for k in (1, 10)
    )
    truth = given[-1].truth
    assert np.linalg.norm(again - truth) < 0.5 * np.linalg.norm(once - truth)


def test_its_covariance_is_that_of_its_errors() -> None:
    """Normalised errors over many draws of start and noise, chi-squared with two degrees of freedom."""
    rng, given, nees = np.random.default_rng(0), list(steps(KRENER_ISIDORI, 0.6)), []
    for _ in range(30):
        task = mission(KRENER_ISIDORI, 0.1 * rng.standard_normal(2), noise=0.05)
        task = type(task)(task.system, task.start, (0.1, 0.1), task.noise, task.period)
        observer = TextbookEkf.build(TextbookEkfConfig(process=0.0), task)
        for step in given:
            read = step.measurements[0].value + 0.05 * rng.standard_normal(1)
            estimate = observer.update(step.t, [Measurement("output", step.t, read)], step.command)
        error = estimate.x - given[-1].truth
        nees.append(error @ np.linalg.solve(estimate.covariance, error))
    assert 1.2 < np.mean(nees) < 3.0


def test_flags_out_of_sight_are_left_out() -> None:
    system = camera_and_flags()
    observer = TextbookEkf.build(CONFIG, mission(system, (0.0, 0.0, 0.0)))
    for step in list(steps(system, 2.0)):
        seen = step.measurements[0].value.copy()
        seen[0] = np.nan
        estimate = observer.update(step.t, [Measurement("output", step.t, seen)], step.command)
        assert estimate.status is Status.OK
    nothing = [Measurement("output", 2.01, np.full(2, np.nan))]
    assert np.isfinite(observer.update(2.01, nothing, step.command).x).all()


def test_an_estimate_that_escapes_is_lost_and_finite() -> None:
    """The truth of Example 2.1 rests, the estimator starts from a state that escapes, and receives no measurement."""
    observer = TextbookEkf.build(CONFIG, mission(EXAMPLE_2_1, (2.0, 3.0)))
    observer.update(0.0, [Measurement("output", 0.0, np.array([2.2]))], np.ones(1))
    for k in range(1, 80):
        estimate = observer.update(0.01 * k, [], np.ones(1))
        assert np.isfinite(estimate.x).all()
        assert estimate.covariance is not None
        assert np.isfinite(estimate.covariance).all()
    assert estimate.status is Status.LOST
