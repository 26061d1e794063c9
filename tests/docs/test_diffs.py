"""A change that a page shows as a diff, with a first line "--- FILE", fits the file as it is."""

from __future__ import annotations

import re

from tests.docs.test_blocks import ROOT

DIFF = re.compile(r"^```diff\n--- (\S+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def test_a_diff_of_a_page_begins_at_what_its_file_holds_once() -> None:
    shown = [diff for page in (ROOT / "docs").rglob("*.md") for diff in DIFF.findall(page.read_text(encoding="utf-8"))]
    assert shown
    for name, diff in shown:
        before = "".join(f"{line[1:]}\n" for line in diff.splitlines() if not line.startswith("+"))
        assert (ROOT / name).read_text(encoding="utf-8").count(before) == 1, f"{name}:\n{before}"
