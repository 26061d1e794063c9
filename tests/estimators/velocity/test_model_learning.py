"""Gains, friction and load that are not those of the model are found where the motion shows them, and used."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.velocity.model_learning import ModelLearning
from mathnavi.models.mechanism.parameters import MechanismParameters
from mathnavi.models.mechanism.system import MechanismSystem
from tests.estimators.velocity.faulty_arms import BITS, moved, observed


def learned(arm: str, **fault: float) -> ModelLearning:
    model, q, _, u = moved(arm, **fault)
    learning, manifold = ModelLearning(MechanismParameters(model)), MechanismSystem(model).manifold
    for k, (a, b) in enumerate(zip(q, u, strict=True)):
        learning.read(k * model.opt.timestep, manifold.rounded(a, BITS), b)
    return learning


@pytest.mark.parametrize("arm", ["servo-six", "servo-seven", "servo-gripper"])
def test_gains_that_are_off_are_found(arm: str) -> None:
    learning = learned(arm, gain=0.8)
    assert learning.known
    found = dict(zip(learning.parameters.names, learning.theta, strict=True))
    joints = [name[8:] for name in found if name.startswith("gain of") and name != "gain of grip"]
    ratios = [(1.0 + found[f"gain of {name}"]) / (1.0 + found[f"rate gain of {name}"]) for name in joints]
    assert ratios == pytest.approx([0.8] * len(ratios), abs=0.02)  # at a steady speed that is all that matters


@pytest.mark.parametrize("arm", ["servo-six", "servo-seven", "servo-gripper", "dm_control:manipulator"])
def test_nothing_is_found_where_the_model_is_right(arm: str) -> None:
    """Nor where joints turn by radians within the window, whose torques no parameter explains."""
    assert not learned(arm).found


def test_nothing_is_found_at_rest() -> None:
    model, q, _, u = moved("servo-six", gain=0.8)
    learning = ModelLearning(MechanismParameters(model))
    for k in range(600):
        learning.read(k * model.opt.timestep, q[0], u[0])
    assert not learning.known
    assert np.abs(learning.theta / learning.parameters.prior).max() < 0.5


@pytest.mark.parametrize(
    ("arm", "fault", "times"),
    [
        ("servo-seven", {"gain": 0.8}, 100.0),
        ("servo-gripper", {"gain": 1.2}, 20.0),
        ("servo-six", {"friction": 2.0}, 2.0),
    ],
    ids=["gain", "gain, saturated", "friction"],
)  # fmt: skip
def test_the_default_observer_uses_what_it_has_learned(
    arm: str, fault: dict[str, float], times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error is many times less than without."""
    watched = observed(arm, "riemannian_observer", **fault)
    monkeypatch.setattr("mathnavi.estimators.riemannian.plugin.uncertain_parameters", lambda system: None)
    without = observed(arm, "riemannian_observer", **fault)
    assert watched.rms(0.8) < without.rms(0.8) / times
    assert watched.ok[-1]


def test_readings_that_are_not_evenly_spaced_begin_a_new_window() -> None:
    model, q, _, u = moved("servo-six", gain=0.8)
    learning, rng, t = ModelLearning(MechanismParameters(model)), np.random.default_rng(2), 0.0
    for a, b in zip(q[:500], u[:500], strict=True):
        t += model.opt.timestep * (1.0 + 0.2 * rng.uniform())
        assert learning.read(t, a, b) is None
    assert not learning.found
