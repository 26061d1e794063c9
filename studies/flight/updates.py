"""Information updates in flight: is the guarantee kept, or its loss announced if it cannot be?

The thesis allows for information updates by a new terminal cost (A.1, A.5). Here radars appear in the way, move into
it, and vanish; the target moves; and the ground is higher than the map, so that the path of the undisturbed mission
leads through a hill, which becomes known to the planner some seconds before the vehicle would hit it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mathnavi.controllers.flight.cost_to_go import factored_cost
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import Hill, with_hills
from mathnavi.models.terrain.visibility import Radar
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import RADAR, paths_on_map, styled_figure
from mathnavi.studies.framework.study import VEHICLE, Setup, StudyResult, TerrainReference, ends, median, track

NOTICES = (20.0, 10.0, 5.0, 3.0, 2.0, 1.0)  # [s] between when a hill is known and when it would be hit
ENOUGH = 5.0  # [s] that is to be enough
PERIOD = 5.0 / 3.0  # [s] between two plans
WEIGHT = 10.0  # of the radars
RADIUS, ASIDE = 0.1, 0.15  # of the map's side: of the radars, from where one drives into the way, the target's own way
HILL_RADIUS, ABOVE = 0.06, 300.0  # of the map's side, and [m] of the hills' tops above the path
_WAY, _ANNOUNCED, _HILL = 0.6, 0.3, 0.55  # of the time of flight: place of radars, their time, place of the hill
_INSIDE = 0.06  # of the map's side that the target stays from the border
_REPETITIONS = 5
COLOURS = {"as it was": "#101824", "radar appears": "#c2183b", "target moves": "#0d5fa8"}


@configuration
class UpdatesConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of missions, each flown with every change"""
    notices: Count = len(NOTICES)
    """largest number of times of notice of a hill"""


class Updates:
    """Radars, targets and maps that change in flight: is the guarantee kept, or its loss announced?"""

    Config = UpdatesConfig
    quick = UpdatesConfig(seeds=2, notices=3)
    title = "Information updates"

    @staticmethod
    def run(config: UpdatesConfig, setup: Setup) -> StudyResult:
        notices = NOTICES[: config.notices]
        seeds = range(config.seeds)
        varied = setup.compute(varied_mission, [MissionToVary(setup.place, seed, notices) for seed in seeds])
        trials = {name: [Trial.from_document(missions[name]) for missions in varied] for name in varied[0]}
        changes = {name: Change(name, records) for name, records in setup.fly_groups(trials).items()}
        rows = [change.row for change in changes.values()]
        (build,) = setup.compute(build_ms, [setup.place])
        shown = setup.flown({name: trials[name][0] for name in COLOURS})
        (radar,) = trials["radar appears"][0].spec.config.radar
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name}; the ends of each are those drawn without a change. "
                f"A new terminal cost takes {build:.0f} ms, {build / PERIOD / 10.0:.1f} % of a planning period: the "
                "thesis' took 15.8 s, and 1.5 s for a changed threat (A.5).",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(changes, shown, setup.ground, notices),
            caption="(a) One mission, with a radar that appears on the way, and with a target that moves. (b) Time in "
            "sight of a radar, known or not. (c) Flights that stay at h_min or above, of those over a hill that is "
            "not on the map, with 95 % limits, over the time between when it is communicated and when it would be hit.",
            claims=[_claim(changes, notices)],
            tracks=[track(name, shown[name], colour) for name, colour in COLOURS.items()],
            places=ends(shown["as it was"]),
            radars=[(radar[0], radar[1], float(setup.ground.height(radar[0], radar[1])), radar[2])],
        )  # fmt: skip


class Change:
    """Outcomes of the missions with one change."""

    def __init__(self, name: str, records: Sequence[Record]) -> None:
        def total(key: str) -> int:
            return int(figures(records, key).sum())

        h_min = np.array([record.parameters["config"]["clearance_min"] for record in records])
        safe = (figures(records, "min_clearance_m") >= h_min) & (figures(records, "ground_contacts") == 0)
        arrived = figures(records, "arrived") > 0
        late = figures(records, "flight_time_s") > figures(records, "deadline_s")
        losses = sum(figures(records, key) for key in ("guarantee_lost", "deadlines_lost", "arrival_lost"))
        self.exposure = figures(records, "radar_exposure_s")  # (n,) [s] in sight of a radar
        self.kept = int((safe & arrived & ~late).sum())  # safe, and there by the deadline in force
        self.row: dict[str, Any] = {
            "change": name,
            "missions": len(records),
            "safe": int(safe.sum()),  # at h_min or above
            "contacts": total("ground_contacts"),
            "unannounced": int((~(safe & arrived) & (losses == 0)).sum()),
            "arrived": int(arrived.sum()),
            "late": int(late.sum()),
            "endangered": total("plan_endangered"),
            "guarantee_lost": int((figures(records, "guarantee_lost") > 0).sum()),
            "arrival_lost": total("arrival_lost"),
            "deadline_moved": total("deadline_moved"),
            "exposure_s": float(self.exposure.mean()),
            "path_m": float(figures(records, "path_length_m").mean()),
        }


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table.of("Missions with a change on the way", rows, (
        ("change", "change"), ("at h_min or above", "{safe} of {missions}"), ("on the ground", "contacts"),
        ("not announced", "unannounced"), ("arrived", "{arrived} of {missions}"), ("late", "late"),
        ("endangered plans", "endangered"), ("guarantee lost", "guarantee_lost"),
        ("deadline moved", "deadline_moved"), ("in sight", "{exposure_s:.1f} s"), ("path", "{path_m:,.0f} m"),
    ))  # fmt: skip


