"""Declarations are refuted by runs that contradict them, and by no others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.sim.records.store import Record
from mathnavi.studies.introduction.observer_properties import (
    STAYS,
    Decay,
    OnTruth,
    PropertyRuns,
    decay,
    ranging_drift,
    verdicts,
)

T = np.linspace(0.0, 10.0, 1001)
SOUND = ObserverProperties(Domain.GLOBAL, Rate.EXPONENTIAL, InputDependence.UNIFORM, Domain.LOCAL, Domain.GLOBAL)


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (np.exp(-T), Decay.EXPONENTIAL),
        (np.exp(-T) * (1.1 + np.cos(9.0 * T)) / 2.1, Decay.EXPONENTIAL),
        (1.0 / (1.0 + 3.0 * T), Decay.ASYMPTOTIC),
        (1.0 / (1.0 + 30.0 * T), Decay.ASYMPTOTIC),
        (np.exp(-T) + 5e-4, Decay.EXPONENTIAL),  # what sampling costs
        (np.exp(-3.0 * T) + 0.05, Decay.NONE),
        (np.ones_like(T), Decay.NONE),
        (np.exp(0.3 * T), Decay.NONE),
        (np.append(1.0, np.zeros(1000)), Decay.FINITE_TIME),
    ],
)
def test_errors_fall_as_they_are_said_to(error: np.ndarray, expected: Decay) -> None:
    assert decay(error, 1.0) is expected


def record(**summary: Any) -> Record:
    figures = {"start": 1.0, "late": 0.0, "largest": 1.0, "drift": 0.0, "decay": int(Decay.EXPONENTIAL), "found": True}
    return Record("key", "scenario", {}, 0, "code", "ok", True, {**figures, **summary})


GOOD = PropertyRuns([0.0], [record()] * 10, [record()] * 10, {"sine": [record()], "zero": [record()]})
LOST = record(found=False, decay=int(Decay.NONE))


def broken(declared: ObserverProperties, evidence: PropertyRuns, depends: bool = False) -> set[str]:
    return {row["property"] for row in verdicts(declared, evidence, depends) if not row["kept"]}


def test_what_is_seen_of_a_sound_observer_refutes_nothing() -> None:
    assert broken(SOUND, GOOD) == set()
    assert broken(replace(SOUND, domain_of_attraction=Domain.LOCAL, rate=Rate.ASYMPTOTIC), GOOD) == set()


@pytest.mark.parametrize(
    ("evidence", "refuted"),
    [
        (replace(GOOD, drifts=[0.0, 2.0 * STAYS]), {"stays on the truth"}),
        (replace(GOOD, far=[*GOOD.far, LOST]), {"domain of attraction", "system's domain of operation"}),
        (replace(GOOD, near=[record(decay=int(Decay.ASYMPTOTIC))] * 10), {"rate"}),
        (replace(GOOD, inputs={**GOOD.inputs, "still": [LOST]}), {"input dependence"}),
        (replace(GOOD, near=[*GOOD.near, record(largest=3.0)]), {"observer's domain of operation"}),
    ],
)
def test_each_promise_is_refuted_by_its_own_runs(evidence: PropertyRuns, refuted: set[str]) -> None:
    assert broken(SOUND, evidence) == refuted


@pytest.mark.parametrize(
    ("declared", "refuted"),
    [
        (replace(SOUND, stays_on_truth=False), "stays on the truth"),
        (replace(SOUND, domain_of_attraction=Domain.NONE), "domain of attraction"),
        (replace(SOUND, rate=Rate.NONE), "rate"),
        (replace(SOUND, input_dependence=InputDependence.NON_UNIFORM), "input dependence"),
    ],
)
def test_a_failing_that_is_declared_has_to_be_seen(declared: ObserverProperties, refuted: str) -> None:
    assert refuted in broken(declared, GOOD)


def test_a_failing_may_be_seen_of_another_system() -> None:
    assert broken(replace(SOUND, input_dependence=InputDependence.NON_UNIFORM), GOOD, depends=True) == set()


def test_the_observer_as_printed_leaves_the_truth_and_with_a_feedforward_it_stays() -> None:
    assert ranging_drift(OnTruth("range_observer", {"feedforward": "none"}, 0)) > 10.0 * STAYS
    assert ranging_drift(OnTruth("range_observer", {"feedforward": "manifold"}, 0)) < STAYS
