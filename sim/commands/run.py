"""``mathnavi run``: fly a scenario, judge it, and write its folder."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from mathnavi.renders.opengl import NoOpenGLError
from mathnavi.sim.commands.arguments import value_of
from mathnavi.sim.commands.errors import BadInputError, bad_input
from mathnavi.sim.commands.output import output_folder
from mathnavi.sim.commands.progress import compilation_announced
from mathnavi.sim.commands.run_config import RunConfig
from mathnavi.sim.commands.run_request import RunRequest, prepare, read_request, usage
from mathnavi.sim.commands.summary import summary_table, verdict, warnings
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunResult


@dataclass(frozen=True)
class RunOptions:
    """Flags of a run."""

    out: Path | None = None
    """folder of the run; renders/out/SCENARIO-seedN if not given"""
    video: bool = False
    """draw video.mp4"""
    report: bool = False
    """write report.html"""
    from_: Annotated[Path | None, tyro.conf.arg(name="from")] = None
    """run folder whose config.json is run again; flags beside it take precedence"""


def main(argv: Sequence[str]) -> int:
    if usage("run", argv):
        return 0
    prepare()
    try:
        source = value_of("--from", argv)
        run_config = RunConfig.read(Path(source)) if source is not None else None
        request = read_request("run", argv, RunOptions, run_config)
    except SystemExit:  # the help is printed
        return 0
    folder = request.options.out or Path("renders/out") / f"{request.name.replace(':', '.')}-seed{request.common.seed}"
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "config.json").exists():
        raise BadInputError(f"--out = {folder} holds other files than a run's; allowed: a new folder, or that of a run")
    errors = Console(stderr=True)
    with output_folder(folder), compilation_announced(errors):
        closed_loop = build(request, run_config)
        result = fly(closed_loop, errors)
        replaced = request.options.out is None and (folder / "summary.json").exists()
        stale = _drawn(folder)
        with bad_input():
            result.write(folder)
        stale |= _drawn(folder)
    shown = sorted(picture for picture in stale if picture.exists())
    for picture in shown:
        picture.unlink()
    if replaced:  # by chance, perhaps: nobody named the folder
        gone = f", and removed its {', '.join(picture.name for picture in shown)}" if shown else ""
        errors.print(f"replaced the run in {folder}{gone}", style="dim", soft_wrap=True, highlight=False)

    console = Console()
    console.print(f"{request.name}, seed {request.common.seed}: {verdict(result)}", style="bold", highlight=False)
    for warning in warnings(result.recording):
        console.print(f"warning: {warning}", style="bold", highlight=False)
    console.print(summary_table(result.summary, result.recording.events))
    _draw(request.options, folder, errors)
    console.print(f"run     {folder}", soft_wrap=True, highlight=False)
    for made in ("video.mp4", "report.html"):
        if (folder / made).is_file():
            console.print(f"{made.partition('.')[0]:8}{folder / made}", soft_wrap=True, highlight=False)
    return 0 if result.success else 1


def build(request: RunRequest, run_config: RunConfig | None) -> ClosedLoop:
    """The closed loop of a request; BadInputError for fields that do not fit, or another terrain than recorded."""
    with request.bad_input():
        closed_loop: ClosedLoop = request.scenario.build(
            request.config, request.common.seed, request.controller, request.estimator
        )
    terrain = closed_loop.config.get("terrain", {})
    same_map = run_config is not None and terrain.get("path") == run_config.terrain_path
    if run_config is not None and same_map and terrain.get("digest") != run_config.terrain_digest:
        raise BadInputError(
            f"terrain {terrain['path']!r} is not the one of {run_config.path}: its digest is {terrain['digest']}; "
            f"allowed: {run_config.terrain_digest}"
        )
    return closed_loop


def fly(closed_loop: ClosedLoop, errors: Console) -> RunResult:
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
        task = bar.add_task("flying", total=closed_loop.duration, pace="")
        try:
            return closed_loop.run(progress)
        except ValueError as error:
            if flying:
                raise  # the loop checks its rates before it starts; whatever comes later is a defect
            raise BadInputError(str(error)) from error


def _drawn(folder: Path) -> set[Path]:
    """Pictures and reports of a run like the one in a folder, if any: those of an earlier run must not stay."""
    from mathnavi.renders.drawing import drawing_of

    try:
        cameras = drawing_of(folder).cameras
    except (OSError, ValueError):
        cameras = ()
    pictures = (f"{camera}.{kind}" for camera in cameras for kind in ("mp4", "png", "webp"))
    return {folder / name for name in ("video.mp4", "report.html", *pictures)}


def _draw(options: RunOptions, folder: Path, errors: Console) -> None:
    """Draw the video and the report if they are requested; a run without them is still a run."""
    from mathnavi.sim.records.run_folder import NothingToDrawError

    if options.video:
        from mathnavi.renders.video import write_video

        try:
            write_video(folder, progress=errors.is_terminal)
        except (NoOpenGLError, NothingToDrawError, RuntimeError) as error:
            print(f"mathnavi: no video: {error}", file=sys.stderr)
    if options.report:
        from mathnavi.renders.report import write_report

        try:
            write_report(folder)
        except NothingToDrawError as error:
            print(f"mathnavi: no report: {error}", file=sys.stderr)
