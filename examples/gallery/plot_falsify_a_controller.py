"""
Falsify a controller: search for its worst flight
=================================================

A hundred drawn missions without a violation say little. A sampler that learns from the missions before finds the one
that hurts. Here a barrier filter flies through a canyon, and the search chooses where it starts; the certified planner
then flies the worst mission.
"""

import matplotlib.pyplot as plt
import numpy as np
import optuna

import mathnavi as mn

canyon = mn.load_terrain("canyon:3")


def mission(east: float, north: float) -> dict:
    """A flight to one target from 60 m above the ground at a place [m]."""
    start = (east, north, float(canyon.height(east, north)) + 60.0)
    return {"terrain": "canyon:3", "start": start, "target": (480.0, 560.0, float(canyon.height(480.0, 560.0)) + 62.0)}


def margin(trial: optuna.Trial) -> float:
    """Least clearance beyond the 50 m that were asked for [m]."""
    fields = mission(trial.suggest_float("east", 80.0, 560.0), trial.suggest_float("north", 60.0, 300.0))
    return mn.run("safe-flight", controller="barrier", **fields).summary["clearance_margin_m"]


optuna.logging.set_verbosity(optuna.logging.WARNING)
search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
search.optimize(margin, n_trials=28)
worst = search.best_params
runs = {name: mn.run("safe-flight", controller=name, **mission(**worst)) for name in ("barrier", "flight")}
for name, run in runs.items():
    print(f"{name}: margin {run.summary['clearance_margin_m']:.1f} m, succeeded: {run.success}")

# %%
# The starts that were tried, and the worst flight above the ground below it.

figure, (map_, side) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
east, north = np.transpose([(trial.params["east"], trial.params["north"]) for trial in search.trials])
margins = [trial.value for trial in search.trials]
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
