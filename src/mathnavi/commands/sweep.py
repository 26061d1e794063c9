"""``mathnavi sweep``: a scenario over many seeds and over variations of its fields, into a store that resumes."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from mathnavi.commands.command_line import CommandLine, prepare
from mathnavi.commands.errors import BadInputError, bad_input, print_error, print_note, worded
from mathnavi.commands.evidence import print_evidence, verdict
from mathnavi.commands.interruption import when_interrupted
from mathnavi.commands.progress import compilation_announced, sweep_progress
from mathnavi.commands.provenance import note_changed_files, note_origins
from mathnavi.commands.served_address import Port, address_of, check_address
from mathnavi.commands.variations import listed_combinations, read_command_lines, read_variations, trials
from mathnavi.commands.worst_runs import fly_again, report_link, worst, worst_section, write_reports
from mathnavi.interfaces.bounds import LARGEST_SEED, MOST_TO_COMPUTE, Count, Positive, Processes, configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import TRANSIENT, Record, Store, StoreWriteError
from mathnavi.sim.records.sweep_data import format_value
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import LostError, check
from mathnavi.sim.sweep.execution import Progress, available_cores, run_trials
from mathnavi.sim.sweep.trial import Trial, contents, named_files

if TYPE_CHECKING:
    from mathnavi.commands.sweep_web import FollowedSweep

REPORT = ".html"


@configuration
class SweepOptions:
    """Flags of a sweep."""

    trials: Count
    """number of trials of each combination of listed values, with the seeds SEED, SEED + 1, and so on"""
    store: Path
    """file of the results (SQLite); a sweep resumes where it stopped, and adds to what is there"""
    vary: tuple[str, ...] = ()
    """field to vary: FIELD=V1,V2,... takes each of these values, FIELD=LOW..HIGH is drawn for every trial; may be given
    several times"""
    workers: Processes | None = None
    """number of processes; one for each core if not given"""
    cluster: str | None = None
    """address of a Dask scheduler whose workers run the trials, tcp://HOST:PORT or tls://HOST:PORT"""
    timeout: Positive | None = None
    """time after which a trial is cut off and recorded as timed out [s]; none if not given"""
    retry: bool = False
    """whether to run those trials again that are stored as timed out or crashed"""
    mix_environments: bool = False
    """whether to accept trials stored from another computing environment, and workers that compute in one"""
    worst: Count = 3
    """number of the worst runs that are flown again into --out"""
    out: Path | None = None
    """folder for the worst runs, worst-1 and so on, which can be drawn, and flown again by --from; with --report the
    page of the sweep and their reports link to each other"""
    report: bool = False
    """whether to write a page next to the store, with .html in place of its ending"""
    web: bool = False
    """whether to show the report of the trials so far in a browser while the sweep runs; prints the URL"""
    host: str | None = None
    """address of this machine at which --web serves; 127.0.0.1 if not given; the URL of any other has a token"""
    port: Port | None = None
    """port at which --web serves; 8765 if not given; 0 chooses a free one"""

    def __post_init__(self) -> None:
        if self.workers is not None and self.cluster is not None:
            raise FieldError(f"cluster = {self.cluster!r} together with --workers {self.workers}; allowed: one of both")
        if self.store.suffix == REPORT:
            raise FieldError(f"store = {self.store}; allowed: another ending than that of the report, {REPORT}")
        check_address(self.host, self.port, web=self.web)


def main(argv: Sequence[str]) -> int:
    prepare()
    sweep = read_sweep(argv)
    with ExitStack() as served:
        return _run(sweep, argv, served)


