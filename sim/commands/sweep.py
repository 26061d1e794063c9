"""``mathnavi sweep``: a scenario over many seeds and over variations of its fields, into a store that resumes."""

from __future__ import annotations

import itertools
import math
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from mathnavi.sim.commands.errors import INTERRUPTED, BadInputError
from mathnavi.sim.commands.evidence import print_evidence, verdict
from mathnavi.sim.commands.progress import compilation_announced, sweep_progress
from mathnavi.sim.commands.run_request import RunRequest, prepare, usage
from mathnavi.sim.commands.variations import read_requests, read_variations, trials
from mathnavi.sim.records.store import TRANSIENT, Record, Store, StoreWriteError
from mathnavi.sim.sweep.child import RefusedError
from mathnavi.sim.sweep.cluster import LostError, check
from mathnavi.sim.sweep.execution import Progress, available_cores, run_trials
from mathnavi.sim.sweep.trial import LARGEST_SEED, Trial, keys

REPORT = ".html"


@dataclass(frozen=True)
class SweepOptions:
    """Flags of a sweep."""

    trials: int
    """of each combination of listed values, with the seeds SEED, SEED + 1, and so on"""
    store: Path
    """file of the results (SQLite); a sweep goes on where it stopped, and adds to what is there"""
    vary: tuple[str, ...] = ()
    """FIELD=V1,V2,...: each of these values; FIELD=LOW..HIGH: drawn for every trial; may be given several times"""
    workers: int | None = None
    """processes; one for each core if not given"""
    cluster: str | None = None
    """address of a Dask scheduler whose workers run the trials, tcp://HOST:PORT"""
    timeout: float | None = None
    """time after which a trial is cut off and recorded as timed out [s]; none if not given"""
    retry: bool = False
    """run those trials again that are stored as timed out or crashed"""
    report: bool = False
    """write a page beside the store, with .html in place of its ending"""

    def __post_init__(self) -> None:
        if self.trials < 1:
            raise ValueError(f"trials = {self.trials}; allowed: a whole number >= 1")
        if self.workers is not None and self.workers < 1:
            raise ValueError(f"workers = {self.workers}; allowed: a whole number >= 1")
        if self.timeout is not None and not (math.isfinite(self.timeout) and self.timeout > 0.0):
            raise ValueError(f"timeout = {self.timeout}; allowed: a finite number of seconds > 0")
        if self.workers is not None and self.cluster is not None:
            raise ValueError(f"cluster = {self.cluster!r} beside --workers {self.workers}; allowed: one of both")
        if self.store.suffix == REPORT:
            raise ValueError(f"store = {self.store}; allowed: another ending than that of the report, {REPORT}")


def main(argv: Sequence[str]) -> int:
    if usage("sweep", argv):
        return 0
    prepare()
    try:
        sweep = read_sweep(argv)
    except SystemExit:  # the help is printed
        return 0
    request, options = sweep.request, sweep.request.options
    errors = Console(stderr=True)
    command = shlex.join(["mathnavi", "sweep", *argv])
    state: Progress | None = None  # before the store is looked into
    try:
        with request.bad_input():
            trial_keys = keys(sweep.trials)  # a file that a field names, and that is not there, comes to light here
            _check_combinations(sweep, trial_keys)
            if options.cluster is not None:
                check(options.cluster)
            with compilation_announced(errors):
                _build_combinations(sweep)
            store = Store.open(options.store)
        with store, sweep_progress(errors, request.name.rpartition(":")[2]) as draw:

            def progress(now: Progress) -> None:
                nonlocal state
                state = now
                draw(now)

            endings = store.endings()
            transient = sum(key in endings and endings[key].status in TRANSIENT for key in trial_keys)
            found = sum(key in endings for key in trial_keys) - (transient if options.retry else 0)
            state = Progress(len(trial_keys), found, found, 0, 0, False)
            message = f"{found} of {len(trial_keys)} trials are already in {options.store}"
            errors.print(message, style="dim", highlight=False, soft_wrap=True)
            records = run_trials(
                sweep.trials,
                store,
                workers=options.workers or available_cores(),
                cluster=options.cluster,
                timeout=options.timeout,
                retry=options.retry,
                progress=progress,
            )
    except KeyboardInterrupt:
        print(f"mathnavi: interrupted, {_stored(state)}; to go on: {command}", file=sys.stderr)
        return INTERRUPTED
    except (StoreWriteError, RefusedError, LostError) as error:
        print(f"mathnavi: {' '.join(str(error).split())}, {_stored(state)}; to go on: {command}", file=sys.stderr)
        return 1
    console = Console()
    console.print(f"{request.name}, {verdict(records)}", style="bold", highlight=False, soft_wrap=True)
    print_evidence(console, records, [*sweep.listed, *sweep.drawn])
    console.print(f"\nstore   {options.store}", soft_wrap=True, highlight=False)
    if transient and not options.retry:
        console.print(
            f"found in the store as timed out or crashed: {transient}; --retry runs such trials again",
            soft_wrap=True,
            highlight=False,
        )
    if options.report:
        try:
            page = _report(sweep, records, command)
        except OSError as error:
            print(f"mathnavi: no report: {error}", file=sys.stderr)
            return 1
        console.print(f"report  {page}", soft_wrap=True, highlight=False)
    return 0


def _report(sweep: SweepRequest, records: Sequence[Record], command: str) -> Path:
    from mathnavi.renders.sweep_report import write_sweep_report  # what draws takes a while to import
    from mathnavi.sim.commands.tracks import shown_flights

    terrain, tracks = shown_flights(sweep.trials, records)
    path: Path = sweep.request.options.store.with_suffix(REPORT)
    return write_sweep_report(path, records, [*sweep.listed, *sweep.drawn], terrain, tracks, command)


@dataclass(frozen=True)
class SweepRequest:
    """The trials of a sweep, and what varies among them."""

    request: RunRequest  # the first, where plug-ins are varied
    trials: list[Trial]  # those of one seed together
    listed: list[str]  # fields
    drawn: list[str]  # fields
    firsts: list[Trial]  # of the first seed, one for each combination of listed values


def read_sweep(argv: Sequence[str]) -> SweepRequest:
    """The sweep that ``argv`` requests; BadInputError if it cannot be."""
    variations = read_variations(argv)
    requests = read_requests(argv, SweepOptions, variations)
    seed, count = requests[0].common.seed, requests[0].options.trials
    if seed > LARGEST_SEED - count + 1:
        raise BadInputError(f"--seed = {seed}; allowed: 0 to {LARGEST_SEED} less the trials that follow")
    by_request = [trials(request, variations, count) for request in requests]
    drawn = by_request[0][1]
    by_seed = zip(*(of_seeds for of_seeds, _ in by_request), strict=True)
    every = list(itertools.chain.from_iterable(itertools.chain.from_iterable(by_seed)))
    listed = [variation.name for variation in variations if variation.name not in drawn]
    return SweepRequest(requests[0], every, listed, drawn, every[: len(every) // count])


def _check_combinations(sweep: SweepRequest, trial_keys: Sequence[str]) -> None:
    """BadInputError if two combinations of listed values are the same trials under two names."""
    seen: dict[str, Trial] = {}
    for key, first in zip(trial_keys, sweep.firsts, strict=False):
        other = seen.setdefault(key, first)
        if other is not first:
            one, two = (trial.record(key, "ok").fields for trial in (other, first))
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
        except Exception:  # a defect, which is recorded when the trial runs
            continue


def _stored(state: Progress | None) -> str:
    return "before the first trial" if state is None else f"{state.done} of {state.total} trials are stored"
