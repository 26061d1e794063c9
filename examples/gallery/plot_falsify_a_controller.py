"""
Falsify a controller: search for its worst flight
=================================================

A hundred drawn missions without a violation say little. A sampler that learns from the missions before finds the one
that hurts. Here a barrier filter flies through a canyon, and the search chooses where it starts; the certified planner
then flies the worst mission.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn
from mathnavi.sim.search.samplers import make_sampler
from mathnavi.sim.search.space import Range, drawn

canyon = mn.load_terrain("canyon:3")


def mission(east: float, north: float) -> dict:
    """A flight to one target from 60 m above the ground at a place [m]."""
    start = (east, north, float(canyon.height(east, north)) + 60.0)
    return {"terrain": "canyon:3", "start": start, "target": (480.0, 560.0, float(canyon.height(480.0, 560.0)) + 62.0)}


def margin(place: dict) -> float:
    """Least clearance beyond the 50 m that were asked for [m]."""
    return mn.run("safe-flight", controller="barrier", **mission(**place)).summary["clearance_margin_m"]


space = [Range("east", 80.0, 560.0), Range("north", 60.0, 300.0)]
sampler = make_sampler("sobol-cmaes", len(space), seed=1)
places, margins = [], []
for _ in range(28):
    shares = sampler.ask()
    places.append(drawn(space, shares))
    margins.append(margin(places[-1]))
    sampler.tell(shares, margins[-1])
worst = places[int(np.argmin(margins))]
runs = {name: mn.run("safe-flight", controller=name, **mission(**worst)) for name in ("barrier", "flight")}
for name, run in runs.items():
    print(f"{name}: margin {run.summary['clearance_margin_m']:.1f} m, succeeded: {run.success}")

# %%
# The starts that were tried, and the worst flight above the ground below it.

figure, (map_, side) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
east, north = np.transpose([(place["east"], place["north"]) for place in places])
axis = canyon.spacing * np.arange(len(canyon.z))
map_.contourf(axis, axis, canyon.z, levels=12, cmap="Greys")
points = map_.scatter(east, north, c=margins, cmap="coolwarm_r", vmin=-15.0, vmax=15.0, edgecolor="black")
map_.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
figure.colorbar(points, label="margin of a flight from here [m]")
for name, run in runs.items():
    x, y, z = run["truth.x"][:, :3].T
    side.plot(run.t, z - canyon.height(x, y), label=name)
side.axhline(50.0, color="black", linestyle=":", label="asked for")
side.set(xlabel="t [s]", ylabel="height above ground [m]")
side.legend()
