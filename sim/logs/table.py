"""Tables in text files as logs: each line is a reading of all columns, and an empty cell is none."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import numpy as np

from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import FieldError, LogError
from mathnavi.interfaces.field_table import TOGETHER, ValueName
from mathnavi.interfaces.reading.table_format import TableFormat
from mathnavi.interfaces.reading.tables import read_head
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.records.log_columns import bare, read_log_columns

ENDINGS = (".csv", ".tsv", ".txt", ".dat")
CHANNEL = "table"
"""name of the one channel"""
_NUMBER = re.compile(r"[+-]?(\d[\d.,' ]*|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|na|null)|-?", re.IGNORECASE)


@configuration
class TableConfig(TableFormat):
    """Format of the text, and what its columns are."""

    time: str = "t"
    """column of the times"""
    time_unit: str | None = None
    """unit of the times, s, ms, us, ns, or iso for dates; that in the column's name, else s, if not given"""
    units: Annotated[tuple[str, ...], TOGETHER, ValueName("COLUMN=UNIT...")] = ()
    """units of columns, as deg or mm; those in brackets in their names, else SI units, if not given"""
    columns: Annotated[tuple[str, ...], TOGETHER] = ()
    """names of the columns that are read; all that begin with a number if not given"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if wrong := [each for each in self.units if not each.partition("=")[0] or "=" not in each]:
            raise FieldError(f"units = {wrong[0]!r}; allowed: COLUMN=UNIT")


class TableLog:
    """Log in a text file with a table (.csv, .tsv, .txt, .dat)."""

    Config = TableConfig

    @staticmethod
    def accepts(path: Path) -> bool:
        """True for a name with one of the ``ENDINGS``."""
        return path.suffix.lower() in ENDINGS

    @staticmethod
    def read(path: Path, config: TableConfig) -> RecordedLog:
        """Read a log; LogError as of ``read_log_columns``, but for times that do not increase."""
        wanted = list(config.columns)
        left: list[str] = []
        if not wanted:
            head = read_head(path, config, LogError)
            for k, name in enumerate(head.names):
                cells = [row[k].strip() for _, row in head.rows if k < len(row)]
                if name != config.time and bare([name]) != [config.time]:
                    (wanted if all(map(_NUMBER.fullmatch, cells)) else left).append(name)
        units = dict(each.split("=", 1) for each in config.units)
        found = read_log_columns(path, config.time, wanted, config.time_unit, units, config, increasing=False)
        notes = [*found.notes, *(f"column {name!r} not read, which holds no numbers" for name in left)]
        signals = (
            f"{name} [{unit}]" if unit else name for name, unit in zip(bare(found.names), found.units, strict=True)
        )
        channel = Channel(found.t, found.values, tuple(signals))
        if np.isnan(found.values).all(axis=0).any():
            empty = [
                name for name, column in zip(channel.signals, found.values.T, strict=True) if np.isnan(column).all()
            ]
            notes.append(f"no reading in column {', '.join(map(repr, empty))}")
        clock = f"column {config.time!r}"
        return RecordedLog(str(path), "table", {CHANNEL: channel}, clock, found.start, notes=tuple(notes))
