"""An arm to which a test adds what an MJCF file may say, and MuJoCo's own motion of it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from mathnavi.models.mechanism.entity import build_model

ARM = """<mujoco>{}<worldbody>{}
  <body name="upper" pos="0 0 1">
    <joint name="a" axis="0 1 0"/><geom type="capsule" size=".04" fromto="0 0 0 .1 0 -.5" mass="1"/>
    <body name="lower" pos="0 0 -.5">
      <joint name="b" axis="0 1 0"/><geom type="box" size=".03 .1 .2" mass=".6"/><site name="tip" pos="0 0 -.2"/>
    </body>
  </body>
</worldbody>{}</mujoco>"""
GROUND = '<geom name="ground" type="plane" size="5 5 1"/>'


def assert_moves_alike(path: Path) -> None:
    """Positions and sensors after 60 steps under constant commands are those of MuJoCo's own model of the file."""
    ends = []
    for model in (mujoco.MjModel.from_xml_path(str(path)), build_model(path)):
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.3
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_step(model, data, 60)
        ends.append((data.qpos, data.sensordata))
    for own, built in zip(*ends, strict=True):
        np.testing.assert_allclose(built, own, rtol=1e-9, atol=1e-12)  # rounding: bodies hang below one more frame
