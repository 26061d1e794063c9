"""
State and solve an optimal control problem
==========================================

Bryson and Denham's problem: bring a mass back to where it was, with the least effort, without passing a wall. It is
written as on paper. The solution is replayed through its dynamics, and is optimal only if the replay is within the
tolerance.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn


def bryson_denham(wall: float) -> mn.OptimalControlProblem:
    """The problem with a wall at a distance."""
    ocp = mn.OptimalControlProblem("Bryson-Denham")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2 / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.constrain(x <= wall)
    for state, begin, end in ((x, 0.0, 0.0), (v, 1.0, -1.0)):
        ocp.start(state, begin)
        ocp.end(state, end)
    return ocp


times = np.linspace(0.0, 1.0, 101)
figure, axes = plt.subplots(figsize=(7, 3.5))
for wall in (1 / 5, 1 / 7, 1 / 9):
    solution = bryson_denham(wall).solve()
    print(
        f"wall at {wall:.3f}: {solution.status.name}, J = {solution.cost:.4f}, replay miss {solution.replay.miss:.0e}"
    )
    axes.plot(times, [solution.state(t)[0] for t in times], label=f"wall at {wall:.3f}")
axes.set(xlabel="t", ylabel="x")
axes.legend()
figure.tight_layout()
