"""Tables as Parquet: a column has one type, and missing values are null."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.writing import write_bytes
from mathnavi.sim.records.store import cell, columns_of

WIDEST = range(-(2**63), 2**63)  # of a whole number


def write_parquet(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as a table, whole or not at all; FieldError if pyarrow is not installed.

    A column of truth values, whole numbers, numbers or texts keeps its type; in any other one all values are texts,
    with JSON for values that are not texts, as in CSV.
    """
    arrow, parquet = extra("pyarrow", "Parquet"), extra("pyarrow.parquet", "Parquet")
    types = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    names = columns_of(rows)
    arrays = []
    for name in names:
        values = [row.get(name) for row in rows]
        kind = _type_of(values)
        arrays.append(arrow.array([None if value is None else _as(kind, value) for value in values], types[kind]))
    content = io.BytesIO()
    parquet.write_table(arrow.table(arrays, names=names), content)
    write_bytes(path, content.getvalue())


def _type_of(values: Sequence[Any]) -> type:
    found = {type(value) for value in values if value is not None}
    if found == {bool}:
        return bool
    if found == {int}:
        return int if all(value is None or value in WIDEST for value in values) else str
    return float if found and found <= {int, float} else str


def _as(kind: type, value: Any) -> Any:
    return str(cell(value)) if kind is str else kind(value)
