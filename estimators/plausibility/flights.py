"""Check of what a flight reads of beacons, and of its fixes, against the declared start.

Until the flight can have gone a twentieth of the way to the nearest beacon, its readings are those of its start p_0:
ranges rho_i = |b_i - p_0| and range differences rho_i - rho_0, azimuths and elevations of b_i - p_0, fixes p_0. Where
they are not, and would be in one other unit or convention, it is named; of lengths the ratio tells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mathnavi.estimators.plausibility.units import (
    CENTIMETRES,
    DEGREES,
    MILLIMETRES,
    RADIO_SECONDS,
    SOUND_SECONDS,
    Unit,
    fit_only,
)
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacons import FlightBeacons, bearings, slant_ranges
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.angles import wrapped
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES

_NEAR = 0.05  # of the way to the nearest beacon, that the flight has gone at most
_CONTRADICTED, _FITS = 0.2, 0.08  # shares of the lengths that readings are off by
_FEWEST, _SHARE = 3, 0.75  # lengths or angles, and the share of them that has to fit
_LENGTHS = (MILLIMETRES, CENTIMETRES)
_OFF, _AGREES = 0.3, 0.1  # [rad] by which angles are off
_COMPASS = "x and y of the map: 0 along x, counter-clockwise; of a compass pi/2 minus the azimuth"
Way = tuple[str, Callable[[Array], Array], str]
"""words after "fit ... only", the numbers in SI units, and what is allowed"""
_AZIMUTHS: tuple[Way, ...] = (
    (DEGREES.name, np.deg2rad, DEGREES.allowed),
    ("as those of a compass", lambda y: 0.5 * math.pi - y, _COMPASS),
    ("as those of a compass in degrees", lambda y: 0.5 * math.pi - np.deg2rad(y), f"radians, {_COMPASS}"),
)


def misread(mission: FlightMission, t: Array, readings: Mapping[str, Array]) -> str:
    """Say in which unit or convention alone the ``readings`` (n, m) by sensor at t (n,) [s] fit the start of a flight;
    "" if they fit, or do in none.
    """
    beacons, start = mission.beacons, np.array(mission.start)
    if not np.isfinite(start).all():
        return ""
    found = "" if beacons is None else _of_beacons(beacons, start, mission, t, readings)
    if not found and "position" in readings:
        found = _of_fixes(start, _first(t, readings["position"], _NEAR * _norm(start) / mission.speed_max))
    return found


def _of_fixes(start: Array, y: Array) -> str:
    """Message about a fix y (3,) at the start (3,) [m], or none."""
    scale = _norm(start)
    if not np.isfinite(y).all() or scale == 0.0 or _norm(y - start) < _CONTRADICTED * scale:
        return ""
    fits = [unit for unit in _LENGTHS if _norm(unit.factor * y - start) < _FITS * scale]
    return _only("position", y, [(unit.name, unit.allowed) for unit in fits])


def _norm(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _of_beacons(
    beacons: FlightBeacons, start: Array, mission: FlightMission, t: Array, readings: Mapping[str, Array]
) -> str:
    """Message about the readings of beacons at known places, or none."""
    places = beacons.array
    ranges = slant_ranges(places, start)[0]
    known = np.isfinite(ranges)
    if not known.any():
        return ""
    seconds, scale = _NEAR * float(ranges[known].min()) / mission.speed_max, float(ranges[known].max())
    first = {name: _first(t, values, seconds) for name, values in readings.items()}
    units = (*_LENGTHS, SOUND_SECONDS, RADIO_SECONDS)
    said = ""
    if RANGES in first:
        said = _lengths(RANGES, first[RANGES], ranges, 0.0, units)
    if not said and DIFFERENCES in first:
        said = _lengths(DIFFERENCES, first[DIFFERENCES], ranges - ranges[0], 0.1 * scale, units)
    if not said and BEARINGS in first:
        azimuths, elevations = bearings(places, start)
        y, n = first[BEARINGS], len(places)
        said = _angles(y[:n], azimuths, _AZIMUTHS, f"azimuths of {BEARINGS}")
        said = said or _angles(y[n:], elevations, _AZIMUTHS[:1], f"elevations of {BEARINGS}")
    return said


def _first(t: Array, values: Array, seconds: float) -> Array:
    """Medians (m,) of the readings in the first seconds, NaN of those that are not read then."""
    rows = values[t <= t[0] + seconds]
    read = np.isfinite(rows).any(axis=0)
    found = np.full(values.shape[1], np.nan)
    if read.any():
        found[read] = np.nanmedian(np.where(np.isfinite(rows[:, read]), rows[:, read], np.nan), axis=0)
    return found


def _lengths(name: str, y: Array, expected: Array, least: float, units: Sequence[Unit]) -> str:
    """Say in which of the units lengths y (m,) are as ``expected`` (m,), where those are longer than ``least`` [m]."""
    asked = np.isfinite(y) & np.isfinite(expected) & (np.abs(expected) > least)
    ratios = y[asked] / expected[asked]
    if len(ratios) < _FEWEST or (np.abs(ratios - 1.0) > _CONTRADICTED).mean() < _SHARE:
        return ""
    fits = [unit for unit in units if (np.abs(unit.factor * ratios - 1.0) < _FITS).mean() >= _SHARE]
    return _only(name, y, [(unit.name, unit.allowed) for unit in fits])


def _angles(y: Array, expected: Array, ways: Sequence[Way], what: str) -> str:
    """Say in which way angles y (n,) are as ``expected`` (n,) [rad]."""
    asked = np.isfinite(y) & np.isfinite(expected)
    y, expected = y[asked], expected[asked]
    if len(y) < _FEWEST or (np.abs(wrapped(y - expected)) > _OFF).mean() < _SHARE:
        return ""
    fits = [each for each in ways if (np.abs(wrapped(each[1](y) - expected)) < _AGREES).mean() >= _SHARE]
    return _only(what, y, [(name, allowed) for name, _, allowed in fits])


def _only(readings: str, y: Array, ways: Sequence[tuple[str, str]]) -> str:
    """Say in which way alone readings y fit; "" unless there is one."""
    if len(ways) != 1:
        return ""
    ((name, allowed),) = ways
    values = f"{readings} ({np.nanmin(y):.3g} to {np.nanmax(y):.3g} at the start)"
    return fit_only(readings, "the declared start", [(name, values, allowed)])
