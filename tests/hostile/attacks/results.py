"""Stores of sweeps, documents of studies and tables, changed or damaged."""

from __future__ import annotations

import shutil
from pathlib import Path

from numpy.random import Generator

from tests.hostile import files
from tests.hostile.attacks.attack import Attack, bring, command_of
from tests.hostile.cells import store_file
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import RUNS, SWEEP
from tests.hostile.values import one_of

STORE_LINES = f"""
store show trials.db
store show trials.db
store export trials.db --out new.csv
store export trials.db --out new.jsonl
compare trials.db trials.db --out new.html
compare trials.db other.db --out new.html
{SWEEP}
study consensus --out .
search {RUNS["textbook"]} --store trials.db --minimise error_rms --over noise=0..1
"""
STUDY_LINES = """
compare study study --out new.html
compare study other --out new.html
compare other study --out new.html
compare study/noise.json other --out new.html
"""
TABLE_LINES = f"""
store show trials.csv
store export trials.csv --out new.csv
compare trials.csv trials.csv
terrain show trials.csv
terrain import trials.csv --out new.npz
sweep {RUNS["textbook"]} --trials 2 --store trials.csv
run --from trials.csv
"""


def _line(rng: Generator, lines: str) -> list[str]:
    return one_of(rng, lines.strip().splitlines()).split()


def stores(rng: Generator, shop: Path, work: Path) -> Case:
    """A store with a cell, a table or bytes changed."""
    words = _line(rng, STORE_LINES)
    bring(shop, work, "trials.db")
    shutil.copyfile(shop / "trials.db", work / "other.db")
    mutation = one_of(rng, (*[store_file] * 3, files.bytes_of, files.place_of_file))
    writes = {"sweep": (".",), "search": (".",), "study": (".",)}.get(words[0], tuple(words[-1:]))
    done = mutation(rng, work / "trials.db")
    return Case(command_of(words), "store", tuple(words), ("trials.db",), writes, done)


def studies(rng: Generator, shop: Path, work: Path) -> Case:
    """A study's document that says something else."""
    bring(shop, work, "study")
    shutil.copytree(shop / "study", work / "other")
    mutation = one_of(rng, (*[files.json_file] * 3, files.bytes_of, files.place_of_file))
    done, words = mutation(rng, work / "study/noise.json"), _line(rng, STUDY_LINES)
    return Case("compare", "study's document", tuple(words), ("study", "noise.json"), ("new.html",), done)


def tables(rng: Generator, shop: Path, work: Path) -> Case:
    """A table in the place of another file."""
    bring(shop, work, "trials.csv")
    done, words = files.bytes_of(rng, work / "trials.csv"), _line(rng, TABLE_LINES)
    writes = (DEFAULT_OUT, "new.csv", "new.npz", *(["trials.csv"] if words[0] == "sweep" else []))
    return Case(command_of(words), "CSV", tuple(words), ("trials.csv",), writes, done)


ATTACKS: dict[Attack, int] = {stores: 40, studies: 14, tables: 4}
