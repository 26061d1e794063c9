"""Attacks: each makes one hostile input in a working folder, from good files, with a generator of its own."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from numpy.random import Generator

from tests.hostile import files
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import MISSION, RUNS
from tests.hostile.values import LONG, NUMBERS, PLACES, misspelt, number, one_of, text

Attack = Callable[[Generator, Path, Path], Case]  # generator, originals, working folder
ATTACKS: dict[str, tuple[Attack, int]] = {}  # each with its weight


def attack(weight: int) -> Callable[[Attack], Attack]:
    def entered(made: Attack) -> Attack:
        ATTACKS[made.__name__] = made, weight
        return made

    return entered


def bring(shop: Path, work: Path, *names: str) -> None:
    """Copy originals into the working folder."""
    for name in names:
        if (shop / name).is_dir():
            shutil.copytree(shop / name, work / name)
        else:
            shutil.copyfile(shop / name, work / name)


# Good command lines.
LINES = f"""
list
list terrains
list estimators --full
run {MISSION} --out new
run {RUNS["textbook"]} --out new
run {RUNS["arm"]} --out new
run --from textbook --out new
sweep {RUNS["textbook"]} --trials 3 --store new.db --vary noise=0,0.1
sweep {RUNS["arm"]} --trials 2 --store trials.db --vary load=0.5..2
search {MISSION} --store new.db --minimise clearance_margin_m --over start[2]=700..900 --missions 4
search {RUNS["arm"]} --store new.db --maximise velocity_error_rms --over load=0.5..2,log --batch 2
store show trials.db
store export trials.db --out new.csv
store export trials.db --out new.jsonl
study consensus --out new
study noise --terrain hills.npz --out new
study all --terrain hills.npz --out new --quick
estimate textbook_ekf textbook --out new
estimate full_state flight --out new
render textbook --still
render flight --still --camera top --time 0.1
render arm --clip --begin 0 --end 0.1
view textbook
view arm --speed 2
compare textbook textbook --out new.html
compare trials.db trials.db --out new.html
compare study study --out new.html
terrain import dem.png --out new.npz --spacing 100 --scale 1
terrain import dem.tif --out new.npz
terrain import hills.npz --out new.npz --crop 0 0 20
terrain import N42E080.hgt --out new.npz --spacing 2000
terrain show hills.npz --out new.png
terrain show tian_shan --out new.png
completion bash
completion words run safe-flight --
completion words study no
"""
COMMANDS: dict[str, list[list[str]]] = {}
for _line in LINES.strip().splitlines():
    _words = _line.split()
    COMMANDS.setdefault(" ".join(_words[: 2 if _words[0] in ("store", "terrain") else 1]), []).append(_words)


def good(rng: Generator, shop: Path, work: Path, command: str | None = None) -> tuple[str, list[str]]:
    """A good command line, with the files that it needs."""
    command = command or one_of(rng, list(COMMANDS))
    words = list(one_of(rng, COMMANDS[command]))
    bring(shop, work, *dict.fromkeys(word for word in words[1:] if word not in ("terrain", "study") and (shop / word).exists()))
    if "study" in words[1:]:
        bring(shop, work, "study")
    return command, words


def written(words: Sequence[str], work: Path) -> tuple[str, ...]:
    """What the words of a command allow it to write."""
    named = [words[k + 1] for k, word in enumerate(words[:-1]) if word in ("--out", "--store")]
    named += [word.partition("=")[2] for word in words if word.startswith(("--out=", "--store="))]
    if words and words[0] == "render":
        named += [word for word in words[1:] if (work / word[:200].replace("\0", "")).is_dir()]
    pages = [os.path.splitext(name)[0] + ending for name in named for ending in (".html", ".png")]
    return (DEFAULT_OUT, *named, *pages)


# ---- words


@attack(14)
def any_words(rng: Generator, shop: Path, work: Path) -> Case:
    """A command and words that mean nothing."""
    command = one_of(rng, list(COMMANDS))
    words = [*command.split(), *(text(rng) for _ in range(int(rng.integers(0, 4))))]
    if rng.random() < 0.15:
        words[0] = one_of(rng, (misspelt(rng, words[0]), text(rng)))
    return Case(command, "words", tuple(words), writes=written(words, work), done="any words")


@attack(26)
def changed_words(rng: Generator, shop: Path, work: Path) -> Case:
    """A good command line with a word changed, dropped, doubled or added."""
    command, words = good(rng, shop, work)
    first = len(command.split())
    k = int(rng.integers(first, len(words))) if len(words) > first else first
    kind = one_of(rng, ("text", "number", "misspelt", "gone", "twice", "added", "flag", "unknown", "cut"))
    culprits: tuple[str, ...] = ()
    if kind == "text":
        words[k:k + 1] = [text(rng)]
    elif kind == "number":
        words[k:k + 1] = [one_of(rng, NUMBERS)]
    elif kind == "misspelt" and k < len(words):
        words[k] = misspelt(rng, words[k])
    elif kind == "gone":
        del words[k : k + 1]
    elif kind == "twice":
        words[k:k] = words[k : k + 1 + int(rng.integers(2))]
    elif kind == "added":
        words.insert(k, text(rng))
    elif kind == "flag":
        words.insert(k, one_of(rng, ("--report", "--video", "--cluster", "--cluster=tcp://x", "--workers=0", "--workers=1e9", "--timeout=nan", "--rare", "--quick",
                                     "--cluster=tcp://127.0.0.1:1", "--cluster=http://[", "--retry", "--help", "-h", "--still", "--clip", "--from=.", "--no-video", "--no-out", "--out=")))  # fmt: skip
    elif kind == "unknown":
        words.append(one_of(rng, ("--xyzzy", "--out-", "--OUT", "---out", "--plan.nodes=3", "--planner=3", "--.=3", "--planner.=3", "--=", "-o", "-7", "--\udcff", "--x\n")))
        culprits = (words[-1].partition("=")[0], words[-1].partition("\n")[0], words[0], "missing", "xff")
    else:
        del words[k:]
    return Case(command, "words", tuple(words), culprits, written(words, work), f"{kind} at {k}")


@attack(12)
def places(rng: Generator, shop: Path, work: Path) -> Case:
    """A place to write to that cannot be, or is taken."""
    command, words = good(rng, shop, work, one_of(rng, ("run", "sweep", "search", "store export", "study", "estimate", "compare", "terrain import", "terrain show")))
    flag = next(word for word in words if word in ("--out", "--store"))
    place, given = one_of(rng, PLACES), words[words.index(flag) + 1]
    if rng.random() < 0.4:
        place += Path(given).suffix
    if rng.random() < 0.2:
        place = one_of(rng, ("textbook", "trials.db", "hills.npz", "study", "trials.csv", "flight/log.npz", "textbook/config.json", "precious.txt/x.npz"))
        if not (work / place.partition("/")[0]).exists():
            bring(shop, work, place.partition("/")[0])
    words[words.index(flag) + 1] = place
    writes = written(words, work)
    if Path(place).exists() if "\0" not in place and len(place) < 200 else False:
        writes = tuple(name for name in writes if not (work / name).is_file())
    return Case(command, "place", tuple(words), (flag, place), written(words, work), f"{flag} {place[:40]!r}")


@attack(8)
def read_places(rng: Generator, shop: Path, work: Path) -> Case:
    """A file or folder to read that is another thing."""
    command, words = good(rng, shop, work, one_of(rng, ("run", "store show", "store export", "study", "estimate", "render", "view", "compare", "terrain import", "terrain show")))
    candidates = [k for k, word in enumerate(words) if k and (work / word).exists()]
    if not candidates:
        return any_words(rng, shop, work)
    k = one_of(rng, candidates)
    given = words[k]
    place = one_of(rng, (*PLACES, "textbook", "trials.db", "hills.npz", "study", "arm.xml", "trials.csv", "N42E080.hgt"))
    if len(place) < 200 and "\0" not in place and (shop / place).exists() and place not in ("", ".", "..", "/", " ") and not (work / place).exists() and not place.startswith("/"):
        bring(shop, work, place)
    if rng.random() < 0.3:
        place += Path(given).suffix
    words[k] = place
    return Case(command, "place", tuple(words), (place, repr(place)[1:-1], "DIR", "FILE", "NAME", "missing"), written(words, work), f"{given} is {place[:40]!r}")


# ---- fields


@cache
def leaves(command: str, name: str) -> tuple[Any, ...]:
    """The flags of a scenario or a study, and of its plug-ins."""
    from mathnavi.sim.plugin.leaves import leaves_of
    from mathnavi.sim.plugin.registry import load

    if command == "study":
        return tuple(leaves_of(load("studies", name).Config, ""))
    scenario = load("scenarios", name)
    found = list(leaves_of(scenario.Config, ""))
    for kind, prefix, part in (("controllers", "planner", scenario.controller), ("estimators", "estimator", scenario.estimator)):
        found += leaves_of(load(kind, part).Config, prefix)
    return tuple(found)


def value_words(rng: Generator, leaf: Any) -> list[str]:
    """Words for a flag: numbers about its bounds, too many or few of them, texts."""
    if leaf.form is None or rng.random() < 0.15:
        return [text(rng)]
    count = leaf.form.count if leaf.form.count is not None else int(rng.integers(0, 5))
    if rng.random() < 0.1:
        count = max(0, count + int(rng.integers(-1, 3)))
    numeric = "FLOAT" in leaf.value_name or "INT" in leaf.value_name
    return [number(rng, leaf.marks) if numeric or rng.random() < 0.3 else text(rng) for _ in range(count)]


def cheap(name: str) -> list[str]:
    """Words that make a mission of a scenario small."""
    return {"safe-flight": MISSION.split()[1:], "simultaneous-arrival": RUNS["fleet"].split()[1:], "arm-velocity": RUNS["arm"].split()[1:]}.get(
        name, {"range-localisation": ["--duration", "0.5"], "textbook-observer": ["--duration", "0.5"], "sphere-observer": ["--duration", "0.5", "--settled", "0.1"],
               "attitude-tracking": ["--duration", "0.5", "--settled", "0.1"], "missile-guidance": ["--target", "2000", "0", "0"]}.get(name, []))  # fmt: skip


SCENARIOS = ("safe-flight", "simultaneous-arrival", "arm-velocity", "range-localisation", "textbook-observer", "sphere-observer", "attitude-tracking", "missile-guidance", "quadrotor-canyon")


@attack(45)
def fields(rng: Generator, shop: Path, work: Path) -> Case:
    """A field of a scenario or of its plug-ins at a value that it does not take, or just so."""
    command, name = one_of(rng, ("run", "run", "run", "sweep", "search")), one_of(rng, SCENARIOS)
    bring(shop, work, "hills.npz", "arm.xml")
    leaf = one_of(rng, leaves("run", name))
    own = {"sweep": ["--trials", "2", "--store", "new.db"], "search": ["--store", "new.db", "--minimise", "clearance_margin_m", "--over", "seed=0..9"]}.get(command, ["--out", "new"])
    base = cheap(name)
    if leaf.flag in base:
        k = base.index(leaf.flag)
        stop = next((j for j in range(k + 1, len(base)) if base[j].startswith("--")), len(base))
        del base[k:stop]
    values = value_words(rng, leaf)
    words = [command, name, *base, *own, leaf.flag, *values]
    last = leaf.name.replace("_", "-")
    return Case(command, f"fields of {name}", tuple(words), (leaf.flag, last, leaf.name, *values, "''", *(word for word in base if word.startswith("--"))), (DEFAULT_OUT, "new", "new.db"), f"{leaf.flag}")


@attack(10)
def study_fields(rng: Generator, shop: Path, work: Path) -> Case:
    """A study with sample sizes that cannot be."""
    from mathnavi.sim.plugin.registry import names

    name = one_of(rng, names("studies"))
    bring(shop, work, "hills.npz")
    words = ["study", name, "--out", "new"]
    found = leaves("study", name)
    leaf = one_of(rng, found) if found else None
    if leaf is not None:
        values = value_words(rng, leaf)
        words += [leaf.flag, *values]
    if rng.random() < 0.3:
        words += ["--quick"]
    culprits = (leaf.flag, leaf.name.replace("_", "-"), leaf.name, *values, "''") if leaf else ()
    return Case("study", "fields of a study", tuple(words), culprits, (DEFAULT_OUT, "new"), leaf.flag if leaf else "")


@attack(12)
def varied(rng: Generator, shop: Path, work: Path) -> Case:
    """Words of --vary and --over that are no variation."""
    command = one_of(rng, ("sweep", "search"))
    name = one_of(rng, ("textbook-observer", "arm-velocity", "safe-flight"))
    bring(shop, work, "hills.npz", "arm.xml")
    leaf = one_of(rng, leaves("run", name))
    field = one_of(rng, (leaf.flag[2:], leaf.flag[2:].replace("-", "_"), f"{leaf.flag[2:]}[{one_of(rng, ('0', '1', '-1', '99', '9' * 30, 'x', ''))}]", "seed", "controller", "estimator", text(rng)))
    low, high = number(rng, leaf.marks), number(rng, leaf.marks)
    values = one_of(rng, (f"{low}..{high}", f"{low},{high}", f"{low}...{high}", f"{low}..", f"..{high}", ",", ",,", f"{low}..{high},log", text(rng), "0..1e308", "-1e308..1e308", "0..1", "1,1", "5..4"))
    if command == "sweep":
        words = ["sweep", name, *cheap(name), "--store", "new.db", "--trials", one_of(rng, ("2", "2", "2", *NUMBERS)), "--vary", f"{field}={values}"]
    else:
        words = ["search", name, *cheap(name), "--store", "new.db", one_of(rng, ("--minimise", "--maximise")), one_of(rng, ("clearance_margin_m", text(rng))), "--over", f"{field}={values}"]
        if rng.random() < 0.3:
            words += [one_of(rng, ("--missions", "--batch", "--particles", "--repetitions", "--worst", "--until", "--workers", "--timeout", "--sampler")), one_of(rng, NUMBERS)]
    return Case(command, "variations", tuple(words), (), (DEFAULT_OUT, "new", "new.db"), f"{field}={values}"[:60])


# ---- run folders


def using_a_run(rng: Generator, run: str) -> tuple[str, tuple[str, ...]]:
    """A command that reads the folder of a run."""
    estimators = {"flight": "full_state", "arm": "riemannian_observer", "robot": "range_ekf", "textbook": "textbook_ekf", "fleet": "full_state"}
    words: tuple[tuple[str, ...], ...] = (
        ("run", "--from", run, "--out", "new"), ("estimate", one_of(rng, (estimators[run], estimators[run], "full_state", "filtered_differences")), run, "--out", "new"),
        ("view", run), ("compare", run, run, "--out", "new.html"), ("compare", run, "other", "--out", "new.html"), ("render", run, "--still"), ("render", run, "--clip"),
        ("run", *RUNS["textbook"].split(), "--out", run), ("run", "--from", run, "--out", "new", "--report"),
    )  # fmt: skip
    chosen = one_of(rng, words)
    return chosen[0], chosen


def _run_case(rng: Generator, shop: Path, work: Path, kind: str, mutate: Callable[[Path], str]) -> Case:
    run = one_of(rng, list(RUNS))
    command, words = using_a_run(rng, run)
    bring(shop, work, run, "hills.npz", "arm.xml")
    if "other" in words:
        shutil.copytree(shop / run, work / "other")
    done = mutate(work / run)
    writes = (DEFAULT_OUT, "new", "new.html", *([run] if command == "render" or words[-1] == run else []))
    culprits = (run, kind, "outside", *(words[1:2] if command == "estimate" else ()), *(("DISPLAY",) if command == "view" else ()))
    return Case(command, kind, words, culprits, writes, f"{run}: {done}")


@attack(40)
def run_config(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose config.json says something else."""
    return _run_case(rng, shop, work, "config.json", lambda folder: files.json_file(rng, folder / "config.json"))


