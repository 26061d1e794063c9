"""Hostile inputs, one after the other, each in a folder of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.hostile.attacks import attacks
from tests.hostile.judge import Case, Outcome, box, judged
from tests.hostile.originals import originals

DRAWN = 8  # one of so many inputs is drawn, where it is to be drawn


@dataclass(frozen=True)
class Finding:
    """An input, and how it ended."""

    number: int
    attack: str
    case: Case
    outcome: Outcome
    folder: Path
    seconds: float  # of the processor, in this process


def findings(seed: int, numbers: Sequence[int], good: Path, boxes: Path) -> Iterator[Finding]:
    """The inputs with these numbers; the folders of those that end well are gone afterwards."""
    shop = originals(good)
    boxes.mkdir(parents=True, exist_ok=True)
    for number, rng, attack in attacks(seed, numbers):
        folder = box(boxes)
        began = time.process_time()
        case = attack(rng, shop, folder / "work")
        outcome = judged(case, folder, draws=number % DRAWN == 0)
        found = Finding(number, attack.__name__, case, outcome, folder, time.process_time() - began)
        yield found
        if not found.outcome.faults:
            remove(folder)


def remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    if os.path.lexists(folder):  # deeper than paths may be long
        subprocess.run(["rm", "-rf", str(folder)], check=False)
