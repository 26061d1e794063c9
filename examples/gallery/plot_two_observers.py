"""
Compare two observers on one scenario
=====================================

Both see the same readings of the same system. Your own observer is passed in the same way,
``estimator=MyObserver``: a class with a ``Config`` and a static ``build``.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

runs = {
    name: mn.run("textbook-observer", seed=3, estimator=name, duration=5.0) for name in ("textbook_ekf", "example_2_2")
}
figure, axes = plt.subplots(figsize=(7, 3.5))
for name, run in runs.items():
    truth = run["truth.x"][np.searchsorted(run.t, run["estimate.t"] - 1e-9)]
    error = np.linalg.norm(run["estimate.x"] - truth, axis=1)
    print(name, f"error {error[-1]:.2e} at the end")
    axes.semilogy(run["estimate.t"], error, label=name)
axes.set(xlabel="t [s]", ylabel="error of the estimate")
axes.legend()
figure.tight_layout()
