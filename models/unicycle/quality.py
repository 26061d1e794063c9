"""Declared quality of a unicycle's sensors, and its known start: shared by its mission and its sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mathnavi.interfaces.errors import FieldError


@dataclass(frozen=True)
class RangeQuality:
    """Declared errors of a range: Gaussian of variance (relative rho)^2 + absolute^2, losses and outliers."""

    relative: float = 0.0  # of the range
    absolute: float = 0.0  # [m]
    dropout: float = 0.0  # fraction of single ranges that are lost, NaN in the reading
    outliers: float = 0.0  # fraction of single ranges that are any value up to the longest in sight
    maximum: float | None = None  # [m] greatest range, beyond which a ray has no echo; None: no limit


@dataclass(frozen=True)
class OdometryQuality:
    """Declared errors of odometry: u_measured = (1 + bias) u + noise, per reading."""

    noise: tuple[float, float] = (0.0, 0.0)  # [m/s, rad/s] standard deviations
    bias: float = 0.0  # relative, of both; an estimator does not know its sign
    slip: tuple[float, float] = (0.0, 0.0)  # [m/s, rad/s] standard deviations of what wheels miss, as declared

    def __post_init__(self) -> None:
        for name in ("noise", "slip"):
            pair = getattr(self, name)
            if len(pair) != 2 or not all(math.isfinite(each) and each >= 0.0 for each in pair):
                raise FieldError(f"odometry {name} = {pair!r}; allowed: two finite values >= 0")
        if not math.isfinite(self.bias):
            raise FieldError(f"odometry bias = {self.bias!r}; allowed: a finite value")


@dataclass(frozen=True)
class KnownStart:
    """A pose that estimators are given, and its standard deviations."""

    pose: tuple[float, float, float]  # [m, m, rad]
    deviation: tuple[float, float, float] = (0.3, 0.3, 0.3)  # standard deviations
    t: float | None = None  # [s] at which the robot is there; None: at the first update, or at 0 s

    def __post_init__(self) -> None:
        if len(self.pose) != 3 or not all(math.isfinite(each) for each in self.pose):
            raise FieldError(f"pose = {self.pose!r} of a known start; allowed: three finite numbers")
        if len(self.deviation) != 3 or not all(math.isfinite(each) and each >= 0.0 for each in self.deviation):
            raise FieldError(f"deviation = {self.deviation!r} of a known start; allowed: three finite values >= 0")
