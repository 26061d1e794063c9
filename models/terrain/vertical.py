"""Heights of a raster file: their unit, and what they are measured from."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mathnavi.interfaces.errors import TerrainError

FOOT, US_FOOT = 0.3048, 1200.0 / 3937.0  # [m]
_UNITS: dict[float, tuple[str, ...]] = {
    1.0: ("m", "metre", "meter", "metres", "meters"),
    FOOT: ("ft", "foot", "feet", "ift", "international foot", "international feet", "foot international", "'"),
    US_FOOT: (
        *("us survey foot", "us survey feet", "survey foot", "survey feet", "us foot", "us feet", "usfoot", "usfeet"),
        *("sfoot", "ftus", "ft us", "us ft", "usft", "sft", "foot us", "feet us", "u s survey foot", "ussurveyfoot"),
    ),
    1e3: ("km", "kilometre", "kilometer", "kilometres", "kilometers"),
    0.1: ("dm", "decimetre", "decimeter", "decimetres", "decimeters"),
    0.01: ("cm", "centimetre", "centimeter", "centimetres", "centimeters"),
    1e-3: ("mm", "millimetre", "millimeter", "millimetres", "millimeters"),
}
_FACTORS = {name: factor for factor, names in _UNITS.items() for name in names}


def is_metre(stated: str) -> bool:
    """Return True if a stated unit of heights is the metre, or none is stated."""
    return not stated or _FACTORS.get(_unit_name(stated)) == 1.0


def _unit_name(stated: str) -> str:
    return " ".join(re.sub(r"[-_.()]", " ", stated).lower().split())


@dataclass(frozen=True)
class Heights:
    """How the numbers of a file become heights."""

    metres: float  # of one unit
    datum: str  # what they are measured from; empty if the file does not say it
    taken: str  # what was taken for granted; empty if nothing was


def heights_of(stated: str, crs: Mapping[str, Any], scale: float | None, where: str) -> Heights:
    """Unit and datum of heights: ``stated`` is the unit of the file's band, ``crs`` its coordinate system as PROJJSON,
    ``scale`` [m per unit] what the user says.

    Raises TerrainError for a unit that is not known, for depths, and where nothing states a unit while the coordinates
    are in feet.
    """
    vertical = _vertical_axis(crs)
    datum = _datum(crs)
    if vertical is not None and vertical.get("direction") == "down":
        raise TerrainError(f"{where}: depths, measured downwards ({datum}); allowed: heights, measured upwards")
    if scale is not None:
        return Heights(scale, datum, "")
    name = _unit_name(stated)
    by_crs = None if vertical is None else _factor(vertical["unit"])
    if name:
        if name not in _FACTORS:
            raise TerrainError(
                f"{where}: scale is missing; heights are in {stated!r}: --scale says how many metres one is, 0.3048 "
                "for feet"
            )
        factor = _FACTORS[name]
        if by_crs is not None and abs(by_crs / factor - 1.0) > 1e-4:
            raise TerrainError(
                f"{where}: scale is missing; heights are in {stated!r} by the band, in units of {by_crs:.7g} m by the "
                "coordinate system: --scale says how many metres one is"
            )
        return Heights(factor, datum, "")
    if by_crs is not None:
        return Heights(by_crs, datum, "")
    across = [_factor(axis["unit"]) for axis in _axes(_horizontal(crs)) if _is_length(axis["unit"])]
    if any(abs(factor - 1.0) > 1e-9 for factor in across):
        raise TerrainError(
            f"{where}: scale is missing; no unit of the heights is stated, and coordinates are in units of "
            f"{across[0]:.10g} m: --scale {across[0]:.10g} for heights in the same unit, --scale 1 for metres"
        )
    return Heights(1.0, datum, "heights taken as metres, the file states no unit")


def _axes(crs: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    axes: Sequence[Mapping[str, Any]] = crs.get("coordinate_system", {}).get("axis", ())
    return axes


def parts_of(crs: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, Any] | None]:
    """Horizontal and vertical part of a coordinate system, each without a transformation to another one."""
    if crs.get("type") == "BoundCRS":
        return parts_of(crs["source_crs"])
    if crs.get("type") == "CompoundCRS":
        across, up = crs["components"]
        return parts_of(across)[0], parts_of(up)[0]
    return crs, None


def _horizontal(crs: Mapping[str, Any]) -> Mapping[str, Any]:
    return parts_of(crs)[0]


def _vertical_axis(crs: Mapping[str, Any]) -> Mapping[str, Any] | None:
    across, up = parts_of(crs)
    axes = _axes(across)[2:] if up is None else _axes(up)
    return axes[0] if axes else None


def _datum(crs: Mapping[str, Any]) -> str:
    across, up = parts_of(crs)
    if up is not None:
        name = str(up.get("name", "unnamed"))
        return f"{'ellipsoid' if 'ellips' in name.lower() else 'geoid'} ({name})"
    return f"ellipsoid ({across.get('name', 'unnamed')})" if len(_axes(across)) > 2 else ""


def _is_length(unit: Any) -> bool:
    return unit == "metre" or (isinstance(unit, Mapping) and unit.get("type") == "LinearUnit")


def _factor(unit: Any) -> float:
    """Metres of one unit of length in PROJJSON."""
    return 1.0 if isinstance(unit, str) else float(unit["conversion_factor"])
