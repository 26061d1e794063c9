"""The ledger has every claim once, a pair of columns for each terrain, and stays one table whatever a claim says."""

from __future__ import annotations

import re
from typing import Any

import pytest

from mathnavi.sim.records.claims import Claim, ledger, tally


def claim(name: str, holds: bool | None, **other: Any) -> Claim:
    fields = {"kind": "printed", "statement": f"{name} is so", "source": "A.6", "expected": "more", "measured": "3 m"}
    return Claim(name, **{**fields, **other}, holds=holds)


def cells(text: str) -> list[list[str]]:
    rows = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]] for row in rows]


def test_every_claim_has_one_row_and_every_terrain_its_columns() -> None:
    first = [claim("A.one", True), claim("A.two", False, kind="target")]
    second = [claim("A.two", None), claim("A.three", True, measured="7 m")]
    head, _, *rows = cells(ledger({"north": first, "south": second}, [], "few"))
    assert head[-4:] == ["measured on north", "holds on north", "measured on south", "holds on south"]
    assert [row[0] for row in rows] == ["A.one", "A.two", "A.three"]
    assert rows[0][-4:] == ["3 m", "yes", "", "not measured"]
    assert rows[1][-4:] == ["3 m", "no", "3 m", "not measured"]
    assert rows[2][-4:] == ["", "not measured", "7 m", "yes"]
    assert rows[1][1] == "target"


def test_what_is_measured_without_terrain_has_a_table_of_its_own() -> None:
    text = ledger({"north": [claim("A.one", True)]}, [claim("B.two", False, measured="|u|")], "few seeds")
    over, without = text.split("## Without terrain")
    assert [row[0] for row in cells(over)[2:]] == ["A.one"]
    assert cells(without)[0][-2:] == ["measured", "holds"]
    assert cells(without)[2][-2:] == [r"\|u\|", "no"]
    assert "- without terrain: 0 of 1 claims hold, 1 does not." in over
    assert "Samples: few seeds." in over


def test_a_ledger_has_no_table_without_claims() -> None:
    assert "## Over terrain" not in ledger({}, [claim("B.two", True)], "few")
    assert "## Without terrain" not in ledger({"north": [claim("A.one", True)]}, [], "few")


def test_no_text_of_a_claim_breaks_the_table() -> None:
    odd = claim("A.odd", True, statement="|a| < 3\nand more", measured="|x|")
    table = cells(ledger({"north": [odd]}, [], "few"))
    assert len({len(row) for row in table}) == 1
    assert table[2][2] == r"\|a\| < 3 and more"


def test_columns_of_short_cells_are_filled_up_so_that_the_raw_text_can_be_read() -> None:
    text = ledger({"north": [claim("A.a", True), claim("A.a-longer-name", False)]}, [], "few")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len({row.index("|", 2) for row in rows}) == 1


def test_a_tally_counts_what_holds_what_does_not_and_what_was_not_measured() -> None:
    claims = [claim("a", True), claim("b", True), claim("c", False), claim("d", None)]
    assert tally(claims) == "2 of 4 claims hold, 1 does not, 1 was not measured"
    assert tally(claims[:2]) == "2 of 2 claims hold"


def test_a_claim_of_another_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="hoped"):
        claim("a", True, kind="hoped")