@attack(10)
def run_code(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose config.json names modules of the working folder, which nobody asked for."""
    import json

    run = one_of(rng, list(RUNS))
    command, words = using_a_run(rng, run)
    bring(shop, work, run, "hills.npz", "arm.xml")
    if "other" in words:
        shutil.copytree(shop / run, work / "other")
    path = work / run / "config.json"
    config = json.loads(path.read_text())
    place = one_of(rng, ("drawing", "controller", "estimator", "scenario"))
    name = one_of(rng, ("evil_module", "evil_module:Evil", "evil_module.inner", "work.evil_module", ".evil_module", "os", "antigravity"))
    if place in ("controller", "estimator"):
        config[place]["name"] = name
    else:
        config[place] = name
    path.write_text(json.dumps(config))
    writes = (DEFAULT_OUT, "new", "new.html", *([run] if command == "render" or words[-1] == run else []))
    return Case(command, "config.json with code", words, (run, name, "config.json"), writes, f"{run}: {place} = {name}")


@attack(14)
def run_summary(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose summary.json says something else."""
    return _run_case(rng, shop, work, "summary.json", lambda folder: files.json_file(rng, folder / "summary.json"))


@attack(12)
def run_events(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose events.jsonl says something else."""
    return _run_case(rng, shop, work, "events.jsonl", lambda folder: files.json_lines(rng, folder / "events.jsonl"))


@attack(6)
def run_states(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose log.json says something else."""
    return _run_case(rng, shop, work, "log.json", lambda folder: files.json_file(rng, folder / "log.json"))


@attack(40)
def run_log(rng: Generator, shop: Path, work: Path) -> Case:
    """A run whose log.npz holds something else."""
    return _run_case(rng, shop, work, "log.npz", lambda folder: files.npz_file(rng, folder / "log.npz"))


@attack(20)
def run_files(rng: Generator, shop: Path, work: Path) -> Case:
    """A run of which a file is damaged, another thing, or missing."""

    def mutate(folder: Path) -> str:
        path = folder / one_of(rng, ("config.json", "summary.json", "events.jsonl", "log.npz", "log.json"))
        return (files.bytes_of if rng.random() < 0.6 else files.place_of_file)(rng, path)

    return _run_case(rng, shop, work, "run folder", mutate)


# ---- stores and studies


def using_a_store(rng: Generator) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """A command that reads a store, and what it may write."""
    sweep = ("sweep", "textbook-observer", "--duration", "0.05", "--trials", "3", "--store", "trials.db", "--vary", "noise=0,0.1")
    chosen: tuple[str, tuple[str, ...], tuple[str, ...]] = one_of(rng, (
        ("store show", ("store", "show", "trials.db"), ()), ("store show", ("store", "show", "trials.db"), ()),
        ("store export", ("store", "export", "trials.db", "--out", "new.csv"), ("new.csv",)), ("store export", ("store", "export", "trials.db", "--out", "new.jsonl"), ("new.jsonl",)),
        ("compare", ("compare", "trials.db", "trials.db", "--out", "new.html"), ("new.html",)), ("compare", ("compare", "trials.db", "other.db", "--out", "new.html"), ("new.html",)),
        ("sweep", sweep, ("trials.db",)), ("study", ("study", "consensus", "--out", "."), ("trials.db", ".")),
        ("search", ("search", "textbook-observer", "--store", "trials.db", "--minimise", "error_rms", "--over", "seed=0..9"), ("trials.db",)),
    ))  # fmt: skip
    return chosen


@attack(40)
def stores(rng: Generator, shop: Path, work: Path) -> Case:
    """A store with a cell, a table or bytes changed."""
    command, words, writes = using_a_store(rng)
    bring(shop, work, "trials.db")
    shutil.copyfile(shop / "trials.db", work / "other.db")
    path = work / "trials.db"
    mutate = one_of(rng, (files.store_file, files.store_file, files.store_file, files.bytes_of, files.place_of_file))
    return Case(command, "store", words, ("trials.db",), writes, mutate(rng, path))


@attack(14)
def studies(rng: Generator, shop: Path, work: Path) -> Case:
    """A study's document that says something else."""
    bring(shop, work, "study")
    shutil.copytree(shop / "study", work / "other")
    path = work / "study/noise.json"
    mutate = one_of(rng, (files.json_file, files.json_file, files.json_file, files.bytes_of, files.place_of_file))
    one, two = one_of(rng, (("study", "study"), ("study", "other"), ("study/noise.json", "other"), ("other", "study")))
    return Case("compare", "study's document", ("compare", one, two, "--out", "new.html"), ("study", "noise.json"), ("new.html",), mutate(rng, path))


@attack(3)
def tables(rng: Generator, shop: Path, work: Path) -> Case:
    """A table in the place of a store, or of a page."""
    bring(shop, work, "trials.csv")
    files.bytes_of(rng, work / "trials.csv")
    words = one_of(rng, (("store", "show", "trials.csv"), ("store", "export", "trials.csv", "--out", "new.csv"), ("compare", "trials.csv", "trials.csv"), ("terrain", "show", "trials.csv"),
                         ("terrain", "import", "trials.csv", "--out", "new.npz"), ("sweep", *RUNS["textbook"].split(), "--trials", "2", "--store", "trials.csv"), ("run", "--from", "trials.csv")))  # fmt: skip
    command = " ".join(words[:2]) if words[0] in ("store", "terrain") else words[0]
    return Case(command, "CSV", words, ("trials.csv",), (DEFAULT_OUT, "new.csv", "new.npz", *(["trials.csv"] if command == "sweep" else [])), "a table")


# ---- terrains


def using_a_map(rng: Generator, name: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """A command that reads a map."""
    mission = [name if word == "hills.npz" else word for word in MISSION.split()]
    chosen: tuple[str, tuple[str, ...], tuple[str, ...]] = one_of(rng, (
        ("terrain show", ("terrain", "show", name, "--out", "new.png"), ("new.png",)), ("terrain show", ("terrain", "show", name), (DEFAULT_OUT,)),
        ("terrain import", ("terrain", "import", name, "--out", "new.npz"), ("new.npz",)), ("run", ("run", *mission, "--out", "new"), ("new",)),
        ("study", ("study", "noise", "--terrain", name, "--terrain", "canyon", "--out", "new"), ("new",)), ("study", ("study", "threat", "--terrain", name, "--out", "new"), ("new",)),
        ("sweep", ("sweep", *mission, "--trials", "2", "--store", "new.db"), ("new.db",)),
    ))  # fmt: skip
    return chosen


@attack(26)
def maps(rng: Generator, shop: Path, work: Path) -> Case:
    """A map with another array, other words about it, or damaged."""
    bring(shop, work, "hills.npz")
    path = work / "hills.npz"
    mutate = one_of(rng, (files.npz_file, files.npz_file, map_meta, map_meta, files.bytes_of, files.place_of_file))
    done = mutate(rng, path)
    command, words, writes = using_a_map(rng, "hills.npz")
    return Case(command, "map .npz", words, ("hills", "start", "target", "outside"), writes, done)


def map_meta(rng: Generator, path: Path) -> str:
    """Change what a map says about itself."""
    import numpy as np

    with np.load(path) as archive:
        z, meta = archive["z"], str(archive["meta"])
    if rng.random() < 0.5:
        import json

        key = one_of(rng, ("name", "source", "licence"))
        value = one_of(rng, ("../../../../outside/precious", "../outside/precious", "../precious", "/tmp/hostile-precious", LONG, "", ".", "a/b", "\x1b[31mred", "line\nbreak", "\0", "<b>", "[bold]", "\u202e", "COM1", "\udcff"))
        made, done = json.dumps({**json.loads(meta), key: value}), f"{key} = {value[:40]!r}"
    else:
        made, done = files.json_text(rng, meta)
    np.savez(path, z=z, meta=np.array(made))
    return f"meta: {done}"


@attack(26)
def elevations(rng: Generator, shop: Path, work: Path) -> Case:
    """An elevation model that is damaged, of another kind, or asked for in a size that cannot be."""
    name = one_of(rng, ("dem.png", "N42E080.hgt", "dem.tif", "hills.npz"))
    bring(shop, work, name)
    path, done = work / name, ""
    if rng.random() < 0.5:
        done = (files.bytes_of if rng.random() < 0.8 else files.place_of_file)(rng, path)
    if rng.random() < 0.35:
        given = one_of(rng, ("N99E999.hgt", "S00W000.hgt", "dem.asc", "dem.PNG", "dem.TIF", "dem", "dem.npz", "dem.tiff", "dem.csv", "x\x1b[31m.hgt", "N42E080.png", "n42e080.hgt", "N90E000.hgt", "\u0661.hgt", "dem.hgt"))
        path.rename(work / given) if os.path.lexists(path) else None
        name, done = given, f"{done} as {given!r}"
    words = ["terrain", "import", name, "--out", "new.npz"]
    if rng.random() < 0.7:
        words += ["--spacing", one_of(rng, ("100", "0.01", "1e-300", "1e300", *NUMBERS))]
    if name.lower().endswith(".png") or rng.random() < 0.2:
        words += ["--scale", one_of(rng, ("1", "0.1", *NUMBERS))]
    if rng.random() < 0.3:
        words += ["--crop", *(one_of(rng, ("0", "1", "20", "-1", "99999999999999999999", "nan", "61")) for _ in range(int(rng.integers(2, 5))))]
    culprits = (name, repr(name)[1:-1], Path(name).stem, "--spacing", "--scale", "--crop", "spacing")
    return Case("terrain import", f"DEM {Path(name).suffix or 'without ending'}", tuple(words), culprits, ("new.npz",), f"{done} {' '.join(words[5:])}"[:90])


# ---- mechanisms and plug-ins


@attack(16)
def mechanisms(rng: Generator, shop: Path, work: Path) -> Case:
    """A mechanism whose MJCF is not one."""
    bring(shop, work, "arm.xml")
    path = work / "arm.xml"
    xml = path.read_text()
    edits = (
        ('mass="1"', f'mass="{one_of(rng, NUMBERS)[:60]}"'), ('size="0.05"', f'size="{one_of(rng, NUMBERS)[:60]}"'), ('timestep="0.001"', f'timestep="{one_of(rng, NUMBERS)[:60]}"'),
        ('type="hinge"', f'type="{one_of(rng, ("free", "ball", "slide", "nothing", ""))}"'), ('axis="0 1 0"', f'axis="{one_of(rng, ("0 0 0", "nan 0 1", "1", "1e308 1e308 0", "x y z"))}"'),
        ("<option", f'<include file="{one_of(rng, ("arm.xml", "../outside/precious.txt", "/dev/zero", "missing.xml", "pipe"))}"/><option'), ("<worldbody>", "<worldbody><body/>"),
        ('name="shoulder"', f'name="{one_of(rng, ("elbow", "", "&#27;[31m", "x" * 9999, "../x"))}"'), ("<mujoco", '<!DOCTYPE m [<!ENTITY e SYSTEM "file:///etc/passwd">]><mujoco'),
        ("</worldbody>", '</worldbody><asset><mesh name="m" file="../outside/precious.txt"/></asset>'), ("</mujoco>", ""), ("<worldbody>", "<worldbody>" + "<body>" * 3000),
        ("</worldbody>", '</worldbody><extension><plugin plugin="evil"/></extension>'), ("</worldbody>", "</worldbody><actuator><motor joint='nothing'/></actuator>"),
        ('<joint name="elbow" type="hinge" axis="0 1 0"/>', ""), ("<mujoco", "<urdf"), ("</worldbody>", '</worldbody><asset><hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/></asset>'),
        ("</worldbody>", '</worldbody><size memory="999G"/>'), ("</worldbody>", '</worldbody><keyframe><key qpos="1"/></keyframe>'), ("</worldbody>", '</worldbody><equality><joint joint1="shoulder"/></equality>'),
    )  # fmt: skip
    old, new = one_of(rng, edits)
    path.write_text(xml.replace(old, new, 1))
    done = f"{old} -> {new[:50]}"
    if rng.random() < 0.25:
        done = (files.bytes_of if rng.random() < 0.6 else files.place_of_file)(rng, path)
    command = one_of(rng, ("run", "run", "sweep"))
    own = ["--out", "new"] if command == "run" else ["--trials", "2", "--store", "new.db"]
    return Case(command, "MJCF", (command, *RUNS["arm"].split(), *own), ("mechanism", "arm.xml"), ("new", "new.db"), done)


PLUGIN = """
from dataclasses import dataclass
from types import SimpleNamespace as Made
import os, sys
import numpy as np
{top}

@dataclass(frozen=True)
class Settings:
    {field}

class Mine:
    Config = Settings
    controller = "flight"
    estimator = "full_state"
    title = "t"
    quick = Settings()

    @staticmethod
    def build(config, mission):
        {build}

    @staticmethod
    def sensors(config, mission):
        {sensors}

    @staticmethod
    def quality(config, mission):
        return None

    @staticmethod
    def run(config, setup):
        {build}
"""
DEEDS = ("raise SystemExit(0)", "sys.exit()", "sys.exit('bye')", "raise KeyboardInterrupt", "raise RuntimeError('no\\nway')", "raise Exception", "1 / 0", "return None", "return 1, 2", "return ()",
         "raise ValueError('\\x1b[31m')", "raise MemoryError", "raise RecursionError", "raise BaseException('x')", "raise StopIteration", "raise UnicodeDecodeError('utf-8', b'x', 0, 1, 'r')",
         "return Made(period=float('nan'), plan=print), Made(period=1.0, command=print, bound=None)", "(lambda f: f(f))(lambda f: f(f))", "raise OSError(28, 'full', 'x')", "import nothing_there",
         "return Made(period=-1.0, update=print)", "return Made(period=0.1, update=lambda *a: None)", "assert False", "raise GeneratorExit", "raise BrokenPipeError", "raise type('Odd', (Exception,), {'__str__': lambda s: 1 / 0})()")  # fmt: skip


@attack(22)
def plugins(rng: Generator, shop: Path, work: Path) -> Case:
    """A plug-in of the working folder that misbehaves when it is imported or built."""
    bring(shop, work, "hills.npz", "arm.xml", "textbook")
    where = one_of(rng, ("top", "build", "sensors", "field"))
    deed = one_of(rng, DEEDS)
    top = deed if not deed.startswith("return") else "x ="
    fields_of = ("gain: float = float('nan')", "gain: list = None", "gain: 'nothing' = 1", "gain: float", "gain: object = object()", "x: int = 'a'", "_a: float = 1", "seed: int = 3", "out: str = ''", "pass", "a: dict = None")
    made = PLUGIN.format(
        top=top if where == "top" else "", field=one_of(rng, fields_of) if where == "field" else "gain: float = 1.0", build=deed if where == "build" else "return None",
        sensors=deed if where == "sensors" else "return ()",
    )  # fmt: skip
    name = f"mine_{int(rng.integers(10**9))}"
    (work / f"{name}.py").write_text(made)
    plugin = one_of(rng, (f"{name}:Mine", f"{name}:Mine", f"{name}:Mine", f"{name}:Nothing", f"{name}:", f"{name}", f"{name}:Settings"))
    own = ["--out", "new"]
    mission = MISSION.split()[:-2]
    words = one_of(rng, (
        ["run", *mission, "--controller", plugin, *own], ["run", *mission, "--estimator", plugin, *own], ["run", plugin, *own], ["estimate", plugin, "textbook", *own],
        ["sweep", *RUNS["textbook"].split(), "--estimator", plugin, "--trials", "2", "--store", "new.db"], ["study", plugin, *own], ["completion", "words", "run", plugin, "--"],
        ["search", plugin, "--store", "new.db", "--minimise", "x", "--over", "gain=0..1"], ["run", *RUNS["fleet"].split(), "--consensus", plugin, *own], ["run", *mission, "--controller", plugin, "--help"],
    ))  # fmt: skip
    return Case(words[0], "plug-in", tuple(words), (name, "new.db"), ("new", "new.db", DEFAULT_OUT), f"{where}: {deed}", runs_code=True)


TERRAIN = """
import os, sys
import numpy as np
from mathnavi.models.terrain.height_field import HeightField

def made(number=0):
    {deed}
"""


@attack(5)
def apart(rng: Generator, shop: Path, work: Path) -> Case:
    """Commands in a process of their own: modules that stand in the way, plug-ins of terrains, words that are no text."""
    bring(shop, work, "hills.npz", "arm.xml", "textbook", "trials.db")
    kind = one_of(rng, ("traps", "terrain", "terrain", "words", "plug-in"))
    if kind == "traps":
        words: tuple[str, ...] = one_of(rng, (("render", "textbook", "--still"), ("terrain", "show", "hills.npz", "--out", "new.png"), ("compare", "trials.db", "trials.db", "--out", "new.html"),
                                              ("run", *RUNS["textbook"].split(), "--out", "new", "--report"), ("list", "--full")))  # fmt: skip
        writes = (DEFAULT_OUT, "new", "new.html", "new.png", *(["textbook"] if words[0] == "render" else []))
        return Case(words[0], "modules in the folder", words, (), writes, "numpy.py, PIL.py, av.py beside", apart=True)
    if kind == "terrain":
        deed = one_of(rng, (*DEEDS, "return HeightField(np.full((9, 9), np.nan), 1.0, 'x')", "return HeightField(np.zeros((9, 9)), 1.0, '../../precious')", "return HeightField(np.zeros((1, 1)), 1.0, 'x')"))
        site = work / "site"
        (site / "evil-1.0.dist-info").mkdir(parents=True)
        (site / "evil-1.0.dist-info/METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
        (site / "evil-1.0.dist-info/entry_points.txt").write_text("[mathnavi.terrains]\nevil = evil_terrain:made\n")
        (site / "evil_terrain.py").write_text(TERRAIN.format(deed=deed))
        words = one_of(rng, (("terrain", "show", "evil"), ("terrain", "show", "evil:3"), ("run", "safe-flight", "--terrain", "evil", "--out", "new"), ("list", "--full"), ("study", "noise", "--terrain", "evil", "--out", "new")))
        return Case(" ".join(words[:2]) if words[0] == "terrain" else words[0], "terrain plug-in", words, ("evil",), (DEFAULT_OUT, "new", "site"), deed, runs_code=True, apart=True,
                    environment=(("PYTHONPATH", str(site)), ("PYTHONDONTWRITEBYTECODE", "1")))  # fmt: skip
    if kind == "plug-in":
        deed = one_of(rng, ("sys.exit()", "sys.exit(0)", "raise SystemExit", "sys.exit('bye')", "raise RuntimeError"))
        (work / "mine.py").write_text(PLUGIN.format(top=deed, field="gain: float = 1.0", build="return None", sensors="return ()"))
        words = one_of(rng, (("run", *RUNS["textbook"].split(), "--estimator", "mine:Mine", "--out", "new"), ("sweep", *RUNS["textbook"].split(), "--estimator", "mine:Mine", "--trials", "1", "--store", "new.db"), ("study", "mine:Mine", "--out", "new")))
        return Case(words[0], "plug-in", words, ("mine",), ("new", "new.db"), f"top: {deed}", runs_code=True, apart=True)
    case = any_words(rng, shop, work)
    words = tuple(word for word in case.words if "\0" not in word and len(word) < 100_000)
    return Case(case.command, "words", words, (), case.writes, case.done, apart=True, environment=(("LC_ALL", "C"), ("PYTHONUTF8", "0")))


def chosen(rng: Generator) -> Attack:
    """One of the attacks, by their weights."""
    names = list(ATTACKS)
    weights = [ATTACKS[name][1] for name in names]
    return ATTACKS[names[int(rng.choice(len(names), p=[weight / sum(weights) for weight in weights]))]][0]


def cases(seed: int, numbers: Sequence[int]) -> Iterator[tuple[int, Generator, Attack]]:
    """The attacks with these numbers, each with its generator: the same for the same seed, whichever else are run."""
    from numpy.random import default_rng

    for k in numbers:
        rng = default_rng([seed, k])
        yield k, rng, chosen(rng)