def _claim(changes: Mapping[str, Change], notices: Sequence[float]) -> Claim:
    hills = {notice: changes[hill_name(notice)].row for notice in notices}
    others = [change for name, change in changes.items() if not name.startswith("hill")]
    flown, kept = sum(change.row["missions"] for change in others), sum(change.kept for change in others)
    early = [row for notice, row in hills.items() if notice >= ENOUGH]
    warned, saved = (sum(row[name] for row in early) for name in ("missions", "safe"))
    total, silent = (sum(change.row[name] for change in changes.values()) for name in ("missions", "unannounced"))
    by_notice = "; ".join(
        f"{notice:g} s {rate(row['safe'], row['missions']).text()}" for notice, row in hills.items()
    )  # fmt: skip
    return Claim(
        "flight.updates", "target", "What is learnt on the way keeps the guarantee, or its loss is announced.",
        "A.1, A.5",
        f"radars and targets that change: all safe, and arrive by the deadline in force; a hill known {ENOUGH:g} s "
        "ahead is cleared; no failure that was not announced",
        f"radars and targets: {kept} of {flown}; hill known {ENOUGH:g} s ahead or more: {saved} of {warned} at h_min "
        f"or above ({by_notice}); not announced: {silent} of {total}",
        kept == flown and saved == warned and silent == 0,
    )  # fmt: skip


# ---- what is drawn


def _figure(
    changes: Mapping[str, Change], shown: Mapping[str, RunData], ground: HeightField, notices: Sequence[float]
) -> Figure:
    with styled_figure((12.4, 4.2)) as page:
        left, middle, right = page.subplots(1, 3, width_ratios=(1.2, 1.0, 1.0))
        flights = {name: (shown[name], colour) for name, colour in COLOURS.items()}
        paths_on_map(left, ground, flights, "(a) one mission, changed on the way")
        radar = shown["radar appears"].config["mission"]["radars"][0]
        centre = (radar["x"] / 1e3, radar["y"] / 1e3)
        left.add_patch(Circle(centre, radar["radius"] / 1e3, facecolor=RADAR, alpha=0.2, edgecolor=RADAR))
        moved = shown["target moves"].config["mission"]["target_path"][-1]
        left.plot(moved[1] / 1e3, moved[2] / 1e3, "s", ms=6, mfc="#ffd90d", mec="#101824", zorder=4)
        _draw_exposure(middle, changes)
        for notice in notices:
            row = changes[hill_name(notice)].row
            found = rate(row["safe"], row["missions"])
            right.plot([notice, notice], [found.low, found.high], color="#0d5fa8", lw=1.6, alpha=0.6)
            right.plot(notice, found.value, "o", ms=6, color="#0d5fa8")
        right.set_xscale("log")
        right.set_xticks(list(notices), [f"{notice:g}" for notice in notices])
        right.minorticks_off()
        right.set(xlabel="known before it would be hit [s]", ylabel="share at h_min or above", ylim=(-0.03, 1.03))
        right.set_title("(c) a hill that is not on the map")
    return page


def _draw_exposure(axes: Axes, changes: Mapping[str, Change]) -> None:
    names = [name for name in changes if name.startswith("radar ")]
    for k, name in enumerate(names):
        sample = np.sort(changes[name].exposure)
        colour = "#5a6876" if name.endswith("not announced") else "#c2183b"
        axes.plot(np.full(len(sample), k) + np.linspace(-0.2, 0.2, len(sample)), sample, "o", ms=3.5, color=colour)
        axes.hlines(median(sample).median, k - 0.3, k + 0.3, color=colour)
    labels = [name.removeprefix("radar ").replace(", ", ",\n") for name in names]
    axes.set_xticks(range(len(names)), labels, fontsize=8)
    axes.set(ylabel="time in sight [s]", title="(b) radars")


# ---- what is measured


def announced(outcome: RunData) -> dict[str, Any]:
    """Count the events that announce a loss of the guarantee (a measure)."""
    kinds = [event.kind for event in outcome.recording.events]
    return {
        name.replace("-", "_"): kinds.count(name)
        for name in ("plan-endangered", "arrival-lost", "arrival-regained", "deadline-moved")
    }


def build_ms(place: TerrainReference) -> MeasuredTime:
    """A job: CPU time [ms] of a new terminal cost with a threat on the planner's default grid, the least of several."""
    ground = place.ground
    middle = 0.5 * np.array([ground.width, ground.depth])
    flight = FlightConfig()
    spent = []
    for k in range(_REPETITIONS):
        target = np.array([*(middle + 10.0 * k), float(ground.height(*(middle + 10.0 * k))) + 300.0])
        radar = Radar(float(0.5 * middle[0]), float(0.5 * middle[1]), RADIUS * _side(ground), WEIGHT)
        began = time.thread_time()
        factored_cost(ground, target, (radar,), flight.grid_nodes, flight.grid_layers)
        spent.append(time.thread_time() - began)
    return MeasuredTime(1e3 * min(spent))


