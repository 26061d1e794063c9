"""
Curvature: geodesics and the observer's sign
============================================

Two geodesics that set out side by side come together on a sphere and move apart on the hyperbolic plane. So does the
error of an observer: its equation (D.6) has a curvature term, whose sign decides whether a fast motion is found.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

s = np.linspace(0.0, 2.0, 100)
_, geodesics = plt.subplots(figsize=(7, 3.8), layout="constrained")
for space in (mn.Sphere(2), mn.EuclideanSpace(2), mn.HyperbolicSpace(2)):
    p, (ahead, beside) = space.origin, np.eye(space.size)[-2:]
    q = space.exp(p, 0.1 * beside)
    direction = space.transport(p, q, ahead)
    apart = [space.distance(space.exp(p, length * ahead), space.exp(q, length * direction)) for length in s]
    geodesics.plot(s, apart, label=space.name)
geodesics.set(xlabel="length", ylabel="distance of two geodesics")
geodesics.legend()

# %%
# A point is pulled over S³ by the potential 25 cos(distance), four times as fast as the observer's bandwidth.

step, sphere = 0.01, mn.Sphere(3)
rng = np.random.default_rng(1)
p = sphere.draw(rng)
v = 4.0 * sphere.draw_vector(rng, p)


def pulled(x):
    """The potential of the force."""
    return 25.0 * x[0]


system = mn.IntrinsicObserver(sphere, bandwidth=1.0, potential=pulled).system
motion = [system.state(p, v)]
for _ in range(1500):
    motion.append(system.flow(motion[-1], np.zeros(4), step))
_, error = plt.subplots(figsize=(7, 3.8), layout="constrained")
for sign in ("minus-one", "none", "plus-one"):
    observer = mn.IntrinsicObserver(sphere, bandwidth=1.0, potential=pulled, curvature=sign)
    found = [observer.step(step, state[:4]).velocity for state in motion]
    errors = np.linalg.norm(np.array(found) - np.array(motion)[:, 4:], axis=1)
    print(f"C = {sign}: error {errors[-1]:.1e} after 15 s")
    error.semilogy(step * np.arange(len(errors)), errors, label=f"C = {sign}")
error.set(xlabel="t [s]", ylabel="error of the velocity [1/s]")
error.legend()
