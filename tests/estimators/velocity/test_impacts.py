"""A body that bounces: the time of an impact is not known within a step, and an estimate says so."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.manifold.mission import POSITION, LagrangianMission, PositionQuality
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load

BALL = """<mujoco><option timestep="0.001"/><worldbody><geom type="plane" size="1 1 1" solref="-4000 -1"/>
<body pos="0 0 0.5"><joint name="height" type="slide" axis="0 0 1"/><geom size="0.05" mass="0.3" solref="-4000 -1"/>
</body></worldbody></mujoco>"""
H, SECONDS, STEP = 1e-3, 4.0, 1e-4  # [s], [s], [m] of the encoder


@pytest.mark.parametrize("name", ["riemannian_observer", "momentum_observer"])
def test_a_ball_that_bounces_as_it_is_modelled_raises_no_alarm_and_stays_within_its_deviations(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(noise=STEP), H)
    plugin = load("estimators", name)
    observer, data, rng = plugin.build(plugin.Config(), mission), mujoco.MjData(model), np.random.default_rng(3)
    bounces, before, right, ok = 0, 0.0, [], []
    for k in range(round(SECONDS / H)):
        y = data.qpos + STEP * rng.standard_normal(1)
        estimate = observer.update(k * H, (Measurement(POSITION, k * H, y),), np.zeros(0))
        error, bound = abs(estimate.x[1] - data.qvel[0]), 3.0 * estimate.extra["deviation"][1]
        right.append(error < max(bound, 1e-3 * 3.2))
        ok.append(estimate.status is Status.OK)
        mujoco.mj_step(model, data)
        bounces += before < -0.3 and data.qvel[0] > 0.3
        before = data.qvel[0] if abs(data.qvel[0]) > 0.3 else before
    assert bounces > 4
    assert np.mean(ok[round(1.0 / H) :]) == 1.0
    assert np.mean(right[round(1.0 / H) :]) > 0.99
