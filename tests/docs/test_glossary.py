"""Every name of the glossary stands in the file that it names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and ".py`" in line
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[1])
def test_a_name_stands_where_the_glossary_says(row: list[str]) -> None:
    file = ROOT / row[-1].strip("`")
    source = file.read_text(encoding="utf-8")
    for name in re.findall(r"`(\w+)`", row[1]):
        assert re.search(rf"\b{name}\b", source), f"{name} is not in {row[-1]}"
