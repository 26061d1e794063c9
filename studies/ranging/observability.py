"""Observability of Paper C, measured: feasible states, what distinguishes them, and convergence by map.

Feasible sets and output flows (Definitions C.9 to C.11, Proposition C.1), indistinguishable states, standing still,
Example C.2, empirical Gramians of scenarios, and the question that the thesis leaves open (3.2): the relation between
the environmental map and the global convergence of the observer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import NullFormatter

from mathnavi.estimators.observability.feasible_set import feasible_set
from mathnavi.estimators.observability.output_flow import mismatch
from mathnavi.estimators.observability.range_outputs import RangeOutputs, motion_under, pose_difference
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Row, Setup, StudyResult, chosen
from mathnavi.studies.ranging.observability_measures import (
    FAMILIES,
    FIRST_ESTIMATES,
    GRAMIANS,
    MOTIONS,
    SENSORS,
    STANDARD,
    THESIS_START,
    WALLS,
    MapCase,
    apart_with_equal_rates,
    converged,
    counted,
    drawn_start,
    driven_path,
    egged,
    flags_ranks,
    found_exactly,
    isolation,
    least_singular_value,
    observability_gramian,
    outputs_of,
    proposition_tried,
    share_converged,
)

ESTIMATOR_COLOURS = {"observer": "#0d5fa8", "EKF": "#e07b00"}  # of those that are compared over walls
COUNTED = ("1", "2s", "2t", "3", "4")  # sensors with which states that read the same are counted
ACTIVE_INPUT = "figure of eight"
FEW = ("1", "2s", "2t")  # sensors of which standing still is not enough
RANKED = 1e-6  # [m per m or rad] a least singular value above which the rank is full
FAILING, FINDING = 0.1, 0.85  # shares of starts from which a robot that stands still does not, and does, find itself
MAPS = (  # of where the first estimate may be: title, wall and sensors, estimator
    ("(g) observer, 2t", MapCase("ellipse", 0.0, STANDARD, "2t"), "observer"),
    ("(h) EKF, 2t", MapCase("ellipse", 0.0, STANDARD, "2t"), "EKF"),
    ("(i) observer, nearly symmetric", MapCase("egg", 0.1, egged(0.1), "2s"), "observer"),
)

PANELS = {  # title and label by family
    "eccentricity": ("(c) eccentricity of an ellipse", "$c_1 / c_2$"),
    "symmetry": ("(d) rotations of the wall", "rotations that map it onto itself"),
    "asymmetry": ("(e) from an ellipse to an egg", "$d$, share of an egg"),
    "sensors": ("(f) number of sensors", "sensors, in the standard ellipse"),
}
APART, ALIKE = "#0d5fa8", "#c2183b"
COLOURS = LinearSegmentedColormap.from_list("flow", (ALIKE, "#f0a07c", "#8fc3e6", APART))
SHARES = LinearSegmentedColormap.from_list("share", ("#b3202f", "#f0a07c", "#f4f1ea", "#6fb0dc", "#0d5fa8"))
FAINTEST, STRONGEST = 1e-2, 1.0  # [m] of mismatch over which the colours vary
AHEAD = 0.3  # [s] over which output flows are compared
INPUTS: dict[str, tuple[float, float]] = {
    "straight on": (0.5, 0.0),
    "left turn": (0.5, 0.8),
    "right turn": (0.5, -0.8),
    "on the spot": (0.0, 0.8),
}
INPUT_COLOURS = dict(zip(INPUTS, ("#101824", "#0d5fa8", "#e07b00", "#0f9472"), strict=True))
SHOWN = "left turn"  # by which the feasible set is coloured

Results = Mapping[Any, list[Any]]  # of the jobs, by key


@configuration
class ObservabilityConfig:
    """Sample sizes: cases that are measured."""

    starts: Count = 60
    """number of starts in each wall"""
    walls: Count = 7
    """largest number of walls of each family"""
    states: Count = 20
    """number of states at which indistinguishable ones are counted and Proposition C.1 is tested"""
    places: Count = 80
    """number of positions of the first estimate in a map of convergence"""
    headings: Count = 4
    """number of headings of the first estimate at each position"""
    searches: Count = 150
    """number of starts of a search for indistinguishable states"""
    gramians: Count = len(GRAMIANS)
    """largest number of runs of scenarios with an empirical Gramian"""
    seconds: Count = 20
    """duration of a run in which an estimator may find the true state [s]"""


class Observability:
    """Feasible states, what distinguishes them, and the effect of the map on global convergence (Paper C)."""

    Config = ObservabilityConfig
    quick = ObservabilityConfig(starts=4, walls=3, states=3, places=12, headings=1)
    title = "Observability: what is feasible, what separates it, and how the map decides"
    on_terrain = False

    @staticmethod
    def run(config: ObservabilityConfig, setup: Setup) -> StudyResult:
        cases = [case for family in FAMILIES.values() for case in _selected(family, config.walls)]
        regions = [Region(*described, config.places) for described in MAPS]
        done = _jobs(config, cases, regions).done(setup)
        rows = _rows(done, cases)
        return StudyResult(
            summary=(
                f"Every share is of {config.starts} starts: the robot drives a figure of eight of 1.5 m by 0.55 m for "
                f"{config.seconds} s, without noise, and the estimator is given a pose drawn from all over the field. "
                "Converged: RMS error below 0.3 m and 0.2 rad over the last quarter, modulo the symmetry of the wall. "
                "The walls have the area of the standard ellipse. The observer is (C.5) with the manifold "
                "feed-forward; the EKF assumes that ranges err by 5 %.",
            ),
            rows=rows,
            tables=(_map_table(rows), _count_table(done), _standing_table(rows, done), _flags_table(rows),
                    _gramian_table(rows)),
            figure=figure(cases, rows, [(region, done[region.title]) for region in regions]),
            caption="(a) The feasible set of the thesis' start with sensors at -90° and -45° (dashed), coloured by "
            "what distinguishes its states; ticks are headings. (b) The same along the branch of the true start, for "
            "four inputs. (c) to (f) Shares of starts that find the true state, with 95 % limits of Clopper and "
            "Pearson; 2s are sensors at ±60°. (g) to (i) By the place of the first estimate, for one run.",
            claims=claims(rows, done),
        )  # fmt: skip


def _selected(family: Sequence[MapCase], walls: int) -> list[MapCase]:
    """Select at most ``walls`` walls for each set of sensors, with the first and the last; or as many sets."""
    selected: list[MapCase] = []
    one_wall = len({case.curve for case in family}) == 1
    for sensors in (None,) if one_wall else dict.fromkeys(case.sensors for case in family):
        cases = [case for case in family if sensors in (None, case.sensors)]
        places = {round(k) for k in np.linspace(0, len(cases) - 1, min(walls, len(cases)))}
        selected += [cases[k] for k in sorted(places)]
    return selected


class Region:
    """Positions [m] of the first estimate of a run, on a square grid within the wall."""

    def __init__(self, title: str, case: MapCase, estimator: str, places: int) -> None:
        self.title, self.case, self.estimator = title, case, estimator
        self.start = drawn_start(case.curve, np.random.default_rng(4))  # (3,)
        self.spacing = math.sqrt(case.curve.area / places)  # [m]
        axes: list[Array] = []
        for a, b in zip(case.curve.polyline.min(axis=0), case.curve.polyline.max(axis=0), strict=True):
            n = max(1, int((b - a) / self.spacing))
            axes.append(0.5 * (a + b) + self.spacing * (np.arange(n) - 0.5 * (n - 1)))
        grid = [(float(x), float(y)) for x in axes[0] for y in axes[1]]
        self.places = [place for place in grid if case.curve.contains(np.array(place))]


def _jobs(config: ObservabilityConfig, cases: Sequence[MapCase], regions: Sequence[Region]) -> Jobs:
    """Return all jobs; in the standard ellipse, indistinguishable states are counted at more states."""
    jobs, seconds = Jobs(), config.seconds
    for case in cases:
        jobs.add(("isolation", case), isolation, [case])
        for name in ESTIMATOR_COLOURS:
            jobs.add(("map", case, name), converged, range(config.starts), case=case, estimator=name, seconds=seconds)
    for wall in WALLS:
        seeds = range(4 * config.states if wall == "ellipse" else config.states)
        for sensors in COUNTED:
            for motion in MOTIONS:
                asked = {"wall": wall, "sensors": sensors, "motion": motion, "searches": config.searches}
                jobs.add(("count", wall, sensors, motion), counted, seeds, **asked)
    poses = range(math.ceil(config.starts / FIRST_ESTIMATES))
    for sensors in SENSORS:
        for drives in (False, True):
            key = ("exactly", sensors, drives)
            jobs.add(key, found_exactly, poses, sensors=sensors, drives=drives, seconds=seconds)
        jobs.add(("rank", sensors), least_singular_value, range(config.starts), sensors=sensors)
    for function in (proposition_tried, apart_with_equal_rates):
        for sensors in ("2s", "2t"):
            jobs.add(function, function, range(config.states), sensors=sensors)
    jobs.add(flags_ranks, flags_ranks, [config.states])
    for region in regions:
        asked = {"case": region.case, "estimator": region.estimator, "start": region.start}
        jobs.add(region.title, share_converged, region.places, headings=config.headings, seconds=seconds, **asked)
    jobs.add("gramians", observability_gramian, range(min(config.gramians, len(GRAMIANS))))
    return jobs


def _rows(done: Results, cases: Sequence[MapCase]) -> list[Row]:
    """Return the rows of the CSV, whose kind is ``what``."""
    return [
        *({"what": "map", "family": case.family, "value": case.value, "sensors": case.sensors, "estimator": name,
           **_share(done["map", case, name]), "isolation": done["isolation", case][0]}
          for case in cases for name in ESTIMATOR_COLOURS),
        *({"what": "states that read the same", "wall": wall, "sensors": sensors, "motion": motion,
           "least": min(n for n, _ in counts), "most": max(n for n, _ in counts), "states": len(counts)}
          for (wall, sensors, motion), counts in _counts(done).items()),
        *({"what": "driving" if drives else "standing still", "wall": "ellipse", "sensors": name,
           **_share(done["exactly", name, drives])}
          for drives in (False, True) for name in SENSORS),
        *done[flags_ranks][0],
        *done["gramians"],
    ]  # fmt: skip


def _share(outcomes: Sequence[bool]) -> dict[str, Any]:
    found = rate(sum(outcomes), len(outcomes))
    return {
        "starts": found.trials, "converged": found.events, "share": found.value, "low": found.low, "high": found.high,
    }  # fmt: skip


def _counts(done: Results) -> dict[tuple[str, str, str], list[tuple[int, int]]]:
    """Return counts (indistinguishable states, known images among them) of each state, by wall, sensors and motion."""
    return {
        (wall, sensors, motion): done["count", wall, sensors, motion]
        for wall in WALLS for sensors in COUNTED for motion in MOTIONS
    }  # fmt: skip


def _text(row: Row) -> str:
    """Return the share of a row with its limits, as text."""
    return rate(row["converged"], row["starts"]).text()


# ---- tables


def _map_table(rows: Sequence[Row]) -> Table:
    """Return the table of shares of starts that converge, of the observer and of the EKF."""
    columns = (
        "family", "value", "sensors", "isolation [m/(m, rad)]", *(f"{name}: converged" for name in ESTIMATOR_COLOURS),
    )  # fmt: skip
    cells = [
        (row["family"], f"{row['value']:.3g}", row["sensors"], f"{row['isolation']:.3f}", _text(row), *map(_text, more))
        for row, *more in zip(*(chosen(rows, what="map", estimator=name) for name in ESTIMATOR_COLOURS), strict=True)
    ]
    return Table("How the map decides: starts from which the true state is found", columns, cells)


def _count_table(done: Results) -> Table:
    """Return the table of numbers of indistinguishable states, which may be infinite."""
    numbers = {key: sorted({n for n, _ in counts}) for key, counts in _counts(done).items()}
    texts = {key: "a continuum" if n[-1] > 20 else " or ".join(map(str, n)) for key, n in numbers.items()}
    cells = [
        (wall, curve.symmetry, sensors, *(texts[wall, sensors, motion] for motion in MOTIONS))
        for wall, curve in WALLS.items() for sensors in COUNTED
    ]  # fmt: skip
    return Table("States that read the same, the true one counted", ("wall", "rotations", "sensors", *MOTIONS), cells)


def _standing_table(rows: Sequence[Row], done: Results) -> Table:
    """Return the table of convergence while standing still, by the set of sensors."""
    columns = ("sensors", "directions [°]", "poses with rank h' = 3", "least singular value, median", "standing still",
               "figure of eight")  # fmt: skip
    cells = []
    for name, angles in SENSORS.items():
        least, directions = np.array(done["rank", name]), " ".join(f"{angle:g}" for angle in angles)
        found = [_text(row) for what in ("standing still", "driving") for row in chosen(rows, what=what, sensors=name)]
        cells.append((name, directions, f"{(least > RANKED).sum()} of {len(least)}", f"{np.median(least):.3f}", *found))
    return Table(
        f"Poses of the standard ellipse found to 1 mm and 1 mrad, from most of {FIRST_ESTIMATES} first estimates that "
        "are off by 0.03 m and 0.03 rad",
        columns,
        cells,
    )


def _flags_table(rows: Sequence[Row]) -> Table:
    flags = chosen(rows, what="two flags")
    return Table.of("Example C.2: rank of d(h, y', ..., y^(order)) with the input held", flags, (
        ("d_0", lambda row: "known" if row["d_0_known"] else "unknown"),
        ("flags' axis", lambda row: "on it" if row["on_axis"] else "off it"), ("u_1 [m/s]", "{u_1:g}"),
        ("u_2 [rad/s]", "{u_2:g}"), ("order", "order"), ("rank", "rank"),
        ("of", lambda row: 3 if row["d_0_known"] else 4),
        ("least singular value but noughts", "{least_singular_value:.2g}"),
    ))  # fmt: skip


def _gramian_table(rows: Sequence[Row]) -> Table:
    columns = ("scenario", "run", "components", "unseen directions", "deviation of the least seen", "which is")
    cells = [
        (row["scenario"], row["run"], len(case.deltas), row["unseen"],
         "–" if row["unseen"] else f"{row['largest_deviation']:.3g}", row["worst"])
        for row, case in zip(chosen(rows, what="empirical Gramian"), GRAMIANS, strict=False)
    ]  # fmt: skip
    return Table(
        "Empirical observability Gramians: what readings say of the start, in the state's own units", columns, cells
    )


# ---- claims


def claims(rows: Sequence[Row], done: Results) -> list[Claim]:
    """Evaluate every claim of the study."""
    still = {row["sensors"]: row["share"] for row in chosen(rows, what="standing still")}
    return [
        _indistinguishable(_counts(done)), _standing_still(still, done), _flags(chosen(rows, what="two flags")),
        *_definitions(still, done), _of_the_map(rows),
    ]  # fmt: skip


def _indistinguishable(counts: Mapping[tuple[str, str, str], Sequence[tuple[int, int]]]) -> Claim:
    by_wall = {
        wall: [pair for sensors in COUNTED for pair in counts[wall, sensors, ACTIVE_INPUT]] for wall in WALLS
    }  # fmt: skip
    elsewhere = ", ".join(
        f"{wall} (rotations: {curve.symmetry}) {_set({n for n, _ in by_wall[wall]})}"
        for wall, curve in WALLS.items() if wall != "ellipse"
    )  # fmt: skip
    two = [pair == (2, 2) for pair in by_wall["ellipse"]]
    return Claim(
        "range.indistinguishable", "target", "In the ellipse exactly two states are indistinguishable.", "C.2, C.4",
        "x and its image under the half-turn, with 1 to 4 sensors and a figure of eight: 2 at every state",
        f"{sum(two)} of {len(two)} states have exactly that one other; elsewhere {elsewhere}", all(two),
    )  # fmt: skip


def _standing_still(still: Mapping[str, float], done: Results) -> Claim:
    full = {name: [value > RANKED for value in done["rank", name]] for name in SENSORS}
    return Claim(
        "range.standing-still", "target", "Standing still is not enough with one or two sensors only.", "2.3, C.3",
        f"rank h' < 3 at every pose and at most {FAILING:.0%} found to 1 mm with one or two; rank 3 at every pose "
        f"and at least {FINDING:.0%} with three and more (first estimates off by 0.03 m and 0.03 rad; found from "
        f"most of {FIRST_ESTIMATES})",
        f"poses with rank 3: {', '.join(f'{name}: {sum(own)} of {len(own)}' for name, own in full.items())}; found: "
        f"{_shares_text(still)}",
        all(
            not any(full[name]) and still[name] <= FAILING if name in FEW
            else all(full[name]) and still[name] >= FINDING
            for name in SENSORS
        ),
    )  # fmt: skip


def _flags(flags: Sequence[Row]) -> Claim:
    stands = {row["rank"] for row in flags if row["u_1"] == 0.0}
    straight = {row["rank"] for row in flags if row["on_axis"] and row["u_2"] == 0.0}
    moving = [row for row in flags if row["u_1"] != 0.0]
    off_axis = chosen(moving, on_axis=False, order=1)
    on_arc = [row for row in chosen(moving, on_axis=True, order=2) if row["u_2"] != 0.0]
    moves, arcs = (
        [{row["rank"] for row in chosen(own, d_0_known=known)} for known in (True, False)] for own in (off_axis, on_arc)
    )
    return Claim(
        "range.flags-ranks", "target", "Two flags and a camera localise a robot that moves.", "Example C.2",
        "d(h, y') has rank 3 (d_0 known) and 4 (unknown) where u_1 != 0 and less than 3 where u_1 = 0; along the "
        "flags' axis straight on is not enough, an arc is",
        f"u_1 = 0: {_set(stands)}; u_1 != 0: {_set(moves[0])} and {_set(moves[1])}; along the axis straight on "
        f"{_set(straight)}, on an arc with y'' {_set(arcs[0])} and {_set(arcs[1])}",
        max(stands) < 3 and max(straight) < 3 and moves == arcs == [{3}, {4}],
    )  # fmt: skip


def _set(values: set[int]) -> str:
    return "/".join(str(value) for value in sorted(values))


def _shares_text(still: Mapping[str, float]) -> str:
    return ", ".join(f"{name}: {share:.0%}" for name, share in still.items())


def _definitions(still: Mapping[str, float], done: Results) -> list[Claim]:
    moving, standing = zip(*done[proposition_tried], strict=True)
    n = len(moving)
    promised = [trial for trial in (*moving, *standing) if trial.singleton]
    kept = sum(trial.weakly_observable for trial in promised)
    weakly = sum(trial.weakly_observable for trial in moving)
    wholly = sum(trial.weakly_observable and trial.others == 0 for trial in moving)
    at_rest, met = (sum(trial.singleton for trial in trials) for trials in (standing, moving))
    apart = np.array(done[apart_with_equal_rates])
    apart = apart[np.isfinite(apart)]
    return [
        Claim(
            "C.small-time", "printed", "Small-time observable at x_1: for any x_2 some input makes a difference by T.",
            "Definition C.8", "for every x_2, x_2 = x_1 not excepted",
            "with x_2 = x_1 none can, so as printed no state is; with x_2 != x_1 the ellipse is so, weakly, at "
            f"{weakly} of {n} states, and for all x_2 at {wholly}, because of the image",
            False,
        ),
        Claim(
            "C.proposition-1", "printed",
            "Where FS_y, OF and a neighbourhood have x_0 alone in common, it is weakly small-time observable there.",
            "Proposition C.1", "whenever (C.1) holds, no state nearby reads the same, over 0.3 s nor over 0.03 s",
            f"so at {kept} of {len(promised)} states where (C.1) holds, of {n} in motion and {len(standing)} at rest",
            kept == len(promised) > 0,
        ),
        Claim(
            "C.singleton", "printed", "Under suitable assumptions the two sets fulfil what Proposition C.1 asks for.",
            "C.4", "with two sensors (C.1) holds at every state in motion; standing still it cannot",
            f"in motion at {met} of {n}, standing still at {at_rest} of {len(standing)}",
            met == n and at_rest == 0,
        ),
        Claim(
            "C.output-flow", "printed", "Q = 0 characterises the set of output flow equivalent states.", "C.4",
            "on {Q = 0}, the ranges change by the same amounts (0.3 s)",
            f"only at first: beyond 0.1 m of the state and its image they differ by {apart.min():.2g} m at least, "
            f"{np.median(apart):.2g} m in the median of {len(apart)} states",
            bool(apart.min() < 1e-9),
        ),
        Claim(
            "C.zero-input", "printed", "Standing still, convergence of the observer is not possible.", "2.3",
            "no start from which the state is found, whatever the number of sensors",
            f"found to 1 mm: {_shares_text(still)}; from three sensors on the ranges alone fix the state",
            max(still.values()) <= FAILING,
        ),
    ]  # fmt: skip


def _of_the_map(rows: Sequence[Row]) -> Claim:
    """Evaluate the claim on the map for two sensors, for their number would have more effect than the wall."""
    two = [row for row in chosen(rows, what="map", estimator="observer") if row["sensors"] in ("2s", "2t")]
    least, most = min(two, key=lambda row: row["share"]), max(two, key=lambda row: row["share"])
    texts = [f"{row['family']} {row['value']:.3g} with {row['sensors']}: {_text(row)}" for row in (least, most)]
    return Claim(
        "C.map", "printed", "The convergence of the observer depends on the environment.", "C.6; left open in 3.2",
        "two sensors: between walls the shares of starts that converge differ beyond their 95 % limits",
        f"from {texts[0]} to {texts[1]}",
        least["high"] < most["low"],
    )  # fmt: skip


# ---- the figure


def figure(cases: Sequence[MapCase], rows: Sequence[Row], regions: Sequence[tuple[Region, Sequence[float]]]) -> Figure:
    """Draw feasible states and what distinguishes them, the effect of the map, and shares by position in regions."""
    with styled_figure((11.8, 10.6)) as drawn:
        top, middle, bottom = np.array(drawn.subfigures(3, 1, height_ratios=(1.2, 1.0, 0.62)))
        field, flow = top.subplots(1, 2, width_ratios=(1.9, 1.0))
        _feasible(field, flow, outputs_of(STANDARD, "2t"), THESIS_START)
        for axes, name in zip(middle.subplots(1, len(PANELS), sharey=True), PANELS, strict=True):
            _family(axes, name, [case for case in cases if case.family == name], chosen(rows, family=name))
        panels = bottom.subplots(1, len(regions))
        for axes, (region, shares) in zip(panels, regions, strict=True):
            _region(axes, region, np.array(shares))
        bar = bottom.colorbar(ScalarMappable(Normalize(0.0, 1.0), SHARES), ax=panels, pad=0.01, shrink=0.8)
        bar.set_label("share of the first headings")
        bar.outline.set_visible(False)
    return drawn


def _feasible(field: Axes, flow: Axes, outputs: RangeOutputs, x_0: Array) -> None:
    motions = {name: _held(u) for name, u in INPUTS.items()}
    curves = [curve.points for curve in feasible_set(outputs, outputs.at(x_0)[0]).curves]
    _wall(field, outputs.curve)
    norm = LogNorm(FAINTEST, STRONGEST)
    for points in curves:
        mismatches = np.array([mismatch(outputs, x, x_0, motions[SHOWN]) for x in points])
        pieces = np.stack([points[:-1, :2], points[1:, :2]], axis=1)
        colours = COLOURS(norm(np.clip(0.5 * (mismatches[1:] + mismatches[:-1]), FAINTEST, STRONGEST)))
        field.add_collection(LineCollection(list(pieces), colors=colours, lw=3.2, capstyle="round", zorder=3))
        for x in points[10::24]:
            tip = x[:2] + 0.2 * np.array([math.cos(x[2]), math.sin(x[2])])
            field.plot([x[0], tip[0]], [x[1], tip[1]], color=INK, lw=0.7, zorder=4)
    for x, face in ((x_0, "#101824"), (outputs.curve.images(x_0)[-1], "white")):
        for end in outputs.curve.points(outputs.curve.ranges(x, outputs.alpha)[1]):
            field.plot([x[0], end[0]], [x[1], end[1]], color="#6b7785", lw=0.8, ls=(0, (4, 3)), zorder=2)
        _robot(field, x, face)
    bar = field.figure.colorbar(
        ScalarMappable(norm, COLOURS), ax=field, location="bottom", pad=0.02, shrink=0.5, aspect=45
    )
    bar.set_label(f"by how much the ranges change otherwise within {AHEAD:g} s of a {SHOWN} [m]")
    bar.outline.set_visible(False)
    field.set_title("(a) all that reads what the robot at its start reads")
    image = outputs.curve.images(x_0)[-1]
    for text, x, offset in (("true start", x_0, (14, -13)), ("its image: indistinguishable", image, (12, 2))):
        annotate(field, text, (x[0], x[1]), offset, fontsize=8.5)
    own = min(curves, key=lambda points: float(np.linalg.norm(pose_difference(points, x_0), axis=1).min()))
    _along(flow, outputs, x_0, own, motions)


def _held(u: tuple[float, float]) -> Array:
    return motion_under(lambda t: u, AHEAD)


def _along(flow: Axes, outputs: RangeOutputs, x_0: Array, points: Array, motions: Mapping[str, Array]) -> None:
    """Return the mismatch along the curve through the true state."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    along -= along[np.argmin(np.linalg.norm(pose_difference(points, x_0), axis=1))]
    for name, motion in motions.items():
        mismatches = np.array([mismatch(outputs, x, x_0, motion) for x in points])
        mismatches[~np.isfinite(mismatches)] = np.nan  # the robot would drive into the wall
        flow.plot(along, np.maximum(mismatches, 0.1 * FAINTEST), color=INPUT_COLOURS[name], lw=1.6, label=name)
    flow.set_yscale("log")
    flow.yaxis.set_minor_formatter(NullFormatter())
    flow.set_ylim(0.1 * FAINTEST, 20.0)
    flow.text(
        0.98, 0.02, "standing still: nought all along", transform=flow.transAxes, ha="right", fontsize=8.5, color=ALIKE
    )
    flow.set(
        xlabel="along the feasible curve, from the true start [m, rad]",
        ylabel=f"difference of the output flow in {AHEAD:g} s [m]",
        title="(b) any motion distinguishes them",
    )
    flow.legend(fontsize=8.5, loc="upper center", ncols=2, columnspacing=1.2, handlelength=1.4)


