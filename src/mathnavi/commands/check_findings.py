"""Findings of a check of a model or a plug-in: what fits, and what is missing, each with the line to write."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

MJCF = "https://mujoco.readthedocs.io/en/stable/XMLreference.html lists elements and attributes"


@dataclass(frozen=True)
class Finding:
    """Something that a run would fail at, or that it would do otherwise than its author may expect."""

    what: str  # names the element
    write: str  # the line to write, and where
    stops: bool = True  # False for a note: the run goes on
    word: str = "missing"  # of one that stops a run


@dataclass
class CheckResult:
    """Result of a check."""

    subject: str
    facts: list[tuple[str, str]] = field(default_factory=list)  # heading and text, in the order in which they are shown
    findings: list[Finding] = field(default_factory=list)
    command: str = ""  # that runs it; "" where something is missing, or nothing can be run

    @property
    def fits(self) -> bool:
        """True if nothing is missing that a run needs."""
        return not any(finding.stops for finding in self.findings)

    def fact(self, heading: str, texts: Sequence[str]) -> None:
        """Add what fits; each text becomes a line, below the same heading."""
        self.facts += [(heading if k == 0 else "", text) for k, text in enumerate(texts)]

    def missing(self, what: str, write: str) -> None:
        """Add something that stops a run."""
        self.findings.append(Finding(what, write))

    def refused_by_mujoco(self, message: str, place: str) -> None:
        """Add what MuJoCo itself refuses to compile: its own message, and the line to correct in the file."""
        line = re.search(r"[Ll]ine(?: number)?[ =]([1-9]\d*)", message)
        where = f"line {line[1]} of {place}" if line else place
        self.findings.append(Finding(message, f"correct {where}: {MJCF}", word="refused"))

    def note(self, what: str, write: str) -> None:
        """Add something that does not stop a run."""
        self.findings.append(Finding(what, write, stops=False))

    def refused(self, message: str) -> None:
        """Add a refusal of mathnavi's own: "what is wrong; allowed: what to write"."""
        what, allowed, write = message.partition("; allowed: ")
        self.missing(what, f"what is allowed: {write}" if allowed else "")


def split_joined(names: Sequence[str], most: int = 12) -> str:
    """Return names in a row, without those beyond ``most``, which are counted."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")
