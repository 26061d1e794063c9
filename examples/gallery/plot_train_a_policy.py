"""
Train a tiny policy
===================

Forty-eight missions fly at once, each with another policy of three numbers: how fast, how high, and how hard to climb
where the ground rises. The cross-entropy method keeps the best eight and draws the next from around them.
``examples/learn/train_safe_flight.py`` trains a network by PPO on the same missions.
"""

import gymnasium
import matplotlib.pyplot as plt
import numpy as np

import mathnavi.sim.environments  # noqa: F401 (it registers them)

ROWS, KEPT, ROUNDS = 48, 8, 6
envs = gymnasium.make_vec(
    "mathnavi/SafeFlight-v1", num_envs=ROWS, vectorization_mode="vector_entry_point", seed=0, missions=8,
    terrain="jacksboro", target=(13320.0, 11610.0, 642.0), drawn_separation=(0.15, 0.3), hold=1.0,
)  # fmt: skip


def returns(policies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns (n,) and outcomes (n,) of one mission with each of the policies (n, 3)."""
    observed, _ = envs.reset(seed=0)
    total, outcome = np.zeros(ROWS), np.full(ROWS, "", dtype=object)
    speed, height, climb = policies.T
    while (outcome == "").any():
        way, v = observed["target"].copy(), observed["velocity"]
        lowest = observed["clearance_ahead"].min(axis=1)
        far = np.hypot(way[:, 0], way[:, 1]) > 1500.0
        way[:, 2] = np.where(far, np.hypot(way[:, 0], way[:, 1]) * climb * (height - lowest) / 1000.0, way[:, 2])
        wanted = np.clip(speed, 10.0, 250.0)[:, None] * way / np.linalg.norm(way, axis=1, keepdims=True)
        observed, reward, ended, _, info = envs.step(0.5 * (wanted - v))
        flying = outcome == ""
        total += flying * reward
        if (flying & ended).any():
            outcome[flying & ended] = info["final_info"]["outcome"][flying & ended]
    return total, outcome


rng = np.random.default_rng(0)
mean, deviation, curve = np.array([100.0, 100.0, 0.5]), np.array([50.0, 100.0, 0.5]), []
for k in range(ROUNDS):
    policies = mean + deviation * rng.standard_normal((ROWS, 3))
    total, outcome = returns(policies)
    best = policies[np.argsort(total)[-KEPT:]]
    mean, deviation = best.mean(axis=0), best.std(axis=0) + np.array([2.0, 5.0, 0.02])
    curve.append([100.0 * np.mean(outcome == name) for name in ("arrived", "crashed", "late")])
    print(f"round {k}: mean return {total.mean():.2f}, arrived {curve[-1][0]:.0f} %")
print(f"speed {mean[0]:.0f} m/s, height {mean[1]:.0f} m, climb {mean[2]:.2f}")

# %%

figure, axes = plt.subplots(figsize=(7, 3.5))
for name, shares in zip(("arrived", "crashed", "late"), np.transpose(curve), strict=True):
    axes.plot(shares, "o-", label=name)
axes.set(xlabel="round", ylabel="missions [%]")
axes.legend()
figure.tight_layout()
