"""Two recordings of the fixed set (``tests.regression.record``), held against each other.

    python -m tests.regression.compare BEFORE AFTER [--renamed OLD=NEW ...] [--show N]

Compared for every file of both: arrays of logs bit for bit, numbers of summaries, fields, CSV tables, events, exit
codes, pixels of pictures. Left out: wall-clock times, versions and keys of the code. Of texts, which may get
better words, only the number of those that differ is printed; ``--renamed`` lists names that were changed on purpose.
The exit code is 1 if anything differs.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from mathnavi.sim.records.timing import TIMING

_NAMES = r"solve_ms\w*|wall_s|\w+_wall_s|wall_seconds|real_time_factor|versions?|code|key"
TIMES = re.compile(rf"(^|[._ ])({_NAMES})($|[.\[])")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--renamed", nargs="*", default=[], metavar="OLD=NEW", help="names changed on purpose")
    parser.add_argument("--show", type=int, default=40, metavar="N", help="how many differences to print")
    arguments = parser.parse_args()
    renamed = dict(pair.split("=", 1) for pair in arguments.renamed)
    compared, words, differing = 0, 0, []
    for name in sorted(_files(arguments.before) | _files(arguments.after)):
        pair = arguments.before / name, arguments.after / name
        if not all(path.is_file() for path in pair):
            differing.append(f"{name}: only in {pair[0].parent if pair[0].is_file() else pair[1].parent}")
            continue
        compared += 1
        for what in _differences(pair[0], pair[1], renamed):
            if what.startswith("words"):
                words += 1
            else:
                differing.append(f"{name}: {what}")
    for line in differing[: arguments.show]:
        print(line)
    print(f"{compared} files compared, {len(differing)} differences, {words} texts with other words")
    return int(bool(differing))


def _files(folder: Path) -> set[str]:
    kept = (".npz", ".json", ".jsonl", ".csv", ".png", ".txt")
    found = (path for path in folder.rglob("*") if path.suffix in kept and path.name != TIMING)
    return {str(path.relative_to(folder)) for path in found}


def _differences(before: Path, after: Path, renamed: Mapping[str, str]) -> Iterator[str]:
    match before.suffix:
        case ".npz":
            yield from _arrays(before, after)
        case ".png":
            one, other = (np.asarray(Image.open(path).convert("RGB")) for path in (before, after))
            if not np.array_equal(one, other):
                share = np.mean(np.any(one != other, axis=-1)) if one.shape == other.shape else 1.0
                yield f"{share:.2%} of the pixels differ"
        case ".json":
            one, other = (_without_place(path) for path in (before, after))
            yield from _plain(json.loads(one), json.loads(other), "", renamed)
        case ".jsonl":
            rows = [[json.loads(line) for line in path.read_text().splitlines()] for path in (before, after)]
            yield from _plain(rows[0], rows[1], "", renamed)
        case ".csv":
            yield from _plain(_table(before), _table(after), "", renamed)
        case ".txt":
            one, other = (path.read_text() for path in (before, after))
            if one.splitlines()[0] != other.splitlines()[0]:
                yield f"{one.splitlines()[0]} became {other.splitlines()[0]}"
            elif one != other:
                yield "words"


def _arrays(before: Path, after: Path) -> Iterator[str]:
    with np.load(before) as one, np.load(after) as other:
        for name in sorted(set(one) ^ set(other)):
            yield f"{name}: only in one"
        for name in sorted(set(one) & set(other)):
            same = one[name].dtype == other[name].dtype and one[name].shape == other[name].shape
            if not TIMES.search(name) and not (same and one[name].tobytes() == other[name].tobytes()):
                yield f"{name}: differs"


def _plain(one: Any, other: Any, where: str, renamed: Mapping[str, str]) -> Iterator[str]:
    if TIMES.search(where):
        return
    if isinstance(one, dict) and isinstance(other, dict):
        one = {renamed.get(key, key): value for key, value in one.items()}
        for key in sorted(one.keys() | other.keys()):
            if key not in one or key not in other:
                if not TIMES.search(key):
                    yield f"{where}.{key}: only {'before' if key in one else 'after'}"
            else:
                yield from _plain(one[key], other[key], f"{where}.{key}", renamed)
    elif isinstance(one, list) and isinstance(other, list):
        if len(one) != len(other):
            yield f"{where}: {len(one)} entries became {len(other)}"
        for k, (a, b) in enumerate(zip(one, other, strict=False)):
            yield from _plain(a, b, f"{where}[{k}]", renamed)
    elif isinstance(one, str) and isinstance(other, str):
        if renamed.get(one, one) != other:
            yield "words" if " " in one or " " in other else f"{where}: {one!r} became {other!r}"
    elif one != other and not (one != one and other != other):
        yield f"{where}: {one!r} became {other!r}"


def _without_place(path: Path) -> str:
    """The text of a file of a run's folder, without where the recording stands."""
    return path.read_text().replace(str(path.parents[1].resolve()), "FOLDER")


def _table(path: Path) -> list[dict[str, Any]]:
    """The rows of a CSV file, in an order that keys do not change: a sweep is stored under digests of its code."""
    rows = [
        {name: _number(value) for name, value in row.items() if not TIMES.search(name)}
        for row in csv.DictReader(path.read_text().splitlines())
    ]
    return sorted(rows, key=repr) if any("seed" in row for row in rows) else rows


def _number(text: str) -> Any:
    try:
        return float(text)
    except (TypeError, ValueError):
        return text


if __name__ == "__main__":
    sys.exit(main())
