"""
Guide a missile to a target that moves
======================================

The missile plans its optimal flight ten times a second, and dives on the target at 90 degrees. The target sets off
after three seconds. One planner aims at where the target will be, the other at where it is.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

begins, speed = 3.0, 20.0  # [s], [m/s]
runs = {
    name: mn.run(
        "missile-guidance", controller=mn.plugin("missile", lead=lead), target_change=((begins, speed, 0.0, 0.0),)
    )
    for name, lead in (("leads", True), ("does not lead", False))
}
for name, run in runs.items():
    figures = run.summary
    print(f"{name}: missed by {figures['miss_m']:.2f} m, {figures['aspect_error_deg']:.1f} deg off the vertical")

# %%

figure, (path, near) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
for name, run in runs.items():
    x, z = run["truth.x"][:, :2].T
    target = 700.0 + speed * np.maximum(run.t - begins, 0.0)
    path.plot(x, z, label=name)
    near.plot(x - target, z, label=name)
path.plot([700.0, target[-1]], [0.0, 0.0], color="black", linewidth=3, label="the target's way")
path.set(xlabel="x [m]", ylabel="height [m]")
path.legend()
near.plot(0.0, 0.0, "kx", markersize=10)
near.set(xlabel="x relative to the target [m]", ylabel="height [m]", xlim=(-40, 20), ylim=(-5, 100))
