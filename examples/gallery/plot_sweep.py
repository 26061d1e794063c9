"""
Sweep a field and plot the figures
==================================

Many seeds of one scenario, with a field that takes listed values. Each trial is stored as it ends; run again, the
sweep flies only what the store lacks.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

if __name__ == "__main__":  # trials are run in processes of their own
    noises = [0.0, 0.01, 0.05]
    swept = mn.sweep("textbook-observer", trials=4, vary={"noise": noises}, workers=2, duration=5.0)
    print(swept)

    figures = np.reshape(swept.figures("error_end"), (len(noises), -1))
    figure, axes = plt.subplots(figsize=(6, 3.5))
    axes.boxplot(figures.T, tick_labels=[f"{noise:g}" for noise in noises])
    axes.set(xlabel="noise of the output", ylabel="error at the end")
    figure.tight_layout()
