"""Simultaneous arrival with real vehicles (A.8, Figure A.11).

The thesis flew one vehicle and simulated the values of the others. Here whole fleets fly in MuJoCo. They agree on the
largest of their least times of arrival, and for comparison on the average of (A.12) by the Laplacian protocol, as
printed.

Fleets also fly in narrow places: over the ridges of jacksboro messages are lost, late or cut off, or the vehicles are
slow or fast; in synthetic canyons of 640 m up to twenty vehicles have slots 20 m apart; and twenty that swap places
start on a ring around their slots, each opposite to its slot, so that all paths cross in the middle.

A single vehicle is given, as in the simulations of A.8.4, a desired time that deviates from its estimate by up to a
given share: is one planning step enough? The vehicle flies its plans. At some step k it is given eta_d, which deviates
from its eta_k, (A.12), by a share drawn uniformly; its next plan is to satisfy (A.13),

    T_p + L(p_N) / v_max + h = eta_d,

with the length to go L. The step succeeds if (A.12) of a certified plan equals eta_d to ``TOLERANCE``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.controllers.arrival.laplacian import is_outlier
from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.planner import RecedingHorizon
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.problem import LengthToGo, Problem
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.flight_parts import drawn_point
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, TerrainReference, median

H = 5.0 / 3.0  # [s]
SIZES = (4, 6, 8, 16)
FAILING = 0.1  # of the solver's answers
NOMINAL, FAULTED, PRINTED = "nominal", "10 % solver failures", "average of (A.12)"
CONSTRAINT, PENALTY = "maximum, by (A.13)", "maximum, by its penalty"
KINDS: Mapping[str, Mapping[str, Any]] = {  # fields of the scenario
    NOMINAL: {},
    FAULTED: {"faults.solver_failure_rate": FAILING},
    PRINTED: {"consensus": "laplacian"},
    CONSTRAINT: {"planner.incorporation": "constraint"},
    PENALTY: {"planner.incorporation": "penalty"},
}
PRINTED_SIZE = 4  # of the fleets that agree, or comply, as printed
SHOWN = 6  # of the fleet that is drawn
LEAST_DRAWN = 1e-2  # [s] of a spread
COLOURS = {NOMINAL: "#0d5fa8", FAULTED: "#d9731a", PRINTED: "#c2183b", CONSTRAINT: "#7b3fa0", PENALTY: "#1a9850"}

# Fleets where it is narrow
RIDGES = "jacksboro"
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
NARROW_SIZES = (2, 9, 20)
SWAP, SWAPPING = "swapping places", 20  # vehicles
_RING, _HEIGHT = 11_000.0, 300.0  # [m] on which they start, and above ground
MISSED = 2  # fleets of thirty that may arrive farther apart

# One vehicle that is asked for another time
DEVIATIONS = (0.03, 0.1, 0.3)  # the thesis' is the last
NODES = 7  # N
TOLERANCE = 0.1  # [s]
_STEPS = (5, 25)  # between which one is drawn at which the vehicle is asked
_DRAWS = 50
_FARTHEST = 0.6  # of the map's side, least distance of start and target
_HEIGHTS = (50.0, 450.0)  # [m] above h_min


@configuration
class ArrivalConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 8
    """number of fleets of each size, with and without failures"""
    sizes: Count = len(SIZES)
    """largest number of sizes of fleets"""
    steps: Count = 40
    """number of changes of the desired time of a single vehicle, at each share"""
    narrow: Count = 31
    """largest number of fleets in narrow places: thirty, and one that swaps places"""


class Arrival:
    """Fleets that agree on one time and arrive at it (Figure A.11)."""

    Config = ArrivalConfig
    quick = ArrivalConfig(seeds=1, sizes=2, steps=4, narrow=4)
    title = "Simultaneous arrival"

    @staticmethod
    def run(config: ArrivalConfig, setup: Setup) -> StudyResult:
        sizes = SIZES[: config.sizes]
        fleets = {
            (kind, size): [_fleet(seed, KINDS[kind], setup.terrain, size) for seed in range(config.seeds)]
            for kind in KINDS
            for size in (sizes if kind in (NOMINAL, FAULTED) else (PRINTED_SIZE,))
        }
        narrow = narrow_fleets(config.narrow)
        records = setup.fly_groups({**fleets, **narrow})
        changes = [ArrivalChange(setup.place, share, seed) for share in DEVIATIONS for seed in range(config.steps)]
        steps = [step for step in setup.compute(one_step, changes) if step is not None]
        shown = setup.flown({NOMINAL: _fleet(0, KINDS[NOMINAL], setup.terrain, min(SHOWN, max(sizes)))})[NOMINAL]
        rows = [_row(*key, records[key]) for key in fleets]
        narrow_rows = [_narrow_row(*key, *records[key]) for key in narrow]
        spreads = {key: figures(records[key], "spread_s") for key in fleets}
        return StudyResult(
            summary=(
                f"{config.seeds} fleets of each size over {setup.ground.name}, without faults and with "
                f"{FAILING:.0%} of the solver's answers lost: they agree on the maximum of the least times of arrival, "
                f"and fly by a schedule. Fleets of {PRINTED_SIZE} that agree on the average of (A.12), as printed, and "
                "such that agree on the maximum and comply by (A.13), as a constraint or by its penalty. "
                f"{len(narrow)} fleets where it is narrow, on maps of their own. A single "
                "vehicle that is asked for a time off its own, on the way, and whether its next plan has "
                "that time to 0.1 s.",
            ),
            rows=[*rows, *narrow_rows],
            tables=(_table(rows), _narrow_table(narrow_rows), _steps_table(steps)),
            figure=_figure(shown, spreads, steps),
            caption="(a) Distance of each vehicle of a fleet to its own slot; dashed, the arrival of the last. "
            "(b) Spread of the arrivals of every fleet. (c) Share of the changes that one step complies with, with "
            "95 % limits.",
            claims=[*_claims(rows, spreads, steps), _narrow_claim(narrow_rows)],
        )


# ---- fleets


def _fleet(seed: int, fields: Mapping[str, Any], terrain: str | None, vehicles: int) -> Trial:
    return trial("simultaneous-arrival", seed, fields={"terrain": terrain, "vehicles": vehicles, **fields})


def narrow_fleets(count: int) -> dict[tuple[str, int], list[Trial]]:
    """Return the first ``count`` fleets in narrow places, by condition and size: small ones first, the swap last."""
    trials: dict[tuple[str, int], list[Trial]] = {}
    for size in NARROW_SIZES:
        for (condition, fields), number in zip(CONDITIONS.items(), CANYONS, strict=True):
            trials[condition, size] = [_fleet(0, fields, RIDGES, size)]
            trials[f"canyon:{number}", size] = [_fleet(0, CANYON, f"canyon:{number}", size)]
    trials[SWAP, SWAPPING] = [_fleet(0, swapping(RIDGES, SWAPPING, _RING, _HEIGHT), RIDGES, SWAPPING)]
    return dict(list(trials.items())[:count])


def swapping(terrain: str, vehicles: int, ring: float | np.ndarray, height: float) -> dict[str, Any]:
    """Return fields of a fleet that starts on a ``ring`` [m] about the middle of a map, each opposite to its slot.

    ``ring`` is one radius, or (vehicles,) one for each; ``height`` [m] is that of starts and target above the ground.
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


