"""Search for holes in the guarantee: is there a mission that violates it unannounced?

Four directed searches minimise the margin of clearance, separation and deadline, excluding violations that an event
announced. Whether such a search would find a hole is measured on four controllers that have one (``guarantee_holes``),
the mutants: by the number of missions until it is found, compared with random draws. The controller ``flight``, which
has all checks, is searched in the same spaces.

All missions are short, in canyons of 640 m and over level ground. The search spaces contain noise and gusts as declared
to the controller, faults, bounds, ends, heights, seeds and changes on the way; for the mutants also the planner's
horizon, period and nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.controllers.flight.certificate import TrackingBound, raised_ground
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.scenarios.flight_parts import mission_but_ends
from mathnavi.sim.search.directed import directed
from mathnavi.sim.search.evaluation import Evaluation, Evaluator, Objective
from mathnavi.sim.search.samplers import SamplerName
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.execution import Pool, Progress
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.flight import guarantee_holes, hostile_parts
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyError, StudyResult

MARGIN = Objective("relative_margin")
FEWEST = 2000  # missions of a hunt from which its claim is judged
ENOUGH = 200  # missions within which a search has to find a hole
BATCH = 8  # missions that a search proposes at a time
SAMPLER: SamplerName = "sobol-cmaes"  # of all searches
BELOW = -1e-3  # [m], or tracking bounds, of the margin of clearance, that no rounding explains
COLOURS = ("#2166ac", "#e08214", "#1a9850", "#8a4fd0")

FLOWN = guarantee_holes.__name__  # where the measures and the mutants are
SEEDS = 100_000
ROUNDING = 1e-3  # [m]
CANYONS = ("canyon:3", "canyon:7")
GRID = {"planner.grid_nodes": 17}  # of the cost-to-go, so that a mission is built quickly
SHORT = {"deadline_factor": 1.5, **GRID}
LEAST = 4.0  # [m] that the ground rises across a hull, on the steepest walls
LOWEST, ABOVE = 20.0, 30.0  # [m] h_min of missions of mutants, and their ends above it
CONTROL_RATE = 20.0  # [Hz]


@configuration
class HuntConfig:
    """Sample sizes: missions that are flown."""

    missions: Count = FEWEST
    """number of missions of each of four searches"""
    hostile: Count = FEWEST // 2
    """number of missions of each of four searches with plug-ins that misbehave"""
    tries: Count = ENOUGH
    """largest number of missions of a search for the hole of a mutant"""
    draws: Count = 400
    """largest number of random draws for the hole of a mutant"""
    repeats: Count = 3
    """number of searches for each hole, and of lots of random draws"""
    compare: tuple[SamplerName, ...] = ()
    """samplers whose searches for each hole are counted as well"""


class HuntStudy:
    """Directed searches for a mission that violates the guarantee without an event that announces it."""

    Config = HuntConfig
    quick = HuntConfig(missions=8, hostile=8, tries=8, draws=8, repeats=1)
    title = "The hunt for holes in the guarantee"
    on_terrain = False

    @staticmethod
    def run(config: HuntConfig, setup: Setup) -> StudyResult:
        with Pool(setup.workers, setup.cluster) as pool:
            search = partial(_searched, setup, pool)
            found = {hunt.name: search(hunt, MARGIN, config.missions) for hunt in HUNTS}
            strangers = {hunt.name: search(hunt, MARGIN, config.hostile) for hunt in HOSTILE}
            holes = [_hole_found(search, holed, config) for holed in HOLES]
        rows = [_row(name, evaluations) for name, evaluations in found.items()]
        strange_rows = [_row(name, evaluations) for name, evaluations in strangers.items()]
        hole_rows = [hole.row for hole in holes]
        return StudyResult(
            summary=(
                f"{config.missions} missions of directed search in each of {len(HUNTS)} scenarios, over noise, "
                "gusts, faults, bounds, heights, seeds and what changes on the way. What is minimised is the least of "
                "the margins of clearance, separation and deadline, each relative to its bound; a violation that an "
                "event has announced counts as none. The mutants are controllers with one check left out each; their "
                "hole is found when a mission comes below h_min. The controller flight is searched in the same "
                "spaces, with as many missions. In further searches planner, tracker and estimator are those of "
                "strangers, which raise, answer nonsense, lie, or change what they were given, at random instants.",
                *_violations({**found, **strangers}),
            ),
            rows=[*rows, *strange_rows, *hole_rows],
            tables=(
                _table("Searches for a silent violation", rows),
                _table("Searches with plug-ins that misbehave", strange_rows),
                _hole_table(hole_rows),
                *([_sampler_table(holes)] if config.compare else []),
            ),
            figure=_figure(found, holes),
            caption="The least margin so far, over the missions of a search; missions until a hole is found, by search "
            "and by random draws, an arrow where none was.",
            claims=[*_claims(rows, holes), _hostile_claim(strange_rows)],
        )  # fmt: skip


# ---- what was found


@dataclass(frozen=True)
class Hole:
    """Missions until the hole of a mutant was found, by each search and lot of random draws; None if it was not."""

    name: str
    searches: tuple[int | None, ...]
    draws: tuple[int | None, ...]
    most_draws: int
    of_product: tuple[int | None, ...]
    """missions until a violation of the product was found, by each search in the same space; None if it was not"""
    compared: Mapping[SamplerName, tuple[int | None, ...]] = field(default_factory=dict)
    """missions until the hole was found, by each search of each of the samplers that are compared"""

    @property
    def median(self) -> float:
        """Missions of the median search; inf if it found nothing."""
        return _median(self.searches)

    @property
    def drawn(self) -> int:
        """Total number of missions in all lots of random draws."""
        return sum(self.most_draws if count is None else count for count in self.draws)

    @property
    def mean_draws(self) -> float:
        """Mean number of random draws until the hole is found, of a geometric distribution; inf without a find."""
        found = sum(count is not None for count in self.draws)
        return self.drawn / found if found else math.inf

    @property
    def shown(self) -> bool:
        """True if a search finds the hole sooner than random draws, and none in the product.

        The median search takes less than ``ENOUGH`` missions, and random draws more.
        """
        return self.median < ENOUGH < self.mean_draws and not any(self.of_product)

    @property
    def row(self) -> dict[str, Any]:
        """Row of the study's table."""
        return {
            "hunt": self.name, "searches": _counts(self.searches), "draws": _counts(self.draws),
            "mean_draws": self.mean_draws if math.isfinite(self.mean_draws) else None,
            "product": _counts(self.of_product),
        }  # fmt: skip

    @property
    def text(self) -> str:
        """All counts as text."""
        row, mean = self.row, self.mean_draws
        drawn = f"{mean:.0f}" if math.isfinite(mean) else f"more than {self.drawn}"
        return f"{self.name}: {row['searches']} against {drawn} draws; product: {row['product']}"


