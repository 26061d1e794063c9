"""Runs of scenarios: one run, a sweep, a study, or an environment that is commanded from outside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured, flat
from mathnavi.interfaces.short_tables import Row, counted, html_table, short_table, value_text
from mathnavi.interfaces.signals import Array
from mathnavi.scripting.requests import specified
from mathnavi.scripting.run_result import RunResult
from mathnavi.sim.engine.answer_times import Latency
from mathnavi.sim.engine.compilation import compile_ahead
from mathnavi.sim.plugin.registry import load as load_plugin
from mathnavi.sim.plugin.registry import names
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.run_spec import Plugin, RunSpec
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.timing import LatencyName
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.sweep.execution import Progress, available_cores, run_trials
from mathnavi.sim.sweep.trial import Trial, Uniform

if TYPE_CHECKING:  # these take a while to import, and no run needs them
    from matplotlib.figure import Figure

    from mathnavi.sim.environments.dm import Environment
    from mathnavi.studies.framework.study import StudyResult


def run(
    scenario: str,
    *,
    seed: int = 0,
    controller: Plugin = None,
    estimator: Plugin = None,
    latency: LatencyName = "none",
    progress: Callable[[float], None] | None = None,
    **fields: Any,
) -> RunResult:
    """Fly a scenario once and evaluate it: the same seed gives the same log, bit for bit.

    ``controller`` and ``estimator`` are plug-ins (``plugin``), their names or their classes; the scenario's own if not
    given. ``fields`` are the scenario's, nested ones as mappings, ``noise={"position": 5.0}``, or by dotted names.
    With the ``latency`` "measured" a plan takes as much simulated time as the planner's answer took on this machine;
    the folder in which the run is saved has these times, and ``mathnavi run --from`` repeats them. ``progress`` is
    called with the simulated time [s].

    Raises PluginError for an unknown scenario or plug-in, FieldError for a field or a value that is not allowed,
    MissionError for a mission that cannot be flown, FileNotFoundError for a missing file.
    """
    if latency not in get_args(LatencyName):
        raise FieldError(f"latency = {latency!r}; allowed: {', '.join(get_args(LatencyName))}")
    spec = specified(scenario, seed, controller, estimator, fields)

    def build() -> ClosedLoop:
        with raising(MissionError):
            closed_loop: ClosedLoop = spec.build()
            return closed_loop

    compile_ahead(*spec.parts.values())
    with spec.failures("a run"):
        return RunResult.of(build().run(progress, build, latency=Latency() if latency == "measured" else None))


def make(scenario: str, *, seed: int = 0, estimator: Plugin = None, **fields: Any) -> Environment:
    """Make a ``dm_env.Environment`` of a scenario, whose actions command the actuators.

    See ``mathnavi.sim.environments.dm``. ``seed`` draws the mission, and a generator of the same seed draws the seeds
    of the episodes. Raises as ``run`` does, and MissionError for a scenario that has nothing to command.
    """
    from mathnavi.sim.environments.dm import environment_of

    spec = specified(scenario, seed, None, estimator, fields)
    with raising(MissionError):
        return environment_of(spec)


def available(kind: str) -> tuple[str, ...]:
    """Return the names of all installed plug-ins of a kind.

    Kinds are "scenarios", "controllers", "estimators", "consensus", "studies", "terrains", "drawings" and "logs".

    Raises FieldError for another kind.
    """
    try:
        return names(kind)
    except KeyError:
        kinds = "scenarios, controllers, estimators, consensus, studies, terrains, drawings, logs"
        raise FieldError(f"kind = {kind!r}; allowed: {kinds}") from None


@dataclass(frozen=True, eq=False, repr=False)
class SweepResult:
    """Trials of a sweep in order of their seeds, those of one seed together."""

    records: tuple[Record, ...]
    varied: tuple[str, ...]  # fields

    @property
    def failures(self) -> Proportion:
        """Return the share of missions that failed, or did not run to their end, with its interval."""
        return rate(sum(not record.success for record in self.records), len(self.records))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each trial: seed, the varied fields, status, success and the summary's figures."""
        return [
            {
                "seed": record.seed,
                **{name: record.fields[name] for name in self.varied},
                "status": record.status,
                "success": record.success,
                **{key: value for key, value in record.summary.items() if key != "seed"},
            }
            for record in self.records
        ]

    def figures(self, name: str) -> Array:
        """Return a figure (trials,) of the summaries; NaN where a trial does not have it."""
        values = (record.summary.get(name) for record in self.records)
        return np.array([math.nan if value is None else float(value) for value in values])

    def _table(self) -> tuple[str, list[Row]]:
        scenario = self.records[0].scenario if self.records else "nothing"
        by_condition: dict[str, list[Record]] = {}
        for record in self.records:
            listed = [f"{name} {value_text(record.fields[name])}" for name in self.varied]
            by_condition.setdefault(", ".join(listed) or "all", []).append(record)
        title = f"{scenario}, {counted(len(self.records), 'trial')}, failures {self.failures.text()}"
        if len(by_condition) == len(self.records):
            return title, []
        return title, [
            (name, f"{sum(bool(record.success) for record in records)} of {len(records)}", "succeeded")
            for name, records in by_condition.items()
        ]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


