"""The peers' table in Markdown: each problem, the replayed accuracy that each software came to, and its CPU seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from benchmarks.ocp_peers import Entry, PeerFindings


def peers_table(findings: PeerFindings, software: Mapping[str, str], machine: Mapping[str, Any]) -> str:
    """Table with a row for each problem and two columns for each ``software``, by its key in the entries.

    The last columns are the level of accuracy at which ours and MAPTOR are compared, and the ratio of their times.
    """
    found = {(entry.problem, entry.software): entry for entry in findings.entries}
    ratios = {row.what: row.ratio for row in findings.comparisons() if row.software == software["maptor"]}
    heads = [f"{name}: {what}" for name in software.values() for what in ("accuracy", "CPU s")]
    lines = [_line(["problem", *heads, "compared at", f"ours / {software['maptor']}"])]
    lines.append(_line(["---", *["--:"] * (len(heads) + 2)]))
    for problem in dict.fromkeys(entry.problem for entry in findings.entries):
        cells = [cell for key in software for cell in _cells(found.get((problem, key)))]
        compared = [(what, ratio) for what, ratio in ratios.items() if what.rpartition(", ")[0] == problem]
        ending = [compared[0][0].rpartition(", ")[2], f"{compared[0][1]:.2f}"] if compared else ["", ""]
        lines.append(_line([problem, *cells, *ending]))
    lines.append("")
    lines += [
        f"{claim['statement']}: **{claim['measured']:.3g}**, wanted {claim['expected']}." for claim in findings.claims()
    ]
    versions = machine["versions"]
    named = ", ".join(f"{name} {versions[name]}" for name in ("casadi", "maptor", "dymos") if versions.get(name))
    load = machine["load_before"][0]
    lines += ["", f"{machine['processor']}, {machine['cores']} cores, load {load:g} at the start; {named}.", ""]
    return "\n".join(lines)


def _cells(entry: Entry | None) -> list[str]:
    """Accuracy and CPU seconds of the attempt that is shown."""
    if entry is None:
        return ["", ""]
    best = entry.best
    if best is None:
        return ["none", entry.ended]
    return [f"{best.accuracy:.0e}", f"{np.median(best.seconds):.3g}"]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
