"""How a table is written in a text file, and the arguments that would fit where a reader meets something else.

The names of the arguments are those of ``pandas.read_csv``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated

from annotated_types import Ge

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import close_names
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER

BLANKS = r"\s+"  # separator of cells that any number of blanks separates
_TAB = r"\t"
_SEPARATORS = (",", ";", "\t", "|", BLANKS)  # that are tried
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d*|[+-]?\d{1,3}(,\d{3}){2,}", re.ASCII)
_NUMBER = re.compile(r"[+-]?[\d.,]+([eE][+-]?\d+)?", re.ASCII)


@configuration
class TableFormat:
    """Format of a text file with a table."""

    sep: str = ","
    r"""separator of the cells, one character, \t for a tab or \s+ for any number of blanks"""
    decimal: str = "."
    """decimal mark, . or ,"""
    thousands: str | None = None
    """mark between thousands; none if not given"""
    encoding: str | None = None
    """encoding of the text, such as latin-1; that of its byte-order mark, else UTF-8, if not given"""
    comment: str | None = None
    """character that starts a comment, to the end of the line; none if not given"""
    skiprows: Annotated[int, Ge(0)] = 0
    """number of lines above the names of the columns that are left out"""
    names: Annotated[tuple[str, ...] | None, TOGETHER] = None
    """names of the columns of a file whose first line has none"""
    na_values: Annotated[tuple[str, ...], TOGETHER] = ()
    """texts and numbers that stand for a missing value, as do an empty cell, NaN, NA and those that pandas takes"""

    def __post_init__(self) -> None:
        if self.sep == _TAB:
            object.__setattr__(self, "sep", "\t")
        for name, allowed in (("sep", r"one character, \t or \s+"), ("thousands", "one character")):
            value = getattr(self, name)
            if value is not None and value != BLANKS and (len(value) != 1 or value in '"\n\r'):
                raise FieldError(f"{name} = {value!r}; allowed: {allowed}")
        if self.comment is not None and (len(self.comment) != 1 or self.comment in '"\n\r'):
            raise FieldError(f"comment = {self.comment!r}; allowed: one character")
        if self.decimal not in (".", ","):
            raise FieldError(f"decimal = {self.decimal!r}; allowed: '.' or ','")
        if self.thousands == self.decimal:
            raise FieldError(f"thousands = {self.thousands!r}; allowed: another character than decimal")
        if self.encoding is not None:
            try:
                "".encode(self.encoding)
            except (LookupError, UnicodeError, ValueError):
                raise FieldError(
                    f"encoding = {self.encoding!r}; allowed: an encoding that Python knows, such as 'utf-8', "
                    "'latin-1', 'cp1252' or 'utf-16'"
                ) from None


def names_in(text: str) -> list[str]:
    """Return names with commas between them; one that has a comma itself stands in double quotes."""
    return [name.strip() for row in csv.reader([text], skipinitialspace=True) for name in row]


def advice_for_cell(cell: str, form: TableFormat) -> str:
    """Return "; ARGUMENT allows it" for a number in another notation; "" for any other cell."""
    if form.decimal == "." and _THOUSANDS.fullmatch(cell):
        return "; thousands=',' allows it"
    return "; decimal=',' allows it" if form.decimal == "." and _DECIMAL_COMMA.fullmatch(cell) else ""


def advice_for_names(lines: Sequence[str], fits: Callable[[Sequence[str]], bool], form: TableFormat) -> str:
    """Return the arguments with which one of the first lines of a file holds names that fit; "" for none."""
    for separator in (form.sep, *_SEPARATORS):
        for k, names in _split(lines, separator):
            if fits(names):
                arguments = [] if separator == form.sep else [f"sep={separator!r}"]
                arguments += [f"skiprows={k}"] if k > form.skiprows else []
                below = next((row for j, row in _split(lines, separator) if j > k), ())
                commas = any(_DECIMAL_COMMA.fullmatch(cell) for cell in below)
                points = any("." in cell for cell in below)
                arguments += ["decimal=','"] if commas and not points and form.decimal == "." else []
                return ", ".join(arguments)
    return ""


def advice_without_names(names: Sequence[str]) -> str:
    """Return the arguments that a file needs whose first line holds numbers in place of names; "" for another file."""
    for separator, cells in (("", list(names)), *_split_anew(names)):
        if cells and all(map(_NUMBER.fullmatch, cells)):
            return f"names=[...] with {len(cells)} names" + (f" and sep={separator!r}" if separator else "")
    return ""


def advice_for_row(row: Sequence[str], count: int) -> str:
    """Return "; ARGUMENT allows it" for a row that has ``count`` cells with another separator; "" for any other."""
    found = [separator for separator, cells in _split_anew(row) if len(cells) == count]
    return f"; sep={found[0]!r} allows it" if found else ""


def advice_for_quotes(line: str) -> str:
    """Return "; ARGUMENT allows it" for a line whose quoted cells another separator follows; "" for any other."""
    found = re.search(r'"([;|\t])', line)
    return f"; sep={found[1]!r} allows it" if found else ""


def _split_anew(row: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Return separators with the cells into which each of them divides a row that is a single cell."""
    for separator in _SEPARATORS if len(row) == 1 else ():
        for _, cells in _split(row, separator):
            if len(cells) > 1:
                yield separator, cells


def misspelt(name: str, names: Sequence[str]) -> str:
    """Return a hint at the columns that a name may stand for; "" without one."""
    alike = [each for each in names if each.lower() == name.lower()] or close_names(name, [*dict.fromkeys(names)])
    return f"; did you mean {' or '.join(map(repr, alike))}?" if alike else ""


def _split(lines: Sequence[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Return the number of lines above, and the cells, of each line that is not blank."""
    for k, line in enumerate(lines):
        if line.strip():
            try:
                cells = line.split() if separator == BLANKS else next(csv.reader([line], delimiter=separator))
            except csv.Error:
                continue
            yield k, [cell.strip().strip('"') for cell in cells]