def _row(kind: str, size: int, records: Sequence[Record]) -> dict[str, Any]:
    spread = figures(records, "spread_s")
    whole = spread[np.isfinite(spread)]
    return {
        "agreement": kind,
        "vehicles": size,
        "fleets": len(records),
        "arrived": int(figures(records, "arrived").sum()),
        "spread_median_s": float(np.median(whole)) if len(whole) else None,
        "spread_max_s": float(whole.max()) if len(whole) else None,
        "separation_min_m": float(figures(records, "separation_min_m").min()),
        "clearance_min_m": float(figures(records, "min_clearance_m").min()),
        "ground_contacts": int(figures(records, "ground_contacts").sum()),
        "not_admitted": int(figures(records, "plans_not_admitted").sum()),
        "without_plan": float((figures(records, "solver_failures") / figures(records, "replans")).mean()),
        "solve_ms_mean": float(figures(records, "solve_ms_mean").mean()),
    }


def _narrow_row(condition: str, size: int, record: Record) -> dict[str, Any]:
    keys = ("arrived", "spread_s", "arrival_time_s", "separation_min_m", "separation_allowed_m", "min_clearance_m",
            "ground_contacts", "plans_not_admitted")  # fmt: skip
    return {"narrow": condition, "vehicles": size, **{key: record.summary[key] for key in keys}}


# ---- tables


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table.of("Arrivals of whole fleets", rows, (
        ("agreement", "agreement"), ("vehicles", "vehicles"), ("all arrived", "{arrived} of {fleets}"),
        ("spread, median [s]", lambda row: _seconds(row["spread_median_s"])),
        ("largest [s]", lambda row: _seconds(row["spread_max_s"])),
        ("least separation [m]", "{separation_min_m:.0f}"), ("least clearance [m]", "{clearance_min_m:.0f}"),
        ("answers without a plan", "{without_plan:.1%}"),
    ))  # fmt: skip


