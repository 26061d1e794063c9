"""Common part of attacks: good command lines, and copies of good files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from numpy.random import Generator

from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import MISSION, RUNS
from tests.hostile.values import one_of

Attack = Callable[[Generator, Path, Path], Case]  # generator, originals, working folder

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
report textbook
report flight --out new.html
check arm.xml
check textbook-observer
check textbook_ekf
new vehicle mine
new planner mine --out new
new terrain mine --out new/mine
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
terrain import hills.npz --out new.npz --crop 0 0 2000 2000
terrain import N42E080.hgt --out new.npz --resample 2000
terrain show hills.npz --out new.png
terrain show tian_shan --out new.png
completion bash
completion words run safe-flight --
completion words study no
"""


EXPORTS = {  # lines that need an extra, by its module
    "mcap": ("export textbook --mcap new.mcap", "export robot --mcap new.mcap"),
    "rerun": ("export textbook --rerun new.rrd",),
}
LINES += "".join(f"{line}\n" for module, lines in EXPORTS.items() if find_spec(module) for line in lines)


def command_of(words: Sequence[str]) -> str:
    """The command that words call: "run", "store show"."""
    return " ".join(words[: 2 if words[:1] in (["store"], ["terrain"], ("store",), ("terrain",)) else 1])


FILES = ("--out", "--store", "--rerun", "--mcap")  # flags of what a command writes
COMMANDS: dict[str, list[list[str]]] = {}  # good command lines
for _line in LINES.strip().splitlines():
    COMMANDS.setdefault(command_of(_line.split()), []).append(_line.split())


def bring(shop: Path, work: Path, *names: str) -> None:
    """Copy originals into the working folder."""
    for name in names:
        if (shop / name).is_dir():
            shutil.copytree(shop / name, work / name)
        else:
            shutil.copyfile(shop / name, work / name)


def good(rng: Generator, shop: Path, work: Path, *commands: str) -> tuple[str, list[str]]:
    """A good command line, of one of the commands if any are given, with the files that it reads."""
    command = one_of(rng, commands or list(COMMANDS))
    words = list(one_of(rng, COMMANDS[command]))
    read = [
        word
        for word in words[1:]
        if (shop / word).is_file() or (word in RUNS and command != "run") or word == "textbook"
    ]
    bring(shop, work, *dict.fromkeys(read), *(["study"] if "study" in words[1:] else []))
    return command, words


def written(words: Sequence[str], work: Path) -> tuple[str, ...]:
    """Places in the working folder that words of a command allow it to write."""
    named = [word for flag, word in pairwise(words) if flag in FILES]
    named += [word.partition("=")[2] for word in words if word.partition("=")[0] in FILES]
    if words[:1] == ["new"]:
        named += [word for word in words[1:] if 0 < len(word) < 200]
    if words[:1] in (["render"], ["report"]):
        named += [word for word in words[1:] if len(word) < 200 and (work / word).is_dir()]
    pages = [f"{os.path.splitext(name)[0]}{ending}" for name in named for ending in (".html", ".png")]
    return (DEFAULT_OUT, *named, *pages)
