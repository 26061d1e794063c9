"""``python -m tests.hostile --count N --seed S``: hostile inputs over all commands and kinds of files, and how they end.

Prints the number of inputs by command, kind and outcome, and each failure with the line that repeats it.
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path

import tests.conftest  # noqa: F401 - a backend to draw with, before mujoco is imported
from tests.hostile.judge import signature
from tests.hostile.program import Finding, findings


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
    seconds: Counter[str] = Counter()
    ends: Counter[tuple[str, str, str]] = Counter()
    failed: list[Finding] = []
    try:
        for found in findings(given.seed, numbers, given.originals or scratch / "originals", given.keep or scratch):
            seconds[found.attack] += found.seconds  # type: ignore[assignment]
            end = "; ".join(found.outcome.faults) or f"exit {found.outcome.code}"
            ends[found.case.command, found.case.kind, "failed" if found.outcome.faults else end] += 1
            if found.outcome.faults:
                failed.append(found)
                print(f"\n{found.number:5} {found.attack}: {end}\n      {found.case.done!r}\n      {shlex.join(found.case.words)[:400]!r}")
                print(f"      python -m tests.hostile --seed {given.seed} --only {found.number}")
            if found.outcome.faults or given.only is not None:
                shown = found.outcome.trace or found.outcome.error
                print("\n".join(f"      | {line[:220]}" for line in shown.splitlines()[-30 if given.only is not None else -7 :]))
                print(f"      folder {found.folder}") if given.keep else None
            sys.stdout.flush()
    finally:
        if given.keep is None:
            shutil.rmtree(scratch, ignore_errors=True)
    for title, place in (("command", 0), ("kind", 1), ("outcome", 2)):
        print(f"\nby {title}")
        sums: Counter[str] = Counter()
        bad: Counter[str] = Counter()
        for key, count in ends.items():
            sums[key[place]] += count
            bad[key[place]] += count * (key[2] == "failed")
        for name, count in sorted(sums.items()):
            print(f"  {name:32}{count:6}{bad[name]:6} failed")
    print("\nprocessor time of each attack [s]")
    for name, total in seconds.most_common():
        print(f"  {name:32}{total:8.1f}")
    classes: dict[str, list[Finding]] = {}
    for found in failed:
        classes.setdefault(signature(found.outcome), []).append(found)
    for name, members in sorted(classes.items(), key=lambda item: -len(item[1])):
        first = members[0]
        numbers_of = ", ".join(str(found.number) for found in members[:12])
        print(f"\n{len(members):4} x {name}\n       {first.case.done!r:.150}\n       {shlex.join(first.case.words)!r:.250}\n       --only {numbers_of}")
        print(f"       | {(first.outcome.trace or first.outcome.error).strip().splitlines()[-1:]!r:.250}")
    print(f"\n{sum(ends.values())} inputs, {len(failed)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