def _median(counts: Sequence[int | None]) -> float:
    """Return the median, in which a search that found nothing counts as infinitely long."""
    return median(math.inf if count is None else float(count) for count in counts)


def _counts(counts: Sequence[int | None]) -> str:
    return ", ".join("not found" if count is None else str(count) for count in counts)


def _flown(found: Sequence[Evaluation]) -> list[tuple[Evaluation, dict[str, Any]]]:
    """Return the missions that were flown, with their summaries."""
    return [(each, each.record.summary) for each in found if each.ending == "flown" and each.record is not None]


def _row(name: str, found: Sequence[Evaluation]) -> dict[str, Any]:
    flown = [summary for _, summary in _flown(found)]
    return {
        "hunt": name,
        "missions": len(found),
        "flown": len(flown),
        "refused": sum(each.ending == "refused" for each in found),
        "failed": sum(each.ending == "failed" for each in found),
        "violated": sum(each["violated"] for each in flown),
        "silently_violated": sum(each["silently_violated"] for each in flown),
        "least_margin": min(each["relative_margin"] for each in flown),
        "least_clearance_m": min(each["clearance_margin_m"] for each in flown),
    }


def _violations(found: dict[str, list[Evaluation]]) -> list[str]:
    """Return a sentence for each hunt with silent violations: their kinds, and the worst mission."""
    sentences = []
    for name, evaluations in found.items():
        flown = _flown(evaluations)
        silent = [(each, summary) for each, summary in flown if summary["silently_violated"]]
        if not silent:
            continue
        worst, summary = min(silent, key=lambda pair: pair[1]["relative_margin"])
        kinds = sorted({str(summary["violation"]) for _, summary in silent})
        fields = ", ".join(f"{field} = {value}" for field, value in worst.values.items())
        sentences.append(
            f"{name}: {rate(len(silent), len(flown)).text()} violate {', '.join(kinds)} without an event before; the "
            f"worst at {summary['violation_s']:.2f} s: {fields}."
        )
    return sentences


