"""Short names of folders: the ends of their paths that tell them apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path


def names_of(folders: Sequence[Path]) -> list[str]:
    """Return a name of each folder: its last part, with as many parts before it as tell it from the others.

    Folders that are the same have numbers: "run", "run (2)".
    """
    parts = [folder.resolve().parts for folder in folders]
    taken = [1] * len(parts)
    while True:
        names = ["/".join(own[-count:]) for own, count in zip(parts, taken, strict=True)]
        counts = Counter(names)
        longer = [
            count + (counts[name] > 1 and count < len(own))
            for name, own, count in zip(names, parts, taken, strict=True)
        ]
        if longer == taken:
            break
        taken = longer
    seen: Counter[str] = Counter()
    found = []
    for name, own in zip(names, parts, strict=True):
        plain = own[-1] if counts[name] > 1 else name
        seen[name] += 1
        found.append(plain if seen[name] == 1 else f"{plain} ({seen[name]})")
    return found
