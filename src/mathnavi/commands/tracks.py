"""Flights that the report of a sweep shows, flown again: a store keeps no paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import PATH_RATIO, figures
from mathnavi.sim.sweep.trial import Trial

COLOURS = {"lowest": "#c2183b", "of median length": "#2166ac", "unsuccessful": "#e08214"}


def shown_flights(trials: Sequence[Trial], records: Sequence[Record]) -> tuple[HeightField | None, list[Track]]:
    """Return a terrain, and over it the flight with the least clearance, one of median length, and one that failed.

    Without a terrain in the scenario there is neither terrain nor tracks.
    """
    ended = {
        k: record
        for k, record in enumerate(records)
        if record.status == "ok" and hasattr(trials[k].spec.config, "terrain")
    }
    if not ended:
        return None, []
    chosen = _chosen(ended)
    place = trials[next(iter(chosen.values()), next(iter(ended)))].spec.config.terrain
    tracks = []
    for name, k in chosen.items():
        x = trials[k].flown().arrays.get("truth.x") if trials[k].spec.config.terrain == place else None
        if x is not None:
            tracks.append(Track(f"{name}, seed {records[k].seed}", x[:, :3], COLOURS[name]))
    return load_terrain(place), tracks


def _chosen(records: Mapping[int, Record]) -> dict[str, int]:
    """Return the indices of the records that are shown, each once, with the reason."""
    places, among = list(records), list(records.values())
    clearance = figures(among, "min_clearance_m")
    ratio = figures(among, PATH_RATIO)
    found: dict[str, int] = {}
    if not np.isnan(clearance).all():
        found["lowest"] = places[int(np.nanargmin(clearance))]
    if not np.isnan(ratio).all():
        found["of median length"] = places[int(np.nanargmin(np.abs(ratio - np.nanmedian(ratio))))]
    failed = [k for k, record in records.items() if record.success is False]
    if failed:
        found["unsuccessful"] = failed[0]
    return {name: k for k, name in {k: name for name, k in found.items()}.items()}