def _table(title: str, rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of(title, rows, (
        ("search", "hunt"), ("missions", "missions"), ("refused", "refused"), ("failed", "failed"),
        ("violated", "violated"), ("of them silently", "silently_violated"),
        ("least relative margin", "{least_margin:.3g}"), ("least margin of clearance", "{least_clearance_m:.2f} m"),
    ))  # fmt: skip


def _hole_table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Missions until the hole of a mutant is found", rows, (
        ("mutant", "hunt"), ("missions of each search", "searches"), ("random draws of each lot", "draws"),
        ("draws in the mean", lambda row: "inf" if row["mean_draws"] is None else f"{row['mean_draws']:.0f}"),
        ("in the product", "product"),
    ))  # fmt: skip


def _sampler_table(holes: Sequence[Hole]) -> Table:
    rows = [
        {"hunt": hole.name, "sampler": sampler, "searches": _counts(counts), "median": _median(counts)}
        for hole in holes
        for sampler, counts in {SAMPLER: hole.searches, **hole.compared}.items()
    ]
    return Table.of("Missions until the hole is found, by sampler", rows, (
        ("mutant", "hunt"), ("sampler", "sampler"), ("missions of each search", "searches"), ("median", "{median:.0f}"),
    ))  # fmt: skip


def _claims(rows: Sequence[dict[str, Any]], holes: Sequence[Hole]) -> list[Claim]:
    total, failed, violated, silent = (
        sum(row[name] for row in rows) for name in ("missions", "failed", "violated", "silently_violated")
    )
    return [
        Claim(
            "search.safe", "target", "A directed search finds no violation that is not announced before it happens.",
            "Propositions A.2 and A.3", f"none in {FEWEST} missions in each of {len(HUNTS)} scenarios",
            f"{silent} silent of {total} missions, {violated} violations in all; {failed} failed; least relative "
            f"margin {min(row['least_margin'] for row in rows):.3g}",
            silent == 0 and failed == 0,
        ),
        Claim(
            "search.power", "target",
            "The search finds the hole of a controller that lacks one check, sooner than random draws do.",
            "beyond the thesis",
            f"in under {ENOUGH} missions each (median of the searches), where random draws need more (mean); "
            "none in the product",
            "; ".join(hole.text for hole in holes), all(hole.shown for hole in holes),
        ),
    ]  # fmt: skip


def _hostile_claim(rows: Sequence[dict[str, Any]]) -> Claim:
    total, failed, violated, silent = (
        sum(row[name] for row in rows) for name in ("missions", "failed", "violated", "silently_violated")
    )
    return Claim(
        "search.hostile", "target",
        "Whatever a stranger's planner, tracker or estimator answers, no bound is broken that is said to be kept.",
        "beyond the thesis", f"none of {4 * (FEWEST // 2)} missions",
        f"{silent} silent of {total} missions, {violated} violations in all; {failed} failed",
        silent == 0 and failed == 0,
    )  # fmt: skip


