"""Reader of columns of numbers from CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mathnavi.interfaces.reading.files import MOST_LINES, Refusal, opened
from mathnavi.interfaces.signals import Array


def read_columns(path: Path, names: Sequence[str], error: Refusal) -> Array:
    """Read columns (rows, len(names)) of a CSV file whose first line names them; NaN for an empty cell.

    Raises ``error`` for a column that is missing or there twice, for a row of another length, and for a cell that is
    not a number, with its line and its column; FileNotFoundError if there is no file.
    """
    with opened(path, error, MOST_LINES) as file, io.TextIOWrapper(file, "utf-8-sig", newline="") as text:
        reader = csv.reader(text)
        try:
            header = [name.strip() for name in next(reader, [])]
            places = [_place(path, header, name, error) for name in names]
            rows = [_numbers(path, reader.line_num, header, places, row, error) for row in reader if row]
        except UnicodeDecodeError as fault:
            raise error(f"{path} is not text in UTF-8 ({fault.reason})") from None
        except csv.Error as fault:
            raise error(f"{path} line {reader.line_num}: {fault}; allowed: comma-separated values") from None
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(names))


def _place(path: Path, header: Sequence[str], name: str, error: Refusal) -> int:
    if header.count(name) != 1:
        found = "two columns" if name in header else "no column"
        raise error(f"{path}: there is {found} {name!r}; it has {', '.join(header) or 'no line'}")
    return header.index(name)


def _numbers(
    path: Path, line: int, header: Sequence[str], places: Sequence[int], row: Sequence[str], error: Refusal
) -> list[float]:
    if len(row) != len(header):
        raise error(f"{path} line {line}: {len(row)} cells; allowed: {len(header)}, as the first line has")
    numbers = []
    for k in places:
        cell = row[k].strip()
        try:
            numbers.append(float(cell) if cell else np.nan)
        except ValueError:
            raise error(
                f"{path} line {line}, column {header[k]!r}: {cell!r}; allowed: a number, or nothing where there is "
                "no reading"
            ) from None
    return numbers