def _narrow_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table.of("Fleets where it is narrow", rows, (
        ("where it is narrow", "narrow"), ("vehicles", "vehicles"),
        ("all arrived", lambda row: "yes" if row["arrived"] else "no"),
        ("spread [s]", lambda row: _seconds(row["spread_s"])),
        ("last arrival [s]", lambda row: _seconds(row["arrival_time_s"], 1)),
        ("least separation [m]", "{separation_min_m:.1f}"), ("allowed [m]", "{separation_allowed_m:g}"),
        ("contacts", "ground_contacts"), ("plans not admitted", "plans_not_admitted"),
    ))  # fmt: skip


def _seconds(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _steps_table(steps: Sequence[ArrivalStep]) -> Table:
    head = ("at most", "later", "in one step", "sooner", "in one step", "both by (A.14) no outlier")
    body: list[tuple[object, ...]] = []
    for share in DEVIATIONS:
        outliers = [step.outlier for step in steps if step.share == share]
        cells: list[object] = []
        for later in (True, False):
            done = _done(steps, share, later=later)
            cells += [len(done), rate(sum(done), len(done)).text() if done else "–"]
        body.append((f"{share:.0%}", *cells, f"{outliers.count(False)} of {len(outliers)}"))
    return Table("One vehicle, asked for another time by (A.13)", head, body)


def _done(steps: Sequence[ArrivalStep], share: float, *, later: bool) -> list[bool]:
    """Tell for each change of up to a share, to a later or an earlier time, whether one step achieved it."""
    return [step.done for step in steps if step.share == share and step.later is later]


# ---- claims


def _claims(
    rows: Sequence[Mapping[str, Any]], spreads: Mapping[tuple[str, int], Array], steps: Sequence[ArrivalStep]
) -> list[Claim]:
    by_kind = {kind: [row for row in rows if row["agreement"] == kind] for kind in KINDS}
    worst = {
        kind: max((row["spread_max_s"] for row in group if row["arrived"]), default=math.inf)
        for kind, group in by_kind.items()
    }
    nominal, faulted = (sum(row["fleets"] for row in by_kind[kind]) for kind in (NOMINAL, FAULTED))
    whole = all(row["arrived"] == row["fleets"] for kind in (NOMINAL, FAULTED) for row in by_kind[kind])
    printed = {
        kind: _spread(spreads[kind, PRINTED_SIZE], digits)
        for kind, digits in ((PRINTED, 1), (CONSTRAINT, 2), (PENALTY, 2))
    }
    later, sooner = (_done(steps, DEVIATIONS[-1], later=way) for way in (True, False))
    return [
        Claim(
            "fleet.spread", "target", "A fleet arrives at one time.", "A.8",
            f"4, 6, 8, 16 vehicles: spread of arrivals at most h = {H:.2f} s, nominally and with {FAILING:.0%} solver "
            "failures",
            f"of {nominal} and {faulted} fleets all arrived: {'yes' if whole else 'no'}; "
            f"spread at most {worst[NOMINAL]:.2f} s, with failures {worst[FAULTED]:.2f} s",
            whole and max(worst[NOMINAL], worst[FAULTED]) <= H,
        ),
        Claim(
            "A.consensus-by-A12", "printed", "(A.12) is a successful choice of the estimated time of arrival.", "A.8.3",
            f"fleets that agree on the average of (A.12) arrive within h = {H:.2f} s of each other",
            f"{printed[PRINTED]}: (A.12) is the least time possible, so half of a fleet is asked for more than it can",
            worst[PRINTED] <= H,
        ),
        Claim(
            "A.constraint", "printed", "The planner satisfies the consensus by imposing (A.13).", "A.8.3",
            f"fleets that agree on the maximum arrive within h = {H:.2f} s of each other",
            f"{printed[CONSTRAINT]}; {by_kind[CONSTRAINT][0]['without_plan']:.0%} of the answers no plan: "
            "who is early would have to fly back",
            worst[CONSTRAINT] <= H,
        ),
        Claim(
            "A.penalty", "printed", "Or by penalising deviations from it.", "A.8.3", "likewise",
            f"{printed[PENALTY]}; {by_kind[PENALTY][0]['without_plan']:.1%} of the answers no plan",
            worst[PENALTY] <= H,
        ),
        Claim(
            "A.one-step", "printed", "In most cases the planner fulfils (A.13) in one single step.", "A.8.4",
            "more than half of the changes of up to 30 %",
            f"{rate(sum(step.done for step in steps), len(steps)).text()} of all; up to {DEVIATIONS[-1]:.0%}: later "
            f"{_share(later)}, sooner {_share(sooner)}"
            if steps else "no vehicle was far enough from its target",
            2 * sum(later + sooner) > len(later + sooner) if steps else None,
        ),
    ]  # fmt: skip


def _spread(spreads: Array, digits: int) -> str:
    """Return median and maximum of the spreads [s] of the fleets that arrived, as text."""
    known = spreads[np.isfinite(spreads)]
    if not len(known):
        return "no fleet arrived"
    return f"spread {median(known).text()} s, at most {known.max():.{digits}f} s"


def _share(done: Sequence[bool]) -> str:
    return f"{np.mean(done):.0%} of {len(done)}" if done else "none tried"


def _narrow_claim(rows: Sequence[Mapping[str, Any]]) -> Claim:
    """Evaluate the claim: all but two of thirty, and the swap, arrive within a planning period, without contacts."""
    spreads = {(row["narrow"], row["vehicles"]): row["spread_s"] if row["arrived"] else math.nan for row in rows}
    worst = float(np.nanmax([*spreads.values(), 0.0]))
    swap = spreads.pop((SWAP, SWAPPING), None)
    beside = "" if swap is None else f"; {SWAPPING} vehicles that swap places: {swap:.2f} s"
    thirty, together = len(spreads), sum(spread <= H for spread in spreads.values())
    contacts = sum(row["ground_contacts"] for row in rows)
    close = sum(row["separation_min_m"] < row["separation_allowed_m"] for row in rows)
    return Claim(
        "fleet.narrow", "target", "A fleet arrives at one time where it is narrow, too.", "A.8",
        f"2, 9, 20 vehicles over {RIDGES} (loss, a cut, delays, 150 and 500 m/s) and in canyons: spread at most h = "
        f"{H:.2f} s in at least 28 of 30, no contact in any; {SWAPPING} that swap places do not lock",
        f"{together} of {thirty} fleets within h, the largest spread {worst:.2f} s; {contacts} contacts, {close} "
        f"pairs too close{beside}",
        together >= thirty - MISSED * thirty // 30 and contacts == 0 and close == 0 and (swap is None or swap <= H),
    )  # fmt: skip


# ---- what is drawn


def _figure(shown: RunData, spreads: Mapping[tuple[str, int], Array], steps: Sequence[ArrivalStep]) -> Figure:
    with styled_figure((13.0, 4.4)) as page:
        left, middle, right = page.subplots(1, 3, width_ratios=(1.3, 1.1, 0.9))
        _draw_fleet(left, shown)
        _draw_spreads(middle, spreads)
        _draw_steps(right, steps)
    return page


def _draw_fleet(axes: Axes, shown: RunData) -> None:
    """Draw the distance of each vehicle from its slot, which shows the common time of arrival."""
    places = shown.config["mission"]["vehicles"]
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(places)))
    t = shown.recording.t
    for (name, place), colour in zip(places.items(), colours, strict=True):
        distance = np.linalg.norm(shown.recording.truths[name][:, :3] - np.array(place["target"]), axis=1)
        axes.plot(t, distance / 1000.0, color=colour, lw=1.3)
    if shown.summary["arrival_time_s"] is not None:
        axes.axvline(shown.summary["arrival_time_s"], color=INK, ls="--", lw=1.0)
    axes.set(xlim=(0.0, t[-1]), ylim=(0.0, None), xlabel="time [s]", ylabel="distance to the own slot [km]")
    axes.set_title(f"(a) {len(places)} vehicles, one arrival")


