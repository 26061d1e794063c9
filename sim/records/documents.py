"""Schemas, as dataclasses, of the JSON files of a run's folder, of a study and of a store, checked when they are read.

Other names than those here belong to a scenario, and are accepted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, Literal

from mathnavi.interfaces.bounds import Seed, configuration
from mathnavi.interfaces.schema import ROOT, validated
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL, SUMMARY_GROUPS, TEXTS, TRUTH_VALUES

LOG_SCENARIO = "recorded-log"
"""name in config.json in place of a scenario, of a log that was imported"""


@configuration
class PluginDocument:
    """A plug-in and its fields."""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)


@configuration
class TerrainDocument:
    """Map that was flown over."""

    name: str
    path: str | None = None  # as given; None in a study
    digest: str | None = None
    hills: tuple[tuple[float, float, float, float], ...] = ()  # that were added to it


@configuration
class PartOfDocument:
    """Search or sweep that a run belongs to, in config.json."""

    name: str
    page: str  # its page, relative to the folder of the run


@configuration
class RunDocument:
    """Content of config.json; that of an earlier version may have fewer fields."""

    scenario: str
    seed: Seed
    fields: dict[str, Any] = field(default_factory=dict)
    controller: PluginDocument | None = None
    estimator: PluginDocument | None = None
    mission: dict[str, Any] = field(default_factory=dict)
    terrain: TerrainDocument | None = None
    drawing: str | None = None
    recorded: str | None = None
    estimator_sign: str | None = None  # with which kinds of events of an estimator begin that is not mathnavi's own
    part_of: PartOfDocument | None = None
    versions: dict[str, str] = field(default_factory=dict)
    machine: dict[str, str] | None = None
    inputs: dict[str, str] | None = None  # digests of the files that were read, by the names of the fields
    code: str | None = None  # version of the code that it ran, of mathnavi and of each further distribution
    latency: Literal["measured"] | None = None  # None: plans took no simulated time


@configuration
class ArrayDocument:
    """One array of a log."""

    shape: tuple[int, ...]
    dtype: str


@configuration
class ArrayIndexDocument:
    """Content of log.json."""

    states: dict[str, tuple[str, ...]]  # (nx,) names with units, by vehicle
    activations: dict[str, tuple[str, ...]] = field(default_factory=dict)  # (na,) of vehicles that have any
    inputs: dict[str, tuple[str, ...]] = field(default_factory=dict)  # (nu,), as all below of vehicles that name any
    readings: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)  # of each sensor's numbers
    estimates: dict[str, tuple[str, ...]] = field(default_factory=dict)
    estimands: dict[str, tuple[str, ...]] = field(default_factory=dict)
    figures: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)  # of an estimate's further figures
    groups: dict[str, dict[str, tuple[str, ...]]] = field(default_factory=dict)  # names without units, by their chart
    arrays: dict[str, ArrayDocument] = field(default_factory=dict)


@configuration
class StudyRecord:
    """Content of NAME.json of a study."""

    study: str
    claims: tuple[Claim, ...]
    terrain: TerrainDocument | None = None
    command: str | None = None
    first_look: str | None = None


@configuration
class TrialParameters:
    """Parameters of a trial in a store."""

    config: dict[str, Any] = field(default_factory=dict)
    controller: PluginDocument | None = None
    estimator: PluginDocument | None = None
    inputs: dict[str, Any] = field(default_factory=dict)


def check_summary(summary: Mapping[str, Any], where: str = ROOT) -> None:
    """Raise FieldError for a figure of a summary that has the wrong type."""
    for name, value in summary.items():
        kind = _KINDS.get(name)
        if kind is not None:
            validated(kind, value, f"{where}.{name}")


_KINDS: dict[str, Any] = {
    name: bool if name in TRUTH_VALUES else str | None if name in TEXTS else float | None
    for names in SUMMARY_GROUPS.values()
    for name in names
} | {SHORTFALL: str | None, PLANNER_STATUS: str, "version": str}
