"""
Four problems of the literature
===============================

Problems with known optima come with the software; each is one file that reads like its definition.
"""

import matplotlib.pyplot as plt

import mathnavi as mn

figure, axes = plt.subplots(2, 2, figsize=(9, 6))
names = "Goddard", "brachistochrone", "double integrator, energy", "hypersensitive"
for panel, name in zip(axes.flat, names, strict=True):
    solution = mn.OptimalControlProblem(name).solve()
    print(f"{name}: {solution.method}, {solution.status.name}, J = {solution.cost:.6g}")
    panel.plot(solution.t, solution.x)
    panel.set(title=name, xlabel="t")
figure.tight_layout()
