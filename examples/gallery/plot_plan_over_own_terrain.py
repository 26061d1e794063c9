"""
Plan a flight over your own elevation model
===========================================

A terrain is an array of heights on a square grid. The plan leads to rest at the target, and its clearance is
certified for every instant. ``mn.import_terrain`` makes such a terrain from a GeoTIFF or an SRTM tile.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

x, y = np.meshgrid(np.arange(201) * 60.0, np.arange(201) * 60.0)  # [m] east, north
terrain = mn.HeightField(500.0 + 250.0 * np.sin(x / 900.0) * np.cos(y / 1100.0), spacing=60.0, name="hills")

plan = mn.plan_flight(terrain, start=(1500, 1500, 800), target=(10000, 9000, 900), speed_max=250.0)
print(plan)

# %%
# The way over the map, and the height above the sea along it.

t = np.linspace(0.0, plan.duration, 300)
states = np.array([plan.state(each) for each in t])
figure, (above, beside) = plt.subplots(1, 2, figsize=(10, 4))
above.pcolormesh(x[0] / 1e3, y[:, 0] / 1e3, terrain.z, cmap="terrain", shading="nearest")
above.plot(states[:, 0] / 1e3, states[:, 1] / 1e3, color="#d95f0e")
above.set(xlabel="east [km]", ylabel="north [km]", aspect="equal")
beside.fill_between(t, terrain.height(states[:, 0], states[:, 1]), color="#b5b5a5", label="ground")
beside.plot(t, states[:, 2], color="#d95f0e", label="plan")
beside.set(xlabel="t [s]", ylabel="height [m]", ylim=(0, None))
beside.legend()
figure.tight_layout()
