"""Units by their symbols."""

from __future__ import annotations

import math

import pytest

from mathnavi.interfaces.units import KNOWN, si_factor, si_unit

FACTORS = {
    "deg °": math.pi / 180.0,
    "rev": 2.0 * math.pi,
    "rpm": math.pi / 30.0,
    "m/s^2 m/s² rad/s m/s/s N*m Nm s^-1 1/s rad": 1.0,
    "deg/s °/s dps deg/sec": math.pi / 180.0,
    "mm ms mN mrad": 1e-3,
    "us µs μs usec": 1e-6,
    "ns": 1e-9,
    "km kN": 1e3,
    "km/h kmh": 1.0 / 3.6,
    "g": 9.80665,
    "ft": 0.3048,
    "mm^2": 1e-6,
}


@pytest.mark.parametrize(
    ("unit", "factor"), [(unit, value) for units, value in FACTORS.items() for unit in units.split()]
)
def test_a_unit_has_the_factor_of_its_definition(unit: str, factor: float) -> None:
    assert si_factor(unit) == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("unit", ["rad s^-1", "m s-2", "N m", " m/s ", "", "-", *KNOWN.split(", ")])
def test_products_blanks_and_no_unit_are_known(unit: str) -> None:
    assert si_factor(unit) is not None


@pytest.mark.parametrize("unit", ["counts", "°C", "x", "0", "ms^-1", "m/s m", "m/", "/s", "m^", "deg deg2rad", "q[0]"])
def test_what_is_no_unit_or_may_be_two_is_not_known(unit: str) -> None:
    assert si_factor(unit) is None


@pytest.mark.parametrize(
    ("unit", "in_si"),
    [
        ("deg", "rad"), ("rpm", "rad/s"), ("°/s", "rad/s"), ("km/h", "m/s"), ("mm", "m"), ("g", "m/s^2"),
        ("m s-2", "m/s^2"), ("Nm", "N m"), ("N*m", "N m"), ("usec", "s"), ("mph", "m/s"), ("kg", "kg"),
        ("1/s", "1/s"), ("mm^2", "m^2"), ("mA", "A"), ("m/m", ""), ("", ""), ("-", ""),
    ],
)  # fmt: skip
def test_a_unit_has_its_si_unit(unit: str, in_si: str) -> None:
    assert si_unit(unit) == in_si
    assert si_factor(in_si) == 1.0
    assert si_unit("furlong") is None
