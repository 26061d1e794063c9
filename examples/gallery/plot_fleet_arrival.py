"""
A fleet agrees on its time of arrival
=====================================

Each vehicle knows how soon it could arrive, and talks to its neighbours only. By max-consensus all of them learn the
largest of these times, and every vehicle stretches its flight to it.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

run = mn.run("simultaneous-arrival", terrain="jacksboro", seed=2, vehicles=3, graph="line")
print(f"arrivals within {1e3 * run.summary['spread_s']:.0f} ms, after {run.summary['arrival_time_s']:.1f} s")
print(f"never nearer to each other than {run.summary['separation_min_m']:.0f} m")

# %%
# The ways over the map, and how far each vehicle still has to go: those that are near take their time.

terrain = mn.load_terrain("jacksboro")
figure, (map_, left) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
axes = [1e-3 * terrain.spacing * np.arange(n) for n in terrain.z.shape[::-1]]
map_.contourf(*axes, terrain.z, levels=12, cmap="Greys")
for k in (1, 2, 3):
    path = run[f"vehicle_{k}.truth.x"][:, :3]
    (line,) = map_.plot(*1e-3 * path[:, :2].T, label=f"vehicle {k}")
    map_.plot(*1e-3 * path[0, :2], "o", color=line.get_color())
    left.plot(run.t, 1e-3 * np.linalg.norm(path - path[-1], axis=1), label=f"vehicle {k}")
map_.set(xlabel="east [km]", ylabel="north [km]", aspect="equal")
map_.legend()
left.axvline(run.summary["arrival_time_s"], color="black", linestyle=":", label="arrival")
left.set(xlabel="t [s]", ylabel="distance from the end [km]")
left.legend()
