"""Figure A.6: a radar with a range of 10 km in the middle of the way; does the planner avoid its line of sight?

Each mission is flown without knowledge of the radar, and with it, at two weights of the threat in the terminal cost.
The exposure is the time in the radar's line of sight over the true terrain. The height above ground, which the thesis
makes a statement about, is measured within one and a half radii of the radar.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial
from mathnavi.studies.framework.drawing import paths_on_map, styled_figure
from mathnavi.studies.framework.study import (
    VEHICLE,
    MissionToDraw,
    Setup,
    StudyResult,
    ends,
    heights,
    median,
    mission_ends,
    track,
)

Booleans = NDArray[np.bool_]

RADIUS = 10_000.0  # [m]
NEAR = 1.5  # radii
WEIGHTS = (3.0, 10.0)
COLOURS = {"unaware": "#c2183b", "weight 3": "#e08214", "weight 10": "#1a9850"}
LEAST_CUT, MOST_PATH = 0.95, 0.20  # of the target


@configuration
class ThreatConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of missions, each flown without and with knowledge of its radar"""


class Threat:
    """Avoidance of a radar in the way, and its price (Figure A.6)."""

    Config = ThreatConfig
    quick = ThreatConfig(seeds=2)
    title = "Threat exposure: a radar in the middle of the way"

    @staticmethod
    def run(config: ThreatConfig, setup: Setup) -> StudyResult:
        drawn = setup.compute(mission_ends, [MissionToDraw(setup.place, seed) for seed in range(config.seeds)])
        missions = [_missions(setup, seed, own) for seed, own in enumerate(drawn)]
        trials = {name: [each[name] for each in missions] for name in COLOURS}
        by_condition = setup.fly_groups(trials)
        near = np.all([np.isfinite(figures(group, "near_height_m")) for group in by_condition.values()], axis=0)
        rows = [_row(name, by_condition[name], by_condition["unaware"], near) for name in COLOURS]
        unaware, aware = rows[0], rows[-1]
        shown = setup.flown({name: trials[name][0] for name in COLOURS})
        (radar,) = trials["unaware"][0].spec.config.radar
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name}, a radar of {RADIUS / 1e3:.0f} km in the middle "
                "of each; the end points are those drawn without a radar.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(by_condition, shown, setup.ground),
            caption="The first mission: paths around the radar and their heights above ground; exposure of all "
            "missions.",
            claims=(
                Claim(
                    "A.threat-lower", "printed",
                    "Exposure is minimised by flying much lower, protected by the terrain.", "Figure A.6, A.7",
                    "less exposure and a lower mean height above ground near the radar, aware than unaware",
                    f"exposure {unaware['exposure_s']:.1f} to {aware['exposure_s']:.1f} s, mean height above ground "
                    f"near the radar {unaware['near_height_m']:.0f} to {aware['near_height_m']:.0f} m in the "
                    f"{aware['near']} missions that come near it",
                    aware["exposure_s"] < unaware["exposure_s"] and aware["near_height_m"] < unaware["near_height_m"],
                ),
                Claim(
                    "flight.radar", "target", "A known radar is avoided at a moderate price.", "A.7",
                    f"mean exposure cut by at least {LEAST_CUT:.0%} for at most {MOST_PATH:.0%} more path",
                    f"cut by {aware['cut']:.1%} for {aware['more_path']:.1%} more path",
                    aware["cut"] >= LEAST_CUT and aware["more_path"] <= MOST_PATH,
                ),
            ),
            tracks=[track(name, shown[name], COLOURS[name]) for name in COLOURS],
            places=ends(shown["unaware"]),
            radars=[(radar[0], radar[1], float(setup.ground.height(radar[0], radar[1])), RADIUS)],
        )  # fmt: skip