def _run(sweep: SweepRequest, argv: Sequence[str], served: ExitStack) -> int:
    """Run the trials and print their results; return the exit code of the command. ``served`` holds a server."""
    line, options = sweep.line, sweep.line.options
    if options.report:
        with bad_input():
            check_spares(options.store.with_suffix(REPORT), [options.store, *line.files], "--report")
    errors = Console(stderr=True, markup=False, emoji=False)
    command = shlex.join(["mathnavi", "sweep", *argv])
    follow: FollowedSweep | None = None
    state: Progress | None = None  # before the store is looked into
    when_interrupted(lambda: f"{_stored(state)}; to go on")
    try:
        with line.bad_input():
            asked = contents(sweep.trials)  # a file that a field names, and that is not there, comes to light here
            _check_combinations(sweep, asked)
            if options.cluster is not None:
                check(options.cluster)
            with compilation_announced(errors):
                _build_combinations(sweep)
            store = Store.open(options.store)
        if options.web:
            follow = served.enter_context(_followed(sweep, asked, command, lambda: _stored(state)))
        with store, sweep_progress(errors, line.spec.scenario.rpartition(":")[2]) as draw:

            def progress(now: Progress) -> None:
                nonlocal state
                state = now
                draw(now)

            endings, elsewhere = store.endings(), Elsewhere()
            keys = store.keys_of(asked, options.mix_environments, elsewhere)
            transient = sum(endings[keys[each]].status in TRANSIENT for each in asked if each in keys)
            found = sum(each in keys for each in asked) - (transient if options.retry else 0)
            state = Progress(len(asked), found, found, 0, 0, False)
            print_note(errors, f"{found} of {len(asked)} trials already in {options.store}")
            note_origins(errors, store, elsewhere)
            note_changed_files(errors, store, named_files(sweep.trials))
            records = run_trials(
                sweep.trials,
                store,
                workers=options.workers or available_cores(),
                cluster=options.cluster,
                timeout=options.timeout,
                retry=options.retry,
                progress=progress,
                mix_environments=options.mix_environments,
            )
    except (StoreWriteError, RefusedError, LostError, OSError) as error:
        print_error(f"{worded(error)}, {_stored(state)}; to go on: {command}")
        return 1
    console = Console(markup=False, emoji=False)
    console.print(f"{line.spec.scenario}, {verdict(records)}", style="bold", highlight=False, soft_wrap=True)
    print_evidence(console, records, [*sweep.listed, *sweep.drawn])
    console.print(f"\nstore   {options.store}", soft_wrap=True, highlight=False)
    if transient and not options.retry:
        console.print(
            f"found in the store as timed out or crashed: {transient}; --retry runs such trials again",
            soft_wrap=True,
            highlight=False,
        )
    try:
        by_content = dict(zip(asked, records, strict=True))
        folders = {} if options.out is None else _fly_worst(sweep, by_content, options.out)
        for folder in folders.values():
            console.print(f"run     {folder}", soft_wrap=True, highlight=False)
        if options.report:
            write_reports(list(folders.values()))
            page = _report(sweep, records, by_content, command, folders)
            console.print(f"report  {page}", soft_wrap=True, highlight=False)
    except (OSError, RunFolderError) as error:
        print_error(f"no report: {worded(error)}" if options.report else worded(error))
        return 1
    if follow is not None:
        follow.show_ended()
    return 0


def _followed(
    sweep: SweepRequest, asked: Sequence[str], command: str, progress: Callable[[], str]
) -> AbstractContextManager[FollowedSweep]:
    from mathnavi.commands.sweep_web import FollowedSweep, followed  # what draws takes a while to import

    options = sweep.line.options
    varied, trials = [*sweep.listed, *sweep.drawn], dict(zip(asked, sweep.trials, strict=True))
    page = FollowedSweep(
        sweep.line.spec.scenario, options.store, trials, varied, options.mix_environments, command, progress
    )  # fmt: skip
    return followed(page, *address_of(options.host, options.port))


def _fly_worst(sweep: SweepRequest, records: Mapping[str, Record], out: Path) -> dict[str, Path]:
    """Fly the worst trials again into the folder ``out``; records, and the folders that it returns, are by content."""
    options = sweep.line.options
    page, trials = options.store.with_suffix(REPORT), dict(zip(contents(sweep.trials), sweep.trials, strict=True))
    chosen = worst(records, options.worst)
    varied = [f"seed {records[each].seed}{_values(sweep, records[each])}" for each in chosen]
    named = [(f"the sweep {page.stem} ({words})", trials[each]) for words, each in zip(varied, chosen, strict=True)]
    return dict(zip(chosen, fly_again(named, out, page if options.report else None), strict=True))