def _draw_spreads(axes: Axes, spreads: Mapping[tuple[str, int], Array]) -> None:
    rng = np.random.default_rng(0)
    sizes = sorted({size for _, size in spreads})
    for (kind, size), spread in spreads.items():
        offset = 0.14 * (list(COLOURS).index(kind) - 2)
        x = sizes.index(size) + offset + rng.uniform(-0.05, 0.05, len(spread))
        label = kind if size == min(s for k, s in spreads if k == kind) else None
        axes.plot(x, np.maximum(spread, LEAST_DRAWN), "o", ms=5, alpha=0.75, color=COLOURS[kind], label=label)
    axes.axhline(H, color=INK, ls="--", lw=1.0)
    annotate(axes, "h", (len(sizes) - 0.55, H), (0, 3))
    axes.set(yscale="log", ylim=(0.7 * LEAST_DRAWN, None))
    axes.set_xticks(range(len(sizes)), [str(size) for size in sizes])
    axes.set(xlabel="vehicles", ylabel="spread of arrivals [s]", title="(b) every fleet")
    axes.legend(loc="upper right", fontsize=8.0)


def _draw_steps(axes: Axes, steps: Sequence[ArrivalStep]) -> None:
    for later, colour, label, offset in ((True, "#0d5fa8", "later", -0.1), (False, "#c2183b", "sooner", 0.1)):
        for k, share in enumerate(DEVIATIONS):
            done = _done(steps, share, later=later)
            if not done:
                continue
            found = rate(sum(done), len(done))
            axes.plot([k + offset, k + offset], [found.low, found.high], color=colour, lw=1.5, alpha=0.6)
            axes.plot(k + offset, found.value, "o", ms=6, color=colour, label=label if k == 0 else None)
    axes.set_xticks(range(len(DEVIATIONS)), [f"{share:.0%}" for share in DEVIATIONS])
    axes.set(ylim=(-0.03, 1.03), xlabel="largest deviation asked for", ylabel="share done in one step")
    axes.set_title("(c) one step by (A.13)")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left")


