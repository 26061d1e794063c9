"""Observability of Paper C, measured: what is feasible, what separates it, and how the map decides convergence.

Feasible sets and output flows (Definitions C.9 to C.11, Proposition C.1), states that nothing distinguishes, standing
still, Example C.2, empirical Gramians of scenarios, and the question that the thesis leaves open (3.2): the relation
between the given environmental map and the global convergence of the observer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.ranging.observability.claims import MapKey, ObservabilityResults, claims
from mathnavi.sim.studies.ranging.observability.figure import ESTIMATOR_COLOURS, Family, MeasuredSeries, figure
from mathnavi.sim.studies.ranging.observability.gramians import GRAMIANS, observability_gramian
from mathnavi.sim.studies.ranging.observability.maps import (
    FAMILIES,
    FIRST_ESTIMATES,
    SENSORS,
    STANDARD,
    Attempt,
    MapCase,
    NearAttempt,
    converged,
    found_exactly,
    isolation,
    share_converged,
)
from mathnavi.sim.studies.ranging.observability.measures import (
    MOTIONS,
    WALLS,
    Counting,
    DrawnState,
    apart_with_equal_rates,
    counted,
    flags_ranks,
    least_singular_value,
    proposition_tried,
)
from mathnavi.sim.studies.ranging.observability.regions import wanted_regions
from mathnavi.sim.studies.ranging.observability.tables import (
    DRAWN,
    count_table,
    flags_table,
    gramian_table,
    map_table,
    rows,
    standing_table,
)

THESIS_START = np.array([1.0, -1.0, 0.5 * math.pi])
COUNTED = ("1", "2s", "2t", "3", "4")  # sensors with which states that read the same are counted


@configuration
class ObservabilityConfig:
    """Sample sizes: cases that are measured."""

    starts: Count = 60
    """starts in each wall"""
    walls: Count = 7
    """walls of each family, at most"""
    states: Count = 20
    """states at which others are counted and Proposition C.1 is tried"""
    places: Count = 80
    """places of the first estimate in a map of where an estimator converges"""
    headings: Count = 4
    """headings of the first estimate at each place"""
    searches: Count = 150
    """starts of a search for the states that read the same"""
    gramians: Count = len(GRAMIANS)
    """runs of scenarios whose empirical Gramian is taken, at most"""
    seconds: Count = 20
    """of a run in which an estimator may find the true state"""


class Observability:
    """Feasible states, what distinguishes them, and how the map decides global convergence (Paper C)."""

    Config = ObservabilityConfig
    quick = ObservabilityConfig(starts=4, walls=3, states=3, places=12, headings=1)
    title = "Observability: what is feasible, what separates it, and how the map decides"
    on_terrain = False

    @staticmethod
    def run(config: ObservabilityConfig, setup: Setup) -> StudyResult:
        cases = [case for family in FAMILIES.values() for case in _chosen(family, config.walls)]
        regions = wanted_regions(config.places, config.headings, config.seconds)
        jobs = Jobs()
        for case in cases:
            jobs.add(("isolation", case), isolation, [case])
            for name in DRAWN:
                jobs.add(("map", case, name), converged, _attempts(case, name, config))
        _add_evidence(jobs, config)
        for k, region in enumerate(regions):
            jobs.add(("region", k), share_converged, region.attempts)
        jobs.add("gramians", observability_gramian, range(min(config.gramians, len(GRAMIANS))))
        done = jobs.done(setup)
        evidence = _evidence(done, cases, config)
        isolations = {(case.family, case.value, case.sensors): done["isolation", case][0] for case in cases}
        gramians = done["gramians"]
        thesis = MapCase("thesis", 0.0, STANDARD, "2t")
        return StudyResult(
            summary=(
                f"Every share is of {config.starts} starts: the robot drives a figure of eight of 1.5 m by .55 m for "
                f"{config.seconds} s, without noise, and the estimator is given a pose drawn from all over the field. "
                "Converged: RMS error below .3 m and .2 rad over the last quarter, modulo the symmetry of the wall. "
                "The walls have the area of the standard ellipse. The observer is (C.5) with the manifold "
                "feed-forward; the EKF assumes that ranges err by 5 %.",
            ),
            rows=rows(evidence, isolations, gramians),
            tables=(
                map_table(evidence, isolations),
                count_table(evidence),
                standing_table(evidence),
                flags_table(evidence.flags),
                gramian_table(gramians),
            ),
            figure=figure(
                thesis.outputs,
                THESIS_START,
                _families(cases, evidence.maps),
                [region.drawn(done["region", k]) for k, region in enumerate(regions)],
            ),
            caption="(a) The feasible set of the thesis' start with sensors at -90° and -45° (dashed), coloured by "
            "what distinguishes its states; ticks are headings. (b) The same along the branch of the true start, for "
            "four inputs. (c) to (f) Shares of starts that find the true state, with 95 % limits of Clopper and "
            "Pearson; 2s are sensors at ±60°. (g) to (i) By the place of the first estimate, for one run.",
            claims=claims(evidence),
        )


def _chosen(family: Sequence[MapCase], walls: int) -> list[MapCase]:
    """Choose so many walls at most for each set of sensors, the first and the last among them; or so many sets."""
    chosen: list[MapCase] = []
    one_wall = len({case.curve for case in family}) == 1
    for sensors in (None,) if one_wall else dict.fromkeys(case.sensors for case in family):
        cases = [case for case in family if sensors in (None, case.sensors)]
        chosen += [cases[k] for k in sorted({round(k) for k in np.linspace(0, len(cases) - 1, min(walls, len(cases)))})]
    return chosen


def _attempts(case: MapCase, estimator: str, config: ObservabilityConfig) -> list[Attempt]:
    return [Attempt(case, estimator, seed, config.seconds) for seed in range(config.starts)]


def _add_evidence(jobs: Jobs, config: ObservabilityConfig) -> None:
    """Ask for all that claims need beside the maps; in the standard ellipse, states are counted at more of them."""
    for wall in WALLS:
        for sensors in COUNTED:
            for motion in MOTIONS:
                seeds = range(4 * config.states if wall == "ellipse" else config.states)
                counts = [Counting(wall, sensors, motion, seed, config.searches) for seed in seeds]
                jobs.add(("count", wall, sensors, motion), counted, counts)
    poses = math.ceil(config.starts / FIRST_ESTIMATES)
    for sensors in SENSORS:
        case = MapCase("ellipse", 0.0, STANDARD, sensors)
        for drives in (False, True):
            near = [NearAttempt(case, "fast observer", seed, drives, config.seconds) for seed in range(poses)]
            jobs.add(("exactly", sensors, drives), found_exactly, near)
        jobs.add(("rank", sensors), least_singular_value, [DrawnState(sensors, seed) for seed in range(config.starts)])
    pairs = [DrawnState(sensors, seed) for sensors in ("2s", "2t") for seed in range(config.states)]
    for function in (proposition_tried, apart_with_equal_rates):
        jobs.add(function, function, pairs)
    jobs.add(flags_ranks, flags_ranks, [config.states])


def _evidence(
    done: Mapping[Any, list[Any]], cases: Sequence[MapCase], config: ObservabilityConfig
) -> ObservabilityResults:
    found = {drives: {name: _rate(done["exactly", name, drives]) for name in SENSORS} for drives in (False, True)}
    return ObservabilityResults(
        counts={key[1:]: counted for key, counted in done.items() if isinstance(key, tuple) and key[0] == "count"},
        rotations={name: curve.symmetry for name, curve in WALLS.items()},
        still_ranks={name: np.array(done["rank", name]) for name in SENSORS},
        still_found=found[False],
        driving_found=found[True],
        flags=done[flags_ranks][0],
        moving=[moving for moving, _ in done[proposition_tried]],
        standing=[standing for _, standing in done[proposition_tried]],
        equal_rates=np.array(done[apart_with_equal_rates]),
        maps={
            (case.family, case.value, case.sensors, name): _rate(done["map", case, name])
            for case in cases
            for name in DRAWN
        },
    )


def _rate(outcomes: Sequence[bool]) -> Proportion:
    return rate(sum(outcomes), len(outcomes))


# ---- what is drawn


def _families(cases: Sequence[MapCase], maps: Mapping[MapKey, Proportion]) -> list[Family]:
    labels = {
        "eccentricity": ("(c) eccentricity of an ellipse", "$c_1 / c_2$"),
        "symmetry": ("(d) rotations of the wall", "rotations that map it onto itself"),
        "asymmetry": ("(e) from an ellipse to an egg", "$d$, share of an egg"),
        "sensors": ("(f) number of sensors", "sensors, in the standard ellipse"),
    }
    drawn = []
    for name, (title, xlabel) in labels.items():
        own = [case for case in cases if case.family == name]
        sets: tuple[str | None, ...] = (None,) if name == "sensors" else tuple(dict.fromkeys(c.sensors for c in own))
        series = [
            MeasuredSeries(
                estimator if sensors is None or len(sets) == 1 else f"{estimator}, {sensors}",
                ESTIMATOR_COLOURS[estimator],
                sensors == "2t",
                [maps[c.family, c.value, c.sensors, estimator] for c in own if sensors in (None, c.sensors)],
            )
            for sensors in sets
            for estimator in DRAWN
        ]
        walls = [case for case in own if sets[0] in (None, case.sensors)]
        rays = [SENSORS[case.sensors] if name == "sensors" else () for case in walls]
        ticks = [f"{case.value:.3g}" for case in walls]
        drawn.append(Family(title, xlabel, series, [case.curve for case in walls], ticks, rays))
    return drawn
