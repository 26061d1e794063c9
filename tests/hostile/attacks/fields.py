"""Fields of scenarios, plug-ins and studies, at values that they do not take, or just so."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from numpy.random import Generator

from mathnavi.interfaces.field_table import Field, leaves_of
from mathnavi.sim.plugin.registry import load, names
from tests.hostile.attacks.attack import Attack, bring
from tests.hostile.judge import DEFAULT_OUT, Case
from tests.hostile.originals import MISSION, RUNS
from tests.hostile.values import NUMBERS, number, one_of, text

SMALL = {  # words that make a mission small
    "safe-flight": MISSION,
    "simultaneous-arrival": RUNS["fleet"],
    "arm-velocity": RUNS["arm"],
    "range-localisation": RUNS["robot"],
    "textbook-observer": RUNS["textbook"],
    "sphere-observer": "sphere-observer --duration 0.5 --settled 0.1",
    "attitude-tracking": "attitude-tracking --duration 0.5 --settled 0.1",
    "missile-guidance": "missile-guidance --target 2000 0 0",
    "quadrotor-canyon": "quadrotor-canyon",
}
STORED = "--store new.db"
OWN = {
    "run": "--out new",
    "sweep": f"--trials 2 {STORED}",
    "search": f"{STORED} --minimise clearance_margin_m --over seed=0..9",
}
COUNTS = [
    "--missions",
    "--batch",
    "--particles",
    "--repetitions",
    "--worst",
    "--until",
    "--workers",
    "--timeout",
    "--sampler",
]


@cache
def leaves(name: str) -> tuple[Field, ...]:
    """The flags of a scenario and of its plug-ins."""
    scenario = load("scenarios", name)
    parts = (("controllers", "planner", scenario.controller), ("estimators", "estimator", scenario.estimator))
    own = [leaf for kind, prefix, part in parts for leaf in leaves_of(load(kind, part).Config, prefix)]
    return (*leaves_of(scenario.Config), *own)


def values(rng: Generator, leaf: Field) -> list[str]:
    """Words for a flag: numbers about its bounds, too many or too few of them, texts."""
    if not leaf.form.readable or rng.random() < 0.15:
        return [text(rng)]
    count = leaf.form.count if leaf.form.count is not None else int(rng.integers(0, 5))
    if rng.random() < 0.1:
        count = max(0, count + int(rng.integers(-1, 3)))
    numeric = "FLOAT" in leaf.value_name or "INT" in leaf.value_name
    return [number(rng, leaf.form.marks) if numeric or rng.random() < 0.3 else text(rng) for _ in range(count)]


def named(leaf: Field, given: list[str]) -> tuple[str, ...]:
    """Words by which an error may name a field or its value."""
    return leaf.flag, leaf.name, leaf.name.replace("_", "-"), *given, "''"


def fields(rng: Generator, shop: Path, work: Path) -> Case:
    """A field of a scenario or of its plug-ins."""
    command, name = one_of(rng, ("run", "run", "run", "sweep", "search")), one_of(rng, list(SMALL))
    bring(shop, work, "hills.npz", "arm.xml")
    leaf = one_of(rng, leaves(name))
    given, words = values(rng, leaf), [command, *SMALL[name].split(), *OWN[command].split()]
    if leaf.flag in words:
        k = words.index(leaf.flag)
        end = next((j for j in range(k + 1, len(words)) if words[j].startswith("--")), len(words))
        del words[k:end]
    beside = (word for word in words if word.startswith("--"))  # a field may not fit to another one
    culprits = (*named(leaf, given), *beside)
    writes = (DEFAULT_OUT, "new", "new.db")
    return Case(command, f"fields of {name}", (*words, leaf.flag, *given), culprits, writes, leaf.flag)


def study_fields(rng: Generator, shop: Path, work: Path) -> Case:
    """A study with sample sizes that cannot be."""
    name = one_of(rng, names("studies"))
    words, culprits = ["study", name, "--out", "new"], ()
    found = tuple(leaves_of(load("studies", name).Config))
    if found:
        leaf = one_of(rng, found)
        given = values(rng, leaf)
        words, culprits = [*words, leaf.flag, *given], named(leaf, given)
    if rng.random() < 0.3:
        words.append("--quick")
    return Case("study", "fields of a study", tuple(words), culprits, (DEFAULT_OUT, "new"), " ".join(words[4:5]))


def variations(rng: Generator, shop: Path, work: Path) -> Case:
    """Words of --vary and --over that are no variation."""
    command = one_of(rng, ("sweep", "search"))
    name = one_of(rng, ("textbook-observer", "arm-velocity", "safe-flight"))
    bring(shop, work, "hills.npz", "arm.xml")
    leaf = one_of(rng, leaves(name))
    own = leaf.flag[2:]
    index = one_of(rng, ("0", "1", "-1", "99", "9" * 30, "x", ""))
    field = one_of(rng, (own, own.replace("-", "_"), f"{own}[{index}]", "seed", "controller", "estimator", text(rng)))
    low, high = number(rng, leaf.form.marks), number(rng, leaf.form.marks)
    ranges = (
        f"{low}..{high}",
        f"{low},{high}",
        f"{low}...{high}",
        f"{low}..",
        f"..{high}",
        f"{low}..{high},log",
        text(rng),
    )
    values = one_of(rng, (*ranges, ",", ",,", "0..1e308", "-1e308..1e308", "0..1", "1,1", "5..4"))
    words = [command, *SMALL[name].split(), *STORED.split()]
    if command == "sweep":
        words += ["--trials", one_of(rng, ("2", "2", "2", *NUMBERS)), "--vary", f"{field}={values}"]
    else:
        figure = one_of(rng, ("clearance_margin_m", text(rng)))
        words += [one_of(rng, ("--minimise", "--maximise")), figure, "--over", f"{field}={values}"]
        words += [one_of(rng, COUNTS), one_of(rng, NUMBERS)] if rng.random() < 0.3 else []
    return Case(command, "variations", tuple(words), (), (DEFAULT_OUT, "new.db"), f"{field}={values}"[:60])


ATTACKS: dict[Attack, int] = {fields: 50, study_fields: 12, variations: 14}
