"""Missions of a quadrotor through canyons, in gusts and with more mass than declared: is the certificate kept?

The planner, its certificate and its guarantee are those of the point mass; a body with four rotors follows its plans
within a bound that was computed, not measured. Every mission has gusts, a tenth more mass than declared and slower
rotors; the ends are drawn on the canyon's floor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.figures import BOUND
from mathnavi.renders.relief import relief
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorCanyonConfig
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import VEHICLE, Setup, StudyResult

FIELDS: Mapping[str, Any] = {
    "faults.gust_rms": 0.6,
    "faults.gust_limit": 1.5,
    "mismatch.mass": 1.1,
    "mismatch.motor_lag": 1.15,
}
H_MIN = QuadrotorCanyonConfig().clearance_min
MAP_PIXELS = 480
PATH, EVERY = "mathnavi.studies.flight.quadrotor:path", 0.4  # a measure, and what lies between its points [s]
BLUE, ORANGE = "#0d5fa8", "#d9731a"


@configuration
class QuadrotorStudyConfig:
    """Sample sizes: missions that are flown."""

    canyons: Count = 20
    """number of canyons, generated from the seeds 0, 1, ..."""
    missions: Count = 5
    """number of missions in each canyon"""
    drawn: Count = 4
    """largest number of canyons whose maps are drawn with the paths flown"""


class QuadrotorStudy:
    """Quadrotors through canyons in gusts, heavier and slower than declared (A.8, Fig. A.9)."""

    Config = QuadrotorStudyConfig
    quick = QuadrotorStudyConfig(canyons=2, missions=3, drawn=2)
    title = "A quadrotor beneath the point mass"
    on_terrain = False  # every canyon is one

    @staticmethod
    def run(config: QuadrotorStudyConfig, setup: Setup) -> StudyResult:
        trials = [_mission(config, canyon, k) for canyon in range(config.canyons) for k in range(config.missions)]
        records = setup.fly(trials)
        flown = [np.array(record.summary["path"]) for record in records]
        paths = {
            canyon: flown[canyon * config.missions : (canyon + 1) * config.missions]
            for canyon in range(min(config.drawn, config.canyons))
        }
        rows = [_row(record) for record in records]
        return StudyResult(
            summary=(
                f"{len(records)} missions through {config.canyons} canyons, each between ends of its own on its "
                f"floor. Gusts of {FIELDS['faults.gust_rms']:g} m/s² rms on each axis, clipped at "
                f"{FIELDS['faults.gust_limit']:g}; the true mass is {FIELDS['mismatch.mass']:g} times, the lag of the "
                f"rotors {FIELDS['mismatch.motor_lag']:g} times what the controller believes. Clearance is that of the "
                "whole vehicle, 0.335 m about its centre, over MuJoCo's triangles.",
            ),
            rows=rows,
            tables=(_table(records),),
            figure=_figure(records, paths),
            caption="Maps: the paths flown. Right: the least clearance of each mission against h_min; how far each was "
            "off its plan at worst, as a share of the bound in its certificate.",
            claims=(_claim(records),),
        )


def _mission(config: QuadrotorStudyConfig, canyon: int, k: int) -> Trial:
    fields = {"terrain": f"canyon:{canyon}", **FIELDS}
    return trial("quadrotor-canyon", canyon * config.missions + k, fields=fields, measure=PATH)


def path(outcome: RunData) -> dict[str, Any]:
    """A measure: positions of the vehicle on the map, [[x, y], ...] [m], two or three times a second."""
    recording = outcome.recording
    places = recording.truths[VEHICLE][:: max(1, round(EVERY / float(np.diff(recording.t[:2])[0])))]
    return {"path": np.round(np.vstack([places, recording.truths[VEHICLE][-1:]])[:, :2], 1).tolist()}


def _share(records: Sequence[Record]) -> np.ndarray:
    """Return the greatest distance (n,) from the plan over the greatest that the bound allows."""
    share: np.ndarray = figures(records, "tracking_error_max_m") / figures(records, "tracking_bound_m")
    return share


def _row(record: Record) -> dict[str, Any]:
    kept = (
        "arrived", "flight_time_s", "deadline_s", "path_length_m", "min_clearance_m", "ground_contacts",
        "speed_max_m_s", "tracking_error_max_m", "tracking_error_rms_m", "tracking_bound_horizontal_m",
        "tracking_bound_vertical_m",
        "tracking_breaches", "tilt_max_deg", "thrust_max_share", "saturated_share", "plans_rejected", "replans",
        "guarantee_lost",
    )  # fmt: skip
    canyon = record.parameters["config"]["terrain"]
    return {"canyon": canyon, "seed": record.seed, **{key: record.summary[key] for key in kept}}


def _table(records: Sequence[Record]) -> Table:
    wanted = {
        "least clearance": ("min_clearance_m", 1.0, "m"),
        "off the plan, rms": ("tracking_error_rms_m", 100.0, "cm"),
        "off the plan, at worst": ("tracking_error_max_m", 100.0, "cm"),
        "bound in the certificate": ("tracking_bound_m", 100.0, "cm"),
        "greatest tilt": ("tilt_max_deg", 1.0, "°"),
        "greatest thrust asked of a rotor": ("thrust_max_share", 100.0, "% of its most"),
        "rotors at a bound": ("saturated_share", 100.0, "% of the commands"),
        "highest speed": ("speed_max_m_s", 1.0, "m/s"),
        "arrival": ("flight_time_s", 1.0, "s"),
        "plans refused": ("plans_rejected", 1.0, "of a mission"),
    }
    body = []
    for name, (key, factor, unit) in wanted.items():
        values = factor * figures(records, key)
        body.append((name, *(f"{value:.3g}" for value in (values.min(), np.median(values), values.max())), unit))
    return Table("Missions", ("", "least", "median", "greatest", "unit"), body)


def _claim(records: Sequence[Record]) -> Claim:
    n = len(records)
    below = int((figures(records, "min_clearance_m") < H_MIN).sum())
    touched = int((figures(records, "ground_contacts") > 0).sum())
    late = (figures(records, "arrived") == 0) | (figures(records, "flight_time_s") > figures(records, "deadline_s"))
    breaches = int(figures(records, "tracking_breaches").sum())
    least, worst = figures(records, "min_clearance_m").min(), 100.0 * figures(records, "tracking_error_max_m").max()
    return Claim(
        "fleet.quadrotor", "target", "A quadrotor beneath the point mass keeps what was certified.", "A.8, Fig. A.9",
        f"{n} missions with gusts, motor lag and mass +10 %: no contact, clearance >= h_min, all arrive in time",
        f"below h_min {rate(below, n).text()}; contacts {rate(touched, n).text()}; not in time "
        f"{rate(int(late.sum()), n).text()}; least clearance {least:.2f} m of {H_MIN:g}; off the plan at worst "
        f"{worst:.1f} cm, {_share(records).max():.0%} of the bound, {breaches} breaches",
        below == 0 and touched == 0 and not late.any(),
    )  # fmt: skip


# ---- what is drawn


def _figure(records: Sequence[Record], paths: Mapping[int, Sequence[np.ndarray]]) -> Figure:
    with styled_figure((12.6, 6.4)) as page:
        maps, rest = np.asarray(page.subfigures(1, 2, width_ratios=(1.25, 1.0)))
        side = int(np.ceil(np.sqrt(len(paths))))
        rows = -(-len(paths) // side)
        panels = np.atleast_1d(maps.subplots(rows, side, sharex=True, sharey=True)).ravel()
        for axes in panels[len(paths) :]:
            axes.axis("off")
        for axes, (canyon, flown) in zip(panels, paths.items(), strict=False):
            terrain = load_terrain(f"canyon:{canyon}")
            axes.imshow(relief(terrain, MAP_PIXELS), extent=(0.0, terrain.width, 0.0, terrain.depth))
            for path in flown:
                axes.plot(*path.T, color="white", lw=2.6, alpha=0.8)
                (line,) = axes.plot(*path.T, color=BLUE, lw=1.3)
                (start,) = axes.plot(*path[0], "o", ms=4.5, mfc="white", mec="#101824")
                (target,) = axes.plot(*path[-1], "o", ms=4.5, mfc="#ffd90d", mec="#101824")
            axes.grid(False)
            axes.set(title=f"canyon {canyon}", xticks=(0, 200, 400, 600), yticks=(0, 200, 400, 600))
        for k, axes in enumerate(panels[: len(paths)]):
            axes.tick_params(labelbottom=k + side >= len(paths))
            axes.set(xlabel="east [m]" if k + side >= len(paths) else "", ylabel="" if k % side else "north [m]")
        maps.legend(
            (line, start, target), ("path flown", "start", "target"), loc="outside lower center", ncols=3, frameon=False
        )
        upper, lower = rest.subplots(2, 1)
        clearance = figures(records, "min_clearance_m")
        top = max(1.15 * float(clearance.max()), H_MIN + 1.0)
        upper.hist(clearance, np.linspace(0.0, top, 45), color=BLUE)
        upper.axvline(H_MIN, color=BOUND, ls=":", lw=1.4)
        annotate(upper, "h_min", (H_MIN, 0.96), (-4, 0), xycoords=("data", "axes fraction"), ha="right", va="top",
                 color=BOUND)  # fmt: skip
        upper.set(xlabel="least clearance [m]", ylabel="missions", title="Clearance of the whole vehicle")
        share = np.sort(_share(records))
        gained = (np.arange(len(share)) + 1.0) / len(share)
        lower.plot(100.0 * share, gained, color=BLUE, label="at worst")
        rms = np.sort(figures(records, "tracking_error_rms_m") / figures(records, "tracking_bound_m"))
        lower.plot(100.0 * rms, gained, color=ORANGE, label="rms")
        lower.axvline(100.0, color=BOUND, ls=":", lw=1.4)
        lower.set(xlabel="off the plan [% of the bound]", ylabel="share of the missions", title="Tracking")
        lower.set_xlim(0.0, max(108.0, 104.0 * float(share[-1])))
        lower.legend(loc="center")
    return page