def _figure(found: dict[str, list[Evaluation]], holes: Sequence[Hole]) -> Figure:
    with styled_figure((9.4, 3.6)) as figure:
        left, right = figure.subplots(1, 2)
        for (name, evaluations), colour in zip(found.items(), COLOURS, strict=True):
            margins = np.array([np.nan if each.figure is None else each.figure for each in evaluations])
            best = np.fmin.accumulate(np.clip(margins, -1.0, 1.0))
            left.step(np.arange(1, len(best) + 1), best, where="post", color=colour, label=name)
        left.axhline(0.0, ls=":", color="#5a6876")
        left.set(xlabel="mission", ylabel="least relative margin", title="Searches")
        left.legend(fontsize=8)
        for k, hole in enumerate(holes):
            for counts, most, colour, shift in (
                (hole.searches, ENOUGH, COLOURS[0], -0.12), (hole.draws, hole.most_draws, COLOURS[1], 0.12)
            ):  # fmt: skip
                for count in counts:
                    right.plot(count or most, k + shift, ">" if count is None else "o", color=colour, ms=6.0)
        right.axvline(ENOUGH, ls=":", color="#5a6876")
        right.set_yticks(range(len(holes)), [hole.name for hole in holes])
        right.set(xscale="log", xlabel="missions until the hole is found", title="Holes: search (blue), draws (orange)")
        right.invert_yaxis()
    return figure


# ---- searches


def _searched(
    setup: Setup, pool: Pool, hunt: Hunt, objective: Objective, missions: int, **named: Any
) -> list[Evaluation]:
    """Return the evaluations of one search; StudyError if no mission could be flown.

    ``named`` are ``sampler``, ``seed`` and ``until`` of ``directed``.
    """

    def report(now: Progress) -> None:
        if setup.progress is not None:
            done = len(evaluator.evaluations)
            setup.progress(replace(now, total=missions, found=done, done=done + now.done))

    evaluator = Evaluator(
        hunt.make, objective, setup.store, pool, retry=True, progress=report,
        mix_environments=setup.mix_environments, elsewhere=setup.elsewhere,
    )  # fmt: skip
    found = directed(evaluator, hunt.space, missions, batch=BATCH, **named)
    if not any(each.ending == "flown" for each in found):
        raise StudyError(f"{hunt.name}: none of {len(found)} missions could be flown; the first: {found[0].reason}")
    return found


def _hole_found(search: Callable[..., list[Evaluation]], holed: HoledHunt, config: HuntConfig) -> Hole:
    """Search for a hole, draw missions at random until it is found, and search for one in the product."""
    objective = Objective(holed.figure)

    def counts(hunt: Hunt, sampler: SamplerName, most: int) -> tuple[int | None, ...]:
        """Return the number of missions until the hole is found, of each repetition; None if it is not."""
        lots = [
            search(hunt, objective, most, sampler=sampler, seed=seed, until=BELOW) for seed in range(config.repeats)
        ]
        return tuple(
            next((each.number + 1 for each in lot if objective.reached(each.figure, BELOW)), None) for lot in lots
        )

    return Hole(
        holed.mutant.name,
        counts(holed.mutant, SAMPLER, config.tries),
        counts(holed.mutant, "random", config.draws),
        config.draws,
        counts(holed.product, SAMPLER, config.tries),
        {sampler: counts(holed.mutant, sampler, config.tries) for sampler in config.compare},
    )


# ---- search spaces: for each hunt a scenario, the fields that are searched over, and its trials


@dataclass(frozen=True)
class Hunt:
    """Scenario and the space that is searched."""

    name: str
    space: tuple[Dimension, ...]
    scenario: str = "safe-flight"
    fields: Mapping[str, Any] = field(default_factory=dict)  # at values of their own
    controller: str | None = None
    estimator: str | None = None
    derived: Callable[[Values], dict[str, Any]] = lambda values: dict(values)  # fields, of the values of the space
    measure: str = f"{FLOWN}:violations"

    def make(self, values: Values) -> Trial:
        """Return the trial at these values; FieldError if the configuration refuses them."""
        fields = {**self.fields, **self.derived(values)}
        seed = fields.pop("seed")
        return trial(self.scenario, seed, self.controller, self.estimator, fields, self.measure)


