from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.velocity.momentum import MomentumObserver, MomentumObserverConfig
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.manifold.constant_curvature import sphere
from mathnavi.models.manifold.systems import PointSystem, linear
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.models.mechanism.system import MechanismSystem, heavier
from tests.estimators.velocity.runs import mission_of, recorded, replayed

START = np.array([0.4, -0.8, 0.3, -0.5])


def held(t: float) -> Array:
    return np.array([2.0 * np.sin(3.0 * t), np.cos(2.0 * t)])


def arm(load: float = 1.0) -> MechanismSystem:
    return MechanismSystem(heavier(build_spec("two-link").compile(), load))


def observer(system: MechanismSystem, bandwidth: float = 30.0) -> object:
    return MomentumObserver.build(MomentumObserverConfig(bandwidth=bandwidth), mission_of(system))


def test_velocity_and_no_disturbance_are_found_where_the_model_is_right() -> None:
    system = arm()
    calls = recorded(mission_of(system), START, 2.0, input_at=held)
    *_, last = replayed(observer(system), calls)
    assert last.status is Status.OK
    assert last.x == pytest.approx(calls[-1].truth, abs=1e-4)
    assert last.extra["disturbance"] == pytest.approx(np.zeros(2), abs=5e-3)


def test_the_disturbance_is_the_torque_that_the_model_lacks() -> None:
    """At rest under its own load, the missing torque is the weight of what the model takes to be lighter."""
    true, believed = arm(1.5), arm()
    x, v = np.array([0.6, -0.4]), np.zeros(2)
    hold = -true.manifold.mass(x) @ true.force(x, v, np.zeros(2))
    calls = recorded(mission_of(true), np.concatenate([x, v]), 1.5, input_at=lambda t: hold)
    *_, last = replayed(observer(believed), calls)
    missing = believed.manifold.mass(x) @ (true.force(x, v, hold) - believed.force(x, v, hold))
    assert np.linalg.norm(missing) > 1.0
    assert last.extra["disturbance"] == pytest.approx(missing, rel=1e-3, abs=1e-3)
    assert last.x[2:] == pytest.approx(v, abs=1e-3)


def test_a_curved_space_without_a_mass_matrix_is_refused() -> None:
    with pytest.raises(FieldError, match=r"system = .*; allowed for momentum_observer: a mechanism"):
        observer(PointSystem(sphere(2), linear(1.0, 0)))