def _wall(axes: Axes, curve: Curve, *, ground: str = "#f6f3ec") -> None:
    axes.add_patch(Polygon(curve.polyline, closed=True, facecolor=ground, edgecolor=INK, lw=1.6, zorder=1))
    low, high = curve.polyline.min(axis=0), curve.polyline.max(axis=0)
    room = 0.03 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_xticks([])
    axes.set_yticks([])


def _robot(axes: Axes, x: Array, face: str, size: float = 0.13) -> None:
    c, s = math.cos(x[2]), math.sin(x[2])
    shape = size * np.array([[1.5, 0.0], [-0.9, 0.85], [-0.45, 0.0], [-0.9, -0.85]])
    axes.add_patch(
        Polygon(x[:2] + shape @ np.array([[c, s], [-s, c]]), facecolor=face, edgecolor=INK, lw=1.1, zorder=6)
    )


def _family(axes: Axes, name: str, cases: Sequence[MapCase], rows: Sequence[Row]) -> None:
    """Draw the shares of a family over its walls, a line for each estimator and, if the wall varies, set of sensors."""
    title, xlabel = PANELS[name]
    sets = list(dict.fromkeys(case.sensors for case in cases))
    walls = [case for case in cases if name == "sensors" or case.sensors == sets[0]]
    x = np.arange(len(walls))
    for own in [{}] if name == "sensors" else [{"sensors": sensors} for sensors in sets]:
        for estimator, colour in ESTIMATOR_COLOURS.items():
            line = chosen(rows, estimator=estimator, **own)
            low, high, share = (np.array([row[side] for row in line]) for side in ("low", "high", "share"))
            label = f"{estimator}, {own['sensors']}" if own and len(sets) > 1 else estimator
            axes.fill_between(x, low, high, color=colour, alpha=0.13, lw=0)
            axes.plot(x, share, color=colour, ls="--" if own.get("sensors") == "2t" else "-", marker="o", ms=3.6,
                      label=label)  # fmt: skip
    axes.set(title=title, xlabel=xlabel, ylim=(0.0, 1.28), xlim=(-0.4, len(x) - 0.6))
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.set_xticks(x, [f"{case.value:.3g}" for case in walls])
    axes.grid(visible=False, axis="x")
    if name == next(iter(PANELS)):
        axes.set_ylabel("share of starts that find the true state")
        axes.legend(fontsize=7.5, loc="lower center", ncols=2, columnspacing=1.0, handlelength=1.5)
    for k, case in enumerate(walls):
        box = axes.inset_axes((k - 0.45, 1.03, 0.9, 0.22), transform=axes.transData)
        p = case.curve.polyline - 0.5 * (case.curve.polyline.max(axis=0) + case.curve.polyline.min(axis=0))
        box.fill(p[:, 0], p[:, 1], facecolor="#f6f3ec", edgecolor=INK, lw=0.8)
        for angle in SENSORS[case.sensors] if name == "sensors" else ():
            end = case.curve.ranges(np.zeros(3), np.radians([angle]))[0] * np.exp(1j * math.radians(angle))
            box.plot([0.0, end[0].real], [0.0, end[0].imag], color=ALIKE, lw=0.8)
        box.set(xlim=(-4.7, 4.7), ylim=(-4.7, 4.7), aspect="equal")
        box.axis("off")


def _region(axes: Axes, region: Region, shares: Array) -> None:
    curve, start, half = region.case.curve, region.start, 0.5 * region.spacing
    _wall(axes, curve, ground="white")
    inside = Polygon(curve.polyline, closed=True, transform=axes.transData)
    for place, share in zip(np.array(region.places), shares, strict=True):
        cell = Polygon(
            place + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), facecolor=SHARES(share), lw=0, zorder=2
        )
        axes.add_patch(cell)
        cell.set_clip_path(inside)
    axes.add_patch(Polygon(curve.polyline, closed=True, fill=False, edgecolor=INK, lw=1.6, zorder=5))
    c, s = math.cos(start[2]), math.sin(start[2])
    path = start[:2] + driven_path()[:, :2] @ np.array([[c, s], [-s, c]])
    axes.plot(*path.T, color="#101824", lw=0.9, zorder=5)
    _robot(axes, start, "#101824", size=0.17)
    axes.set_title(f"{region.title}: {shares.mean():.0%}")
