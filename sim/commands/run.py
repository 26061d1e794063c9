"""``mathnavi run``: fly a scenario, judge it, and write its folder."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from renders import opengl
from sim.commands.arguments import Group, flags, given, parse, value_of, with_flag
from sim.commands.errors import BadInputError, bad_input
from sim.commands.saved import Saved
from sim.commands.summary import summary_table
from sim.plugins import Part, load, names

DERIVED = ("video.mp4", "report.html", *(f"{camera}.{kind}" for camera in ("chase", "overview", "top") for kind in ("mp4", "png")))
USAGE = "usage: mathnavi run SCENARIO [OPTIONS]      SCENARIO: {}\n`mathnavi run SCENARIO --help` lists the options."


@dataclass(frozen=True)
class Options:
    """Flags of every scenario."""

    seed: int = 0
    """of every random draw: the same seed gives the same log, bit for bit"""
    out: Path | None = None
    """folder of the run; renders/out/SCENARIO-seedN if not given"""
    video: bool = False
    """draw video.mp4"""
    report: bool = False
    """write report.html"""
    from_: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """run folder whose config.json is run again; flags beside it take precedence"""
    controller: str = ""
    """name of a plug-in, or package.module:Class; its fields are --planner.*"""
    estimator: str = ""
    """name of a plug-in, or package.module:Class; its fields are --estimator.*"""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed = {self.seed}; allowed: a whole number >= 0")


@dataclass(frozen=True)
class Order:
    """Everything that was asked for."""

    name: str  # of the scenario
    scenario: Any
    options: Options
    config: Any
    controller: Part
    estimator: Part
    known: tuple[str, ...]  # flags
    saved: Saved | None

    @property
    def folder(self) -> Path:
        return self.options.out or Path("renders/out") / f"{self.name.replace(':', '.')}-seed{self.options.seed}"


def main(argv: Sequence[str]) -> int:
    if not argv or argv[0] in ("-h", "--help"):
        print(USAGE.format(", ".join(names("scenarios"))), file=sys.stdout if argv else sys.stderr)
        return 0 if argv else 2
    opengl.choose_backend()
    sys.path.append(os.getcwd())  # where a user's own plug-in lies, "my_planner:Mine"
    try:
        order = read_order(argv)
    except SystemExit:  # the help is printed
        return 0
    errors = Console(stderr=True)
    with output_folder(order.folder), compilation_told(errors):
        experiment = build(order)
        outcome = fly(experiment, errors)
        with bad_input():
            outcome.write(order.folder)
    for stale in DERIVED:
        (order.folder / stale).unlink(missing_ok=True)

    console = Console()
    verdict = "the mission did what it should" if outcome.success else "the mission did NOT do what it should"
    kinds = Counter(event.kind for event in outcome.recording.events)
    console.print(summary_table(f"{order.name}, seed {order.options.seed}: {verdict}", outcome.summary, kinds))
    _draw(order, errors)
    console.print(f"run     {order.folder}", soft_wrap=True, highlight=False)
    for made in ("video.mp4", "report.html"):
        if (order.folder / made).is_file():
            console.print(f"{made.partition('.')[0]:8}{order.folder / made}", soft_wrap=True, highlight=False)
    return 0 if outcome.success else 1


def read_order(argv: Sequence[str]) -> Order:
    """What ``argv`` asks for, on top of what a saved run says."""
    source = value_of("--from", argv)
    saved = Saved.read(Path(source)) if source is not None else None
    name, words = _scenario(argv, saved)
    scenario = _plugin("scenarios", name)
    controller, controller_config = _part("controllers", value_of("--controller", words), saved, scenario.controller)
    estimator, estimator_config = _part("estimators", value_of("--estimator", words), saved, scenario.estimator)
    fields = dict(saved.fields) if saved else {}
    for flag in given(words):  # a list appends to nothing but itself
        if isinstance(fields.get(flag[2:].replace("-", "_")), list):
            del fields[flag[2:].replace("-", "_")]
    config = saved.restored(scenario.Config, fields, "fields") if saved else scenario.Config()
    groups = (
        Group(Options, default=Options(saved.seed if saved else 0, controller=controller.name, estimator=estimator.name)),
        Group(type(config), default=config),
        Group(type(controller_config), "planner", controller_config),
        Group(type(estimator_config), "estimator", estimator_config),
    )
    known = tuple(flag for group in groups for flag, _ in flags(group.of, group.prefix))
    options, config, controller_config, estimator_config = parse(
        words, f"mathnavi run {name}", (scenario.__doc__ or "").strip().partition("\n")[0], *groups
    )
    return Order(
        name, scenario, options, config, Part(controller.plugin, controller_config),
        Part(estimator.plugin, estimator_config), known, saved,
    )  # fmt: skip


def _scenario(argv: Sequence[str], saved: Saved | None) -> tuple[str, Sequence[str]]:
    if argv[0].startswith("-"):
        if saved is None:
            raise BadInputError(f"{argv[0]} stands where the scenario belongs; allowed: {', '.join(names('scenarios'))}")
        return saved.scenario, argv
    if saved is not None and argv[0] != saved.scenario:
        raise BadInputError(f"scenario {argv[0]!r} is not the one in {saved.path}; allowed: {saved.scenario}")
    return argv[0], argv[1:]


def _plugin(kind: str, name: str) -> Any:
    with bad_input():
        return load(kind, name)
