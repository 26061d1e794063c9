"""Missions whose ends are drawn by a job, because drawing needs first plans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.framework.study import TerrainReference


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
