"""Units by their usual symbols: the SI unit of each, angles in radians, and what a number is multiplied by to be in it.

A unit is a product of symbols with exponents: "deg/s", "m/s^2", "m s-2", "rad s^-1", "N m", "mm", "°/s", "km/h". "g" is
the standard acceleration of gravity, as data sheets of accelerometers have it, and never a gram.
"""

from __future__ import annotations

import math
import re

_PREFIXES = {"": 1.0, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}
_PREFIXED = {  # factor of a symbol, and the prefixes that it is used with
    "m": (1.0, "kcmun"),
    "s": (1.0, "mun"),
    "sec": (1.0, "mun"),
    "N": (1.0, "km"),
    "Nm": (1.0, "km"),
    "rad": (1.0, "m"),
    "g": (9.80665, "mu"),
    "T": (1.0, "mun"),
    "Hz": (1.0, "k"),
    "V": (1.0, "m"),
    "A": (1.0, "m"),
}
_OTHERS = {
    math.radians(1.0): "deg ° degree degrees dps degps",
    2.0 * math.pi: "rev turn turns",
    2.0 * math.pi / 60.0: "rpm RPM",
    0.3048: "ft foot feet",
    0.0254: "in inch",
    0.9144: "yd",
    1609.344: "mi",
    1852.0: "nmi",
    1852.0 / 3600.0: "kn kt",
    1609.344 / 3600.0: "mph",
    1.0 / 3.6: "kmh kph",
    4.4482216152605: "lbf",
    60.0: "min minute",
    3600.0: "h hour",
    1.0: "1 kg second seconds radian radians meter meters metre metres mps",
}
_SYMBOLS = {
    **{
        f"{prefix}{name}": factor * _PREFIXES[prefix]
        for name, (factor, prefixes) in _PREFIXED.items()
        for prefix in ("", *prefixes)
    },
    **{name: factor for factor, names in _OTHERS.items() for name in names.split()},
}
_EXPRESSED = {  # SI units with their exponents, and the symbols that are multiples of these
    (("s", 1),): "sec second seconds min minute h hour",
    (("rad", 1),): "deg ° degree degrees rev turn turns radian radians",
    (("rad", 1), ("s", -1)): "dps degps rpm RPM",
    (("m", 1),): "ft foot feet in inch yd mi nmi meter meters metre metres",
    (("m", 1), ("s", -1)): "kn kt mph kmh kph mps",
    (("m", 1), ("s", -2)): "g",
    (("N", 1), ("m", 1)): "Nm",
    (("N", 1),): "lbf",
    (): "1",
}
_BASES = {name: parts for parts, names in _EXPRESSED.items() for name in names.split()}
_BASES |= {
    f"{prefix}{name}": _BASES.get(name, ((name, 1),))
    for name, (_, prefixes) in _PREFIXED.items()
    for prefix in ("", *prefixes)
}
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴", "-01234")
_FACTOR = re.compile(r"([^\W\d_]+0?|°|1)(?:(?:\^|\*\*)?\(?([+-]?\d)\)?)?")
_BETWEEN = re.compile(r"\s*(\*|·|⋅|\.|/|\s)\s*")
KNOWN = "deg, rad, rev, deg/s, rad/s, rpm, m, mm, cm, km, ft, in, m/s, km/h, m/s^2, g, N, N m, s, ms, us, ns"


def si_factor(unit: str) -> float | None:
    """Return the factor to SI units of a unit; None for a text that is no unit known here.

    "-" and "" are those of a number without a unit.
    """
    found = _parsed(unit)
    return None if found is None else found[0]


def si_unit(unit: str) -> str | None:
    """Return the SI unit of a unit, "m/s^2" of "g"; "" without one, None for a text that is no unit known here."""
    found = _parsed(unit)
    if found is None:
        return None
    above, below = (
        [name if abs(power) == 1 else f"{name}^{abs(power)}" for name, power in found[1].items() if power * sign > 0]
        for sign in (1, -1)
    )
    return "/".join([" ".join(above) or "1", *below]) if above or below else ""


def _parsed(unit: str) -> tuple[float, dict[str, int]] | None:
    """Factor to SI units of a unit, and these with their exponents."""
    text = unit.strip().translate(_SUPERSCRIPTS).replace("µ", "u").replace("μ", "u")
    if text in ("", "-"):
        return 1.0, {}
    factor, power, place = 1.0, 1, 0
    units: dict[str, int] = {}
    while found := _FACTOR.match(text, place):
        symbol, exponent = found[1], int(found[2] or 1)
        if symbol not in _SYMBOLS or (symbol == "ms" and exponent != 1):  # "ms^-1" may be m/s
            return None
        factor *= _SYMBOLS[symbol] ** (power * exponent)
        for name, own in _BASES.get(symbol, ((symbol, 1),)):
            units[name] = units.get(name, 0) + power * exponent * own
        if (place := found.end()) == len(text):
            return factor, units
        between = _BETWEEN.match(text, place)
        if between is None or (power == -1 and between[1] != "/"):  # "m/s m" may be m m/s
            return None
        power = -1 if between[1] == "/" else 1
        place = between.end()
    return None
