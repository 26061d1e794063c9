"""An arm whose encoders fail: what its observers know of its motion, and when they are OK again."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.interfaces.signals import Status
from mathnavi.studies.ranging.encoder_integrity import (
    END,
    ESTIMATORS,
    FAULTS,
    ONE_TURN,
    ONSET,
    STANDS,
    SURE_OF_MODEL,
    _mission,
    estimated,
    findable,
    of_seed,
    watched,
)
from mathnavi.studies.ranging.integrity_judging import Watched

QUICK = "filtered_differences", "momentum_observer", "high_gain"


@pytest.mark.parametrize("fault", [STANDS, "an encoder 0.1 rad off", "an encoder times 1.1"])
@pytest.mark.parametrize("name", QUICK)
def test_no_observer_is_sure_and_wrong_of_an_arm_whose_encoder_fails_at_once(name: str, fault: str) -> None:
    outcome = watched(Watched(name, fault, 100, True))
    assert outcome.position == outcome.rest == outcome.false == 0.0
    assert outcome.detected < 0.2
    assert outcome.recovered < 5.5


@pytest.mark.parametrize("name", ["momentum_observer", "high_gain"])
def test_an_observer_that_predicts_well_finds_a_slip_of_twenty_deviations_of_its_encoder(name: str) -> None:
    outcome = watched(Watched(name, "an encoder 0.01 rad off", 100, True))
    assert outcome.position == outcome.rest == outcome.false == 0.0
    assert outcome.detected < 0.05


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("fault", ["none", ONE_TURN])
def test_an_encoder_that_is_good_is_not_doubted(name: str, fault: str) -> None:
    mission = _mission()
    swing, joint = of_seed(101, mission, fault)
    found = estimated(name, mission, fault, swing, joint)
    assert all(each.status is Status.OK for each in found if each.t > 1.5)
    error = np.abs([each.x for each in found] - swing.truth)
    assert error[500:, :2].max() < 0.005


def test_a_drift_can_be_found_by_those_who_are_sure_of_their_model_alone() -> None:
    mission, fault = _mission(), "an encoder drifts by 0.1 rad/s"
    swing, joint = of_seed(100, mission, fault)
    swing.readings[:] = swing.truth[:, :2]
    during = slice(round(ONSET / mission.period), round(END / mission.period))
    FAULTS[fault](swing, during, joint)
    with_model, without = (findable(mission, swing, during, fault, modelled=each) for each in (True, False))
    assert with_model[during].mean() > 0.8
    assert not without[during].any()
    assert not with_model[: during.start].any()
    assert set(SURE_OF_MODEL) < set(ESTIMATORS)
