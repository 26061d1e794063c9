"""An estimate is doubted when it is lost, worse than declared, or says nothing that can be compared."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.flight.certified import doubt
from mathnavi.interfaces.signals import Array, Estimate, Status

DECLARED = (2.0, 0.5)  # [m, m/s]


def estimate(position: float, velocity: float, status: Status = Status.OK) -> Estimate:
    """An estimate with these standard deviations [m, m/s] on its last axes, and none on the others."""
    covariance: Array = np.diag(np.square([0.0, 0.0, position, 0.0, 0.0, velocity]))
    return Estimate(0.0, np.zeros(6), covariance, status)


@pytest.mark.parametrize(("position", "velocity"), [(0.0, 0.0), (2.0, 0.5), (2.0005, 0.5005)])
def test_what_is_as_good_as_declared_is_not_doubted(position: float, velocity: float) -> None:
    assert doubt(estimate(position, velocity), DECLARED) == ""


def test_without_a_covariance_or_a_declaration_there_is_nothing_to_doubt() -> None:
    assert doubt(Estimate(0.0, np.zeros(6)), DECLARED) == ""
    assert doubt(estimate(1e6, 1e6), (math.inf, math.inf)) == ""


@pytest.mark.parametrize(
    ("position", "velocity", "reason"),
    [
        (2.1, 0.0, "the estimate's position is off by 2.1 m, one sigma; declared: 2"),
        (0.0, 0.6, "the estimate's velocity is off by 0.6 m/s, one sigma; declared: 0.5"),
        (math.nan, 0.0, "the estimate's position is off by nan m, one sigma; declared: 2"),
        (0.0, math.nan, "the estimate's velocity is off by nan m/s, one sigma; declared: 0.5"),
    ],
)
def test_what_is_worse_than_declared_is_doubted(position: float, velocity: float, reason: str) -> None:
    assert doubt(estimate(position, velocity), DECLARED) == reason


@pytest.mark.parametrize("shape", [(3, 3), (9, 9), (6,)])
def test_a_covariance_of_another_shape_is_doubted(shape: tuple[int, ...]) -> None:
    other = Estimate(0.0, np.zeros(6), np.zeros(shape))
    assert doubt(other, DECLARED) == f"the estimate's covariance has shape {shape}; allowed: (6, 6)"


@pytest.mark.parametrize("status", [Status.LOST, Status.INITIALISING, Status.SOLVER_FAILED])
def test_a_lost_estimate_is_doubted_however_good_it_says_it_is(status: Status) -> None:
    assert doubt(estimate(0.0, 0.0, status), DECLARED) == status.value


def test_a_degraded_estimate_is_judged_by_its_covariance_and_doubted_without_one() -> None:
    assert doubt(estimate(1.9, 0.4, Status.DEGRADED), DECLARED) == ""
    assert "position is off by 2.1 m" in doubt(estimate(2.1, 0.4, Status.DEGRADED), DECLARED)
    assert doubt(Estimate(0.0, np.zeros(6), None, Status.DEGRADED), DECLARED) == Status.DEGRADED.value
