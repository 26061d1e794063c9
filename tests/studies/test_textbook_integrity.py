"""Observers of textbook systems whose outputs fail do not call themselves OK, and healthy ones do."""

from __future__ import annotations

import math

import pytest

from mathnavi.studies.ranging import textbook_integrity
from mathnavi.studies.ranging.integrity_judging import Outcome, Watched
from mathnavi.studies.ranging.textbook_integrity import ESTIMATORS, MOVED, STANDS, UNDRIVEN


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(textbook_integrity, "DURATION", 13.0)


def outcome(estimator: str, fault: str, seed: int = 100) -> Outcome:
    return textbook_integrity.watched(Watched(estimator, fault, seed, True))


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_healthy_one_is_ok(estimator: str) -> None:
    found = outcome(estimator, "none")
    assert found.false == found.position == found.rest == 0.0
    assert math.isnan(found.detected)


@pytest.mark.parametrize(
    ("estimator", "fault"),
    [
        *((each, "output 0.5 off") for each in ESTIMATORS),
        ("example_2_2", "output times 1.1"),
        ("output_injection", STANDS),
        ("kazantzis_kravaris", UNDRIVEN),
        ("textbook_ekf", MOVED),
    ],
)
def test_one_whose_output_or_system_fails_says_so(estimator: str, fault: str) -> None:
    """Without tests of innovations they were sure and wrong for 10 to 27 % of the time of the study."""
    found = outcome(estimator, fault)
    assert found.judged == 0.0
    assert found.detected < 1.5