SEED = Range("seed", 0, SEEDS)
FAULTS = (
    Range("faults.solver_failure_rate", 0.0, 0.95),
    Range("faults.late_plan_rate", 0.0, 0.9),
    Range("faults.dropout_rate", 0.0, 0.9),
)
AIR = (
    Range("faults.gust_rms", 0.0, 1.0),
    Range("faults.gust_time_constant", 0.1, 10.0, log=True),
    Range("noise.position", 0.0, 2.0),
)


def _course(fixed: Mapping[str, Any], values: Values) -> dict[str, Any]:
    """Return fields with start and target on opposite sides of a middle, above the lowest certified height."""
    fields = {name: value for name, value in values.items() if name not in COURSE_NAMES}
    keep = _lowest({**fixed, **fields})
    heading, half = float(values["heading"]), 0.5 * float(values["distance"])
    for name, side in (("start", -half), ("target", half)):
        x = float(values["middle_x"]) + side * math.cos(heading)
        y = float(values["middle_y"]) + side * math.sin(heading)
        fields[name] = (x, y, keep(x, y) + float(values[f"{name}_height"]))
    return fields


def _lowest(fields: Mapping[str, Any]) -> Callable[[float, float], float]:
    """Return a function of (x, y) [m]: the least height z [m] of a certified plan of ``safe-flight`` with these fields.

    It is h_min above the ground, which is raised by the tracking bound and the hull.
    """
    mission, bound = _to_certify(fields)
    ground = raised_ground(mission.terrain, bound.horizontal + mission.reach, bound.vertical)
    return lambda x, y: float(ground.height(x, y)) + mission.clearance_min + ROUNDING


def _to_certify(fields: Mapping[str, Any]) -> tuple[FlightMission, TrackingBound]:
    """Return the mission of ``safe-flight`` with these fields, without its ends, and the product's tracking bound."""
    spec = RunSpec.of("safe-flight", fields={name: value for name, value in fields.items() if name != "seed"})
    mission = mission_but_ends(spec.config, load_terrain(spec.config.terrain), spec.estimator)
    return mission, tracking_bound(spec["planner.bandwidth"], mission)


COURSE = (
    Range("middle_x", 150.0, 490.0), Range("middle_y", 150.0, 490.0), Range("heading", 0.0, 2.0 * math.pi),
    Range("distance", 80.0, 220.0), Range("start_height", 0.0, 80.0), Range("target_height", 0.0, 80.0),
)  # fmt: skip
COURSE_NAMES = frozenset(each.name for each in COURSE)


PATIENT = {**SHORT, "estimator.timeout": 60.0}
SAFE_FLIGHT = Hunt(
    "safe-flight",
    (
        Choice("terrain", CANYONS), SEED, *COURSE, *FAULTS, *AIR,
        Choice("estimator.rate", (60.0, 20.0, 5.0, 1.0)), Range("planner.margin", 0.0, 25.0),
        Range("clearance_min", 2.0, 60.0), Range("speed_max", 20.0, 150.0), Range("acceleration_max", 8.0, 40.0),
    ),
    fields=PATIENT,
    derived=partial(_course, PATIENT),
)  # fmt: skip


def _low(values: Values) -> dict[str, Any]:
    """Return fields whose ends are drawn between ``LEAST`` and ``LEAST`` + ``height`` [m] above h_min."""
    fields = dict(values)
    fields["drawn_heights"] = (LEAST, LEAST + fields.pop("height"))
    return fields


def _fleet(values: Values) -> dict[str, Any]:
    fields = _low(values)
    fields["radio.delay"] = (0.0, fields.pop("delay"))
    fields["slot_spacing"] = 4.0 * fields["separation"] + 40.0
    return fields


