"""
A safety filter around someone's policy
========================================

The policy flies straight at the target and knows nothing of mountains. The filter lets each command pass if a certified
way to rest is left behind it, and else flies the nearest command that leaves one.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

x, y = np.meshgrid(np.arange(201) * 60.0, np.arange(201) * 60.0)  # [m] east, north
hills = mn.HeightField(500.0 + 250.0 * np.sin(x / 900.0) * np.cos(y / 1100.0), spacing=60.0, name="hills")
target, period = np.array([10000.0, 9000.0, 660.0]), 0.1


def policy(x: np.ndarray) -> np.ndarray:
    """Accelerations [m/s^2] towards 150 m/s straight at the target."""
    way = target - x[:3]
    return 0.5 * (150.0 * way / max(np.linalg.norm(way), 1000.0) - x[3:])


def flown(safe: mn.SafetyFilter | None) -> tuple[np.ndarray, np.ndarray]:
    """States (n, 6) and the changes of the commands (n,) [m/s^2] of a flight."""
    x, states, changes = np.array([1500.0, 1500.0, 640.0, 0.0, 0.0, 0.0]), [], []
    for k in range(1200):
        proposed = policy(x)
        u = proposed if safe is None else safe.step(k * period, x, proposed)[0]
        states.append(x)
        changes.append(np.linalg.norm(u - proposed))
        x = np.concatenate([x[:3] + period * x[3:] + period**2 / 2 * u, x[3:] + period * u])
    return np.array(states), np.array(changes)


bare, _ = flown(None)
filtered, changes = flown(mn.SafetyFilter(hills, target, clearance_min=50.0, period=period))

# %%
# Without the filter the path leads through the hills. With it the vehicle stays 50 m above them and arrives.

figure, (height, change) = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
t = period * np.arange(len(bare))
for name, states in (("policy alone", bare), ("behind the filter", filtered)):
    above = states[:, 2] - hills.height(states[:, 0], states[:, 1])
    print(f"{name}: {above.min():.0f} m above ground at least, {np.linalg.norm(states[-1, :3] - target):.0f} m left")
    height.plot(t, above, label=name)
height.axhline(50.0, color="black", linestyle=":", label="asked for")
height.set(ylabel="height above ground [m]")
height.legend()
change.plot(t, changes, color="C1")
change.set(xlabel="t [s]", ylabel="change of the command [m/s²]")
