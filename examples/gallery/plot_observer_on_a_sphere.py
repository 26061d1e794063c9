"""
Observe a velocity on a sphere
==============================

A point moves along a great circle. The observer is shown where it is, fifty times a second, and finds how fast it
moves; nothing in it depends on coordinates.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

times = np.arange(0.0, 4.0, 0.02)
truth = 2.0 * np.stack([-np.sin(2.0 * times), np.cos(2.0 * times), 0.0 * times], axis=1)  # [1/s]
errors = {}
for bandwidth in (1.0, 3.0, 10.0):
    observer = mn.IntrinsicObserver(mn.Sphere(2), bandwidth=bandwidth)
    found = [observer.step(0.02, [np.cos(2.0 * t), np.sin(2.0 * t), 0.0]).velocity for t in times]
    errors[bandwidth] = np.linalg.norm(found - truth, axis=1)
    print(f"bandwidth {bandwidth:4.0f} 1/s: error {errors[bandwidth][-1]:.1e} 1/s after 4 s")

# %%
# A higher bandwidth finds it sooner, and would pass on more noise.

figure, axes = plt.subplots(figsize=(7, 3.5))
for bandwidth, error in errors.items():
    axes.semilogy(times, error, label=f"bandwidth {bandwidth:g} 1/s")
axes.set(xlabel="t [s]", ylabel="error of the velocity [1/s]")
axes.legend()
figure.tight_layout()