FLEET = Hunt(
    "fleet separation",
    (
        Choice("terrain", CANYONS), SEED, *FAULTS, *AIR,
        Range("radio.loss", 0.0, 0.9), Range("radio.duplication", 0.0, 0.5), Range("delay", 0.0, 1.0),
        Range("separation", 2.0, 20.0), Range("height", 5.0, 60.0), Range("speed_max", 20.0, 100.0),
    ),
    scenario="simultaneous-arrival",
    fields={"vehicles": 3, "drawn_distance": (0.2, 0.4), "clearance_min": 20.0, "spread": 10.0, **GRID},
    derived=_fleet,
)  # fmt: skip

QUADROTOR = Hunt(
    "quadrotor",
    (
        Choice("terrain", CANYONS), SEED, *FAULTS,
        Range("faults.gust_rms", 0.0, 0.6), Range("faults.gust_time_constant", 0.5, 10.0, log=True),
        Range("noise.position", 0.0, 0.2),
        Range("mismatch.mass", 1.0, 1.1), Range("mismatch.drag", 0.75, 1.25), Range("clearance_min", 0.5, 6.0),
        Range("height", 1.0, 10.0), Range("speed_max", 6.0, 14.0),
    ),
    scenario="quadrotor-canyon",
    fields={"drawn_separation": (0.04, 0.08), "planner.flight.grid_nodes": 17},
    derived=_low,
)  # fmt: skip


def _changing(values: Values) -> dict[str, Any]:
    """Return fields with a hill that becomes known on the way, a radar that appears and moves, and a target that moves.

    Places are shares of the map; that of the target is a step [m] from the middle of the map.
    """
    given = {name: values[name] for name in CHANGES}
    fields = _course(CHARTED, {name: value for name, value in values.items() if name not in CHANGES})
    ground = load_terrain(fields["terrain"])
    hill = (given["hill_x"] * ground.width, given["hill_y"] * ground.depth, given["hill_radius"], given["hill_height"])
    x, y = given["radar_x"] * ground.width, given["radar_y"] * ground.depth
    there = (given["target_x"] * ground.width, given["target_y"] * ground.depth)
    z = float(ground.height(*there)) + float(values["target_height"]) + float(given["hill_height"]) + 60.0
    return {
        **fields,
        "uncharted": (hill,),
        "uncharted_time": given["hill_time"],
        "radar": ((x, y, 60.0, 10.0),),
        "radar_time": given["radar_time"],
        "radar_velocity": (given["radar_speed"], 0.0),
        "target_path": ((given["target_time"], *there, z),),
    }


CHANGES = {
    each.name: each
    for each in (
        Range("hill_x", 0.1, 0.9), Range("hill_y", 0.1, 0.9), Range("hill_radius", 15.0, 80.0),
        Range("hill_height", 10.0, 150.0), Range("hill_time", 0.0, 15.0),
        Range("radar_x", 0.1, 0.9), Range("radar_y", 0.1, 0.9), Range("radar_time", 0.0, 10.0),
        Range("radar_speed", -30.0, 30.0),
        Range("target_x", 0.1, 0.9), Range("target_y", 0.1, 0.9), Range("target_time", 1.0, 15.0),
    )
}  # fmt: skip
CHARTED = {**SHORT, "clearance_min": 10.0}
UPDATES = Hunt(
    "updates",
    (
        Choice("terrain", CANYONS), SEED, *COURSE, *CHANGES.values(), Range("faults.solver_failure_rate", 0.0, 0.9),
        Range("planner.margin", 0.0, 25.0), Range("speed_max", 20.0, 100.0),
    ),
    fields=CHARTED,
    derived=_changing,
)  # fmt: skip

HUNTS = (SAFE_FLIGHT, FLEET, QUADROTOR, UPDATES)


# ---- plug-ins of strangers that misbehave, behind the certificate, behind the filter, in a fleet and on a quadrotor

