"""What a study is: a table or a figure of the thesis, done again, and what it says of the claims.

A study is a class with a frozen dataclass ``Config`` of its sample sizes, ``quick``, such a configuration for a first
look, a ``title``, and a static ``run(config, setup)``. It flies its missions through ``Setup.fly``, so each is stored
as it ends and a study that was interrupted goes on where it stopped. It is done on a terrain unless it declares
``on_terrain = False``; then it is done once, whatever terrains the others are done on.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from matplotlib.figure import Figure

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.page import number
from mathnavi.renders.study_report import StudyPage, Table, write_study_report
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.engine.log import write_bytes, write_json, write_text
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band, supported_band
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.sweep.execution import Progress, run_trials
from mathnavi.sim.sweep.trial import Trial, trial

VEHICLE = "vehicle"


class StudyError(RuntimeError):
    """A study that cannot say anything."""


@dataclass(frozen=True)
class Setup:
    """Where a study flies, and with what."""

    terrain: str | None  # name, or an .npz file; None for a study that declares ``on_terrain = False``
    store: Store
    workers: int = 1
    progress: Callable[[Progress], None] | None = None

    @cached_property
    def ground(self) -> HeightField:
        """The terrain itself; StudyError where there is none."""
        if self.terrain is None:
            raise StudyError("it asks for a terrain, though it declares on_terrain = False")
        return load_terrain(self.terrain)

    def trial(self, seed: int, measure: str = "", **named: Any) -> Trial:
        """A mission of ``safe-flight`` here; ``named`` are ``controller``, ``estimator`` and ``fields``."""
        here = {"terrain": self.terrain, **named.pop("fields", {})}
        return trial("safe-flight", seed, fields=here, measure=measure, **named)

    def fly(self, trials: Sequence[Trial]) -> list[Record]:
        """The records of the trials, in their order, flown where the store has none.

        StudyError if a trial did not run to its end: a table over what is left would not be the one it claims to be.
        """
        records = run_trials(trials, self.store, workers=self.workers, progress=self.progress, retry=True)
        for record in records:
            if record.status != "ok":
                last = (record.error or "").strip().rpartition("\n")[2]
                raise StudyError(f"seed {record.seed} {record.status}: {last}; parameters: {record.parameters}")
        return records

    def flown(self, mission: Trial) -> RunResult:
        """One mission again, for its path."""
        return mission.flown()


@dataclass(frozen=True)
class StudyResult:
    """What came out."""

    summary: Sequence[str]  # paragraphs
    rows: Sequence[Mapping[str, Any]]  # NAME.csv, one value a cell
    tables: Sequence[Table]
    figure: Figure  # NAME.png
    caption: str
    claims: Sequence[Claim]
    tracks: Sequence[Track] = ()
    places: Mapping[str, np.ndarray] = field(default_factory=dict)
    radars: Sequence[tuple[float, float, float, float]] = ()  # x, y, z, radius [m]


class Study(Protocol):
    """An entry point of ``mathnavi.studies``."""

    Config: ClassVar[type[Any]]  # a frozen dataclass: how much is flown
    quick: ClassVar[Any]  # a Config that ends within a minute
    title: ClassVar[str]
    # on_terrain: ClassVar[bool], True where it is not declared: whether it is done on a terrain

    @staticmethod
    def run(config: Any, setup: Setup) -> StudyResult:
        """Fly, measure, judge."""
        ...


def on_terrain(plugin: Any) -> bool:
    """Whether a study is done on a terrain."""
    return bool(getattr(plugin, "on_terrain", True))


def first_look(config: Any) -> str:
    """What of a study's configuration is smaller than in full, "seeds 2 instead of 20"; "" if nothing is."""
    full = type(config)()
    pairs = {entry.name: (getattr(config, entry.name), getattr(full, entry.name)) for entry in fields(config)}
    smaller = [
        f"{name.replace('_', ' ')} {number(value)} instead of {number(whole)}"
        for name, (value, whole) in pairs.items()
        if isinstance(value, (int, float)) and value < whole
    ]
    return ", ".join(smaller)


def write_findings(
    folder: Path, name: str, title: str, findings: StudyResult, setup: Setup, command: str, small: str = ""
) -> None:
    """NAME.csv, NAME.png, NAME.html, and NAME.json last, so that a JSON means a whole study.

    ``small`` is what makes it a ``first_look`` only, if anything.
    """
    ground = None if setup.terrain is None else setup.ground
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").unlink(missing_ok=True)
    write_text(folder / f"{name}.csv", as_csv(findings.rows))
    picture = io.BytesIO()
    findings.figure.savefig(picture, format="png", dpi=150, facecolor="white")
    findings.figure.set_layout_engine("none")  # everything has its place now, and the page shows it there
    write_bytes(folder / f"{name}.png", picture.getvalue())
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
    write_study_report(folder / f"{name}.html", page)
    document = {
        "study": name,
        "title": title,
        "terrain": None if ground is None else {"name": ground.name, "digest": ground.digest},
        "summary": list(findings.summary),
        "rows": list(findings.rows),
        "claims": [asdict(claim) for claim in findings.claims],
        "command": command,
        "first_look": small,
    }
    write_json(folder / f"{name}.json", document)


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, under the names of all of them."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    out = io.StringIO()
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def median(sample: np.ndarray) -> Band:
    """The median with its bootstrap band, where the sample supports one; what is NaN is left out."""
    return supported_band(sample[np.isfinite(sample)], np.random.default_rng(0))


def effort_norm(records: Sequence[Record], h: float) -> np.ndarray:
    """||a||_2 [m/s^2] = sqrt(sum_k |a_k|^2) over accelerations held for h [s]: the measure of effort in A.6 and A.7."""
    return np.sqrt(figures(records, "control_effort") / h)


def falls(sequence: Sequence[float]) -> bool:
    """Whether each is less than the one before."""
    return all(later < earlier for earlier, later in pairwise(sequence))


def node_spacing(outcome: RunResult) -> dict[str, Any]:
    """A measure: d of (A.8) [m], the longest way between two subsequent sampling instants of a planner.

    Its grid is uniform, and it plans again after each arc.
    """
    fields = outcome.config["controller"]["fields"]
    h = (fields["horizon"] or (fields["nodes"] - 1) * 5.0 / 3.0) / (fields["nodes"] - 1)  # [s]
    recording = outcome.recording
    instants = np.arange(0.0, recording.t[-1], h)
    p = recording.truths[VEHICLE][np.searchsorted(recording.t, instants - 1e-6), :3]
    return {"node_spacing_m": float(np.linalg.norm(np.diff(p, axis=0), axis=1).max(initial=0.0))}


SPACING = "mathnavi.sim.studies.framework.study:node_spacing"


def track(name: str, outcome: RunResult, colour: str, *, dashed: bool = False) -> Track:
    """The path flown, for the 3-D view."""
    return Track(name, outcome.recording.truths[VEHICLE][:, :3], colour, dashed)


def heights(outcome: RunResult) -> np.ndarray:
    """(n,) [m] height of the path flown above the ground."""
    x = outcome.recording.truths[VEHICLE]
    above: np.ndarray = x[:, 2] - load_terrain(outcome.config["terrain"]["path"]).height(x[:, 0], x[:, 1])
    return above


def ends(outcome: RunResult) -> dict[str, np.ndarray]:
    """Start and target of a mission, for the 3-D view."""
    return {name: np.array(outcome.config["mission"][name]) for name in ("start", "target")}
