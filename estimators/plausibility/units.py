"""Units and signs in which readings come, and how a log is refused that fits in one of them only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """Unit, or sign, of readings that are not in SI units."""

    name: str  # after "fit ... only"
    factor: float  # to the SI unit
    allowed: str  # the SI unit, and how it is reached


DEGREES = Unit("as degrees", math.pi / 180.0, "radians: multiply by pi/180")
TURNS = Unit("as turns", 2.0 * math.pi, "radians: multiply by 2 pi")
MILLIMETRES = Unit("as millimetres", 1e-3, "metres: multiply by 0.001")
CENTIMETRES = Unit("as centimetres", 1e-2, "metres: multiply by 0.01")
SOUND_SECONDS = Unit("as times of sound in seconds", 343.0, "metres: multiply by the speed of sound, 343 m/s in air")
RADIO_SECONDS = Unit("as times of radio in seconds", 299_792_458.0, "metres: multiply by 299792458 m/s")
LATITUDES = Unit(
    "as degrees of latitude and longitude",
    111_320.0,
    "metres in a plane: multiply latitudes by 111320, and longitudes by 111320 cos(latitude)",
)
OTHER_SIGN = Unit("with the other sign", -1.0, "the model's sign: multiply by -1, unless the input has the wrong one")

DEGREES_PER_SECOND = Unit("as deg/s", math.pi / 180.0, "rad/s: multiply by pi/180")
MILLIMETRES_PER_SECOND = Unit("as mm/s", 1e-3, "m/s: multiply by 0.001")
CENTIMETRES_PER_SECOND = Unit("as cm/s", 1e-2, "m/s: multiply by 0.01")
CLOCKWISE = Unit("with the other sign", -1.0, "counter-clockwise: multiply by -1")
DEGREES_CLOCKWISE = Unit(
    "as degrees with the other sign", -math.pi / 180.0, "radians, counter-clockwise: multiply by -pi/180"
)
BACKWARDS = Unit("with the other sign", -1.0, "forwards: multiply by -1")

STANDARD_GRAVITY = 9.80665  # [m/s^2]
GRAVITIES = Unit("in g", STANDARD_GRAVITY, "m/s^2: multiply by 9.80665")
MILLIGRAVITIES = Unit("in thousandths of g", STANDARD_GRAVITY / 1e3, "m/s^2: multiply by 0.00980665")


def gear(factor: float) -> Unit:
    """Return the unit of an angle that is read before a gear, and becomes that of the joint times this factor."""
    ratio = f"{1.0 / factor:.2g}"
    return Unit(
        f"before a gear of about {ratio}", factor, f"the joint's angle: divide by the gear's ratio, about {ratio}"
    )


def fit_only(readings: str, what: str, parts: Sequence[tuple[str, str, str]]) -> str:
    """Say in which way alone readings fit: in each part the name of a unit, the columns, and what is allowed."""
    ways = " and ".join(f"{name} in {columns}" for name, columns, _ in parts)
    allowed = "; ".join(dict.fromkeys(allowed for *_, allowed in parts))
    return f"the readings of {readings} fit {what} only {ways}; allowed: {allowed}"
