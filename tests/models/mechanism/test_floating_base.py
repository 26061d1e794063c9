"""A floating base: its IMU reads what MuJoCo's own sensors read, its switches what its feet touch."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.floating_base import BaseImu, FloatingBase, FootSwitches, JointEncoders
from mathnavi.models.mechanism.system import MechanismSystem

BODY = """<mujoco><option timestep=".001"/><worldbody><body name="hull"><freejoint/><geom size=".1" mass="2"/>
{site}{more}</body></worldbody><sensor>{sensors}</sensor></mujoco>"""
SITE = '<site name="imu"/>'
IMU = '<gyro site="imu"/><accelerometer site="imu"/>'


@dataclass(frozen=True)
class Moving:
    """A ``StateView``."""

    x: Array
    acceleration: Array

    def sensed(self, name: str) -> Array:
        raise ValueError(name)


def test_the_imu_reads_what_mujoco_s_gyro_and_accelerometer_read() -> None:
    model, rng = build_model("quadruped"), np.random.default_rng(0)
    base, data = FloatingBase.from_model(model), mujoco.MjData(model)
    data.qpos[3:7] = rng.standard_normal(4)
    data.qpos[2], data.qvel[:] = 2.0, rng.standard_normal(model.nv)
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_forward(model, data)
    view = Moving(np.concatenate([data.qpos, data.qvel]), data.qacc.copy())
    read = BaseImu(base, 1e3).read(view, rng)
    noise = np.repeat([base.gyro, base.accelerometer], 3)
    assert (noise > 0.0).all()
    assert (np.abs(read - data.sensordata[:6]) < 4.0 * noise).all()
    silent = BaseImu(FloatingBase(model, base.mounting, base.offset, 0.0, 0.0, base.feet, base.radii), 1e3)
    np.testing.assert_allclose(silent.read(view, rng), data.sensordata[:6], atol=1e-9)


def test_a_foot_s_switch_is_closed_on_the_ground_only() -> None:
    model = build_model("quadruped")
    switches = FootSwitches(FloatingBase.from_model(model), 1e3)
    x = np.concatenate([model.qpos0, np.zeros(model.nv)])
    for height, expected in ((0.5, [0.0] * 4), (0.36, [1.0] * 4)):
        x[2] = height
        np.testing.assert_array_equal(switches.read(Moving(x, np.zeros(model.nv)), np.random.default_rng(0)), expected)
    x[7] = 0.4  # one hip turns, and its foot is lifted
    assert switches.read(Moving(x, np.zeros(model.nv)), np.random.default_rng(0)).tolist() == [0.0, 1.0, 1.0, 1.0]


def test_encoders_read_the_joints_and_not_the_base() -> None:
    system = MechanismSystem(build_model("quadruped"))
    mission = LagrangianMission(system, PositionQuality(noise=1e-3))
    x, n = mission.start_state, system.manifold.size
    read = JointEncoders(mission.sensor).read(Moving(x, x[n:]), np.random.default_rng(0))
    assert read is not None
    assert read.shape == (8,) == (JointEncoders(mission.sensor).size,)
    assert 0.0 < np.abs(read - x[7:n]).max() < 5e-3


@pytest.mark.refused("MJCF", "free base without IMU sensors, for the filter of a base")
@pytest.mark.parametrize(
    ("site", "more", "sensors", "message"),
    [
        ("", "", "", r"without an IMU on its base 'hull'; allowed .*<gyro> and an <accelerometer>"),
        (SITE, "", '<gyro site="imu"/>', r"without an IMU"),
        (SITE + '<site name="other"/>', "", '<gyro site="imu"/><accelerometer site="other"/>', r"at one site"),
        (
            SITE,
            '</body><body pos="1 0 0"><freejoint/><geom size=".1"/>',
            IMU,
            r"system = a mechanism with 2 free joints; allowed for floating_base_iekf: one, the first; riemannian",
        ),
    ],
)
def test_a_base_without_its_imu_is_refused(site: str, more: str, sensors: str, message: str) -> None:
    model = mujoco.MjModel.from_xml_string(BODY.format(site=site, more=more, sensors=sensors))
    with pytest.raises(FieldError, match=message):
        MechanismSystem(model).floating_base.has_joints  # noqa: B018


def test_a_fixed_base_is_refused() -> None:
    with pytest.raises(FieldError, match="0 free joints; allowed for floating_base_iekf"):
        FloatingBase.from_model(build_model("two-link"))
