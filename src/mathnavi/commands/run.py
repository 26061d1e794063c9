"""``mathnavi run``: fly a scenario, evaluate it, and write its folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.console import Console

from mathnavi.commands.arguments import given, value_of
from mathnavi.commands.command_line import CommandLine, prepare, read_command_line
from mathnavi.commands.deadline import WallDeadline, watched
from mathnavi.commands.errors import BadInputError, bad_input, print_error, worded
from mathnavi.commands.interruption import when_interrupted
from mathnavi.commands.output import run_folder
from mathnavi.commands.progress import flight_progress
from mathnavi.commands.provenance import changed_inputs, note_environment
from mathnavi.commands.recorded_spec import RecordedSpec
from mathnavi.commands.replacing import install_run
from mathnavi.commands.served_address import Port, address_of, check_address
from mathnavi.commands.summary import print_timing, summary_table, verdict
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.models.opengl import NoOpenGLError
from mathnavi.renders.heartbeat import lines_of_progress
from mathnavi.sim.engine.answer_times import Latency
from mathnavi.sim.engine.compilation import compile_ahead
from mathnavi.sim.plugin.trust import trusting, within_record
from mathnavi.sim.records.figure_names import PLANNER_STATUS
from mathnavi.sim.records.run_folder import NothingToDrawError
from mathnavi.sim.records.timing import LatencyName, read_delays

if TYPE_CHECKING:
    from mathnavi.commands.run_web import FollowedRun
    from mathnavi.sim.engine.loop import Loop
    from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunData

UNPLANNED = 3  # exit status of a run that succeeded without its planner


@configuration
class RunOptions:
    """Flags of a run."""

    out: Path | None = None
    """folder of the run; renders/out/SCENARIO-seedN if not given"""
    video: bool = False
    """whether to draw video.mp4"""
    codec: Literal["h264", "av1", "vp9"] | None = None
    """codec of the video; h264 if not given; av1 and vp9 are encoded without a library under the GPL"""
    report: bool = False
    """whether to write report.html"""
    from_: Path | None = None
    """folder of a run whose config.json is run again; other flags take precedence over it"""
    latency: LatencyName | None = None
    """simulated time that plans take: none, or measured, as long as the answers of the planner take on this machine;
    if not given, that recorded in the folder of --from, else none"""
    web: bool = False
    """whether to show the run in a browser while it is simulated, with sliders for what may change; prints the URL"""
    host: str | None = None
    """address of this machine at which --web serves; 127.0.0.1 if not given; the URL of any other has a token"""
    port: Port | None = None
    """port at which --web serves; 8765 if not given; 0 chooses a free one"""
    wall_deadline: WallDeadline | None = None
    """limit of wall-clock time [s], after which the command is ended; none if not given"""
    trust: bool = False
    """whether to import code that the folder of --from names and that is not installed; it runs with your rights"""

    def __post_init__(self) -> None:
        if self.codec is not None and not self.video:
            raise FieldError(f"codec = {self.codec}; allowed: only together with --video")
        check_address(self.host, self.port, web=self.web)


def main(argv: Sequence[str]) -> int:
    if (code := watched("run", argv)) is not None:
        return code
    prepare()
    source = value_of("--from", argv)
    with trusting("--trust" in given(argv)):
        recorded = RecordedSpec.read(Path(source), argv) if source is not None else None
    line = read_command_line("run", argv, RunOptions, recorded)
    latency = _latency(line.options, recorded)
    folder = line.options.out or Path("renders/out") / f"{line.spec.scenario.replace(':', '.')}-seed{line.spec.seed}"
    _check_spared(folder, Path(source) if source is not None else None, line.files)
    errors = Console(stderr=True, markup=False, emoji=False)
    with ExitStack() as served:
        follow = served.enter_context(_followed(line)) if line.options.web else None
        code = _run(line, recorded, latency, folder, follow, errors)
        if follow is not None:
            follow.show_ended(folder)
    return code


def _latency(options: RunOptions, recorded: RecordedSpec | None) -> Latency | None:
    """Return the simulated time that plans take; BadInputError if it is not known, or not possible."""
    chosen = options.latency or (recorded.latency if recorded else None)
    if chosen is None or chosen == "none":
        return None
    if options.web:
        raise BadInputError(
            f"--latency = {chosen}: with --web a run begins again after every change, and would not repeat what was "
            "measured; allowed: --latency none"
        )
    if options.latency is not None or recorded is None:
        return Latency()
    with bad_input():
        return Latency(read_delays(recorded.path.parent))


def _run(
    line: CommandLine,
    recorded: RecordedSpec | None,
    latency: Latency | None,
    folder: Path,
    follow: FollowedRun | None,
    errors: Console,
) -> int:
    """Fly, write the folder and draw; return the exit code of the command."""
    with run_folder(folder) as claim:
        with flight_progress(errors) as progress:
            compile_ahead(*line.spec.parts.values())
            closed_loop = build(line, recorded)
            if recorded is not None:
                note_environment(errors, recorded)
            with line.failures("a run"):
                if follow is None:
                    result = fly(closed_loop, progress, lambda: build(line, recorded), latency=latency)
                else:
                    result = follow.fly(closed_loop, lambda loop, watch: fly(loop, progress, watch=watch))
        result.write_files(claim.new)
        install_run(claim, folder, errors, flown=True)
        when_interrupted(lambda: f"the run is in {folder}, its pictures may not be; to begin again")
        console = Console(markup=False, emoji=False)
        console.print(f"{line.spec.scenario}, seed {line.spec.seed}: {verdict(result)}", style="bold", highlight=False)
        console.print(summary_table(result.summary, result.recording.events))
        print_timing(console, result.timing)
        with trusting():
            whole = _draw(line.options, folder, errors)
    console.print(f"run     {folder}", soft_wrap=True, highlight=False)
    for made in ("video.mp4", "report.html"):
        if (folder / made).is_file():
            console.print(f"{made.partition('.')[0]:8}{folder / made}", soft_wrap=True, highlight=False)
    if not (result.success and whole):
        return 1
    return UNPLANNED if PLANNER_STATUS in result.summary else 0


def _followed(line: CommandLine) -> AbstractContextManager[FollowedRun]:
    from mathnavi.commands.run_web import followed  # what draws takes a while to import

    return followed(line.spec, *address_of(line.options.host, line.options.port))


def _check_spared(folder: Path, source: Path | None, files: Sequence[Path]) -> None:
    """Raise BadInputError if the run would overwrite the one that it comes from, or a file that it reads."""
    with bad_input():
        check_spares(folder, [] if source is None else [source], "--out")
    for file in files:
        if file.resolve().is_relative_to(folder.resolve()):
            raise BadInputError(f"--out = {folder} holds {file}, which the run reads; allowed: another folder")


def build(line: CommandLine, recorded: RecordedSpec | None) -> ClosedLoop:
    """Build the closed loop; BadInputError for fields that do not fit, or a file that differs from the recorded one,
    unless its flag is given again.
    """
    with line.bad_input():
        for sentence in changed_inputs(recorded, line.spec, line.given) if recorded else ():
            raise BadInputError(sentence)
        with within_record(recorded.places if recorded else {}):
            return line.build()


def fly(
    closed_loop: ClosedLoop,
    progress: Callable[[float, float], None],
    again: Callable[[], ClosedLoop] | None = None,
    watch: Callable[[Loop], None] | None = None,
    latency: Latency | None = None,
) -> RunData:
    """Run with a bar over the simulated time; ``again`` builds the closed loop once more if necessary, and ``watch`` is
    called with the loop after every step. ``latency`` is the simulated time that plans take.
    """
    flying = False

    def update(t: float) -> None:
        nonlocal flying
        flying = True
        progress(t, closed_loop.duration)

    try:
        return closed_loop.run(update, again, watch, latency)
    except RunFolderError as error:
        allowed = "a run that makes the recorded requests, or --latency measured, or --latency none"
        raise BadInputError(f"--from: {error}; allowed: {allowed}") from error
    except ValueError as error:
        if flying:
            raise  # the loop checks its rates before it starts; whatever comes later is a defect
        raise BadInputError(str(error)) from error


def _draw(options: RunOptions, folder: Path, errors: Console) -> bool:
    """Draw the video and the report if requested; return False if one could not be written, to a full disk for example.

    A run without them is still valid, and so is one in which there is nothing to draw. The report is written while
    other processes make the scene of the video.
    """
    unwritten: list[str] = []
    of_report = (NothingToDrawError, RunFolderError, OSError)
    of_video = (*of_report, NoOpenGLError, RuntimeError)

    @contextmanager
    def told(what: str, kinds: tuple[type[Exception], ...]) -> Iterator[None]:
        try:
            yield
        except kinds as error:
            print_error(f"no {what}: {worded(error)}")
            if isinstance(error, OSError):
                unwritten.append(what)

    with ExitStack() as drawing:
        finish = None
        if options.video:
            from mathnavi.renders.video import video_begun

            with told("video", of_video):
                finish = drawing.enter_context(video_begun(folder, codec=options.codec))
        if options.report:
            from mathnavi.renders.report import write_report

            with told("report", of_report), _announced(errors, "writing the report"):
                write_report(folder)
        if finish is not None:
            with told("video", of_video):
                finish()
    return not unwritten


def _announced(errors: Console, what: str) -> AbstractContextManager[object]:
    """Announce the work of the block: on a terminal while it lasts, elsewhere by a line before it and during it."""
    if errors.is_terminal:
        return errors.status(what)
    errors.print(what, highlight=False)
    began = time.monotonic()
    return lines_of_progress(errors, lambda: f"{what}: {time.monotonic() - began:.0f} s")
