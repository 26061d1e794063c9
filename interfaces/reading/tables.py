"""Reader of tables of numbers in text files: bytes to text, text to cells, cells to numbers.

What the columns mean is not known here. Every row that is read has its line in the file: the module that gives the
columns a meaning can name it. Of the last line, if no line end follows it, a writer that was interrupted may have
written a part: it is left out where that shows, which a note says.

Blocks of numbers are converted as a whole (``number_blocks``), all else cell by cell through Python's ``csv`` and a
strict pattern of numbers. Both accept the same numbers: "1_5", "0x1f" and digits of other scripts, which ``float`` or
others would take, are refused.
"""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import IO, NoReturn

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.reading.files import MEBIBYTE, MOST_LINES, MOST_OF_A_LINE, Refusal, opened
from mathnavi.interfaces.reading.number_blocks import numbers_only
from mathnavi.interfaces.reading.table_format import (
    BLANKS,
    TableFormat,
    advice_for_cell,
    advice_for_quotes,
    advice_for_row,
)
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.signals import Array

_BLOCK = 4 * MEBIBYTE  # [bytes] that are read at a time
_MARKS = {  # byte-order marks, the longer before those that they begin with
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
    codecs.BOM_UTF8: "utf-8-sig",
}
_NO_TEXT = {  # first bytes of files that are no text
    b"\x1f\x8b": "a gzip archive; allowed: the file in it, unpacked",
    b"PK\x03\x04": "a zip archive or a workbook; allowed: a table in it, unpacked or saved as CSV",
    b"\x89HDF": "an HDF5 or MATLAB file; allowed: its columns, saved as CSV",
    b"MATLAB 5.0": "a MATLAB file; allowed: its columns, saved as CSV",
    b"PAR1": "a Parquet file; allowed: its columns, saved as CSV",
    b"#ROSBAG": "a ROS bag; allowed: one of its topics, saved as CSV",
    b"\x89MCAP": "an MCAP file; allowed: one of its topics, saved as CSV",
    b"ULog": "a ULog file; allowed: one of its topics, saved as CSV",
}
_MISSING = {  # what pandas takes for a missing value, besides NaN
    *("", "NA", "N/A", "n/a", "<NA>", "#N/A", "#N/A N/A", "#NA", "NULL", "null", "None"),
    *("1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"),
}
_NAN = re.compile(r"[+-]?nan", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_NOT_WRITTEN = re.compile("[\0\udc80-\udcff]")  # null bytes, and bytes that are no text
_SHOWN = 40  # [characters] of a line that is left out
_COMPARED = 16  # lines above one that may be cut off


@dataclass(frozen=True)
class TableHead:
    """Lines above the rows of a table."""

    names: tuple[str, ...]  # of the columns
    line: int  # of the names; that before the first row where the file has none
    rows: tuple[tuple[int, tuple[str, ...]], ...]  # line and cells of the first rows, at most two


@dataclass(frozen=True)
class TableColumns:
    """Some columns of a table."""

    numbers: Array  # (n, columns), NaN for a missing value
    texts: tuple[tuple[str, ...], ...]  # cells (n,) of each column that is read as text
    lines: NDArray[np.int64]  # (n,) line of each row in the file, the first is 1
    notes: tuple[str, ...]  # what was left out, a sentence each


_Part = tuple[Array, list[list[str]], NDArray[np.int64]]
"""numbers, texts by column, and lines of some rows"""


def read_head(path: Path, form: TableFormat, error: Refusal) -> TableHead:
    """Read the names of the columns of a table, and its first rows.

    Raises ``error`` for a file that is no text in the encoding, FileNotFoundError if there is no file.
    """
    with opened(path, error, MOST_LINES) as file:
        reader = _TableReader(path, form, error, form.names or ())
        rows = list(islice((row for block in reader.blocks(file, 0) for row in reader.rows(*block)), 3))
    if form.names is not None:
        return TableHead(form.names, form.skiprows, tuple(rows[:2]))
    if not rows:
        raise error(f"{path}: it has no line; allowed: a line with the names of the columns, and rows below it")
    line, names = rows[0]
    while len(names) > 1 and not names[-1]:  # each line ends in a separator
        names = names[:-1]
    return TableHead(names, line, tuple(rows[1:]))


def first_lines(path: Path, form: TableFormat, count: int, error: Refusal) -> list[str]:
    """Read the first lines of a file, those that the format skips too; errors as of ``read_head``."""
    with opened(path, error, MOST_LINES) as file:
        blocks = _TableReader(path, replace(form, skiprows=0, comment=None, sep=","), error, ()).blocks(file, 0)
        return [line for _, text in islice(blocks, 1) for line in text.split("\n")[:count]]


def read_table(
    path: Path, form: TableFormat, head: TableHead, numbers: Sequence[int], texts: Sequence[int], error: Refusal
) -> TableColumns:
    """Read the rows below ``head``: some columns, by their places, as numbers, and some as text.

    A row without any cell that is filled is left out, as a blank line is. Raises ``error`` for a row of another length,
    and for a cell among ``numbers`` that is neither a number nor a missing value, with its line and its column.
    """
    reader = _TableReader(path, form, error, head.names)
    parts: list[_Part] = [(np.empty((0, len(numbers))), [[] for _ in texts], np.empty(0, dtype=np.int64))]
    above: list[str] = []
    with opened(path, error, MOST_LINES) as file:
        for line, text in reader.blocks(file, head.line):
            ended = text.rfind("\n") + 1
            if ended:
                parts.append(reader.columns(line, text[:ended], numbers, texts))
                above = text[:ended].rsplit("\n", _COMPARED + 1)[-_COMPARED - 1 : -1]
            if tail := text[ended:]:
                line += text.count("\n")
                if reader.is_whole(line, tail, above, numbers):
                    parts.append(reader.columns(line, f"{tail}\n", numbers, texts))
    columns = zip(*(part for _, part, _ in parts), strict=True)
    return TableColumns(
        np.concatenate([part for part, _, _ in parts]),
        tuple(tuple(chain.from_iterable(column)) for column in columns),
        np.concatenate([part for _, _, part in parts]),
        tuple(reader.notes),
    )


class _TableReader:
    """Reader of one table whose columns have ``names``."""

    def __init__(self, path: Path, form: TableFormat, error: Refusal, names: Sequence[str]) -> None:
        self.path, self.form, self.error, self.names = path, form, error, tuple(names)
        self.notes: list[str] = []
        self._sep = " " if form.sep == BLANKS else form.sep
        self._missing = _MISSING | set(form.na_values)
        self._missing_numbers = {value for each in form.na_values if not math.isnan(value := _plain_number(each))}

    # ---- bytes to text

    def blocks(self, file: IO[bytes], after: int) -> Iterator[tuple[int, str]]:
        """Return blocks of whole lines, each with the number of its first line; each line end is a line feed.

        The lines that the format skips, and those up to ``after``, are left out.
        """
        after = max(after, self.form.skiprows)
        encoding = self._encoding(file.read(16))
        file.seek(0)
        decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)("surrogateescape"), True)
        line, rest, content = 1, "", b"more"
        while content:
            content = file.read(_BLOCK)
            try:
                rest += decoder.decode(content, final=not content)
            except UnicodeError as fault:
                self._refuse(line, f"it is not text in {encoding} ({fault}); allowed: the file's encoding")
            whole = rest.rfind("\n") + 1 if content else len(rest)
            quoted = content and '"' in rest and rest.count('"', 0, whole) % 2
            if not whole or quoted:  # a quoted cell goes on in the next block
                if len(rest) > MOST_OF_A_LINE + _BLOCK:
                    self._refuse(line, f"it is longer than {MOST_OF_A_LINE} characters, or a quoted cell does not end")
                continue
            text, rest = rest[:whole], rest[whole:]
            first, line = line, line + text.count("\n")
            while first <= after and text:
                text, first = text[text.find("\n") + 1 or len(text) :], first + 1
            if text:
                self._check_text(first, text, encoding)
                yield first, self._prepared(text)

    def _encoding(self, start: bytes) -> str:
        for mark, what in _NO_TEXT.items():
            if start.startswith(mark):
                raise self.error(f"{self.path} is {what}")
        stated = next((name for mark, name in _MARKS.items() if start.startswith(mark)), "")
        given = self.form.encoding
        if given is None:
            if not stated and (start[1:2] == b"\0" or start[:1] == b"\0") and len(start) > 1:
                order = "le" if start[1:2] == b"\0" else "be"
                raise self.error(
                    f"{self.path} line 1: every second byte is zero; allowed with encoding='utf-16-{order}'"
                )
            return stated or "utf-8"
        if stated and not codecs.lookup(given).name.startswith(stated.removesuffix("-sig")):
            raise self.error(f"{self.path} begins with the byte-order mark of {stated}; allowed: encoding={stated!r}")
        return stated or given

    def _check_text(self, first: int, text: str, encoding: str) -> None:
        """Raise the error for bytes that are no text, and for null bytes, but in a last line that does not end."""
        ended = text[: text.rfind("\n") + 1]
        if not ended.isascii() and (wrong := re.search("[\udc80-\udcff]", ended)):
            line, byte = first + ended.count("\n", 0, wrong.start()), ord(wrong[0]) - 0xDC00
            likely = "" if codecs.lookup(encoding).name == "cp1252" else ", such as encoding='cp1252'"
            self._refuse(line, f"it is not text in {encoding} (byte {byte:#04x}); allowed: the file's encoding{likely}")
        if (place := ended.find("\0")) >= 0:
            self._refuse(first + ended.count("\n", 0, place), "it has null bytes; allowed: text")

    def _prepared(self, text: str) -> str:
        """Return the text without comments, and with one blank in place of each run of them if blanks separate."""
        if self.form.comment and self.form.comment in text:
            text = "\n".join(_without_comment(each, self.form.comment) for each in text.split("\n"))
        if self.form.sep == BLANKS:
            text = "\n".join(" ".join(each.split()) for each in text.split("\n"))
        return text

    # ---- text to cells

    def rows(self, first: int, text: str) -> Iterator[tuple[int, tuple[str, ...]]]:
        """Return the cells of each row that is not blank, without blanks around them, and its line."""
        lines = text.split("\n")
        reader = csv.reader(lines, delimiter=self._sep, skipinitialspace=True, strict=True)
        try:
            for row in reader:
                if any(cells := tuple(cell.strip() for cell in row)):
                    yield first + reader.line_num - 1, cells
        except csv.Error as fault:
            advice = advice_for_quotes(lines[reader.line_num - 1])
            allowed = f"cells with {self._sep!r} between them{advice}"
            self._refuse(first + reader.line_num - 1, f"{fault}; allowed: {allowed}")

    def columns(self, first: int, text: str, numbers: Sequence[int], texts: Sequence[int]) -> _Part:
        """Return some columns of lines as numbers (n, k), some as texts, and the line of each row."""
        form, sep = self.form, self._sep
        values = None
        if not (
            '"' in text or form.thousands or form.na_values or (form.decimal != "." and (sep == "," or "." in text))
        ):
            plain = text.replace(form.decimal, ".")
            values = numbers_only(plain, sep, len(self.names), numbers)
        if values is not None and (texts or not np.isnan(values).all(axis=1).any()):
            parts = [_column(text, sep, k) for k in texts]
            if all(all(part) for part in parts):
                return values, parts, np.arange(first, first + len(values), dtype=np.int64)
        found = [(line, self._checked(line, row)) for line, row in self.rows(first, text)]
        values = np.array([self._values(found, k) for k in numbers], dtype=np.float64).T
        texted = [[row[k] for _, row in found] for k in texts]
        return values.reshape(len(found), len(numbers)), texted, np.array([line for line, _ in found], dtype=np.int64)

    def _checked(self, line: int, row: tuple[str, ...]) -> tuple[str, ...]:
        """Return a row with a cell for each column."""
        count = len(self.names)
        if len(row) > count and not any(row[count:]):  # it ends in separators
            row = row[:count]
        if len(row) != count:
            advice = advice_for_row(row, count)
            self._refuse(line, f"{counted(len(row), 'cell')}; allowed: {count}, as there are names of columns{advice}")
        if row == self.names:
            self._refuse(line, "it repeats the names of the columns, as where two logs were joined; allowed: one log")
        return row

    # ---- cells to numbers

    def _values(self, rows: Sequence[tuple[int, tuple[str, ...]]], place: int) -> list[float | None]:
        """Return the numbers in a column of rows with their lines."""
        values = [self._value(row[place]) for _, row in rows]
        if None in values:
            line, row = rows[values.index(None)]
            where = f"{self.path} line {line}, column {self.names[place]!r}: {row[place]!r}"
            advice = advice_for_cell(row[place], self.form)
            raise self.error(f"{where}; allowed: a number, or nothing where there is no reading{advice}")
        return values

    def _value(self, cell: str) -> float | None:
        """Return the number in a cell, NaN for a missing value; None for anything else."""
        if cell in self._missing or _NAN.fullmatch(cell):
            return math.nan
        form = self.form
        if form.thousands and form.thousands in cell:
            whole, point, part = cell.partition(form.decimal)
            groups = whole.lstrip("+-").split(form.thousands)
            if not all(len(group) == 3 for group in groups[1:]) or not 1 <= len(groups[0]) <= 3:
                return None
            cell = f"{whole.replace(form.thousands, '')}{point}{part}"
        if form.decimal != ".":
            if "." in cell:
                return None
            cell = cell.replace(form.decimal, ".")
        if _INFINITE.fullmatch(cell):
            return float(cell)
        value = _plain_number(cell)
        if math.isnan(value):
            return None
        return math.nan if value in self._missing_numbers else value

    # ---- the last line

    def is_whole(self, line: int, tail: str, above: Sequence[str], numbers: Sequence[int]) -> bool:
        """Return False, and make a note, if a last line that no line end follows is cut off."""
        try:
            row = next(csv.reader([tail], delimiter=self._sep, skipinitialspace=True, strict=True))
        except csv.Error:
            row = []
        cut = len(row) < len(self.names) or bool(_NOT_WRITTEN.search(tail))
        if not cut and len(row) == len(self.names) and len(row) - 1 in numbers:
            value = self._value(row[-1].strip())
            cut = value is None or self._fewer_decimals(row[-1], above)
            if not cut:
                self.notes.append(f"line {line} does not end: its last number, {row[-1].strip()}, may be cut off")
        if cut:
            shown = tail if len(tail) <= _SHOWN else f"{tail[:_SHOWN]}..."
            self.notes.append(f"line {line} is cut off and left out: {shown!r}")
        return not cut

    def _fewer_decimals(self, cell: str, above: Sequence[str]) -> bool:
        """Return True if all numbers above a last one have the same number of decimals, and it has fewer."""
        mark = self.form.decimal
        decimals = [len(each.rpartition(self._sep)[2].rstrip('" ').partition(mark)[2]) for each in above]
        return len({*decimals}) == 1 and len(cell.strip().partition(mark)[2]) < decimals[0]

    def _refuse(self, line: int, what: str) -> NoReturn:
        raise self.error(f"{self.path} line {line}: {what}")


def _column(text: str, sep: str, place: int) -> list[str]:
    """Return the cells of a column of lines without quotes."""
    lines = text.split("\n")[:-1]
    if place == 0:
        return [line.partition(sep)[0].strip() for line in lines]
    return [line.split(sep, place + 1)[place].strip() for line in lines]


def _plain_number(cell: str) -> float:
    """Return a finite number, NaN for any other text."""
    value = float(cell) if _NUMBER.fullmatch(cell) else math.nan
    return value if math.isfinite(value) else math.nan


def _without_comment(line: str, comment: str) -> str:
    """Return a line up to the first comment sign outside quotes."""
    place = line.find(comment)
    while place >= 0 and line.count('"', 0, place) % 2:
        place = line.find(comment, place + 1)
    return line if place < 0 else line[:place]
