"""What a planner believes of the pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.interfaces.signals import Array, Estimate


@dataclass(frozen=True)
class Belief:
    """A pose x = (x_1, x_2, phi) [m, m, rad] and how sure it is."""

    pose: Array  # (3,)
    covariance: Array  # (3, 3) of the error of the pose, positive definite
    is_found: bool = True  # False while the estimator has no estimate, or has lost its sensors

    @property
    def position_deviation(self) -> float:
        """[m] the standard deviation in the direction in which it is the largest."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))

    @property
    def heading_deviation(self) -> float:
        """[rad]"""
        return math.sqrt(float(self.covariance[2, 2]))


def checked_pose(estimate: Estimate) -> Array:
    """The estimate's pose (3,); ValueError for any other shape, which compiled code would read beyond."""
    if estimate.x.shape != (3,):
        raise ValueError(f"the estimate's state has shape {estimate.x.shape}; allowed: (3,)")
    return np.asarray(estimate.x, np.float64)
