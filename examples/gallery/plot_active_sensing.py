"""
Active sensing against a fixed circle
=====================================

A robot with two range sensors does not know where it is. How soon it finds out depends on how it drives: it may circle,
or choose, five times a second, the input from which its estimator will learn most.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

seeds, colours = range(3), {"active": "#d95f0e", "circle": "#2b6cb0"}
figure, (room, error) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
angle = np.linspace(0.0, 2.0 * np.pi, 200)
room.plot(3.763 * np.cos(angle), 2.0**0.5 * np.sin(angle), color="black")
for mode, colour in colours.items():
    found = []
    for seed in seeds:
        run = mn.run("range-localisation", seed=seed, duration=5.0, controller=mn.plugin("active_sensing", mode=mode))
        found.append(run.summary["convergence_time_s"])
        truth = run["truth.x"][np.searchsorted(run.t, run["estimate.t"] - 1e-9), :2]
        estimate = run["estimate.x"][:, :2]
        # the wall is an ellipse, so a pose and the one half a turn from it read the same ranges
        errors = np.minimum(*(np.linalg.norm(sign * estimate - truth, axis=1) for sign in (1.0, -1.0)))
        error.semilogy(run["estimate.t"], errors, color=colour, label=mode if seed == 0 else None)
        room.plot(*run["truth.x"][:, :2].T, color=colour)
    print(f"{mode}: the pose is known after {', '.join(f'{t:.2f} s' for t in found)}")
room.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
error.set(xlabel="t [s]", ylabel="error of the position [m]")
error.legend()
