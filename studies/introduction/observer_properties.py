"""Properties that estimators declare in the terms of Table 2.1 of the thesis, compared with those that their runs show.

All runs are without noise. Starts are drawn over the whole state space, the same for every estimator of a system. Runs
can refute a declaration but not prove it: one start without convergence refutes global attraction, while the weakest
entries, local operation of the observer or of the system, cannot be refuted. A declared failure, such as no convergence
under some input, must be observed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.estimators.integrity.guard import alone
from mathnavi.estimators.observability.region import exact_run
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.fields import instance, with_fields
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.sphere_observer import SphereObserverConfig, config_mission
from mathnavi.sim.scenarios.textbook import TextbookConfig
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult
from mathnavi.studies.ranging.observability_measures import STANDARD, MapCase, drawn_start, driving

SLOW = ("camera-and-flags",)  # the robot has to come near the flags
NEAR, FAR = 0.1, 3.0  # of the error that a textbook system starts with by itself
SILENT = {"noise.range_relative": 0.0, "noise.odometry_noise": (0.0, 0.0), "noise.odometry_bias": 0.0}
RANGE_INPUTS = ("figure-eight", "circle", "random", "straight", "still")
SIGNALS = {"zero": (0.0, 0.0), "constant": (0.3, 0.0), "sine": (0.0, 0.5), "fast sine": (0.0, 2.0)}  # constant, sine
SPAN = {  # (low, high) of the starts of each state of a textbook system
    "example-2-2": ((-6.0, -4.0), (-2.0, 0.0), (-1.0, 1.0)),  # from where no input here makes it escape
    "krener-isidori": ((-2.0, 2.0), (-2.0, 2.0)),
    "kazantzis-kravaris": ((-0.8, 0.8), (-0.5, 0.5)),
    "camera-and-flags": ((2.2, 2.8), (-4.2, -3.8), (1.5, 1.64)),  # from where the flags stay in sight
}
SPEED = 10.0  # [rad/s, 1/s] of which ``NEAR`` and ``FAR`` are shares where a start is known to be at rest
BRIEF = 0.3  # of the time of a textbook system, for those that find a velocity within tenths of a second
TORQUES = {  # [N m] constant and sine about each axis of the body, whose inertia is 0.05 kg m^2
    "none": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "constant": ((0.05, -0.03, 0.04), (0.0, 0.0, 0.0)),
    "sine": ((0.0, 0.0, 0.0), (0.3, 0.2, 0.25)),
    "strong sine": ((0.0, 0.0, 0.0), (3.0, 2.0, 2.5)),
}
STAYS = 1e-3  # in the units of the state: largest error within a second of what starts on the truth and stays there
MOST = 0.9  # of the starts nearby, from which a local observer converges
CLOSE = 2.0  # times its start, that the error of an observer of local operation keeps below
DECAYED = 0.1  # of the error at the start, below which an error has decayed
UNSURE = (0.3, 0.3, 0.3)  # [m, m, rad]
_LATE = 0.9  # of a run, from which on its last tenth lasts
_SOON = 1.0  # [s] in which what does not stay on the truth has left it, and round-off has not grown to be seen
_FALLEN = 1e-2  # of the error at the start: what falls to it may be exponential
_FLOOR = 2e-3  # likewise: below it, and below
_SMALL = 1e-3  # in the units of the state, what an observer's sampling and steps cost is seen, not its dynamics
_STEADY = 0.25  # of the first half's rate of decay, that of the second half of an exponential is at least
_FALLING = 0.9  # of the second third's largest error, that the last third's is at most where it still falls
_EXACT = 1e-9
NEARBY, ANYWHERE = "#0d5fa8", "#d9731a"
KEPT, BROKEN = "#2b7a4b", "#b3202f"


@dataclass(frozen=True)
class Textbook:
    """Textbook system whose start is known with an error."""

    system: str
    tells_certainty = False

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(SIGNALS) if SYSTEMS[self.system].inputs else ("none",)

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        rng, system = np.random.default_rng(seed), SYSTEMS[self.system]
        start = [float(rng.uniform(*span)) for span in SPAN[self.system]]
        size = np.abs(system.start_error)
        error = share * size * rng.choice([-1.0, 1.0], len(start)) * rng.uniform(0.5, 1.0, len(start))
        fields: dict[str, Any] = {"system": self.system, "start": tuple(start), "start_error": tuple(error.tolist())}
        if signal in SIGNALS:
            constant, sine = SIGNALS[signal]
            fields["planner.constant"] = (constant,) * len(system.inputs)
            fields["planner.amplitude"] = (sine,) * len(system.inputs)
        return "textbook-observer", {**fields, "duration": seconds * (2.0 if self.system in SLOW else 1.0)}


@dataclass(frozen=True)
class RoomWall:
    """Robot within a wall; a near start is known to 0.05 m and 3 degrees, a far one is unknown."""

    inputs = RANGE_INPUTS
    tells_certainty = True

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        known = {"start_known": True, "start_error": (0.05, 0.05, 3.0)} if share <= NEAR else {}
        fields = {**SILENT, **known, "duration": 2.0 * seconds, "planner.mode": signal or RANGE_INPUTS[0]}
        return "range-localisation", fields


@dataclass(frozen=True)
class Space:
    """Body on a curved space; only the position of its start is known, so the error is the velocity."""

    space: str = "body"
    tells_certainty = False

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(TORQUES) if self.space == "body" else ("none",)

    def fields(self, seed: int, seconds: float, share: float, signal: str) -> tuple[str, dict[str, Any]]:
        fields: dict[str, Any] = {
            "space": self.space, "speed": share * SPEED, "duration": BRIEF * seconds, "settled": 0.0,
            "reading.noise": 0.0, "speed_max": 2.0 * FAR * SPEED,
        }  # fmt: skip
        if self.space == "body":
            fields["planner.constant"], fields["planner.amplitude"] = TORQUES[signal or "sine"]
        else:
            fields["force"] = "linear"
        return "sphere-observer", fields


Arena = Textbook | RoomWall | Space
"""scenario of an estimator with its ``inputs``; ``fields`` returns the scenario's name and its fields for a start that
is known with a share of the usual error, with signal "" for the system's input. ``tells_certainty`` if a start that is
given exactly also counts as certain, so that starts on the truth are run by ``ranging_drift``
"""


@dataclass(frozen=True)
class Subject:
    """An estimator with a configuration, and its scenario."""

    name: str
    estimator: str
    arena: Arena = field(default_factory=RoomWall)
    configuration: Mapping[str, Any] = field(default_factory=dict, hash=False)  # fields of the estimator

    @property
    def declared(self) -> ObserverProperties:
        """Entries of Table 2.1 that the plug-in declares."""
        plugin = load("estimators", self.estimator)
        properties: ObserverProperties = plugin.properties(with_fields(plugin.Config(), self.configuration))
        return properties

    def trial(self, share: float, seed: int, seconds: float, signal: str = "") -> Trial:
        """Return the trial from a start that is known with a share of the usual error, or unknown."""
        own = {f"estimator.{name}": value for name, value in self.configuration.items()}
        scenario, fields = self.arena.fields(seed, seconds, share, signal)
        measure = f"{__name__}:property_figures"
        return trial(scenario, seed, estimator=self.estimator, fields={**fields, **own}, measure=measure)

    def on_truth(self, seed: int) -> OnTruth:
        """Return the argument of ``ranging_drift``, for scenarios in which an exactly known start counts as certain."""
        return OnTruth(self.estimator, dict(self.configuration), seed)


PRINTED = Subject("(C.5) as printed", "range_observer", configuration={"feedforward": "none"})
SUBJECTS = (
    PRINTED,
    Subject("Example 2.2", "example_2_2", Textbook("example-2-2")),
    Subject("Example 2.2, β < 0", "example_2_2", Textbook("example-2-2"), {"beta": -0.2}),
    Subject("output injection (2.3)", "output_injection", Textbook("krener-isidori")),
    Subject("Kazantzis-Kravaris, z", "kazantzis_kravaris", Textbook("kazantzis-kravaris")),
    Subject("(2.4) corrected", "kazantzis_kravaris", Textbook("kazantzis-kravaris"), {"form": "corrected"}),
    Subject("(2.4) as printed", "kazantzis_kravaris", Textbook("kazantzis-kravaris"), {"form": "printed"}),
    Subject("EKF, van der Pol", "textbook_ekf", Textbook("krener-isidori")),
    Subject("EKF, camera and flags", "textbook_ekf", Textbook("camera-and-flags")),
    Subject("(C.5), feed-forward", "range_observer"),
    Subject("feasible-set bank", "feasible_set_bank"),
    Subject("range EKF", "range_ekf"),
    Subject("range UKF", "range_ukf"),
    Subject("range particles", "range_particle"),
    Subject("range IEKF", "range_iekf"),
    Subject("certified bank", "range_certified"),
    Subject("moving horizon, ranges", "moving_horizon"),
    Subject("(D.6), attitude", "riemannian_observer", Space()),
    Subject("(D.6), hyperbolic plane", "riemannian_observer", Space("hyperbolic-plane")),
    Subject("(D.6) with printed gains", "riemannian_observer", Space(), {"gains": "printed"}),
    Subject("high gain", "high_gain", Space()),
    Subject("Lagrangian EKF", "lagrangian_ekf", Space()),
    Subject("Lagrangian UKF", "lagrangian_ukf", Space()),
    Subject("filtered differences", "filtered_differences", Space()),
)


@configuration
class ObserverPropertiesConfig:
    """Sample sizes: runs."""

    starts: Count = 20
    """number of near and of far starts for each estimator; a quarter of it on the truth and under each input"""
    subjects: Count = len(SUBJECTS)
    """largest number of estimators"""
    seconds: Count = 10
    """duration of a run of a textbook system [s]; twice as long for a robot within a wall, less for a velocity"""


class ObserverPropertiesStudy:
    """Comparison of the declared properties of estimators (terms of Table 2.1) with those that their runs show."""

    Config = ObserverPropertiesConfig
    quick = ObserverPropertiesConfig(starts=2)
    title = "What estimators declare to be as observers"
    on_terrain = False

    @staticmethod
    def run(config: ObserverPropertiesConfig, setup: Setup) -> StudyResult:
        subjects = SUBJECTS[: config.subjects]
        seen = _flown(subjects, config, setup)
        failing = {subject.estimator for subject in subjects if seen[subject.name].failing}
        rows = [
            {"estimator": subject.name, **verdict}
            for subject in subjects
            for verdict in verdicts(subject.declared, seen[subject.name], subject.estimator in failing)
        ]
        return StudyResult(
            summary=(
                f"Runs without noise, of {config.seconds} s for the systems of the textbook, twice that for the "
                f"robots and {BRIEF:g} times that for what finds a velocity. A start nearby is known with a tenth of "
                "the error that a system has by itself, or 0.05 m and 3°; one from anywhere with three times that "
                f"error, or not at all; of a velocity, the error is itself, {NEAR * SPEED:g} and {FAR * SPEED:g} rad/s "
                "or 1/s. Found: a tenth of the error of the start is left, or, without a start, RMS below 0.3 m and "
                "0.2 rad.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(rows, seen),
            caption="Shares of the starts from which the error goes, with 95 % limits of Clopper and Pearson, and how "
            "far an estimator has left the truth a second after it started on it. Names are green where everything "
            "declared is kept.",
            claims=_claims(rows, seen),
        )


def _flown(subjects: Sequence[Subject], config: ObserverPropertiesConfig, setup: Setup) -> dict[str, PropertyRuns]:
    """Fly the runs of each estimator, and return them by its name in the study."""
    few, seconds = max(1, config.starts // 4), float(config.seconds)
    asked = {}
    for subject in subjects:
        if not subject.arena.tells_certainty:
            asked[subject, "true"] = [subject.trial(0.0, seed, seconds) for seed in range(few)]
        asked[subject, "near"] = [subject.trial(NEAR, seed, seconds) for seed in range(config.starts)]
        asked[subject, "far"] = [subject.trial(FAR, seed, seconds) for seed in range(config.starts)]
        for name in subject.arena.inputs:
            asked[subject, f"under {name}"] = [subject.trial(NEAR, seed, seconds, name) for seed in range(few)]
    done = setup.fly_groups(asked)
    robots = [subject for subject in subjects if subject.arena.tells_certainty]
    drifts = setup.compute(ranging_drift, [subject.on_truth(seed) for subject in robots for seed in range(few)])
    drifted = {subject: drifts[k * few : (k + 1) * few] for k, subject in enumerate(robots)}
    drifted |= {key[0]: figures(runs, "drift").tolist() for key, runs in done.items() if key[1] == "true"}
    return {
        subject.name: PropertyRuns(
            drifted[subject],
            done[subject, "near"],
            done[subject, "far"],
            {name: done[subject, f"under {name}"] for name in subject.arena.inputs},
        )
        for subject in subjects
    }


@dataclass(frozen=True)
class PropertyRuns:
    """The runs of one estimator, none with noise."""

    drifts: Sequence[float]  # the largest error within a second, of runs that start on the truth
    near: Sequence[Record]
    far: Sequence[Record]
    inputs: Mapping[str, Sequence[Record]]  # as near, by the input

    @property
    def drift(self) -> float:
        """The largest error within a second of starts on the truth."""
        return max(self.drifts)

    @property
    def decays(self) -> list[tuple[Decay, int]]:
        """Kinds of decay from near starts with their counts, the most frequent first."""
        return Counter(Decay(int(record.summary["decay"])) for record in self.near).most_common()

    @property
    def decay(self) -> Decay:
        """The most frequent kind of decay from near starts."""
        return self.decays[0][0]

    @property
    def failing(self) -> list[str]:
        """Inputs under which the estimator does not converge from most starts."""
        return [name for name, runs in self.inputs.items() if found(runs).value <= 0.5]

    @property
    def peak(self) -> float:
        """The largest error of a run from a near start over that of its start."""
        return float((figures(self.near, "largest") / figures(self.near, "start")).max())


def found(runs: Sequence[Record]) -> Proportion:
    """Return the share of runs that have converged."""
    return rate(sum(bool(record.summary["found"]) for record in runs), len(runs))


def verdicts(declared: ObserverProperties, e: PropertyRuns, depends: bool) -> list[dict[str, Any]]:
    """Return rows that compare Property 2.1 and the entries of Table 2.1, as declared and as measured.

    ``depends`` tells whether the plug-in failed under some input, of this system or of another.
    """
    near, far, size = found(e.near), found(e.far), len(e.near)
    falls = ", ".join(f"{Rate[decay.name].value} {count}/{size}" for decay, count in e.decays)
    under = ", ".join(f"{name} {found(runs).events}/{found(runs).trials}" for name, runs in e.inputs.items())
    entries = (
        (
            "stays on the truth", "yes" if declared.stays_on_truth else "no",
            f"{e.drift:.1e} off within 1 s, {len(e.drifts)} runs", declared.stays_on_truth is (e.drift <= STAYS),
        ),
        (
            "domain of attraction", declared.domain_of_attraction.value,
            f"near {near.text()}; anywhere {far.text()}", _attracts(declared, e),
        ),
        (
            "rate", declared.rate.value, f"{Rate[e.decay.name].value}: {falls}",
            e.decay >= Decay[declared.rate.name] if declared.rate is not Rate.NONE else e.decay is Decay.NONE,
        ),
        (
            "input dependence", declared.input_dependence.value, under,
            depends if declared.input_dependence is InputDependence.NON_UNIFORM else not e.failing,
        ),
        (
            "observer's domain of operation", declared.observer_domain.value,
            f"error at most {e.peak:.2g} of its start",
            declared.observer_domain is Domain.GLOBAL or e.peak <= CLOSE,
        ),
        (
            "system's domain of operation", declared.system_domain.value, f"near {near.text()}, states from all over",
            declared.system_domain is not Domain.GLOBAL or _attracts(declared, e),
        ),
    )  # fmt: skip
    return [dict(zip(("property", "declared", "measured", "kept"), entry, strict=True)) for entry in entries]


def _attracts(declared: ObserverProperties, e: PropertyRuns) -> bool:
    """Return True if starts converge as declared: all for global attraction, most near ones for local, few for none.

    An estimator that declares no attraction may come near the truth if its error does not decay.
    """
    near, far = found(e.near), found(e.far)
    if declared.domain_of_attraction is Domain.GLOBAL:
        return near.events + far.events == near.trials + far.trials
    if declared.domain_of_attraction is Domain.NONE:
        return near.value <= 0.5 or e.decay is Decay.NONE
    return near.value >= MOST


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Table 2.1, declared beside measured", rows, (
        ("estimator", "estimator"), ("property", "property"), ("declared", "declared"), ("measured", "measured"),
        ("kept", lambda row: "yes" if row["kept"] else "no"),
    ))  # fmt: skip


def _claims(rows: Sequence[dict[str, Any]], seen: Mapping[str, PropertyRuns]) -> list[Claim]:
    broken = [row for row in rows if not row["kept"]]
    listed = "; ".join(f"{row['estimator']}: {row['property']} {row['declared']} ({row['measured']})" for row in broken)
    printed = seen[PRINTED.name]
    runs = len(printed.drifts)
    return [
        Claim(
            "range.properties", "target", "Every estimator is what it declares to be.", "2.3, Table 2.1",
            "of the estimators of the textbook, of ranges and of velocities, every entry agrees with runs without "
            "noise",
            f"{len(rows) - len(broken)} of {len(rows)} entries of {len(seen)} estimators"
            + (f"; not {listed}" if broken else ""),
            not broken,
        ),
        Claim(
            "C.property-2-1", "printed", "(C.5) contains the robot as a particular solution.", "C.4, Property 2.1",
            f"started on the truth, without noise, it stays there: at most {STAYS:g} m or rad off within 1 s",
            f"{printed.drift:.2g} off in the worst of {runs} runs; from nearby the error goes in "
            f"{found(printed.near).text()}",
            printed.drift <= STAYS,
        ),
    ]  # fmt: skip


def _figure(rows: Sequence[dict[str, Any]], seen: Mapping[str, PropertyRuns]) -> Figure:
    broken = {row["estimator"] for row in rows if not row["kept"]}
    with styled_figure((11.0, 1.9 + 0.36 * len(seen))) as figure:
        shares, drifts = figure.subplots(1, 2, sharey=True, width_ratios=(1.6, 1.0))
        for row, e in enumerate(seen.values()):
            _share(shares, row - 0.14, found(e.near), NEARBY)
            _share(shares, row + 0.14, found(e.far), ANYWHERE)
            drifts.plot(max(e.drift, 1e-15), row, "o", ms=7, color=KEPT if e.drift <= STAYS else BROKEN)
        shares.set(xlim=(-0.03, 1.03), xlabel="share of starts from which the error goes",
                   title="(a) domain of attraction")  # fmt: skip
        shares.set_yticks(range(len(seen)), list(seen))
        for label, name in zip(shares.get_yticklabels(), seen, strict=True):
            label.set_color(BROKEN if name in broken else KEPT)
        shares.set_ylim(len(seen) - 0.5, -1.0)
        for text, x, colour in (("from nearby", 0.0, NEARBY), ("from anywhere", 0.3, ANYWHERE)):
            shares.text(x, -0.65, f"● {text}", color=colour, fontsize=9.0, va="center")
        drifts.axvline(STAYS, color=INK, ls="--", lw=1.0)
        drifts.text(STAYS, -0.65, "stays  ", ha="right", va="center", fontsize=8.5)
        drifts.text(STAYS, -0.65, "  leaves", ha="left", va="center", fontsize=8.5)
        drifts.set(xscale="log", xlabel="error 1 s after a start on the truth", title="(b) Property 2.1")
    return figure


def _share(axes: Axes, height: float, share: Proportion, colour: str) -> None:
    axes.plot([share.low, share.high], [height, height], color=colour, lw=2.2, alpha=0.45, solid_capstyle="round")
    axes.plot(share.value, height, "o", ms=6, color=colour)


# ---- what is measured


class Decay(IntEnum):
    """Kinds of decay of an error, ordered by the strength of the claim; the names are those of ``Rate``."""

    NONE = 0
    ASYMPTOTIC = 1
    EXPONENTIAL = 2
    FINITE_TIME = 3


def property_figures(outcome: RunData) -> dict[str, Any]:
    """A measure: lengths of the error in the units of the state, from the first estimate that is not initialising.

    ``start`` is that of the given start, or of the first estimate if no start was given; ``late`` is the root mean
    square over the last tenth of the run, ``largest`` the largest, ``drift`` the largest of the first second.
    ``found`` tells whether at most a tenth of the start's error is left at the end; if no start was given, the scenario
    decides.
    """
    given = _given_error(outcome)
    t, error = errors(outcome)
    if len(t) < 3:
        lost = dict.fromkeys(("start", "late", "largest", "drift"), math.inf)
        return {**lost, "decay": int(Decay.NONE), "found": False}
    late = float(np.sqrt(np.mean(np.square(error[t >= _LATE * t[-1]]))))
    start = float(error[0]) if given is None else given
    return {
        "start": start,
        "late": late,
        "largest": float(error.max()),
        "drift": float(error[t <= t[0] + _SOON].max()),
        "decay": int(decay(error, start)),
        "found": bool(outcome.summary["converged"] if given is None else late <= DECAYED * given),
    }


@dataclass(frozen=True)
class OnTruth:
    """Ranging estimator that is given its true start with standard deviations ``UNSURE``."""

    estimator: str
    fields: Mapping[str, Any]
    seed: int


def ranging_drift(started: OnTruth) -> float:
    """A job: largest error [m, rad] within a second of a start on the truth that is declared uncertain."""
    case = MapCase("ellipse", 0.0, STANDARD, "2s")
    start = drawn_start(STANDARD, np.random.default_rng(started.seed))
    known = KnownStart((float(start[0]), float(start[1]), float(start[2])), UNSURE)
    mission = RangingMission(STANDARD, case.outputs.angles, start=known)
    run = exact_run(mission, start, driving, _SOON)
    plugin = load("estimators", started.estimator)
    estimator = alone(plugin.build(with_fields(plugin.Config(), started.fields), mission))  # what is declared of it
    found = [estimator.update(*each) for each in zip(run.t, run.readings, run.commands, strict=True)]
    return max(math.hypot(*mission.error(one.x, truth)) for one, truth in zip(found, run.truth, strict=True))


def errors(outcome: RunData) -> tuple[Array, Array]:
    """Return times (k,) [s] and error lengths (k,) of the estimates that are not initialising, up to an escape."""
    recording = outcome.recording
    ((name, agent),) = recording.agents.items()
    ready = [estimate for estimate in agent.estimates if estimate.status is not Status.INITIALISING]
    escape = outcome.summary.get("escape_time_s")
    ready = [estimate for estimate in ready if escape is None or estimate.t <= escape]
    if not ready:
        return np.empty(0), np.empty(0)
    t, x = np.array([estimate.t for estimate in ready]), np.array([estimate.x for estimate in ready])
    truth = recording.truths[name][np.searchsorted(recording.t, t - 1e-9)]
    return t, lengths(outcome, x, truth)


def lengths(outcome: RunData, x: Array, truth: Array) -> Array:
    """Return lengths (k,) of the errors of estimates (k, nx) to true states (k, nx), as the scenario compares them."""
    scenario = load("scenarios", outcome.config["scenario"])
    config = instance(scenario.Config, outcome.config["fields"], "fields")
    length: Array = np.linalg.norm(np.array(list(scenario.errors(config, x, truth).values())), axis=0)
    return length


def decay(error: Array, start: float) -> Decay:
    """Classify the decay of errors (k,) at equal intervals from the initial error ``start``.

    Exact estimates from the second on are finite-time decay. Exponential decay falls to a hundredth, and until it meets
    its floor is not much slower in the second half of the time than in the first. Decay by less, or ever more slowly,
    which is still smaller in the last third than in the second, is asymptotic.
    """
    if float(error[1:].max()) <= _EXACT * max(start, 1.0):
        return Decay.FINITE_TIME
    floor = max(_FLOOR * start, _SMALL)
    below = np.flatnonzero(error <= floor)
    end = int(below[0]) if len(below) else len(error)
    last = float(np.sqrt(np.mean(np.square(error[int(_LATE * len(error)) :]))))
    if end >= 4 and last <= max(_FALLEN * start, floor):
        middle = (end - 1) // 2
        fall = [math.log(start / error[middle]), math.log(error[middle] / error[end - 1])]
        if fall[1] >= _STEADY * fall[0]:
            return Decay.EXPONENTIAL
    thirds = np.array_split(error, 3)
    falling = last <= floor or float(thirds[2].max()) < _FALLING * float(thirds[1].max())
    return Decay.ASYMPTOTIC if last <= DECAYED * start and falling else Decay.NONE


def _given_error(outcome: RunData) -> float | None:
    """Return the length of the error of the start that was given to the estimator; None if none was given."""
    if outcome.config["scenario"] == "textbook-observer":
        config = instance(TextbookConfig, outcome.config["fields"], "fields")
        believed, true = config.mission.start_state, config.start_state
    elif outcome.config["scenario"] == "sphere-observer":  # from a reading without error, and taken to be at rest
        moving = instance(SphereObserverConfig, outcome.config["fields"], "fields")
        size = config_mission(moving).system.manifold.size
        ((true, *_),) = outcome.recording.truths.values()
        believed = np.where(np.arange(len(true)) < size, true, 0.0)
    else:
        known, true = outcome.config["mission"]["known_start"], np.array(outcome.config["mission"]["start"])
        if known is None:
            return None
        believed = np.array(known["pose"])
    return float(lengths(outcome, believed[np.newaxis], true[np.newaxis])[0])
