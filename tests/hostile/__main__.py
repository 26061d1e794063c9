"""``python -m tests.hostile --count N --seed S``: hostile inputs over all commands and kinds of files, and their ends.

Prints each failure with the line that repeats it, then the number of inputs by command, kind and outcome, the
processor time of each attack, and the classes of failures.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import tests.conftest  # noqa: F401 - a backend to draw with, before mujoco is imported
from tests.hostile.judge import signature
from tests.hostile.program import Finding, findings, remove

SHOWN = 8  # lines of what a failure printed


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="how many inputs")
    parser.add_argument("--seed", type=int, default=0, help="of all of them")
    parser.add_argument("--only", type=int, help="one input, by its number, with all that it printed")
    parser.add_argument("--keep", type=Path, help="folder in which the folders of failures are kept")
    parser.add_argument("--originals", type=Path, help="folder of the good files, made if it is not there")
    given = parser.parse_args()
    numbers = range(given.count) if given.only is None else (given.only,)
    scratch = Path(tempfile.mkdtemp())
    ends: list[Finding] = []
    try:
        for end in findings(given.seed, numbers, given.originals or scratch / "originals", given.keep or scratch):
            ends.append(end)
            if end.outcome.faults or given.only is not None:
                print(_failure(end, given.seed, 10 * SHOWN if given.only is not None else SHOWN), flush=True)
    finally:
        remove(scratch)
    _print_counts(ends)
    failed = [end for end in ends if end.outcome.faults]
    _print_classes(failed)
    print(f"\n{len(ends)} inputs, {len(failed)} failed")
    return 1 if failed else 0


def _failure(end: Finding, seed: int, lines: int) -> str:
    """A failure in a few lines."""
    shown = (end.outcome.trace or end.outcome.error).splitlines()[-lines:]
    head = [
        f"\n{end.number:5} {end.attack}: {'; '.join(end.outcome.faults) or f'exit {end.outcome.code}'}",
        f"      {end.case.done!r}",
        f"      {shlex.join(end.case.words)[:400]!r}",
        f"      python -m tests.hostile --seed {seed} --only {end.number}",
        f"      {end.folder}",
    ]
    return "\n".join([*head, *(f"      | {line[:220]}" for line in shown)])


def _print_counts(ends: Sequence[Finding]) -> None:
    for title, name in (
        ("command", lambda end: end.case.command),
        ("kind", lambda end: end.case.kind),
        ("outcome", lambda end: "failed" if end.outcome.faults else f"exit {end.outcome.code}"),
    ):
        every = Counter(name(end) for end in ends)
        failed = Counter(name(end) for end in ends if end.outcome.faults)
        print(f"\nby {title}")
        for each, count in sorted(every.items()):
            print(f"  {each:32}{count:6}{failed[each]:6} failed")
    print("\nby attack, with the processor time in this process [s]")
    seconds: dict[str, float] = {}
    for end in ends:
        seconds[end.attack] = seconds.get(end.attack, 0.0) + end.seconds
    for each, total in sorted(seconds.items(), key=lambda item: -item[1]):
        print(f"  {each:32}{sum(end.attack == each for end in ends):6}{total:8.1f}")


def _print_classes(failed: Sequence[Finding]) -> None:
    classes: dict[str, list[Finding]] = {}
    for end in failed:
        classes.setdefault(signature(end.outcome), []).append(end)
    for name, members in sorted(classes.items(), key=lambda item: -len(item[1])):
        first = members[0]
        print(f"\n{len(members):4} x {name}")
        print(f"       {first.case.done!r:.150}")
        print(f"       {shlex.join(first.case.words)!r:.250}")
        print(f"       --only {', '.join(str(end.number) for end in members[:12])}")
        print(f"       | {(first.outcome.trace or first.outcome.error).strip().splitlines()[-1:]!r:.250}")


if __name__ == "__main__":
    sys.exit(main())
