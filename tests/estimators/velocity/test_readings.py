from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.estimators.velocity.readings import OutlierCounter, SpeedGate, reading_variance
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.system import MechanismSystem
from tests.estimators.velocity.runs import mission_of, moving


def test_what_is_refused_ten_times_in_a_row_is_believed_from_then_on() -> None:
    counter = OutlierCounter()
    assert counter.admits(True)
    assert [counter.admits(False) for _ in range(12)] == [False] * 10 + [True] * 2
    assert counter.admits(True)
    assert not counter.admits(False)


def test_a_reading_is_refused_that_the_system_cannot_have_come_to() -> None:
    """At 10 rad/s a body turns by 0.1 rad in a hundredth of a second. Twice that passes."""
    system, start = moving("rigid body", 0.0)
    gate = SpeedGate(mission_of(system), start[:4])
    assert gate.passes(np.array([0.19, 0.0, 0.0]), 0.01)
    assert not gate.passes(np.array([0.21, 0.0, 0.0]), 0.01)


def test_noise_alone_is_not_refused() -> None:
    system, start = moving("flat", 0.0)
    gate = SpeedGate(mission_of(system, noise=0.1), start[:2])
    differences = 0.1 * np.random.default_rng(1).standard_normal((1000, 2, 2))
    assert all(gate.passes(b - a, 0.0) for a, b in differences)


RAIL = """
<mujoco>
  <worldbody>
    <body><joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <body><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def test_rounding_counts_as_a_twelfth_of_a_step_squared_of_each_encoder() -> None:
    """A step is a share of a metre of a slide, and of a turn of a hinge."""
    system = MechanismSystem(mujoco.MjModel.from_xml_string(RAIL))
    mission = LagrangianMission(system, PositionQuality(noise=1e-4, resolution=12))
    steps = np.array([1.0, 2.0 * np.pi]) / 2**12
    variance = reading_variance(mission, system.manifold.origin)
    np.testing.assert_allclose(variance, 1e-8 + np.square(steps) / 12.0, rtol=0.1)


def test_without_encoders_there_is_only_noise() -> None:
    system, start = moving("rigid body", 0.0)
    np.testing.assert_allclose(reading_variance(mission_of(system, noise=0.1), start[:4]), 0.01)
    with pytest.raises(ValueError, match="resolution"):
        reading_variance(mission_of(system, resolution=8), start[:4])
