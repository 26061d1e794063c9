"""Studies: a study reproduces a table or a figure of the thesis and evaluates claims.

A study is a class with a frozen dataclass ``Config`` of its sample sizes, ``quick``, a configuration for a first look,
a ``title``, and a static ``run(config, setup)``. It flies its missions through ``Setup.fly`` and computes everything
else through ``Setup.compute``, so each result is stored when it is ready, and an interrupted study continues where it
stopped. A study runs on every requested terrain; one that declares ``on_terrain = False`` runs once, without a terrain.

**Computations** of several kinds are requested by key and done by one pool of workers.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.errors import ArgumentError, PluginError, TerrainError
from mathnavi.interfaces.writing import write_together
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.figures import lay_out
from mathnavi.renders.page import number
from mathnavi.renders.study_report import StudyPage, Table, report
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.plugin.registry import of_stranger
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.computing_environment import environment
from mathnavi.sim.records.figure_names import is_wall_clock
from mathnavi.sim.records.files import as_json
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.statistics import Band, supported_band
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.records.table import Row as Row
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.execution import Progress, run_jobs, run_trials
from mathnavi.sim.sweep.job import Job, job
from mathnavi.sim.sweep.trial import Trial, trial


class Jobs:
    """Computations by key that one pool of workers executes together."""

    def __init__(self) -> None:
        self._jobs: list[tuple[Any, Job]] = []

    def add(self, key: Any, function: Callable[..., Any], arguments: Iterable[Any], **named: Any) -> None:
        """Add a job for each argument of a module-level function; ``named`` are passed on to every call."""
        self._jobs += [(key, call(function, argument, **named)) for argument in arguments]

    def done(self, setup: Setup) -> dict[Any, list[Any]]:
        """Execute the jobs; return the results by key, in the order of ``add``. Raises as ``Setup.perform`` does."""
        results: dict[Any, list[Any]] = {}
        for (key, _), result in zip(self._jobs, setup.perform([each for _, each in self._jobs]), strict=True):
            results.setdefault(key, []).append(result)
        return results


VEHICLE = "vehicle"
Key = TypeVar("Key")
Result = TypeVar("Result")


class StudyError(RuntimeError):
    """A study could not be completed."""


@dataclass(frozen=True)
class TerrainReference:
    """Reference to a terrain in the arguments of a job: its name or file, and the digest of its heights."""

    terrain: str  # name, or an .npz file
    digest: str

    @property
    def ground(self) -> HeightField:
        """The heights; TerrainError if they have changed since the reference was made."""
        ground = _loaded(self.terrain)
        if ground.digest != self.digest:
            raise TerrainError(f"terrain {self.terrain!r} has changed; allowed: heights with the digest {self.digest}")
        return ground


@cache
def _loaded(terrain: str) -> HeightField:
    return load_terrain(terrain)


@dataclass(frozen=True)
class Setup:
    """The terrain, the store and the workers of a study."""

    terrain: str | None  # name, or an .npz file; None for a study that declares ``on_terrain = False``
    store: Store
    workers: int = 1
    progress: Callable[[Progress], None] | None = None
    cluster: str | None = None  # address of a Dask scheduler whose workers take the place of this machine's
    mix_environments: bool = False  # results that are stored from another computing environment count too
    elsewhere: Elsewhere = field(default_factory=Elsewhere)  # counts of those

    @cached_property
    def ground(self) -> HeightField:
        """The terrain; StudyError if the study declares ``on_terrain = False``."""
        if self.terrain is None:
            raise StudyError("the study requests a terrain; allowed: none, for it declares on_terrain = False")
        return load_terrain(self.terrain)

    @property
    def place(self) -> TerrainReference:
        """The terrain as the argument of a job; StudyError if the study declares ``on_terrain = False``."""
        return TerrainReference(str(self.terrain), self.ground.digest)

    def trial(self, seed: int, measure: str = "", **named: Any) -> Trial:
        """Return a trial of ``safe-flight`` here; ``named`` are ``controller``, ``estimator`` and ``fields``."""
        here = {"terrain": self.terrain, **named.pop("fields", {})}
        return trial("safe-flight", seed, fields=here, measure=measure, **named)

    def fly(self, trials: Sequence[Trial]) -> list[Record]:
        """Return the records of the trials in order; those that the store lacks are flown.

        StudyError if a trial did not run to its end, for a table over the others would be biased.
        """
        records = run_trials(
            trials, self.store, workers=self.workers, cluster=self.cluster, progress=self.progress, retry=True,
            mix_environments=self.mix_environments, elsewhere=self.elsewhere,
        )  # fmt: skip
        for record in records:
            if record.status != "ok":
                raise StudyError(
                    f"seed {record.seed} {record.status}: {_last_line(record.error)}; parameters: {record.parameters}"
                )
        return records

    def fly_each(self, trials: Mapping[Key, Trial]) -> dict[Key, Record]:
        """Return the record of each trial by its name; raises as ``fly`` does."""
        return dict(zip(trials, self.fly(list(trials.values())), strict=True))

    def fly_groups(self, groups: Mapping[Key, Sequence[Trial]]) -> dict[Key, list[Record]]:
        """Return the records of each group of trials by its name; raises as ``fly`` does."""
        records = iter(self.fly([trial for trials in groups.values() for trial in trials]))
        return {name: [next(records) for _ in trials] for name, trials in groups.items()}

    def compute(self, function: Callable[..., Result], arguments: Iterable[Any], **named: Any) -> list[Result]:
        """Return the results of a module-level function for each argument in order, computed or from the store.

        ``named`` are passed on to every call. Arguments are plain data or dataclasses of plain data; their field
        ``seed``, if any, seeds the global generators too. A function returns measured times as ``MeasuredTime``.
        StudyError if a call raised an exception.
        """
        return self.perform([call(function, argument, **named) for argument in arguments])

    def perform(self, jobs: Sequence[Job]) -> list[Any]:
        """Return the results of the jobs in order, as ``compute`` does."""
        records = run_jobs(
            jobs, self.store, workers=self.workers, cluster=self.cluster, progress=self.progress, retry=True,
            mix_environments=self.mix_environments, elsewhere=self.elsewhere,
        )  # fmt: skip
        for record in records:
            if record.status != "ok":
                last = _last_line(record.error)
                raise StudyError(f"{record.function} {record.status}: {last}; arguments: {record.arguments}")
        return [record.value for record in records]

    def flown(self, missions: Mapping[Key, Trial]) -> dict[Key, RunData]:
        """Return the runs of missions with their logs, for figures, without CPU and wall-clock times."""
        made = [job(logged_run, mission.document, mission.content, seed=mission.seed) for mission in missions.values()]
        return dict(zip(missions, self.perform(made), strict=True))


def call(function: Callable[..., Any], argument: Any, **named: Any) -> Job:
    """Return ``function(argument, **named)`` as a job, with the seed of the argument if it has one."""
    seed = getattr(argument, "seed", 0)
    return job(function, argument, seed=seed if type(seed) is int else 0, **named)


def recorded_trial(document: Mapping[str, Any], content: str) -> Trial:
    """The trial of a document, as a job is given it; ArgumentError unless its content has the hash ``content``."""
    mission = Trial.from_document(document)
    if mission.content != content:
        raise ArgumentError(f"trial {content} is now {mission.content}; allowed: unchanged sources and files")
    return mission


def logged_run(document: Mapping[str, Any], content: str) -> RunData:
    """A job: the run of a mission, its log and all; ``content`` is the hash of all that the mission depends on.

    CPU and wall-clock times, which no other run reproduces, and the scene are left out.
    """
    outcome = recorded_trial(document, content).flown()
    agents = {
        name: replace(
            agent, solve_ms=[], answer_times={}, plans=[(t, replace(plan, solve_ms=np.nan)) for t, plan in agent.plans]
        )
        for name, agent in outcome.recording.agents.items()
    }
    summary = {name: value for name, value in outcome.summary.items() if not is_wall_clock(name)}
    recording = replace(outcome.recording, agents=agents)
    return replace(outcome, recording=recording, summary=summary, scene=None, timing=None)


def _last_line(error: str | None) -> str:
    return (error or "").strip().rpartition("\n")[2]


@dataclass(frozen=True)
class StudyResult:
    """Summary, tables, figures and claims of a study."""

    summary: Sequence[str]  # paragraphs
    rows: Sequence[Mapping[str, Any]]  # NAME.csv, one value a cell
    tables: Sequence[Table]
    figure: Figure  # NAME.png
    caption: str
    claims: Sequence[Claim]
    tracks: Sequence[Track] = ()
    places: Mapping[str, np.ndarray] = field(default_factory=dict)
    radars: Sequence[tuple[float, float, float, float]] = ()  # x, y, z, radius [m]


class StudyPlugin(Protocol):
    """An entry point of ``mathnavi.studies``."""

    Config: ClassVar[type[Any]]  # a frozen dataclass: how much is flown
    quick: ClassVar[Any]  # a Config that ends within a minute
    title: ClassVar[str]
    # on_terrain: ClassVar[bool], True where it is not declared: whether it is done on a terrain

    @staticmethod
    def run(config: Any, setup: Setup) -> StudyResult:
        """Run the study: fly, measure, and evaluate the claims."""
        ...


def checked_result(name: str, plugin: Any, config: Any, setup: Setup) -> StudyResult:
    """Return the result of a study; PluginError if a third-party study fails or returns another type."""
    with of_stranger(plugin, f"studies: {name!r}: run() failed:"):
        result = plugin.run(config, setup)
    if not isinstance(result, StudyResult):
        returned = type(result).__name__
        raise PluginError(f"studies: {name!r}: run() returned a {returned}; allowed: a StudyResult")
    return result


def on_terrain(plugin: Any) -> bool:
    """Return True if a study runs on a terrain."""
    return bool(getattr(plugin, "on_terrain", True))


def first_look(config: Any) -> str:
    """Return the fields that are smaller than their defaults as text, "seeds 2 instead of 20"; "" if none differ."""
    full = type(config)()
    pairs = {entry.name: (getattr(config, entry.name), getattr(full, entry.name)) for entry in fields(config)}
    smaller = [
        f"{name.replace('_', ' ')} {number(value)} instead of {number(whole)}"
        for name, (value, whole) in pairs.items()
        if isinstance(value, (int, float)) and value < whole
    ]
    return ", ".join(smaller)


def write_result(
    folder: Path, name: str, title: str, findings: StudyResult, setup: Setup, command: str, small: str = ""
) -> None:
    """Write NAME.csv, NAME.png, NAME.html and NAME.json, all or none.

    ``small`` is the text of ``first_look``. OSError names the file that could not be written.
    """
    ground = None if setup.terrain is None else setup.ground
    folder.mkdir(parents=True, exist_ok=True)
    picture = io.BytesIO()
    lay_out(findings.figure)
    findings.figure.savefig(picture, format="png", dpi=150, facecolor="white")
    page = StudyPage(
        name=name,
        title=title if ground is None else f"{title}, {ground.name}",
        summary=findings.summary,
        tables=findings.tables,
        figures=[(name, findings.figure, findings.caption)],
        claims=findings.claims,
        terrain=ground,
        tracks=findings.tracks,
        places=findings.places,
        radars=findings.radars,
        command=command,
        first_look=small,
    )
    document = {
        "study": name,
        "title": title,
        "terrain": None if ground is None else {"name": ground.name, "digest": ground.digest},
        "summary": list(findings.summary),
        "rows": list(findings.rows),
        "claims": [asdict(claim) for claim in findings.claims],
        "command": command,
        "first_look": small,
        "environment": dict(environment()),
        "from_other_environments": setup.elsewhere.taken.total(),
    }
    write_together(
        {
            folder / f"{name}.csv": as_csv(findings.rows).encode(),
            folder / f"{name}.png": picture.getvalue(),
            folder / f"{name}.html": report(page).encode(),
            folder / f"{name}.json": as_json(document).encode(),
        }
    )


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the rows as CSV with a header of all their names."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    out = io.StringIO()
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def median(sample: np.ndarray) -> Band:
    """Return the median with its bootstrap band, if the sample supports one; NaN is left out."""
    return supported_band(sample[np.isfinite(sample)], np.random.default_rng(0))


def effort_norm(records: Sequence[Record], h: float) -> np.ndarray:
    """Return ||a||_2 = sqrt(sum_k |a_k|^2) [m/s^2] over accelerations held for h [s]: the effort of A.6 and A.7."""
    return np.sqrt(figures(records, "control_effort") / h)


def chosen(rows: Iterable[Row], **values: Any) -> list[Row]:
    """Return the rows that have these values."""
    return [row for row in rows if all(row.get(name) == value for name, value in values.items())]


def falls(sequence: Sequence[float]) -> bool:
    """Return True if each value is less than the one before."""
    return all(later < earlier for earlier, later in pairwise(sequence))


def node_spacing(outcome: RunData) -> dict[str, Any]:
    """A measure: d of (A.8) [m], the longest distance between two successive sampling instants of a planner.

    The grid is uniform, and the planner plans again after each arc.
    """
    fields = outcome.config["controller"]["fields"]
    h = (fields["horizon"] or (fields["nodes"] - 1) * 5.0 / 3.0) / (fields["nodes"] - 1)  # [s]
    recording = outcome.recording
    instants = np.arange(0.0, recording.t[-1], h)
    p = recording.truths[VEHICLE][np.searchsorted(recording.t, instants - 1e-6), :3]
    return {"node_spacing_m": float(np.linalg.norm(np.diff(p, axis=0), axis=1).max(initial=0.0))}


SPACING = "mathnavi.studies.framework.study:node_spacing"


def track(name: str, outcome: RunData, colour: str, *, dashed: bool = False) -> Track:
    """Return the path flown, for the 3-D view."""
    return Track(name, outcome.recording.truths[VEHICLE][:, :3], colour, dashed)


def heights(outcome: RunData) -> np.ndarray:
    """Return the heights (n,) [m] of the path flown above the ground."""
    x = outcome.recording.truths[VEHICLE]
    above: np.ndarray = x[:, 2] - load_terrain(outcome.config["terrain"]["path"]).height(x[:, 0], x[:, 1])
    return above


def ends(outcome: RunData) -> dict[str, np.ndarray]:
    """Return start and target (3,) [m] of a mission, for the 3-D view."""
    return {name: np.array(outcome.config["mission"][name]) for name in ("start", "target")}


@dataclass(frozen=True)
class MissionToDraw:
    """A mission whose ends are to be drawn."""

    place: TerrainReference
    seed: int
    fields: Mapping[str, Any] = field(default_factory=dict)  # of the scenario, beside the terrain


def mission_ends(wanted: MissionToDraw) -> dict[str, tuple[float, float, float]]:
    """A job: start and target [m] of a seed, between which a first plan can be certified."""
    fields = {"terrain": wanted.place.terrain, **wanted.fields}
    drawn = trial("safe-flight", wanted.seed, fields=fields).build().config["fields"]
    return {name: tuple(drawn[name]) for name in ("start", "target")}
