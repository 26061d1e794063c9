"""The motion that all tasks of a unicycle share."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.quality import KnownStart


class UnicycleMotion:
    """A robot with the pose x = (x_1, x_2, phi) [m, m, rad] that drives at u = (u_1, u_2) [m/s, rad/s]."""

    state_names: ClassVar[tuple[str, ...]] = ("x [m]", "y [m]", "heading [rad]")
    """names of the numbers of a pose"""

    start: KnownStart | None

    @property
    def begins(self) -> float | None:
        """Time [s] of the known start; None if it is that of the first update."""
        return None if self.start is None else self.start.t

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """Pose (3,) [m, m, rad] after the input u (2,) [m/s, rad/s] was held for dt [s] from x (3,)."""
        after: Array = integrate(np.asarray(x, np.float64), float(u[0]), float(u[1]), dt)
        return after
