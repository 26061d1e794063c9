"""The table of what is stated of an optimal control problem, for a terminal and a notebook."""

from __future__ import annotations

from mathnavi.controllers.ocp.problem_functions import duration_row, limit_rows
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.interfaces.short_tables import Row


def table_of(s: Statement) -> tuple[str, list[Row]]:
    """Return the title and the rows: what is stated, with its limits, and which states have no dynamics yet."""
    rows = limit_rows("state", [(v.name, v.lower, v.upper) for v in s.states])
    rows += limit_rows("control", [(v.name, v.lower, v.upper) for v in s.controls])
    rows += limit_rows("path", [(row.name, row.lower, row.upper) for row in s.path])
    for at, stated, values in (("start of ", s.initial, s.starts), ("end of ", s.final, s.ends)):
        pinned = {at + name: value for name, value in values.items()}
        others = [row for row in stated if row.name not in pinned]
        rows += [(name, f"= {value}", "") for name, value in pinned.items()]
        rows += limit_rows("", [(row.name, row.lower, row.upper) for row in others])
    at_times = [(f"{row.name} at {each.time:g} s", row.lower, row.upper) for each in s.instants for row in each.rows]
    rows += limit_rows("", at_times)
    rows += limit_rows("parameter", [(each.name, each.nominal, each.nominal) for each in s.parameters])
    if s.duration is not None:
        rows.append(duration_row(s.duration.lower, s.duration.upper))
    if missing := [v.name for v in s.states if v.name not in s.rates]:
        rows.append(("no dynamics yet", ", ".join(missing), ""))
    return f"OptimalControlProblem {s.name!r}", rows