# ---- the missions: each as it was, and with each change, by the path that it had


def hill_name(notice: float) -> str:
    """Return the name of a mission with a hill that becomes known ``notice`` [s] ahead."""
    return f"hill announced {notice:g} s ahead"


@dataclass(frozen=True)
class MissionToVary:
    """A mission to be flown with variations."""

    place: TerrainReference
    seed: int
    notices: tuple[float, ...]


def varied_mission(mission: MissionToVary) -> dict[str, dict[str, Any]]:
    """A job: fly a mission, and return documents of its trials without and with each change, which the path decides."""
    terrain, ground = mission.place.terrain, mission.place.ground
    outcome = trial("safe-flight", mission.seed, fields={"terrain": terrain}).flown()
    drawn = outcome.config["mission"]
    flown = Flown(outcome.recording.t, outcome.recording.truths[VEHICLE], np.array(drawn["target"]), ground)
    place = {"terrain": terrain, "start": drawn["start"], "target": drawn["target"]}
    varied = {
        "as it was": {},
        **_radars(flown),
        "target moves": {"target_path": _path(flown)},
        **_hills(flown, mission.notices),
    }
    return {
        name: trial("safe-flight", mission.seed, fields={**place, **fields}, measure=f"{__name__}:announced").document
        for name, fields in varied.items()
    }


@dataclass(frozen=True, eq=False)
class Flown:
    """A mission without a change."""

    t: Array  # (n,) [s]
    x: Array  # (n, 6)
    target: Array  # (3,) [m]
    ground: HeightField

    @property
    def duration(self) -> float:
        return float(self.t[-1])

    def at(self, share: float) -> Array:
        """Return the state (6,) [m, m/s] at a share of the flight time."""
        state: Array = self.x[np.searchsorted(self.t, share * self.t[-1])]
        return state

    @property
    def aside(self) -> Array:
        """Displacement (2,) [m] to the left of the path, by which a radar or the target moves."""
        vx, vy = self.at(_WAY)[3:5]
        left: Array = np.array([-vy, vx]) / max(float(np.hypot(vx, vy)), 1e-9)
        return ASIDE * _side(self.ground) * left


def _side(ground: HeightField) -> float:
    """Return the shorter side [m] of the map."""
    return min(ground.width, ground.depth)


def _radars(flown: Flown) -> dict[str, dict[str, Any]]:
    """Return fields of a radar that appears in the way, of one that moves into it, and of one that vanishes before."""
    ground, way, announced_at = flown.ground, flown.at(_WAY)[:2], _ANNOUNCED * flown.duration
    radius, aside = RADIUS * _side(ground), flown.aside
    if not ground.contains(*(way + aside)):
        aside = -aside
    begin = np.clip(way + aside, 0.0, [ground.width, ground.depth])
    velocity = (way - begin) / (_WAY * flown.duration)
    appears = {"radar": ((*way.tolist(), radius, WEIGHT),), "radar_time": announced_at}
    drives = {"radar": ((*begin.tolist(), radius, WEIGHT),), "radar_velocity": tuple(velocity.tolist())}
    return {
        "radar appears": appears,
        "radar appears, not announced": {**appears, "radar_known": False},
        "radar drives": drives,
        "radar drives, not announced": {**drives, "radar_known": False},
        "radar vanishes": {"radar": appears["radar"], "radar_until": announced_at},
    }


def _path(flown: Flown) -> tuple[tuple[float, ...], ...]:
    """Return the path of a target that moves to the side, or, near the border, towards the middle of the map."""
    here, size, side = flown.target[:2], np.array([flown.ground.width, flown.ground.depth]), _side(flown.ground)
    there, inside = here + flown.aside, _INSIDE * side
    if np.any(there < inside) or np.any(there > size - inside):
        inwards = 0.5 * size - here
        there = here + ASIDE * side * inwards / float(np.linalg.norm(inwards))
    height = float(flown.target[2])
    return ((0.4 * flown.duration, *here.tolist(), height), (0.7 * flown.duration, *there.tolist(), height))


def _hills(flown: Flown, notices: Sequence[float]) -> dict[str, dict[str, Any]]:
    """Return fields of a hill through which the path would lead, for each time of notice [s]."""
    ground, top = flown.ground, flown.at(_HILL)
    height = float(top[2] - ground.height(*top[:2])) + ABOVE
    hill = (float(top[0]), float(top[1]), HILL_RADIUS * _side(ground), height)
    higher = with_hills(ground, (Hill(*hill),))
    hit = float(flown.t[np.argmax(flown.x[:, 2] < higher.height(flown.x[:, 0], flown.x[:, 1]))])
    return {hill_name(notice): {"uncharted": (hill,), "uncharted_time": max(hit - notice, 0.0)} for notice in notices}
