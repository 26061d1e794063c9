"""Ellipsoids on which elevation models lie: lengths of a degree."""

from __future__ import annotations

import math
from dataclasses import dataclass

DEGREE = math.radians(1.0)


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid of revolution."""

    name: str
    semi_major: float  # a [m], equatorial
    eccentricity_squared: float = 0.0  # e^2, of a meridian

    def metres_per_degree(self, latitude: float) -> tuple[float, float]:
        """Return the lengths (north, east) [m] of one degree of latitude and of longitude at ``latitude`` [degrees].

        With w^2 = 1 - e^2 sin^2 phi the radius of curvature of the meridian is a (1 - e^2) / w^3, and that of the
        parallel a cos phi / w.
        """
        sine, cosine = math.sin(math.radians(latitude)), math.cos(math.radians(latitude))
        w = math.sqrt(1.0 - self.eccentricity_squared * sine**2)
        north = self.semi_major * (1.0 - self.eccentricity_squared) / w**3
        return DEGREE * north, DEGREE * self.semi_major / w * cosine


WGS84 = Ellipsoid("WGS 84", 6378137.0, 0.00669437999014)
EARTH = (6.3e6, 6.4e6)  # [m] semi-major axes of the ellipsoids that stand for the Earth