def sweep(
    scenario: str,
    trials: int = 20,
    *,
    vary: Mapping[str, Any] | None = None,
    seed: int = 0,
    controller: Plugin = None,
    estimator: Plugin = None,
    store: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    timeout: float | None = None,
    mix_environments: bool = False,
    progress: Callable[[Progress], None] | None = None,
    **fields: Any,
) -> SweepResult:
    """Fly a scenario with the seeds ``seed`` to ``seed + trials - 1``, in parallel processes.

    ``vary`` names fields as on the command line ("planner.nodes", "faults.gust_rms", "controller"). Every value of a
    list flies every seed; a pair (low, high) is a uniform distribution, drawn again for each seed. With a ``store`` (an
    SQLite file) every trial is kept as it ends, and what it already holds is not flown again. ``timeout`` [s] is for
    each trial; ``cluster`` is the address of a Dask scheduler. Trials that are stored from another computing
    environment, and workers in one, are accepted only with ``mix_environments``.

    Raises as ``run`` does, and StoreError for a broken store. A custom plug-in must lie in a module, so that the
    processes find it.
    """
    if trials < 1:
        raise FieldError(f"trials = {trials!r}; allowed: a whole number >= 1")
    listed = {name: list(values) for name, values in (vary or {}).items() if not isinstance(values, tuple)}
    drawn = {name: values for name, values in (vary or {}).items() if isinstance(values, tuple)}
    specs = []
    for values in itertools.product(*listed.values()):
        chosen = dict(zip(listed, values, strict=True))
        parts = chosen.pop("controller", controller), chosen.pop("estimator", estimator)
        specs.append(specified(scenario, seed, *parts, {**flat(fields), **chosen}))
    with raising(FieldError):
        here = [spec.with_seed(spec.seed + number) for number in range(trials) for spec in specs]
        asked = [
            Trial(spec.with_fields({name: _uniform(spec, name, ends).draw(spec.seed) for name, ends in drawn.items()}))
            for spec in here
        ]
    with ExitStack() as opened:
        path = store if store is not None else Path(opened.enter_context(TemporaryDirectory())) / "trials.db"
        records = run_trials(
            asked,
            opened.enter_context(Store.open(path)),
            workers=available_cores() if workers is None else workers,
            cluster=cluster,
            timeout=timeout,
            progress=progress,
            mix_environments=mix_environments,
        )
    return SweepResult(tuple(records), tuple(vary or ()))


def _uniform(spec: RunSpec, name: str, bounds: tuple[Any, ...]) -> Uniform:
    try:
        kind = spec.type_of(name)
    except (KeyError, AttributeError):
        raise FieldError(f"vary: {name} is not a field of {spec.scenario}") from None
    if kind not in (int, float) or len(bounds) != 2 or not bounds[0] <= bounds[1]:
        raise FieldError(f"vary: {name} = {bounds!r}; allowed: (low, high) of a field that is a number, or a list")
    return Uniform(name, *map(kind, bounds))


@dataclass(frozen=True, eq=False, repr=False)
class StudyRun:
    """Result of a study: its claims, tables and figure."""

    name: str
    title: str
    result: StudyResult
    folder: Path | None = None  # into which it was written

    @property
    def claims(self) -> Sequence[Claim]:
        """Return the verdicts of the study on its claims: expected, measured, holds."""
        return self.result.claims

    @property
    def rows(self) -> Sequence[Mapping[str, Any]]:
        """Return the measurements, a mapping for each row of its CSV."""
        return self.result.rows

    @property
    def figure(self) -> Figure:
        """Return the study's matplotlib figure."""
        return self.result.figure

    def _table(self) -> tuple[str, list[Row]]:
        held = {None: "not measured", True: "holds", False: "does NOT hold"}
        return f"{self.name}: {self.title}", [(claim.id, held[claim.holds], "") for claim in self.claims]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


def study(
    name: str,
    *,
    quick: bool = False,
    terrain: str | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    **fields: Any,
) -> StudyRun:
    """Reproduce a table or a figure of the thesis; ``quick`` takes a small sample for a first look.

    ``fields`` are its sample sizes. A study of flights is done over ``terrain``, "tian_shan" if not given. With ``out``
    its trials are stored there, and NAME.csv, NAME.png, NAME.html and NAME.json are written.

    Raises PluginError for an unknown study, FieldError for a field or a value that is not allowed.
    """
    from mathnavi.studies.framework.study import Setup, checked_result, first_look, on_terrain, write_result

    found = load_plugin("studies", name)
    config = configured(found.quick if quick else found.Config(), fields)
    if terrain is not None and not on_terrain(found):
        raise FieldError(f"terrain = {terrain!r}: {name} is not done on a terrain; allowed: None")
    site = (terrain or "tian_shan") if on_terrain(found) else None
    with ExitStack() as opened:
        folder = Path(out) if out is not None else Path(opened.enter_context(TemporaryDirectory()))
        trials = opened.enter_context(Store.open(folder / "trials.db"))
        setup = Setup(site, trials, available_cores() if workers is None else workers, progress)
        result = checked_result(name, found, config, setup)
        if out is not None:
            small = first_look(config)
            write_result(folder, name.replace(":", "."), found.title, result, setup, f"study {name}", small)
    return StudyRun(name, found.title, result, Path(out) if out is not None else None)
