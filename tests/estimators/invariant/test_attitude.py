"""The filter on SO(3) beside that in the tangent bundle, and of a body with three moments of inertia."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.estimators.invariant.attitude import AttitudeIekf
from mathnavi.estimators.velocity.kalman import LagrangianEkf
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import sphere
from mathnavi.models.manifold.systems import PointSystem, linear
from mathnavi.models.mechanism.system import MechanismSystem
from tests.estimators.velocity.runs import mission_of, moving, recorded, replayed, velocity_error

BALL = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="ball" type="ball"/>
<inertial pos="0 0 0" mass="1" diaginertia="{}"/></body></worldbody><actuator>
<motor joint="ball" gear="1 0 0"/><motor joint="ball" gear="0 1 0"/><motor joint="ball" gear="0 0 1"/>
</actuator></mujoco>"""


def tumbling(moments: str) -> tuple[MechanismSystem, Array]:
    system = MechanismSystem(mujoco.MjModel.from_xml_string(BALL.format(moments)))
    return system, np.array([1.0, 0.0, 0.0, 0.0, 1.0, -2.0, 1.5])


def test_of_a_sphere_in_free_motion_it_says_what_the_filter_in_the_tangent_bundle_says() -> None:
    """Both hold the error in the body's own axes, and the motion is linear in it."""
    system, start = moving("rigid body", 1.0)
    mission = mission_of(system, noise=0.005)
    calls = recorded(mission, start, 2.0)
    one = replayed(AttitudeIekf.build(AttitudeIekf.Config(), mission), calls)[-1]
    other = replayed(LagrangianEkf.build(LagrangianEkf.Config(), mission), calls)[-1]
    np.testing.assert_allclose(one.x, other.x, atol=2e-3)
    np.testing.assert_allclose(one.extra["deviation"], other.extra["deviation"], rtol=0.02)


def test_a_body_with_three_moments_is_found_without_noise() -> None:
    system, start = tumbling("0.01 0.05 0.055")
    mission = mission_of(system)
    calls = recorded(mission, start, 2.0)
    *_, last = replayed(AttitudeIekf.build(AttitudeIekf.Config(), mission), calls)
    assert velocity_error(system.manifold, last, calls[-1].truth) < 1e-5


def test_what_it_believes_of_its_readings_is_what_is_true() -> None:
    """The innovations are chi-square distributed, of 3 degrees: their mean is 3."""
    system, start = tumbling("0.03 0.04 0.05")
    mission = mission_of(system, noise=0.01)
    calls = recorded(mission, start, 4.0)
    found = replayed(AttitudeIekf.build(AttitudeIekf.Config(acceleration=0.01), mission), calls)
    settled = np.array([estimate.extra["nis"][0] for estimate in found[100:]])
    assert np.mean(settled) == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / len(settled)))


def test_a_system_that_does_not_turn_is_refused() -> None:
    mission = mission_of(PointSystem(sphere(2), linear(1.0, 0)))
    with pytest.raises(FieldError, match=r"system = one on .*; allowed: a rotating body"):
        AttitudeIekf.build(AttitudeIekf.Config(), mission)
