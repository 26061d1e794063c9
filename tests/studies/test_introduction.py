"""The measures of the study of the Introduction's examples."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.models.textbook.library import EXAMPLE_2_1, EXAMPLE_2_2, error_dynamics
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.introduction.examples import example_2_2, in_coordinates, predicted, unseen_directions


def test_a_linear_equation_is_predicted() -> None:
    t, matrix = np.linspace(0.0, 1.0, 11), np.array([[0.0, 1.0], [-4.0, 0.0]])
    e = predicted(t, np.array([1.0, 0.0]), matrix)
    np.testing.assert_allclose(e[:, 0], np.cos(2.0 * t), atol=1e-12)


@pytest.mark.parametrize(("alpha", "beta"), [(2.0, 3.0), (4.0, 1.0), (-1.0, 2.0)])
def test_the_exponent_of_example_2_2_is_that_of_its_slower_root(alpha: float, beta: float) -> None:
    fields = {"estimator.alpha": alpha, "estimator.beta": beta, "duration": 3.0, "start_error": (1.0, 0.4, 1.0)}
    measured = example_2_2(trial("textbook-observer", 0, estimator="example_2_2", fields=fields).build().run())
    slower = np.linalg.eigvals(error_dynamics(alpha, beta)[:2, :2]).real.max()  # of s^2 + beta s + alpha
    assert measured["exponent_per_s"] == pytest.approx(slower, abs=1e-4)
    assert measured["deviation"] < 1e-6


@pytest.mark.parametrize(("form", "follows"), [("z", True), ("corrected", True), ("printed", False)])
def test_an_observer_follows_its_equation_or_does_not(form: str, follows: bool) -> None:
    fields = {"system": "kazantzis-kravaris", "estimator.form": form, "duration": 2.0}
    measured = in_coordinates(
        trial("textbook-observer", 0, estimator="kazantzis_kravaris", fields=fields).build().run()
    )
    assert (measured["deviation"] < 1e-3) == follows
    assert (measured["exponent_per_s"] < 0.0) == follows
    assert (measured["error_ratio"] < 1.0) == follows


def test_what_the_output_does_not_see_is_counted() -> None:
    assert unseen_directions(EXAMPLE_2_1, 1.0) == 1
    assert unseen_directions(EXAMPLE_2_1, -1.0) == 0
    assert unseen_directions(EXAMPLE_2_2, -1.0) == 1  # x_3, which decays by itself
