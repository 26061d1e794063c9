"""A table is made of rows and of what its columns say of one."""

from __future__ import annotations

import pytest

from mathnavi.sim.records.table import Table


def test_a_column_is_a_value_a_format_or_a_function_of_the_row() -> None:
    rows = [{"planner": "flight", "arrived": 3, "fleets": 4}, {"planner": "faster", "arrived": 0, "fleets": 4}]
    columns = (("planner", "planner"), ("arrived", "{arrived} of {fleets}"), ("any", lambda row: row["arrived"] > 0))
    table = Table.of("Fleets", rows, columns)
    assert table == Table(
        "Fleets", ["planner", "arrived", "any"], [("flight", "3 of 4", True), ("faster", "0 of 4", False)]
    )
    with pytest.raises(KeyError, match="missing"):
        Table.of("Fleets", rows, [("missing", "missing")])
