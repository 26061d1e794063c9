"""``mathnavi search``: a directed search for the worst missions of a scenario, or the probability of a rare event."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

from annotated_types import Interval
from rich.console import Console

from mathnavi.commands.command_line import CommandLine, prepare, read_command_line
from mathnavi.commands.errors import BadInputError, bad_input, print_error, worded
from mathnavi.commands.interruption import when_interrupted
from mathnavi.commands.progress import compilation_announced, sweep_progress
from mathnavi.commands.provenance import note_changed_files, note_origins
from mathnavi.commands.search_fields import SearchFields, read_space
from mathnavi.commands.search_results import SearchResults, print_results, write_pages, write_worst
from mathnavi.commands.worst_runs import write_reports
from mathnavi.interfaces.bounds import MOST_TO_COMPUTE, Count, Positive, Processes, configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.sim.records.store import Store, StoreWriteError
from mathnavi.sim.search.directed import check_space, directed
from mathnavi.sim.search.evaluation import Evaluation, Evaluator, NoSuchFigureError, Objective
from mathnavi.sim.search.importance import importances
from mathnavi.sim.search.rare import REDRAW, RareEvent, rare_event
from mathnavi.sim.search.samplers import SamplerName
from mathnavi.sim.search.space import Choice
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import LostError, check
from mathnavi.sim.sweep.execution import Pool, Progress, available_cores
from mathnavi.sim.sweep.trial import named_files

SeveralCount = Annotated[int, Interval(ge=2, le=MOST_TO_COMPUTE)]
PAGES = (".html", ".png")


@configuration
class SearchOptions:
    """Flags of a search."""

    store: Path
    """file of the results (SQLite); a search resumes where it stopped, and adds to what is there"""
    minimise: str | None = None
    """figure of the summary to minimise: clearance_margin_m, separation_margin_m, ..."""
    maximise: str | None = None
    """figure of the summary to maximise, instead of --minimise: tracking_bound_share, ..."""
    over: tuple[str, ...] = ()
    """field to search over: FIELD=LOW..HIGH, with ,log on a logarithmic scale, or FIELD=V1,V2,...; FIELD[K] is one
    component of a field that is given, and seed is the seed; may be given several times"""
    missions: Count = 200
    """largest number of missions"""
    until: float | None = None
    """value of the figure at which the search ends; with --rare the value that defines the event"""
    sampler: SamplerName = "sobol-cmaes"
    """sampler of the next missions: CMA-ES from the best of Sobol' points, CMA-ES alone, or random draws"""
    batch: Count = 8
    """number of missions proposed at a time; the same seed and batch give the same search with any number of workers"""
    rare: bool = False
    """whether to estimate the probability that a mission reaches --until, by multilevel splitting over random draws"""
    particles: SeveralCount = 40
    """number of missions (particles) that --rare moves together"""
    repetitions: SeveralCount = 5
    """number of independent repetitions of --rare, from whose spread its interval follows"""
    workers: Processes | None = None
    """number of processes; one for each core if not given"""
    cluster: str | None = None
    """address of a Dask scheduler whose workers run the missions, tcp://HOST:PORT or tls://HOST:PORT"""
    timeout: Positive | None = None
    """time after which a mission is cut off and recorded as timed out [s]; none if not given"""
    retry: bool = False
    """whether to run those missions again that are stored as timed out or crashed"""
    mix_environments: bool = False
    """whether to accept missions stored from another computing environment, and workers that compute in one"""
    worst: Count = 3
    """number of the worst missions that are flown again into --out"""
    out: Path | None = None
    """folder for the runs of the worst missions, worst-1 and so on, which can be drawn, and flown again by --from"""
    report: bool = False
    """whether to write a page and a picture next to the store, with .html and .png in place of its ending"""

    def __post_init__(self) -> None:
        if self.workers is not None and self.cluster is not None:
            raise FieldError(f"cluster = {self.cluster!r} together with --workers {self.workers}; allowed: one of both")
        if (self.minimise is None) == (self.maximise is None):
            given = f"{self.minimise!r} together with --maximise {self.maximise}" if self.minimise else "not given"
            raise FieldError(f"minimise = {given}; allowed: one of --minimise and --maximise")
        if self.rare and self.until is None:
            raise FieldError("until = not given; allowed with --rare: the value of the figure that defines the event")
        if self.store.suffix in PAGES:
            raise FieldError(
                f"store = {self.store}; allowed: another ending than those of the report, {', '.join(PAGES)}"
            )

    @property
    def objective(self) -> Objective:
        """Return the figure and the direction in which to search."""
        return Objective(str(self.minimise or self.maximise), self.maximise is not None)


