"""Run folders of which a file says something else, is damaged, or is another thing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from numpy.random import Generator

from tests.hostile import files
from tests.hostile.arrays import npz_file
from tests.hostile.attacks.attack import COMMANDS, Attack, bring
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import RUNS
from tests.hostile.values import one_of

LINES = f"""
view RUN
view RUN
compare RUN RUN --out new.html
compare RUN other --out new.html
estimate ESTIMATOR RUN --out new
estimate ESTIMATOR RUN --out new
run --from RUN --out new
run {RUNS["textbook"]} --out RUN
render RUN --still
report RUN --out new.html
report RUN
"""
SLOW_LINES = """
run --from RUN --out new --report
render RUN --clip
render RUN
"""
LINES += "export RUN --mcap new.mcap\n" * ("export" in COMMANDS)
SLOW = 0.05  # share of what takes long
ESTIMATORS = {
    "flight": "full_state",
    "arm": "riemannian_observer",
    "robot": "range_ekf",
    "textbook": "textbook_ekf",
    "fleet": "full_state",
}
NAMES = [
    "evil_module",
    "evil_module:Evil",
    "evil_module.inner",
    "work.evil_module",
    ".evil_module",
    "os",
    "antigravity",
]
Mutation = Callable[[Generator, Path], str]  # of a folder; returns what was done


def _case(rng: Generator, shop: Path, work: Path, kind: str, mutation: Mutation) -> Case:
    run = one_of(rng, list(RUNS))
    estimator = one_of(rng, (ESTIMATORS[run], ESTIMATORS[run], "full_state", "filtered_differences"))
    line = one_of(rng, (SLOW_LINES if rng.random() < SLOW else LINES).strip().splitlines())
    words = tuple(line.replace("RUN", run).replace("ESTIMATOR", estimator).split())
    bring(shop, work, run, "hills.npz", "arm.xml")
    if "other" in words:
        shutil.copytree(shop / run, work / "other")
    done = mutation(rng, work / run)
    writes = (
        DEFAULT_OUT,
        "new",
        "new.html",
        "new.mcap",
        *([run] if words[0] in ("render", "report") or words[-1] == run else []),
    )
    beside = {"estimate": (estimator,), "view": ("DISPLAY",)}.get(words[0], ())
    return Case(
        words[0], kind, words, (run, kind, "outside", done.rpartition(" ")[2], *beside), writes, f"{run}: {done}"
    )


def config(rng: Generator, shop: Path, work: Path) -> Case:
    """A config.json that says something else."""
    return _case(rng, shop, work, "config.json", lambda rng, folder: files.json_file(rng, folder / "config.json"))


def summary(rng: Generator, shop: Path, work: Path) -> Case:
    """A summary.json that says something else."""
    return _case(rng, shop, work, "summary.json", lambda rng, folder: files.json_file(rng, folder / "summary.json"))


def events(rng: Generator, shop: Path, work: Path) -> Case:
    """An events.jsonl that says something else."""
    return _case(rng, shop, work, "events.jsonl", lambda rng, folder: files.json_lines(rng, folder / "events.jsonl"))


def states(rng: Generator, shop: Path, work: Path) -> Case:
    """A log.json that says something else."""
    return _case(rng, shop, work, "log.json", lambda rng, folder: files.json_file(rng, folder / "log.json"))


def log(rng: Generator, shop: Path, work: Path) -> Case:
    """A log.npz that holds something else."""
    return _case(rng, shop, work, "log.npz", lambda rng, folder: npz_file(rng, folder / "log.npz"))


def folder(rng: Generator, shop: Path, work: Path) -> Case:
    """A file that is damaged, another thing, or missing."""

    def mutation(rng: Generator, folder: Path) -> str:
        path = folder / one_of(rng, ("config.json", "summary.json", "events.jsonl", "log.npz", "log.json"))
        return (files.bytes_of if rng.random() < 0.6 else files.place_of_file)(rng, path)

    return _case(rng, shop, work, "run folder", mutation)


def code(rng: Generator, shop: Path, work: Path) -> Case:
    """A config.json that names modules of the working folder, which nobody asked for."""

    def mutation(rng: Generator, folder: Path) -> str:
        path = folder / "config.json"
        content = json.loads(path.read_text())
        part, name = one_of(rng, ("drawing", "controller", "estimator", "scenario")), one_of(rng, NAMES)
        if part in ("controller", "estimator"):
            content[part]["name"] = name
        else:
            content[part] = name
        path.write_text(json.dumps(content))
        return f"{part} = {name}"

    return _case(rng, shop, work, "config.json", mutation)


ATTACKS: dict[Attack, int] = {config: 40, summary: 14, events: 12, states: 6, log: 40, folder: 20, code: 12}
