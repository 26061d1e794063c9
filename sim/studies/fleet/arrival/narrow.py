"""Fleets where it is narrow: thirty, and one whose vehicles swap places.

Over the ridges of jacksboro messages are lost, late or cut off, or the vehicles are slow or fast. In made-up canyons of
640 m up to twenty vehicles have slots 20 m apart. Twenty that swap places start on a ring around their slots, each
opposite to its own: all ways cross in the middle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.sweep.trial import Trial, trial

GROUND = "jacksboro"
CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "30 % loss": {"radio.loss": 0.3},
    "cut in two for 50 s": {"radio.partition": (20.0, 70.0)},
    "delays of 0 to 1 s": {"radio.delay": (0.0, 1.0)},
    "150 m/s": {"speed_max": 150.0},
    "500 m/s": {"speed_max": 500.0},
}
CANYONS = (3, 5, 7, 11, 13)
CANYON: Mapping[str, Any] = {
    **{"speed_max": 15.0, "acceleration_max": 6.0, "clearance_min": 10.0, "separation": 10.0, "slot_spacing": 20.0},
    **{"arrival_radius": 3.0, "drawn_heights": (5.0, 30.0), "drawn_distance": (0.2, 0.9), "planner.margin": 3.0},
}
SIZES = (2, 9, 20)
SWAPPING = 20  # vehicles
_RING, _HEIGHT = 11_000.0, 300.0  # [m] on which they start, and above ground
MISSED = 2  # fleets of thirty that may arrive farther apart
SWAP = "swapping places"


def fleets(count: int) -> dict[tuple[str, int], Trial]:
    """The first ``count`` trials, by the condition and the number of vehicles; small fleets first, the swap last."""
    trials: dict[tuple[str, int], Trial] = {}
    for size in SIZES:
        for (condition, fields), number in zip(CONDITIONS.items(), CANYONS, strict=True):
            trials[condition, size] = _trial({"terrain": GROUND, "vehicles": size, **fields})
            trials[f"canyon:{number}", size] = _trial({"terrain": f"canyon:{number}", "vehicles": size, **CANYON})
    trials[SWAP, SWAPPING] = _trial(swapping(GROUND, SWAPPING, _RING, _HEIGHT))
    return dict(list(trials.items())[:count])


def swapping(terrain: str, vehicles: int, ring: float | np.ndarray, height: float) -> dict[str, Any]:
    """Fields of a fleet that starts on a ``ring`` [m] about the middle of a map, each opposite to its own slot.

    ``ring`` is one radius, or (vehicles,) one of each; ``height`` [m] is that of starts and target above the ground.
    """
    ground = load_terrain(terrain)
    x, y = 0.5 * ground.width, 0.5 * ground.depth
    angles = [2.0 * math.pi * k / vehicles + math.pi for k in range(vehicles)]
    radii = np.broadcast_to(ring, vehicles).tolist()
    places = [(x + r * math.cos(angle), y + r * math.sin(angle)) for r, angle in zip(radii, angles, strict=True)]
    *starts, target = [(px, py, float(ground.height(px, py)) + height) for px, py in (*places, (x, y))]
    return {
        "terrain": terrain, "vehicles": vehicles, "start": tuple(starts), "target": target,
        "slot_assignment": "in_order",
    }  # fmt: skip


def _trial(fields: Mapping[str, Any]) -> Trial:
    return trial("simultaneous-arrival", 0, fields=dict(fields))


def rows(records: Mapping[tuple[str, int], Record]) -> list[dict[str, Any]]:
    """A row for each fleet."""
    keys = ("arrived", "spread_s", "arrival_time_s", "separation_min_m", "separation_allowed_m", "min_clearance_m",
            "ground_contacts", "plans_not_admitted")  # fmt: skip
    return [
        {"narrow": condition, "vehicles": size, **{key: record.summary[key] for key in keys}}
        for (condition, size), record in records.items()
    ]


def table(records: Mapping[tuple[str, int], Record]) -> Table:
    """Table of the fleets."""
    head = ("where it is narrow", "vehicles", "all arrived", "spread [s]", "last arrival [s]", "least separation [m]",
            "allowed [m]", "contacts", "plans not admitted")  # fmt: skip
    body = [
        (
            row["narrow"], row["vehicles"], "yes" if row["arrived"] else "no", _seconds(row["spread_s"], 2),
            _seconds(row["arrival_time_s"], 1), f"{row['separation_min_m']:.1f}", f"{row['separation_allowed_m']:g}",
            row["ground_contacts"], row["plans_not_admitted"],
        )
        for row in rows(records)
    ]  # fmt: skip
    return Table("Fleets where it is narrow", head, body)


def _seconds(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def claim(records: Mapping[tuple[str, int], Record], period: float) -> Claim:
    """Claim that all but two of thirty arrive within a planning period [s], the swap too, and none has a contact."""
    every, swap = list(records.values()), records.get((SWAP, SWAPPING))
    thirty = [record for record in every if record is not swap]
    together = int((_spreads(thirty) <= period).sum())
    contacts = int(figures(every, "ground_contacts").sum())
    close = int((figures(every, "separation_min_m") < figures(every, "separation_allowed_m")).sum())
    swapped = swap is None or bool(_spreads([swap])[0] <= period)
    worst = float(np.nanmax(np.append(_spreads(every), 0.0)))
    beside = "" if swap is None else f"; {SWAPPING} vehicles that swap places: {_spreads([swap])[0]:.2f} s"
    return Claim(
        "fleet.narrow", "target", "A fleet arrives at one time where it is narrow, too.", "A.8",
        f"2, 9, 20 vehicles over {GROUND} (loss, a cut, delays, 150 and 500 m/s) and in canyons: spread at most h = "
        f"{period:.2f} s in at least 28 of 30, no contact in any; {SWAPPING} that swap places do not lock",
        f"{together} of {len(thirty)} fleets within h, the largest spread {worst:.2f} s; {contacts} contacts, {close} "
        f"pairs too close{beside}",
        together >= len(thirty) - MISSED * len(thirty) // 30 and contacts == 0 and close == 0 and swapped,
    )  # fmt: skip


def _spreads(records: Sequence[Record]) -> np.ndarray:
    """[s] of each fleet; NaN where not all arrived."""
    return np.asarray(figures(records, "spread_s"), dtype=np.float64)
