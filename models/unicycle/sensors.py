"""Sensors of the unicycle: MuJoCo's rangefinders and wheel encoders with the errors that a mission declares."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.drives import inputs_of
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality


@dataclass(frozen=True)
class RangeSensor:
    """Ranges (l,) [m] of the rangefinders ``range_0``, ..., NaN where a ray was lost or met nothing.

    Each errs by a Gaussian of variance (relative rho)^2 + absolute^2; a fraction ``outliers`` is uniform between zero
    and ``longest`` instead, and a fraction ``dropout`` is lost. The random numbers drawn do not depend on the size of
    the errors, so runs that differ in them only see the same noise.
    """

    size: int  # l
    quality: RangeQuality
    longest: float  # [m] longest range in sight
    rate: float | None  # [Hz]; None: every control step
    name: str = "ranges"
    partial: ClassVar[bool] = True  # single values of a reading may be NaN

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the ranges (l,) [m] of ``motion``; ``rng`` draws noise, outliers and losses."""
        quality = self.quality
        rho = np.array([motion.sensed(f"range_{i}")[0] for i in range(self.size)])
        rho[rho < 0.0] = np.nan  # MuJoCo's value for a ray that meets nothing
        deviation = np.hypot(quality.relative * rho, quality.absolute)
        reading = rho + deviation * rng.standard_normal(self.size)
        chance, any_value = rng.random(self.size), rng.random(self.size)
        reading = np.where(chance < quality.outliers, self.longest * any_value, reading)
        return np.where(rng.random(self.size) < quality.dropout, np.nan, reading)


@dataclass
class WheelOdometry:
    """Sensor of the mean input (u_1, u_2) (2,) [m/s, rad/s] over the last period, by wheels that do not slip.

    A reading is (1 + bias) u + noise, the sign of the bias drawn once a run. The first one only notes where the wheels
    are, so there is none. It remembers the wheels: it belongs to one vehicle and one run.
    """

    quality: OdometryQuality
    rate: float  # [Hz]
    name: str = "odometry"
    size: int = 2
    _before: Array | None = field(default=None, init=False, repr=False)  # (2,) [rad] of the wheels at the last reading
    _bias: float = field(default=0.0, init=False, repr=False)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the mean input (2,) [m/s, rad/s] of ``motion`` since the last reading; None for the first."""
        wheels = np.concatenate([motion.sensed("wheel_left"), motion.sensed("wheel_right")])
        before, self._before = self._before, wheels
        if before is None:
            self._bias = self.quality.bias * float(rng.choice((-1.0, 1.0)))
            return None
        u = (1.0 + self._bias) * inputs_of((wheels - before) * self.rate)
        noisy: Array = u + np.array(self.quality.noise) * rng.standard_normal(2)
        return noisy