def main(argv: Sequence[str]) -> int:
    prepare()
    line = read_command_line("search", argv, SearchOptions)
    fields = read_space(argv, line)
    options: SearchOptions = line.options
    if options.report:
        with bad_input():
            for ending in PAGES:
                check_spares(options.store.with_suffix(ending), [options.store, *line.files], "--report")
    errors, console = Console(stderr=True, markup=False, emoji=False), Console(markup=False, emoji=False)
    again = shlex.join(["mathnavi", "search", *argv])
    _check(fields, line)
    evaluations: Sequence[Evaluation] = ()
    ended = 0  # of the missions that are being evaluated
    when_interrupted(lambda: f"{_stored(evaluations, options, ended)}; to go on")
    try:
        with line.bad_input():
            if options.cluster is not None:
                check(options.cluster)
            with compilation_announced(errors):
                named = _check_missions(fields)
            store = Store.open(options.store)
            pool = Pool(options.workers or available_cores(), options.cluster, options.mix_environments)
        with store, pool, sweep_progress(errors, line.spec.scenario.rpartition(":")[2]) as draw:
            stored = store.keys()

            def progress(now: Sequence[Evaluation]) -> None:
                nonlocal evaluations, ended
                evaluations, ended = tuple(now), 0
                draw(_counts(now, options.missions, stored))

            def of_batch(now: Progress) -> None:
                nonlocal ended
                ended = now.done

            draw(Progress(options.missions, 0, 0, 0, 0, False))
            note_changed_files(errors, store, named)
            evaluator = Evaluator(
                fields.make, options.objective, store, pool, options.timeout, options.retry, of_batch,
                mix_environments=options.mix_environments,
            )  # fmt: skip
            rare = _search(evaluator, fields, options, line.spec.seed, progress)
            note_origins(errors, store, evaluator.elsewhere)
    except NoSuchFigureError as error:
        flag = "--maximise" if options.objective.largest else "--minimise"
        raise BadInputError(f"{flag} = {error}") from error
    except (StoreWriteError, RefusedError, LostError, OSError) as error:
        print_error(f"{worded(error)}, {_stored(evaluations, options, ended)}; to go on: {again}")
        return 1
    results = SearchResults(
        line.spec.scenario, options.objective, fields.space, evaluator.evaluations, options.until, rare,
        {} if rare else importances(evaluator.evaluations, fields.space), again,
    )  # fmt: skip
    print_results(console, results)
    console.print(f"\nstore   {options.store}", soft_wrap=True, highlight=False)
    try:
        worst: list[Path] = []
        if options.out is not None:
            of_search = options.store.with_suffix(".html") if options.report else None
            worst = write_worst(results, options.out, options.worst, of_search)
            for folder in worst:
                console.print(f"run     {folder}", soft_wrap=True, highlight=False)
        if options.report:
            write_reports(worst)
            for page in write_pages(results, options.store, worst):
                console.print(f"report  {page}", soft_wrap=True, highlight=False)
    except (OSError, RunFolderError) as error:
        print_error(worded(error))
        return 1
    return 0


def _search(
    evaluator: Evaluator,
    fields: SearchFields,
    options: SearchOptions,
    seed: int,
    progress: Callable[[Sequence[Evaluation]], None],
) -> RareEvent | None:
    if options.rare:
        assert options.until is not None  # SearchOptions refuses that
        return rare_event(
            evaluator, fields.space, options.until, options.missions, seed=seed,
            particles=options.particles, repetitions=options.repetitions, progress=progress,
        )  # fmt: skip
    directed(
        evaluator, fields.space, options.missions, sampler=options.sampler, seed=seed, batch=options.batch,
        until=options.until, progress=progress,
    )  # fmt: skip
    return None


def _check(fields: SearchFields, line: CommandLine) -> None:
    """Raise BadInputError for a space that cannot be searched with these options."""
    options: SearchOptions = line.options
    if options.rare and not hasattr(line.spec.config, REDRAW):
        raise BadInputError(
            f"--rare: {line.spec.scenario} cannot draw part of its chance again; allowed: scenarios with --{REDRAW}"
        )
    if options.rare and options.missions < options.particles * options.repetitions:
        raise BadInputError(
            f"--missions = {options.missions}; allowed with --rare: >= {options.particles * options.repetitions}, the "
            "particles of all repetitions"
        )
    if not options.rare:
        with line.bad_input():
            check_space(fields.space)


def _check_missions(fields: SearchFields) -> dict[tuple[str, str], str]:
    """Raise ValueError or OSError, before any flight, for what is wrong with all missions: a missing file, bad bounds.

    Returns the digests of the files that missions name, as ``named_files``. Without a field to search over, the
    mission is built, and so has to be one that can be flown.
    """
    listed = [{each.name: value} for each in fields.space if isinstance(each, Choice) for value in each.values]
    named = named_files([fields.make(values) for values in [{}, *listed]])
    if not fields.space:
        fields.make({}).build()
    return named


def _counts(evaluations: Sequence[Evaluation], missions: int, stored: set[str]) -> Progress:
    return Progress(
        missions,
        sum(each.record is not None and each.record.key in stored for each in evaluations),
        len(evaluations),
        sum(each.ending == "failed" for each in evaluations),
        sum(each.violated for each in evaluations),
        False,
    )


def _stored(evaluations: Sequence[Evaluation], options: SearchOptions, ended: int) -> str:
    """Return the note on what is kept of a search that ends early; ``ended`` missions are stored, not yet evaluated."""
    more = f", and {ended} more stored" if ended else ""
    return f"{len(evaluations)} of {options.missions} missions evaluated{more}"