def _values(sweep: SweepRequest, record: Record) -> str:
    names = [name for name in (*sweep.listed, *sweep.drawn) if name in record.fields]
    return "".join(f", {name} {format_value(record.fields[name])}" for name in names)


def _report(
    sweep: SweepRequest,
    records: Sequence[Record],
    by_content: Mapping[str, Record],
    command: str,
    folders: Mapping[str, Path],
) -> Path:
    """Write the page, with links to the reports in the ``folders`` of the worst runs."""
    from mathnavi.commands.tracks import shown_flights
    from mathnavi.renders.sweep_report import write_sweep_report  # what draws takes a while to import

    terrain, tracks = shown_flights(sweep.trials, records)
    path: Path = sweep.line.options.store.with_suffix(REPORT)
    varied = [*sweep.listed, *sweep.drawn]
    links = worst_section(
        {each: by_content[each] for each in folders}, varied,
        lambda each, words: report_link(path, folders[each], words), len(folders),
        "Each was flown again with the code and on the machine that wrote this page; a link shows its report.",
    )  # fmt: skip
    return write_sweep_report(path, records, varied, terrain, tracks, command, links)


@dataclass(frozen=True)
class SweepRequest:
    """Trials of a sweep, and the fields that vary among them."""

    line: CommandLine  # the first, where plug-ins are varied
    trials: list[Trial]  # those of one seed together
    listed: list[str]  # fields
    drawn: list[str]  # fields
    firsts: list[Trial]  # of the first seed, one for each combination of listed values


def read_sweep(argv: Sequence[str]) -> SweepRequest:
    """Return the sweep that ``argv`` requests; BadInputError if ``argv`` is wrong."""
    variations = read_variations(argv)
    lines = read_command_lines(argv, SweepOptions, variations)
    seed, count = lines[0].spec.seed, lines[0].options.trials
    if seed > LARGEST_SEED - count + 1:
        raise BadInputError(f"--seed = {seed}; allowed: 0 to {LARGEST_SEED} less the trials that follow")
    combinations = len(lines) * listed_combinations(lines[0], variations)
    if count * combinations > MOST_TO_COMPUTE:
        raise BadInputError(
            f"--trials = {count} of each of {combinations} combinations; allowed: {MOST_TO_COMPUTE} trials in all"
        )
    by_line = [trials(line, variations, count) for line in lines]
    drawn = by_line[0][1]
    by_seed = zip(*(of_seeds for of_seeds, _ in by_line), strict=True)
    every = list(itertools.chain.from_iterable(itertools.chain.from_iterable(by_seed)))
    listed = [variation.name for variation in variations if variation.name not in drawn]
    return SweepRequest(lines[0], every, listed, drawn, every[: len(every) // count])


def _check_combinations(sweep: SweepRequest, asked: Sequence[str]) -> None:
    """Raise BadInputError if two combinations of listed values are the same trials under two names."""
    seen: dict[str, Trial] = {}
    for content, first in zip(asked, sweep.firsts, strict=False):
        other = seen.setdefault(content, first)
        if other is not first:
            one, two = (trial.record(content, "ok").fields for trial in (other, first))
            name = next(name for name in sweep.listed if one[name] != two[name])
            raise BadInputError(
                f"--vary {name}: {one[name]} and {two[name]} have the same content; allowed: each content once"
            )


def _build_combinations(sweep: SweepRequest) -> None:
    """Build each combination once, so that a ValueError that only building finds is raised before anything is run."""
    for trial in sweep.firsts:
        try:
            trial.build()
        except (ValueError, OSError):
            raise
        except Exception:  # a defect of mathnavi, which is recorded when the trial runs
            continue


def _stored(state: Progress | None) -> str:
    return "before the first trial" if state is None else f"{state.done} of {state.total} trials stored"
