"""
Joint velocities of your own mechanism
======================================

Any MJCF file of slide, hinge and ball joints will do: its mass matrix is the metric. Here a double pendulum is
pushed, and its encoders are read a thousand times a second.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import mathnavi as mn

MODEL = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body>
      <joint name="upper" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.4" mass="1"/>
      <body pos="0 0 -0.4">
        <joint name="lower" axis="0 1 0" damping="0.05"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="upper"/></actuator>
</mujoco>
"""
file = Path(tempfile.mkdtemp()) / "pendulum.xml"
file.write_text(MODEL)

model = mujoco.MjModel.from_xml_path(str(file))
data = mujoco.MjData(model)
data.qvel[:] = 2.0, -1.0  # [rad/s], which the observer does not know
observer = mn.VelocityObserver(str(file), bandwidth=50.0)
truth, found = [], []
for k in range(1000):
    data.ctrl[:] = 2.0 * np.cos(0.01 * k)  # [N m]
    mujoco.mj_step(model, data)
    truth.append(data.qvel.copy())
    found.append(observer.step(model.opt.timestep, data.qpos, data.ctrl).velocity)
truth, found = np.array(truth), np.array(found)
print("error in the second half:", np.abs(found - truth)[500:].max().round(3), "rad/s at most")

# %%

figure, axes = plt.subplots(figsize=(7, 3.5))
for joint, name in enumerate(("upper", "lower")):
    axes.plot(0.001 * np.arange(1000), truth[:, joint], color=f"C{joint}", label=f"{name}, true")
    axes.plot(0.001 * np.arange(1000), found[:, joint], "--", color=f"C{joint}", label=f"{name}, estimated")
axes.set(xlabel="t [s]", ylabel="joint velocity [rad/s]")
axes.legend(ncols=2)
figure.tight_layout()
