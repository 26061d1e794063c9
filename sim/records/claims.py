"""Claims, printed in the thesis or required, each with the measured value; and their ledger."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Literal

from mathnavi.interfaces.bounds import configuration

Kind = Literal["printed", "target"]
VERDICTS = {True: "yes", False: "no", None: "not measured"}
WIDEST = 40  # [characters] of a padded column, so that the text is readable where it is not rendered


@configuration(prefix="claim {id!r}: ")
class Claim:
    """Claim with its measured value and whether it holds."""

    id: str
    kind: Kind  # "printed": in the thesis, and may honestly not hold; "target": required of this software
    statement: str
    source: str  # where it stands
    expected: str
    measured: str
    holds: bool | None  # None: not measured

    @property
    def verdict(self) -> str:
        """Verdict in one word."""
        return VERDICTS[self.holds]


def tally(claims: Sequence[Claim]) -> str:
    """Return the numbers of claims that hold and that do not, in words."""
    counts = Counter(claim.verdict for claim in claims)
    counted = [f"{counts['yes']} of {len(claims)} claims {'holds' if counts['yes'] == 1 else 'hold'}"]
    if missed := counts["no"]:
        counted.append(f"{missed} {'does' if missed == 1 else 'do'} not")
    if unknown := counts["not measured"]:
        counted.append(f"{unknown} {'was' if unknown == 1 else 'were'} not measured")
    return ", ".join(counted)


def ledger(over_terrain: Mapping[str, Sequence[Claim]], without: Sequence[Claim], samples: str) -> str:
    """Return the claims as Markdown: a table of those that are measured over terrain, a table of the others.

    The first has a pair of columns for each terrain. ``samples`` describes the samples that were measured.
    """
    tables, tallies = [], [f"- {terrain}: {tally(claims)}.\n" for terrain, claims in over_terrain.items()]
    if any(over_terrain.values()):
        tables.append(f"## Over terrain\n\n{_over_terrain(over_terrain)}")
    if without:
        head = ["id", "kind", "claim", "where in the thesis", "expected", "measured", "holds"]
        tables.append(f"## Without terrain\n\n{_table(head, [[*_cells(c), c.measured, c.verdict] for c in without])}")
        tallies.append(f"- without terrain: {tally(without)}.\n")
    return (
        "# Claims\n\n"
        "What the thesis prints (kind `printed`; it may honestly not hold) and what this software must reach (kind\n"
        "`target`), each with the measured value. Written by `mathnavi study all`.\n\n"
        f"Samples: {samples}.\n\n" + "".join(tallies) + "\n" + "\n".join(tables)
    )


def _cells(claim: Claim) -> list[str]:
    return [claim.id, claim.kind, claim.statement, claim.source, claim.expected]


def _over_terrain(claims: Mapping[str, Sequence[Claim]]) -> str:
    by_id = {terrain: {claim.id: claim for claim in found} for terrain, found in claims.items()}
    first: dict[str, Claim] = {}
    for measured in claims.values():
        for claim in measured:
            first.setdefault(claim.id, claim)
    head = ["id", "kind", "claim", "where in the thesis", "expected"]
    head += [f"{what} {terrain}" for terrain in claims for what in ("measured on", "holds on")]
    rows = []
    for name, claim in first.items():
        row = _cells(claim)
        for terrain in claims:
            found = by_id[terrain].get(name)
            row += [found.measured if found else "", found.verdict if found else VERDICTS[None]]
        rows.append(row)
    return _table(head, rows)


def _table(head: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    rows = [[" ".join(cell.split()).replace("|", "\\|") for cell in row] for row in cells]
    widths = [max(len(cell) for cell in column) for column in zip(head, *rows, strict=True)]
    widths = [width if width <= WIDEST else 3 for width in widths]
    lines = [head, ["-" * width for width in widths], *rows]
    return "".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))} |\n" for line in lines
    )
