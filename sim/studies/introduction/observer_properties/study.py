"""Properties that estimators declare in the terms of Table 2.1 of the thesis, beside those that their runs show."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import INK, STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Proportion
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.introduction.observer_properties.measures import ranging_drift
from mathnavi.sim.studies.introduction.observer_properties.subjects import (
    BRIEF,
    FAR,
    NEAR,
    PRINTED,
    SPEED,
    SUBJECTS,
    Subject,
)
from mathnavi.sim.studies.introduction.observer_properties.verdicts import (
    STAYS,
    PropertyRuns,
    PropertyVerdict,
    found,
    verdicts,
)

NEARBY, ANYWHERE = "#0d5fa8", "#d9731a"
KEPT, BROKEN = "#2b7a4b", "#b3202f"


@configuration
class ObserverPropertiesConfig:
    """Sample sizes: runs."""

    starts: Count = 20
    """starts nearby, and anywhere, for each estimator; on the truth and under each input a quarter of it"""
    subjects: Count = len(SUBJECTS)
    """estimators, at most"""
    seconds: Count = 10
    """of a run of a textbook system; a robot within a wall drives for twice as long, a velocity is found in less"""


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
        failing = {subject.estimator for subject in subjects if seen[subject].failing}
        judged = {
            subject: verdicts(subject.declared, seen[subject], subject.estimator in failing) for subject in subjects
        }
        return StudyResult(
            summary=(
                f"Runs without noise, of {config.seconds} s for the systems of the textbook, twice that for the "
                f"robots and {BRIEF:g} times that for what finds a velocity. A start nearby is known with a tenth of "
                "the error that a system has by itself, or .05 m and 3°; one from anywhere with three times that "
                f"error, or not at all; of a velocity, the error is itself, {NEAR * SPEED:g} and {FAR * SPEED:g} rad/s "
                "or 1/s. Found: a tenth of the error of the start is left, or, without a start, RMS below .3 m and "
                ".2 rad.",
            ),
            rows=[
                {"estimator": subject.name, "property": one.name, "declared": one.declared, "measured": one.measured,
                 "kept": one.kept}
                for subject, found in judged.items() for one in found
            ],
            tables=(_table(judged),),
            figure=_figure({subject.name: seen[subject] for subject in subjects}, judged),
            caption="Shares of the starts from which the error goes, with 95 % limits of Clopper and Pearson, and how "
            "far an estimator has left the truth a second after it started on it. Names are green where everything "
            "declared is kept.",
            claims=_claims(judged, seen),
        )  # fmt: skip


def _flown(
    subjects: tuple[Subject, ...], config: ObserverPropertiesConfig, setup: Setup
) -> dict[Subject, PropertyRuns]:
    few, seconds = max(1, config.starts // 4), float(config.seconds)
    asked = {}
    for subject in subjects:
        if not subject.arena.tells_certainty:
            asked[subject, "true"] = [subject.true(seed, seconds) for seed in range(few)]
        asked[subject, "near"] = [subject.near(seed, seconds) for seed in range(config.starts)]
        asked[subject, "far"] = [subject.far(seed, seconds) for seed in range(config.starts)]
        for name in subject.arena.inputs:
            asked[subject, f"under {name}"] = [subject.under(name, seed, seconds) for seed in range(few)]
    done = setup.fly_groups(asked)
    robots = [subject for subject in subjects if subject.arena.tells_certainty]
    drifts = setup.compute(ranging_drift, [subject.on_truth(seed) for subject in robots for seed in range(few)])
    drifted = {subject: drifts[k * few : (k + 1) * few] for k, subject in enumerate(robots)}
    drifted |= {key[0]: figures(runs, "drift").tolist() for key, runs in done.items() if key[1] == "true"}
    return {
        subject: PropertyRuns(
            drifted[subject],
            done[subject, "near"],
            done[subject, "far"],
            {name: done[subject, f"under {name}"] for name in subject.arena.inputs},
        )
        for subject in subjects
    }


def _table(judged: Mapping[Subject, list[PropertyVerdict]]) -> Table:
    rows = [
        (subject.name, one.name, one.declared, one.measured, "yes" if one.kept else "no")
        for subject, verdicts in judged.items()
        for one in verdicts
    ]
    return Table("Table 2.1, declared beside measured", ("estimator", "property", "declared", "measured", "kept"), rows)


def _claims(judged: Mapping[Subject, list[PropertyVerdict]], seen: Mapping[Subject, PropertyRuns]) -> list[Claim]:
    every = [(subject, one) for subject, verdicts in judged.items() for one in verdicts]
    broken = [f"{subject.name}: {one.name} {one.declared} ({one.measured})" for subject, one in every if not one.kept]
    printed = seen[PRINTED]
    runs = len(printed.drifts)
    return [
        Claim(
            "range.properties", "target", "Every estimator is what it declares to be.", "2.3, Table 2.1",
            "of the estimators of the textbook, of ranges and of velocities, every entry agrees with runs without "
            "noise",
            f"{len(every) - len(broken)} of {len(every)} entries of {len(judged)} estimators"
            + (f"; not {'; '.join(broken)}" if broken else ""),
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


# ---- what is drawn


def _figure(seen: Mapping[str, PropertyRuns], judged: Mapping[Subject, list[PropertyVerdict]]) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 1.9 + 0.36 * len(seen)), layout="constrained")
        shares, drifts = figure.subplots(1, 2, sharey=True, width_ratios=(1.6, 1.0))
        for row, e in enumerate(seen.values()):
            _share(shares, row - 0.14, found(e.near), NEARBY)
            _share(shares, row + 0.14, found(e.far), ANYWHERE)
            drifts.plot(max(e.drift, 1e-15), row, "o", ms=7, color=KEPT if e.drift <= STAYS else BROKEN)
        shares.set(xlim=(-0.03, 1.03), xlabel="share of starts from which the error goes",
                   title="(a) domain of attraction")  # fmt: skip
        shares.set_yticks(range(len(seen)), list(seen))
        for label, verdicts in zip(shares.get_yticklabels(), judged.values(), strict=True):
            label.set_color(KEPT if all(one.kept for one in verdicts) else BROKEN)
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