MISBEHAVING: tuple[Dimension, ...] = (
    *(Choice(name, misdeeds) for name, misdeeds in hostile_parts.MISDEEDS.items()),
    Range("planner.share", 0.02, 1.0), Range("estimator.share", 0.02, 1.0), Range("planner.draw", 0, SEEDS),
    Range("estimator.draw", 0, SEEDS),
)  # fmt: skip
STRANGE_ESTIMATOR = tuple(each for each in MISBEHAVING if each.name.startswith("estimator."))
STRANGE = f"{hostile_parts.__name__}:Hostile"


def _hostile(hunt: Hunt, name: str, **fields: Any) -> Hunt:
    """Return a hunt in which every part of the vehicles misbehaves; on a quadrotor the estimator alone."""
    known, whole = {each.name for each in hunt.space}, hunt.scenario != "quadrotor-canyon"
    more = tuple(each for each in (MISBEHAVING if whole else STRANGE_ESTIMATOR) if each.name not in known)
    return replace(
        hunt,
        name=name,
        space=(*hunt.space, *more),
        fields={**hunt.fields, **fields},
        derived=partial(_beside, hunt.derived, tuple(each.name for each in more)),
        controller=f"{STRANGE}Flight" if whole else None,
        estimator=f"{STRANGE}FullState" if whole else f"{STRANGE}QuadrotorState",
    )


def _beside(derived: Callable[[Values], dict[str, Any]], names: Sequence[str], values: Values) -> dict[str, Any]:
    """Return the fields that ``derived`` makes of all values but those named, and those."""
    return {**derived({name: values[name] for name in values if name not in names}), **{n: values[n] for n in names}}


HOSTILE = (
    _hostile(SAFE_FLIGHT, "strangers, certified"),
    _hostile(SAFE_FLIGHT, "strangers, filtered", filter=True),
    _hostile(FLEET, "strangers in a fleet"),
    _hostile(QUADROTOR, "a stranger's estimator of a quadrotor"),
)


# ---- controllers with a hole


@dataclass(frozen=True)
class HoledHunt:
    """Missions of a mutant, and the same missions of the product's controller, which has no hole.

    The hole is found if a mission comes below h_min; a search for it minimises ``figure``.
    """

    mutant: Hunt
    product: Hunt
    figure: str = "clearance_margin_m"


def _hole(
    name: str,
    attribute: str,
    *space: Dimension,
    ends: tuple[Dimension, ...] | None = None,
    derived: Callable[[Values], dict[str, Any]] | None = None,
    product: Callable[[Values], dict[str, Any]] | None = None,
    measured: str = "",
    fields: Mapping[str, Any],
) -> HoledHunt:
    given = {"clearance_min": LOWEST, "deadline_factor": 1.5, "control_rate": CONTROL_RATE, **GRID, **fields}
    measure = f"{FLOWN}:{measured}" if measured else ""
    mutant = Hunt(
        name,
        (SEED, *(ends or RIM), *space),
        fields=given,
        controller=f"{FLOWN}:{attribute}",
        derived=derived or _to_the_plateau,
        measure=measure,
    )
    flown = replace(mutant, name=f"{name}: product", controller=None, derived=product or mutant.derived)
    return HoledHunt(mutant, flown, measured or "clearance_margin_m")


def _to_the_plateau(values: Values) -> dict[str, Any]:
    """Return fields of missions from the gorge to the plateau, both ends ``ABOVE`` h_min.

    ``period_share`` is the planner's period in horizons, ``reading`` the estimator's in control steps, and ``late`` the
    delay [s] of late plans.
    """
    fields = _ends(values, CANYONS[0], ABOVE)
    period = max(1, round(fields.pop("period_share") * fields["planner.horizon"] * CONTROL_RATE)) / CONTROL_RATE
    fields["planner.period"] = period
    if "reading" in fields:
        fields["estimator.rate"] = CONTROL_RATE / fields.pop("reading")
    if "late" in fields:
        fields["faults.late_plan_latency"] = period + fields.pop("late")
    return fields


