"""Safe loiter positions over a map, and goals that are found between them.

A vehicle that cannot stop ends its plans in circles. With limits of its height above ground, h_min to h_max, the circle
of radius r about a place at one level z is safe if every point c of it has

    h_ground(c) + h_min  <=  z  <=  h_ground(c) + h_max,

so the place is a safe loiter position if the ground along the circle is at most h_max - h_min higher at one point than
at another (J. Lim, F. Achermann, R. Girod, N. Lawrance, R. Siegwart, Safe Low-Altitude Navigation in Steep Terrain with
Fixed-Wing Aerial Vehicles, IEEE RA-L 9(5), 2024, with 50 and 120 m, the limits of open category flights in Europe, and
66.7 m). A goal that is one needs no heading. They plan with Dubins' airplanes; here the certified planner flies a point
mass of the acceleration v^2 / r, which keeps h_min, and not h_max: the share of the time within both is a figure.

Goals are found if the vehicle arrives: within r of the goal, by its deadline.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyError, StudyResult, heights, track

LOWEST, HIGHEST = 50.0, 120.0  # [m] h_min and h_max
RADIUS, SPEED = 200.0 / 3.0, 15.0  # [m] and [m/s] of the vehicle
RADII = (40.0, RADIUS, 100.0, 150.0)  # [m]
ANGLES = 48  # points of a circle
MOST_PLACES = 250  # along each side of the map
NEAREST, FARTHEST = 1000.0, 4000.0  # [m] that start and goal are apart
COLOUR = "#1a9850"


@configuration
class LoiterConfig:
    """Sample sizes: missions that are flown."""

    goals: Count = 20
    """number of missions from one safe loiter position to another"""


class Loiter:
    """Safe loiter positions in steep terrain, and the goals found between them (A.4, after Lim et al.)."""

    Config = LoiterConfig
    quick = LoiterConfig(goals=3)
    title = "Safe loiter positions, and the goals found between them"

    @staticmethod
    def run(config: LoiterConfig, setup: Setup) -> StudyResult:
        ground = setup.ground
        safe = {radius: safe_positions(ground, radius) for radius in RADII}
        rows = [
            {
                "radius_m": radius,
                "places": int(asked.sum()),
                "safe": int(found.sum()),
                "share": found.sum() / asked.sum(),
            }
            for radius, (_, asked, found) in safe.items()
            if asked.any()
        ]
        missions = drawn(ground, safe[RADIUS], config.goals)
        trials = [
            setup.trial(seed, fields=_fields(*ends), measure=f"{__name__}:within_limits")
            for seed, ends in enumerate(missions)
        ]
        records = setup.fly(trials)
        arrived = [bool(record.summary["arrived"]) for record in records]
        below = int((figures(records, "min_clearance_m") < LOWEST).sum())
        share = next(row["share"] for row in rows if row["radius_m"] == RADIUS)
        within = float(np.mean(figures(records, "within_limits")))
        found = rate(sum(arrived), len(arrived))
        shown = setup.flown({seed: trials[seed] for seed in range(min(4, len(trials)))})
        return StudyResult(
            summary=(
                f"Circles of {', '.join(f'{radius:.3g}' for radius in RADII)} m over {ground.name}, {LOWEST:g} to "
                f"{HIGHEST:g} m above ground; {config.goals} missions between safe positions of {RADIUS:.3g} m at "
                f"{SPEED:g} m/s.",
            ),
            rows=rows,
            tables=(
                Table.of("Safe loiter positions", rows, (
                    ("radius", "{radius_m:.3g} m"), ("places", "places"), ("safe", "safe"), ("share", "{share:.1%}"),
                )),
                _table(records, arrived),
            ),
            figure=figure(ground, safe[RADIUS], missions, arrived),
            caption=f"Safe loiter positions of {RADIUS:.3g} m (green) over the ground, and the missions between them.",
            claims=(
                Claim(
                    "flight.loiter", "target", "Goals between safe loiter positions are found, and no ground is met.",
                    "A.4 (Lim et al., RA-L 2024)", f"all of {config.goals} within {RADIUS:.3g} m by the deadline, none "
                    f"below {LOWEST:g} m",
                    f"goals found {found.text()}; below {LOWEST:g} m {below}; safe loiter positions {share:.1%} of the "
                    f"places; {within:.0%} of the time within {HIGHEST:g} m of the ground, which no plan has to keep",
                    all(arrived) and below == 0,
                ),
            ),
            tracks=[track(f"mission {seed}", outcome, COLOUR) for seed, outcome in shown.items()],
        )  # fmt: skip


def safe_positions(
    ground: HeightField, radius: float
) -> tuple[tuple[Array, Array], NDArray[np.bool_], NDArray[np.bool_]]:
    """Coordinates x (n,), y (m,) [m] of places, those (m, n) whose circle is on the map, and those that are safe."""
    x, y = (np.linspace(0.0, side, min(MOST_PLACES, int(side / 10.0) + 1)) for side in (ground.width, ground.depth))
    east, north = np.meshgrid(x, y)
    inside = (east >= radius) & (east <= ground.width - radius) & (north >= radius) & (north <= ground.depth - radius)
    low, high = np.full(east.shape, np.inf), np.full(east.shape, -np.inf)
    for angle in np.linspace(0.0, 2.0 * np.pi, ANGLES, endpoint=False):
        at = (
            np.clip(east + radius * np.cos(angle), 0.0, ground.width),
            np.clip(north + radius * np.sin(angle), 0.0, ground.depth),
        )
        height = np.asarray(ground.height(*at))
        low, high = np.minimum(low, height), np.maximum(high, height)
    return (x, y), inside, inside & (high - low <= HIGHEST - LOWEST)


def level(ground: HeightField, place: Array, radius: float) -> float:
    """Height [m] in the middle of those at which the circle about a safe place (2,) is."""
    angles = np.linspace(0.0, 2.0 * np.pi, ANGLES, endpoint=False)
    along = np.asarray(ground.height(place[0] + radius * np.cos(angles), place[1] + radius * np.sin(angles)))
    return 0.5 * float(along.max() + LOWEST + along.min() + HIGHEST)


def drawn(
    ground: HeightField, safe: tuple[tuple[Array, Array], NDArray[np.bool_], NDArray[np.bool_]], count: int
) -> list[tuple[Array, Array]]:
    """Draw starts and goals (3,) [m] from safe places. Raises StudyError for a map without enough of them."""
    (x, y), _, found = safe
    rows, columns = np.nonzero(found)
    places = np.column_stack([x[columns], y[rows]])
    rng, missions = np.random.default_rng(0), list[tuple[Array, Array]]()
    for _ in range(10_000 * count):
        if len(missions) == count or len(places) < 2:
            break
        ends = places[rng.choice(len(places), 2, replace=False)]
        if NEAREST <= np.linalg.norm(ends[1] - ends[0]) <= FARTHEST:
            start, goal = (np.append(each, level(ground, each, RADIUS)) for each in ends)
            missions.append((start, goal))
    if len(missions) < count:
        raise StudyError(
            f"{ground.name} has no {count} pairs of safe loiter positions {NEAREST:g} to {FARTHEST:g} m apart"
        )
    return missions


def _fields(start: Array, goal: Array) -> dict[str, Any]:
    return {
        "start": tuple(start.tolist()), "target": tuple(goal.tolist()), "clearance_min": LOWEST,
        "arrival_radius": RADIUS, "speed_max": SPEED, "acceleration_max": SPEED**2 / RADIUS,
    }  # fmt: skip


def within_limits(outcome: RunData) -> dict[str, Any]:
    """A measure: the share of the time that a flight is no more than ``HIGHEST`` above the ground."""
    return {"within_limits": float((heights(outcome) <= HIGHEST).mean())}


def _table(records: Sequence[Record], arrived: Sequence[bool]) -> Table:
    rows = [
        (
            str(record.seed),
            "yes" if each else "no",
            f"{record.summary['min_clearance_m']:.1f} m",
            f"{record.summary['flight_time_s']:.0f} s",
            f"{record.summary['within_limits']:.0%}",
        )
        for record, each in zip(records, arrived, strict=True)
    ]
    return Table(
        "Missions", ("mission", "goal found", "least clearance", "time of flight", f"within {HIGHEST:g} m"), rows
    )


def figure(
    ground: HeightField,
    safe: tuple[tuple[Array, Array], NDArray[np.bool_], NDArray[np.bool_]],
    missions: Sequence[tuple[Array, Array]],
    arrived: Sequence[bool],
) -> Figure:
    """Draw the map, safe places and missions."""
    (x, y), _, found = safe
    east, north = np.meshgrid(x, y)
    z = np.asarray(ground.height(east, north))
    with styled_figure((8.0, 0.8 + 7.0 * ground.depth / ground.width)) as drawn_figure:
        axes = drawn_figure.subplots()
        axes.contour(1e-3 * x, 1e-3 * y, z, levels=12, colors="#8a8f98", linewidths=0.6)
        axes.contourf(1e-3 * x, 1e-3 * y, found, levels=[0.5, 1.5], colors=[COLOUR], alpha=0.35)
        for (start, goal), good in zip(missions, arrived, strict=True):
            line = np.array([start, goal])
            axes.plot(*(1e-3 * line[:, :2].T), color="#0d5fa8" if good else "#c2183b", lw=1.0, marker="o", ms=3.0)
        axes.set(xlabel="east [km]", ylabel="north [km]", aspect="equal")
    return drawn_figure
