"""
Certify a plan that someone else made
======================================

The certificate takes any plan of constant accelerations. Its clearance is exact over every arc, not sampled, so a
ridge between two samples is found.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

z = np.full((61, 61), 100.0)
z[:, 33] = 780.0  # a narrow ridge from south to north
ridge = mn.HeightField(z, spacing=100.0, name="ridge")

plans = {
    height: mn.FlightPlan.from_inputs(t=[0, 10, 20], start=[1500, 3000, height, 0, 0, 0], u=[[20, 0, 0], [-20, 0, 0]])
    for height in (700.0, 800.0, 850.0)
}
for height, plan in plans.items():
    print(f"{height:.0f} m:", mn.certify(plan, ridge, clearance_min=50.0), sep="\n")

# %%
# Samples every two seconds see nothing of the ridge.

figure, axes = plt.subplots(figsize=(8, 3.5))
east = np.linspace(1000.0, 4000.0, 600)
axes.fill_between(east, ridge.height(east, np.full_like(east, 3000.0)), color="#b5b5a5", label="ground")
for height, plan in plans.items():
    samples = np.array([plan.state(t) for t in np.arange(0.0, 20.1, 2.0)])
    axes.plot(samples[:, 0], samples[:, 2], "o", label=f"{height:.0f} m, every 2 s")
axes.set(xlabel="east [m]", ylabel="height [m]")
axes.legend()
figure.tight_layout()
