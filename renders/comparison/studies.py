"""Comparison of two sets of studies: claims with another verdict, and claims with another figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading.files import read_json
from mathnavi.renders.comparison.comparison import Comparison, differing_fields, names_of_two
from mathnavi.renders.page import UNKNOWN
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.documents import StudyRecord
from mathnavi.sim.records.table import Table

KEYS = ("study", "claims")  # by which a study's document is recognised

MOST_NAMED = 3  # studies in a title

Name = tuple[str, str]  # of a study and of its terrain, "" for none


@dataclass(frozen=True)
class StudyDocument:
    """Document that a study writes: its configuration, and its claims."""

    fields: Mapping[str, Any]  # what it was done on and with
    claims: Mapping[str, Claim]  # by id


def is_study(path: Path) -> bool:
    """True if a file is a study's document."""
    try:
        document = read_json(path, dict[str, Any], ValueError)
    except (OSError, ValueError):
        return False
    return all(key in document for key in KEYS)


def documents(path: Path) -> list[Path]:
    """The documents of the studies in a folder and in those of its terrains; of a file itself."""
    found = [path] if path.is_file() else sorted([*path.glob("*.json"), *path.glob("*/*.json")])
    return [file for file in found if is_study(file)]


def read_studies(path: Path) -> dict[Name, StudyDocument]:
    """The studies at a place; ValueError for a broken document."""
    return dict(map(_read, documents(path)))


def compare_studies(left: Path, right: Path) -> Comparison:
    """Two sets of studies; errors as of ``read_studies``, and ArgumentError where they have no study in common."""
    one, other = read_studies(left), read_studies(right)
    shared = [name for name in one if name in other]
    if not shared:
        held, other_held = (", ".join(map(_called, names)) for names in (one, other))
        raise ArgumentError(f"{left} holds {held} and {right} {other_held}; allowed: a study in common")
    names = names_of_two(left, right)
    pairs = [pair for name in shared for pair in _pairs(name, one[name], other[name])]
    both = [pair for pair in pairs if pair.left and pair.right]
    verdicts = [pair for pair in both if pair.changed]
    counts = Counter(f"{pair.left.verdict} → {pair.right.verdict}" for pair in verdicts if pair.left and pair.right)
    changes = f": {', '.join(f'{count} {change}' for change, count in counts.items())}" if counts else ""
    lists = {
        "Claims with another verdict": verdicts,
        "Claims of one side only": [pair for pair in pairs if pair not in both],
        "Claims with the same verdict and another figure": [
            pair for pair in both if not pair.changed and pair.row[2] != pair.row[3]
        ],
    }
    return Comparison(
        f"studies: {', '.join(map(_called, shared)) if len(shared) <= MOST_NAMED else f'{len(shared)} in common'}",
        f"{len(verdicts)} of {len(both)} claims changed verdict{changes}.",
        names,
        str(left),
        str(right),
        [
            differing_fields(_fields(one, shared, other), _fields(other, shared, one), names),
            *(
                Table(title, ("study", "claim", *names), [pair.row for pair in listed])
                for title, listed in lists.items()
                if listed
            ),
        ],
        lambda: (),
    )


@dataclass(frozen=True)
class ClaimPair:
    """Claim on both sides; None where it is missing."""

    study: str
    id: str
    left: Claim | None
    right: Claim | None

    @property
    def changed(self) -> bool:
        """True if the verdicts of the two sides differ."""
        return self.left is None or self.right is None or self.left.holds is not self.right.holds

    @property
    def row(self) -> tuple[str, str, str, str]:
        """Study, claim, and what was found on either side."""
        statement = next(claim.statement for claim in (self.left, self.right) if claim)
        left, right = (f"{claim.verdict}: {claim.measured}" if claim else UNKNOWN for claim in (self.left, self.right))
        return self.study, f"{self.id}: {statement}", left, right


def _read(path: Path) -> tuple[Name, StudyDocument]:
    record: StudyRecord = read_json(path, StudyRecord, ValueError)
    terrain = record.terrain
    fields = {"first_look": record.first_look, "command": record.command}
    fields |= {"terrain's digest": terrain.digest if terrain else None}
    return (record.study, terrain.name if terrain else ""), StudyDocument(fields, {c.id: c for c in record.claims})


def _called(name: Name) -> str:
    return f"{name[0]} over {name[1]}" if name[1] else name[0]


def _fields(
    studies: Mapping[Name, StudyDocument], shared: Sequence[Name], others: Mapping[Name, StudyDocument]
) -> dict[str, Any]:
    """The fields of each study in common, and the studies of this side only."""
    fields = {f"{_called(name)}: {key}": value for name in shared for key, value in studies[name].fields.items()}
    alone = [_called(name) for name in studies if name not in others]
    return {"studies of this side only": ", ".join(alone) or "none", **fields}


def _pairs(name: Name, left: StudyDocument, right: StudyDocument) -> list[ClaimPair]:
    ids = dict.fromkeys([*left.claims, *right.claims])
    return [ClaimPair(_called(name), key, left.claims.get(key), right.claims.get(key)) for key in ids]
