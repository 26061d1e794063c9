"""``mathnavi run``: fly a scenario, judge it, and write its folder."""

from __future__ import annotations

import dataclasses
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from renders.opengl import NoOpenGLError
from sim.commands import opengl
from sim.commands.arguments import Group, flags, given, parse, value_of, with_flag
from sim.commands.errors import BadInputError, bad_input
from sim.commands.saved import Saved
from sim.commands.summary import summary_table
from sim.plugins import Part, load, names
from sim.scenarios.experiment import Experiment, Outcome

DERIVED = (
    "video.mp4",
    "report.html",
    *(f"{camera}.{kind}" for camera in ("chase", "overview", "top") for kind in ("mp4", "png")),
)
PLACES = {"scenarios": "SCENARIO", "controllers": "--controller", "estimators": "--estimator"}
USAGE = "usage: mathnavi run SCENARIO [OPTIONS]      SCENARIO: {}\nmathnavi run SCENARIO --help lists the options."


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
    if not argv:
        raise BadInputError(f"SCENARIO is missing; allowed: {', '.join(names('scenarios'))}")
    if argv[0] in ("-h", "--help"):
        print(USAGE.format(", ".join(names("scenarios"))))
        return 0
    opengl.choose()
    if os.getcwd() not in sys.path:  # where a user's own plug-in lies, "my_planner:Mine"
        sys.path.append(os.getcwd())
    try:
        order = read_order(argv)
    except SystemExit:  # the help is printed
        return 0
    errors = Console(stderr=True)
    with output_folder(order.folder), compilation_told(errors):
        experiment = build(order)
        outcome = fly(experiment, errors)
        replaced = order.options.out is None and (order.folder / "summary.json").exists()
        with bad_input():
            outcome.write(order.folder)
    if replaced:  # by chance, perhaps: nobody named the folder
        errors.print(f"replaced the run in {order.folder}", style="dim", soft_wrap=True, highlight=False)
    for stale in DERIVED:
        (order.folder / stale).unlink(missing_ok=True)

    console = Console()
    verdict = "the mission did what it should" if outcome.success else "the mission did NOT do what it should"
    kinds = Counter(event.kind for event in outcome.recording.events)
    console.print(f"{order.name}, seed {order.options.seed}: {verdict}", style="bold", highlight=False)
    console.print(summary_table(outcome.summary, kinds))
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
    controller, estimator = value_of("--controller", words), value_of("--estimator", words)
    if controller is None:
        controller = saved.controller if saved else scenario.controller
    if estimator is None:
        estimator = saved.estimator if saved else scenario.estimator
    planner = _part("controllers", controller, saved, (saved.controller, saved.controller_fields) if saved else None)
    observer = _part("estimators", estimator, saved, (saved.estimator, saved.estimator_fields) if saved else None)
    config = _restored(scenario.Config, saved, words) if saved else scenario.Config()
    groups = (
        Group(Options, default=Options(saved.seed if saved else 0, controller=controller, estimator=estimator)),
        Group(type(config), default=config),
        Group(type(planner.config), "planner", planner.config, f"Of the controller {controller}."),
        Group(type(observer.config), "estimator", observer.config, f"Of the estimator {estimator}."),
    )
    known = tuple(flag for group in groups for flag, _ in flags(group.of, group.prefix))
    purpose = (scenario.__doc__ or "").strip().partition("\n")[0]
    options, config, planner_config, observer_config = parse(words, f"mathnavi run {name}", purpose, *groups)
    parts = Part(planner.plugin, planner_config), Part(observer.plugin, observer_config)
    return Order(name, scenario, options, config, *parts, known, saved)


def _scenario(argv: Sequence[str], saved: Saved | None) -> tuple[str, Sequence[str]]:
    if argv[0].startswith("-"):
        if saved is None:
            raise BadInputError(
                f"{argv[0]} stands where the scenario belongs; allowed: {', '.join(names('scenarios'))}"
            )
        return saved.scenario, argv
    if saved is not None and argv[0] != saved.scenario:
        raise BadInputError(f"scenario {argv[0]!r} is not the one in {saved.path}; allowed: {saved.scenario}")
    return argv[0], argv[1:]


