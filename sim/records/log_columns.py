"""Meaning of the columns of a table as a log: which of them are times, readings and inputs, and in which units.

A column is called by its whole name in the file, "q1 [deg]", or by what stands before the unit, "q1". A unit in
brackets, or in a row of units below the names, is honoured: numbers are converted to SI units, angles to radians.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces import units as symbols
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.reading.table_format import TableFormat, advice_for_names, advice_without_names, misspelt
from mathnavi.interfaces.reading.tables import TableColumns, TableHead, first_lines, read_head, read_table
from mathnavi.interfaces.signals import Array
from mathnavi.sim.records import log_times

_BRACKETS = re.compile(r"(.*?)(\s*)(?:\[([^\[\]]*)\]|\(([^()]*)\))$")
_ENDINGS = {  # of names, that state a unit which is not the SI unit
    **dict.fromkeys(("deg", "degs", "degree", "degrees"), "deg"),
    **dict.fromkeys(("dps", "degps", "deg_s", "deg_per_s", "deg_per_sec", "degrees_per_second"), "deg/s"),
    **{"rpm": "rpm", "gs": "g", "mm": "mm", "cm": "cm", "km": "km", "kmh": "km/h", "kph": "km/h", "km_per_h": "km/h"},
}
_ENDING = re.compile(rf".*[^A-Za-z]({'|'.join(sorted(_ENDINGS, key=len, reverse=True))})", re.IGNORECASE)
_TIME_ENDING = re.compile(r".*[^A-Za-z](ms|msec|us|usec|ns|nsec)|.*(?:Ms|Us|Ns)")
_TIME_FACTORS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}
_TIME_SYMBOL = re.compile(r"([mnuµμ]?s|[mun]?sec|seconds?)")
_TIMES = re.compile(r"time|stamp|(?<![A-Za-z])t(?![A-Za-z])|sec", re.IGNORECASE)
_LOOKED_THROUGH = 40  # lines for the names of the columns


@dataclass(frozen=True)
class LogColumns:
    """Columns of a log."""

    t: Array  # (n,) [s]
    start: Decimal  # [s] what was subtracted from the times of the file
    values: Array  # (n, k) in SI units; NaN where there is none
    lines: NDArray[np.int64]  # (n,) of the file
    names: tuple[str, ...]  # of the k columns in the file
    units: tuple[str, ...]  # SI units of the k columns, "" where none is known
    notes: tuple[str, ...]


def read_log_columns(
    path: Path,
    time: str,
    wanted: Sequence[str],
    time_unit: str | None,
    units: Mapping[str, str],
    form: TableFormat,
    *,
    increasing: bool = True,
) -> LogColumns:
    """Read the times, which have to be ``increasing`` or not, and the columns ``wanted`` of a log, in SI units.

    Raises LogError for a column that is missing or there twice, for a unit that is not known or may be another, for
    a cell that is no number, and for times that do not increase, with the line and the column; FileNotFoundError.
    """
    head = read_head(path, form, LogError)
    time_place, *places = _places(path, head, (time, *wanted), form)
    header = [head.names[place] for place in (time_place, *places)]
    notes: list[str] = []
    stated = [_stated(name) for name in header]
    if (row := _unit_row(head, (time_place, *places))) is not None:
        line = head.rows[0][0]
        notes.append(f"line {line} holds units")
        stated = [unit or own for unit, own in zip(row, stated, strict=True)]
        head = TableHead(head.names, line, head.rows[1:])
    given = _given(path, dict(zip((time, *wanted), header, strict=True)), units)
    if (of_times := given.pop(header[0], None)) is not None:
        if time_unit is not None:
            raise LogError(
                f"{path}: units has {of_times!r} for the times, and time_unit is {time_unit!r}; allowed: one"
            )
        time_unit = _time_symbol(of_times) or of_times
    unit = _time_unit(path, time, header[0], stated[0], time_unit, notes)
    if log_times.PER_SECOND.get(unit, 1) != 1:
        notes.append(f"column {header[0]!r} was converted from {unit}, 1 {unit} = {1 / log_times.PER_SECOND[unit]:g} s")
    factors = [
        _factor(path, name, own, given.get(name), notes) for name, own in zip(header[1:], stated[1:], strict=True)
    ]
    in_si = tuple(
        symbols.si_unit(given.get(name) or own or "") or "" for name, own in zip(header[1:], stated[1:], strict=True)
    )
    exact = _exact(path, head, time_place, unit, form)
    numbers = [*places] if exact else [time_place, *places]
    table = read_table(path, form, head, numbers, [time_place] if exact else [], LogError)
    if not len(table.lines):
        raise LogError(f"{path}: it has no row below the names of the columns{_noted(table.notes)}")
    if exact:
        t, start = _exact_times(path, table, header[0], unit, form)
        values = table.numbers
        notes.append(f"t = 0 is {start:f} s of the file's times")
    else:
        t, start, values = table.numbers[:, 0] / log_times.PER_SECOND[unit], Decimal(0), table.numbers[:, 1:]
    _check_times(path, t, table.lines, header[0], increasing=increasing)
    if any(factor != 1.0 for factor in factors):
        values = values * np.array(factors)
    return LogColumns(t, start, values, table.lines, tuple(header[1:]), in_si, (*notes, *table.notes))


def _places(path: Path, head: TableHead, wanted: Sequence[str], form: TableFormat) -> list[int]:
    """Return the places of columns by their names, whole or without their units."""
    short = bare(head.names)
    places: list[int] = []
    for name in wanted:
        found = [k for k, each in enumerate(head.names) if each == name]
        found = found or [k for k, each in enumerate(short) if each == name]
        if len(found) != 1:
            how, advice = f"there are {len(found)} columns", "; names=[...] and skiprows= give them others"
            if not found:
                how, advice = "there is no column", _advice(path, head, wanted, name, form)
                if not advice and not places:
                    advice = f"; time={_like_a_time(short)} names the one of the times"
            raise LogError(f"{path}: {how} {name!r}; it has {', '.join(head.names)}{advice}")
        places += found
    return places


def _like_a_time(names: Sequence[str]) -> str:
    """Return the name of a column that may hold times, quoted, or NAME."""
    return next((repr(name) for name in names if _TIMES.search(name)), "NAME")


def _advice(path: Path, head: TableHead, wanted: Sequence[str], name: str, form: TableFormat) -> str:
    """Return what would name the columns, or the one that is missing."""
    if advice := advice_without_names(head.names):
        return f"; its first line holds numbers: {advice} allows it"
    lines = first_lines(path, form, _LOOKED_THROUGH, LogError)
    if advice := advice_for_names(lines, lambda names: {*wanted} <= {*names, *bare(names)}, form):
        return f"; {advice} allows it"
    if advice := misspelt(name, head.names):
        return advice
    sign = head.names[0][:1]
    return f"; comment={sign!r} leaves out the lines that begin so" if sign in ("#", "%", ";") else ""


def bare(names: Sequence[str]) -> list[str]:
    """Return names of columns without the units in their brackets."""
    return [name if _stated(name) is None else _BRACKETS.sub(r"\1", name) for name in names]


def _stated(name: str) -> str | None:
    """Return the unit in the brackets at the end of a name, known or not; None if they hold none.

    Brackets at once behind a name may be an index, "q[0]", and parentheses a remark: there only known units count.
    """
    parts = _BRACKETS.fullmatch(name)
    if parts is None or not parts[1].strip():
        return None
    unit = (parts[3] if parts[3] is not None else parts[4]).strip()
    if symbols.si_factor(unit) is not None:
        return None if unit == "1" and not parts[2] else unit
    return unit if parts[2] and parts[3] is not None and not unit.isdigit() else None


def _unit_row(head: TableHead, places: Sequence[int]) -> list[str] | None:
    """Return the units of columns in the row below the names, "" where none is given; None if it holds no units."""
    row = head.rows[0][1] if head.rows else ()
    if len(row) != len(head.names):
        return None
    cells = [row[k].strip("[]() ") for k in places]
    known = [cell in ("", "-") or (not cell[0].isdigit() and symbols.si_factor(cell) is not None) for cell in cells]
    return cells if all(known) and any(cell.strip("-") for cell in cells) else None


def _given(path: Path, used: Mapping[str, str], units: Mapping[str, str]) -> dict[str, str]:
    """Return the units that are given by the names of their columns in the file."""
    found = {}
    for name, unit in units.items():
        column = used.get(name, name if name in used.values() else None)
        if column is None:
            allowed = allowed_for(name, list(used))
            raise LogError(f"{path}: units names {name!r}, which is neither time, reading nor input; {allowed}")
        if symbols.si_factor(unit) is None:
            raise LogError(f"{path}: units = {{{name!r}: {unit!r}}}; allowed: units such as {symbols.KNOWN}")
        found[column] = unit
    return found


def _factor(path: Path, name: str, stated: str | None, given: str | None, notes: list[str]) -> float:
    """Return what the numbers of a column are multiplied by."""
    if given is not None:
        factor = symbols.si_factor(given)
        if stated is not None and symbols.si_factor(stated) != factor:
            notes.append(f"column {name!r} is in {given}, as units says, and not in {stated}")
        if factor not in (None, 1.0):
            notes.append(_converted(name, given, factor))
        return factor or math.nan
    if stated is not None:
        factor = symbols.si_factor(stated)
        if factor is None:
            raise LogError(
                f"{path}: column {name!r} has the unit {stated!r}, which is not known; allowed with "
                f"units={{{name!r}: UNIT}}, such as {symbols.KNOWN}"
            )
        if factor != 1.0:
            notes.append(_converted(name, stated, factor))
        return factor
    if ending := _ENDING.fullmatch(name):
        unit = _ENDINGS[ending[1].lower()]
        raise LogError(
            f"{path}: column {name!r} may be in {unit}; units={{{name!r}: {unit!r}}} converts it, and "
            f"units={{{name!r}: '1'}} takes it as it is"
        )
    return 1.0


def _converted(name: str, unit: str, factor: float | None) -> str:
    """Return the note on the conversion of a column to SI units, with the factor."""
    return f"column {name!r} was converted from {unit}, 1 {unit} = {factor:.6g} {symbols.si_unit(unit) or ''}".rstrip()


def _time_unit(path: Path, time: str, name: str, stated: str | None, given: str | None, notes: list[str]) -> str:
    """Return the unit of the times."""
    if given is not None:
        if given not in log_times.UNITS:
            raise LogError(f"{path}: time_unit = {given!r}; allowed: {', '.join(log_times.UNITS)}")
        if stated is not None and given != _time_symbol(stated):
            notes.append(f"column {name!r} is in {given}, as time_unit says, and not in {stated}")
        return given
    if stated is not None:
        unit = _time_symbol(stated)
        if unit is None:
            allowed = ", ".join(log_times.UNITS)
            raise LogError(f"{path}: column {name!r} has the unit {stated!r}; allowed with time_unit=UNIT: {allowed}")
        return unit
    if ending := _TIME_ENDING.fullmatch(name):
        unit = (ending[1] or name[-2:]).lower()[0] + "s"
        raise LogError(
            f"{path}: column {name!r} may be in {unit}; allowed with time_unit={unit!r}, or 's' if it is not"
        )
    return "s"


def _time_symbol(unit: str) -> str | None:
    """Return the unit of time that a symbol stands for; None for another unit."""
    return _TIME_FACTORS.get(symbols.si_factor(unit) or 0.0) if _TIME_SYMBOL.fullmatch(unit) else None


def _exact(path: Path, head: TableHead, place: int, unit: str, form: TableFormat) -> bool:
    """Return True if the times have to be read as text; LogError if the first obviously has another unit."""
    line, cells = head.rows[0] if head.rows else (head.line, ())
    first = _plain(cells[place], form) if len(cells) > place else ""
    try:
        log_times.check_unit(first, unit)
    except log_times.TimeError as fault:
        raise LogError(f"{path} line {line}, column {head.names[place]!r}: {first!r} {fault}") from None
    return log_times.is_exact(first, unit)


def _exact_times(path: Path, table: TableColumns, name: str, unit: str, form: TableFormat) -> tuple[Array, Decimal]:
    (cells,) = table.texts
    if unit != log_times.ISO and (form.thousands or form.decimal != "."):
        cells = tuple(_plain(cell, form) for cell in cells)
    try:
        return log_times.exact_seconds(cells, unit)
    except log_times.TimeError as fault:
        line, cell = table.lines[fault.place], cells[fault.place]
        raise LogError(f"{path} line {line}, column {name!r}: {cell!r} {fault}") from None


def _check_times(path: Path, t: Array, lines: NDArray[np.int64], name: str, *, increasing: bool) -> None:
    if (bad := np.flatnonzero(~np.isfinite(t))).size:
        raise LogError(f"{path} line {lines[bad[0]]}, column {name!r}: no time; allowed: a time in each row")
    if increasing and (bad := np.flatnonzero(np.diff(t) <= 0.0)).size:
        k = int(bad[0])
        raise LogError(
            f"{path} line {lines[k + 1]}, column {name!r}: {t[k + 1]:.9g} s comes after {t[k]:.9g} s; allowed: times "
            "that increase"
        )


def _plain(cell: str, form: TableFormat) -> str:
    """Return a number with a decimal point and without marks between thousands."""
    return cell.replace(form.thousands or "\0", "").replace(form.decimal, ".")


def _noted(notes: Sequence[str]) -> str:
    return "".join(f"; {note}" for note in notes)