def _level(bounds: float, values: Values) -> dict[str, Any]:
    """Return fields of missions over level ground, ``bounds`` + ``height`` vertical tracking bounds above h_min."""
    _, bound = _to_certify({**LEVEL, **{name: value for name, value in values.items() if name not in ENDS_NAMES}})
    return _ends(values, LEVEL["terrain"], (bounds + float(values["height"])) * bound.vertical + ROUNDING)


def _ends(values: Values, terrain: str, height: float) -> dict[str, Any]:
    """Return fields with start and target ``height`` [m] above h_min."""
    fields = {name: value for name, value in values.items() if name not in ENDS_NAMES} | {"terrain": terrain}
    ground = load_terrain(terrain)
    for name in ("start", "target"):
        x, y = float(values[f"{name}_x"]), float(values[f"{name}_y"])
        fields[name] = (x, y, float(ground.height(x, y)) + LOWEST + height)
    return fields


ENDS_NAMES = frozenset(("height", "start_x", "start_y", "target_x", "target_y"))
LEVEL: Mapping[str, Any] = {
    "terrain": "plain", "control_rate": CONTROL_RATE, "planner.margin": 0.0, "acceleration_max": 40.0,
    "faults.gust_limit": 20.0,
}  # fmt: skip
# Missions that are long, so that gusts have time: from the west to the east.
ACROSS = (
    Range("start_x", 80.0, 400.0), Range("start_y", 80.0, 880.0), Range("target_x", 560.0, 880.0),
    Range("target_y", 80.0, 880.0),
)  # fmt: skip
# Ends between which the highest ground is under the target: a flight that completes is far above all ground, so that
# what comes near to it are the plans themselves, around the rim.
RIM = (
    Range("start_x", 240.0, 390.0), Range("start_y", 270.0, 320.0), Range("target_x", 200.0, 345.0),
    Range("target_y", 50.0, 90.0),
)  # fmt: skip
PLANS = (Range("planner.horizon", 4.0, 20.0, log=True), Range("period_share", 0.05, 0.9))
# The monitor answers a plan that begins beside the vehicle by another at once, as long as it knows where that is. So
# readings are rare here, and the estimate is lost between them, although it stays right for want of gusts.
RARE = (Range("speed_max", 30.0, 80.0), Range("acceleration_max", 3.0, 20.0, log=True))
BLIND: Mapping[str, Any] = {"estimator.timeout": 0.05, "deadline_factor": 2.0}
HOLES = (
    # Between two points at which the optimiser asks for clearance: few nodes, unequal arcs, and plans that are flown
    # nearly to their end.
    _hole(
        "no clearance check", "NoClearanceCheck", *PLANS,
        Range("speed_max", 20.0, 120.0), Range("acceleration_max", 2.0, 30.0, log=True),
        Range("planner.nodes", 3, 13), Range("planner.stretch", 1.0, 1.4),
        fields={"planner.margin": 20.0, "deadline_factor": 2.0},
    ),
    _hole(
        "no start check", "NoStartCheck", *PLANS, *RARE, Range("reading", 2, 40),
        fields={**BLIND, "planner.margin": 15.0},
    ),
    _hole(
        "late plans flown", "LatePlansFlown", *PLANS, *RARE, Range("reading", 20, 140),
        Range("faults.late_plan_rate", 0.0, 0.6), Range("late", 0.0, 5.0), fields={**BLIND, "planner.margin": 10.0},
    ),
    _hole(
        "tracking bound halved", "HalvedBound",
        Range("height", 0.0, 6.0), Range("speed_max", 20.0, 40.0), Range("planner.bandwidth", 0.6, 1.6),
        Choice("estimator.rate", (20.0, 5.0, 2.0, 1.0)),
        Range("faults.gust_rms", 0.0, 3.0), Range("faults.gust_time_constant", 0.2, 10.0, log=True),
        ends=ACROSS, derived=partial(_level, 0.5), product=partial(_level, 1.0), measured="clearance_in_bounds",
        fields=LEVEL,
    ),
)  # fmt: skip
