"""
A robot finds itself in your room
=================================

The room is a closed curve through corners that you measured. The robot has two range sensors and odometry, and
knows nothing of where it begins. A bank of hypotheses rules poses out until one is left.
"""

import matplotlib.pyplot as plt
import numpy as np

import mathnavi as mn

corners = [(0.0, 0.0), (4.0, -0.2), (4.6, 2.0), (2.4, 3.2), (0.2, 2.4)]  # [m]
wall = mn.wall_through(corners, order=8)
angles, pose = [0.0, np.pi / 2], np.array([1.5, 1.0, 0.3])
bank = mn.FeasibleSetBank(wall, angles, range_noise=0.01, period=0.02)
path, errors = [], []
for _ in range(400):
    pose = pose + 0.02 * np.array([0.5 * np.cos(pose[2]), 0.5 * np.sin(pose[2]), 0.6])
    estimate = bank.step(0.02, wall.ranges(pose, angles)[0], odometry=[0.5, 0.6])
    path.append(pose)
    errors.append(np.hypot(*(estimate.pose - pose)[:2]))
print(estimate)

# %%

path = np.array(path)
figure, (room, error) = plt.subplots(1, 2, figsize=(9, 3.8))
room.fill(*np.array(corners).T, fill=False, linestyle=":", label="corners")
room.plot(path[:, 0], path[:, 1], color="#d95f0e", label="driven")
room.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
room.legend()
error.semilogy(0.02 * np.arange(400), errors)
error.set(xlabel="t [s]", ylabel="error of the position [m]")
figure.tight_layout()