def _missions(setup: Setup, seed: int, drawn: Mapping[str, Sequence[float]]) -> dict[str, Trial]:
    """Return the trials between the drawn ends of a seed, with a radar in the middle."""
    start, target = drawn["start"], drawn["target"]
    middle = (0.5 * (start[0] + target[0]), 0.5 * (start[1] + target[1]))

    def one(weight: float, known: bool) -> Trial:
        radar = ((*middle, RADIUS, weight),)
        return setup.trial(seed, measure=NEAR_MEASURE, fields={**drawn, "radar": radar, "radar_known": known})

    return {"unaware": one(WEIGHTS[-1], False)} | {f"weight {weight:g}": one(weight, True) for weight in WEIGHTS}


NEAR_MEASURE = "mathnavi.studies.flight.threat:near_radar"


def near_radar(outcome: RunData) -> dict[str, Any]:
    """A measure: mean height above ground [m] within ``NEAR`` radii of the radar; None if the path stays outside."""
    (radar,) = outcome.config["mission"]["radars"]
    x, above = outcome.recording.truths[VEHICLE], heights(outcome)
    near = np.hypot(x[:, 0] - radar["x"], x[:, 1] - radar["y"]) <= NEAR * radar["radius"]
    return {"near_height_m": float(above[near].mean()) if near.any() else None}


def _row(name: str, records: Sequence[Record], unaware: Sequence[Record], near: Booleans) -> dict[str, Any]:
    """Return a row of the table; ``near`` are the missions that come near the radar with and without knowing it.

    Heights near the radar are compared over them only.
    """
    exposure, path = figures(records, "radar_exposure_s"), figures(records, "path_length_m")
    return {
        "planner": name,
        "exposure_s": float(exposure.mean()),
        "exposure_max_s": float(exposure.max()),
        "cut": float(1.0 - exposure.sum() / figures(unaware, "radar_exposure_s").sum()),
        "path_m": float(path.mean()),
        "more_path": float((path / figures(unaware, "path_length_m")).mean() - 1.0),
        "near_height_m": float(figures(records, "near_height_m")[near].mean()) if near.any() else math.nan,
        "near": int(near.sum()),
        "height_m": float(figures(records, "mean_height_m").mean()),
    }


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Exposure to the radar (the thesis gives a picture, no numbers)", rows, (
        ("planner", "planner"), ("exposure, mean", "{exposure_s:.1f} s"), ("largest", "{exposure_max_s:.1f} s"),
        ("cut", "{cut:.1%}"), ("path", "{path_m:,.0f} m"), ("more path", "{more_path:+.1%}"),
        ("height near the radar", "{near_height_m:.0f} m"), ("on the whole way", "{height_m:.0f} m"),
    ))  # fmt: skip


def _figure(by_condition: dict[str, list[Record]], shown: dict[str, RunData], ground: HeightField) -> Figure:
    with styled_figure((9.4, 3.9)) as figure:
        path, height, exposure = figure.subplots(1, 3, width_ratios=(1.2, 1.3, 0.8))
        flights = {name: (shown[name], colour) for name, colour in COLOURS.items()}
        paths_on_map(path, ground, flights, "Figure A.6: paths")
        for name, colour in COLOURS.items():
            outcome = shown[name]
            x = outcome.recording.truths[VEHICLE]
            travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1))])
            height.plot(travelled / 1e3, heights(outcome), color=colour, lw=1.0)
        height.set(xlabel="distance flown [km]", ylabel="height above ground [m]", title="Height", ylim=(0.0, None))
        for k, (name, colour) in enumerate(COLOURS.items()):
            sample = figures(by_condition[name], "radar_exposure_s")
            exposure.plot(
                np.full(len(sample), k) + np.linspace(-0.2, 0.2, len(sample)), np.sort(sample), "o", ms=3, color=colour
            )
            exposure.hlines(median(sample).median, k - 0.3, k + 0.3, color=colour)
        exposure.set_xticks(range(len(COLOURS)), [name.replace(" ", "\n") for name in COLOURS])
        exposure.set(ylabel="time in sight [s]", title="Exposure")
    return figure