def _plugin(kind: str, name: str) -> Any:
    try:
        return load(kind, name)
    except ValueError as error:
        raise BadInputError(str(error).replace(kind, PLACES[kind], 1)) from error


def _part(kind: str, name: str, saved: Saved | None, before: tuple[str, dict[str, Any]] | None) -> Part:
    """A plug-in with its default fields, or with the saved ones if it is the plug-in that was saved."""
    plugin = _plugin(kind, name)
    if saved is not None and before is not None and _plugin(kind, before[0]) is plugin:
        return Part(plugin, saved.restored(plugin.Config, before[1], f"{kind.removesuffix('s')}.fields"))
    return Part.of(plugin)


def _restored(config: type, saved: Saved, words: Sequence[str]) -> Any:
    """The saved fields of a scenario, but for the lists that are given anew: those start empty."""
    lists = {flag for flag, repeats in flags(config) if repeats} & set(given(words))
    fields = {name: value for name, value in saved.fields.items() if f"--{name.replace('_', '-')}" not in lists}
    return saved.restored(config, fields, "fields")


def build(order: Order) -> Experiment:
    """The closed loop; what is wrong with its fields comes to light here."""
    try:
        with bad_input():
            experiment: Experiment = order.scenario.build(
                order.config, order.options.seed, order.controller, order.estimator
            )
    except BadInputError as error:
        raise BadInputError(with_flag(_about_a_file(str(error), order.config), order.known)) from error
    terrain, saved = experiment.config.get("terrain", {}), order.saved
    same_map = saved is not None and terrain.get("path") == saved.terrain_path
    if saved is not None and same_map and terrain.get("digest") != saved.terrain_digest:
        raise BadInputError(
            f"terrain {terrain['path']!r} is not the one of {saved.path}: its digest is {terrain['digest']}; "
            f"allowed: {saved.terrain_digest}"
        )
    return experiment


def _about_a_file(message: str, config: Any) -> str:
    """A message that starts with the name of a file, with the field that names it before it."""
    for entry in dataclasses.fields(config):
        value = getattr(config, entry.name)
        if isinstance(value, str) and message.startswith(f"{value}: "):
            return f"{entry.name} = {message}"
    return message


def fly(experiment: Experiment, errors: Console) -> Outcome:
    """Run with a progress bar over the simulated time."""
    bar = Progress(
        TextColumn("flying"), BarColumn(), TextColumn("{task.completed:.0f} s of at most {task.total:.0f} s"),
        TextColumn("{task.fields[pace]}"), console=errors, disable=not errors.is_terminal, transient=True,
    )  # fmt: skip
    began = time.perf_counter()
    flying = False

    def progress(t: float) -> None:
        nonlocal flying
        flying = True
        bar.update(task, completed=t, pace=f"{t / (time.perf_counter() - began):.1f} x real time")

    with bar:
        task = bar.add_task("flying", total=experiment.duration, pace="")
        try:
            return experiment.run(progress)
        except ValueError as error:
            if flying:
                raise  # the loop checks its rates before it starts; whatever comes later is a defect
            raise BadInputError(str(error)) from error


@contextmanager
def output_folder(folder: Path) -> Iterator[None]:
    """Make the folder and try to write into it; if what follows fails, what was made goes again."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise BadInputError(
                f"--out = {folder}: {error.strerror}; allowed: a folder that can be made or written to"
            ) from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


@contextmanager
def compilation_told(errors: Console) -> Iterator[None]:
    """Say so when numba starts to compile, which it does only where its cache holds nothing."""
    from numba.core import event  # takes a while to import

    class Announcement(event.Listener):
        told = False

        def on_start(self, event: Any) -> None:
            if not self.told:
                errors.print("compiling the numerical kernels, once on this machine (about 15 s)", highlight=False)
            self.told = True

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Announcement()):
        yield


def _draw(order: Order, errors: Console) -> None:
    """Video and report if they were asked for; a run without them is still a run."""
    if order.options.video:
        from renders.video import write_video

        try:
            write_video(order.folder, progress=errors.is_terminal)
        except (NoOpenGLError, RuntimeError) as error:
            print(f"mathnavi: no video: {error}", file=sys.stderr)
    if order.options.report:
        from renders.report import write_report

        write_report(order.folder)