# ---- one vehicle that is asked for another time


@dataclass(frozen=True)
class ArrivalChange:
    """Change of the desired time of arrival of one vehicle in flight."""

    place: TerrainReference
    share: float
    seed: int


@dataclass(frozen=True)
class ArrivalStep:
    """Result of one planning step after a change of the desired time of arrival."""

    share: float
    later: bool  # whether a later time was asked for
    done: bool
    outlier: bool  # by (A.14)


def one_step(change: ArrivalChange) -> ArrivalStep | None:
    """Fly one vehicle until its desired time changes, and plan one step.

    Return None if it has no first plan, or came too near to its target before.
    """
    rng = np.random.default_rng(change.seed)
    mission = _drawn(change.place.ground, rng)
    flight = FlightConfig(nodes=NODES)
    planner, _ = FlightController.build(flight, mission)
    assert isinstance(planner, RecedingHorizon)
    certificate = Certificate.for_mission(mission, tracking_bound(flight.bandwidth, mission))
    current: Plan | None = None
    t, x = 0.0, np.array([*mission.start, 0.0, 0.0, 0.0])
    count = int(rng.integers(*_STEPS))
    deviation = float(rng.uniform(-change.share, change.share))
    for _ in range(count):
        start = t if current is None else t + planner.period
        plan = planner.plan(PlanRequest(t, start, Estimate(t, x), current))
        current = plan if plan.ok else current
        if current is None:
            return None
        t += planner.period
        x = state_at(current, t)
    return _complied(planner, certificate, x, change.share, deviation)


def _complied(
    planner: RecedingHorizon, certificate: Certificate, x: Array, share: float, deviation: float
) -> ArrivalStep | None:
    parameters, environment = planner.parameters, planner.environment
    free = CondensedSqp().solve(Problem(parameters, environment, x), np.zeros(3 * parameters.arcs + 1))
    if isinstance(free, str):
        return None
    h, horizon, speed = parameters.h, parameters.horizon, certificate.speed_max

    def eta(accelerations: Array, start: Array) -> float:
        s = parameters.matrices
        end = start[:3] + s.base[-2] * start[3:] + s.weights[-2] @ accelerations
        return float(horizon + environment.cost(end)[0] / speed)

    own = eta(free.accelerations, x)
    if own < 2.0 * horizon:
        return None
    agreed = own * (1.0 + deviation)
    first = free.accelerations[0]
    following = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * first, x[3:] + h * first])
    length = speed * (agreed - h - horizon)
    problem = replace(Problem(parameters, environment, following), length_to_go=LengthToGo(length))
    found = CondensedSqp(iteration_limit=50).solve(problem, free.unknowns)
    done = not isinstance(found, str) and abs(eta(found.accelerations, following) + h - agreed) <= TOLERANCE
    return ArrivalStep(share, deviation > 0.0, done, is_outlier(agreed, own, h))


def _drawn(terrain: HeightField, rng: np.random.Generator) -> FlightMission:
    side = max(terrain.width, terrain.depth)
    blank = FlightMission(terrain=terrain, start=(0.0, 0.0, 0.0), target=(0.0, 0.0, 0.0))
    for _ in range(_DRAWS):
        start, target = (drawn_point(blank, _HEIGHTS, rng) for _ in range(2))
        if np.linalg.norm(np.subtract(start, target)) >= _FARTHEST * side:
            break
    return replace(blank, start=start, target=target)
