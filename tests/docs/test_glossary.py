"""Every name of the glossary stands in the file that it names."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and ".py`" in line
]


def test_a_name_stands_where_the_glossary_says() -> None:
    assert len(ROWS) > 50
    missing = [
        f"{name} is not in {row[-1]}"
        for row in ROWS
        for name in re.findall(r"`(\w+)`", row[1])
        if not re.search(rf"\b{name}\b", (ROOT / row[-1].strip("`")).read_text(encoding="utf-8"))
    ]
    assert missing == []
