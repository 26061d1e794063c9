"""Figures of the wall-clock times that the components of a run took for their answers: ``timing.json``.

    share of the period   mean time of an answer / time from one to the next, 1 for a component in need of a whole core
    longer                number of answers that took longer than that: of a planner, plans that would have been late

Each vehicle is a separate computer. Another run of the same seed gives other figures and the same log, so none of
them is in summary.json. Answers that compile kernels are not among them, for a run that compiles in its first planning
periods is flown again; what the first answer imports is.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge

from mathnavi.interfaces.bounds import NonNegative, Positive, configuration
from mathnavi.interfaces.errors import FieldError, RunFolderError
from mathnavi.interfaces.reading import files
from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.engine.answer_times import PLANNER, AnswerTimes
from mathnavi.sim.engine.log import Recording

TIMING = "timing.json"
DELAYS = "delays.json"
_LEAST_SHARE = 1e-4  # of a period that is shown as a number
LATENCY = "latency"
"""key in config.json of a run in which plans took simulated time"""

LatencyName = Literal["none", "measured"]
PlansTake = Literal["no time", "measured", "recorded"]
"""simulated time of the plans of a run: none, that measured in it, or that recorded in an earlier one"""

Number = Annotated[int, Ge(0)]


@configuration
class AnswerFigures:
    """Wall-clock times of the answers of one component of a vehicle."""

    answers: Number
    period_s: Positive  # from one answer to the next
    median_s: NonNegative
    p99_s: NonNegative  # 99 % of the answers took no longer
    worst_s: NonNegative
    first_s: NonNegative  # of the first answer, which imports what the component has not imported yet
    period_share: NonNegative  # mean time of an answer over the period
    longer: Number  # answers that took longer than the period

    @property
    def keeps_pace(self) -> bool:
        """Whether the answers took no longer than their periods, most of them and all together."""
        return self.period_share <= 1.0 and 2 * self.longer <= self.answers

    @staticmethod
    def of(times: AnswerTimes) -> AnswerFigures:
        """Figures of a component's times, of which there is one at least."""
        seconds = np.array(times.seconds)
        median, p99, worst = np.percentile(seconds, (50.0, 99.0, 100.0)).tolist()
        period = float(times.period)
        share, longer = float(seconds.mean()) / period, int((seconds > period).sum())
        return AnswerFigures(len(seconds), period, median, p99, worst, float(seconds[0]), share, longer)


@configuration
class Timing:
    """Content of timing.json."""

    plans_take: PlansTake
    vehicles: dict[str, dict[str, AnswerFigures]]  # by vehicle and component

    @staticmethod
    def of(recording: Recording, components: Collection[str], plans_take: PlansTake) -> Timing:
        """Timing of the components of a run; those that gave no answer are left out."""
        return Timing(
            plans_take,
            {
                name: {
                    component: AnswerFigures.of(times)
                    for component, times in agent.answer_times.items()
                    if component in components and times.seconds
                }
                for name, agent in recording.agents.items()
            },
        )


@configuration
class DelaysDocument:
    """Content of delays.json: the simulated time [s] that each answer of a planner took."""

    delays_s: dict[str, tuple[float, ...]]  # by vehicle, one for each request

    def __post_init__(self) -> None:
        for vehicle, delays in self.delays_s.items():
            for number, delay in enumerate(delays):
                if not 0.0 <= delay < math.inf:
                    raise FieldError(f"delays_s.{vehicle}[{number}] = {delay!r}; allowed: a finite time >= 0")


def read_timing(folder: Path) -> Timing | None:
    """Read the timing of a run; None for a run without one. Raises RunFolderError for a broken file."""
    path = folder / TIMING
    if not path.is_file():
        return None
    timing: Timing = files.read_json(path, Timing, RunFolderError)
    return timing


def read_delays(folder: Path) -> Mapping[str, tuple[float, ...]]:
    """Read the delays of a run by vehicle, [s] of each request; RunFolderError for a missing or a broken file."""
    path = folder / DELAYS
    if not path.is_file():
        raise RunFolderError(f"{path} is missing: the plans of this run took the times that it has")
    document: DelaysDocument = files.read_json(path, DelaysDocument, RunFolderError)
    return document.delays_s


def timing_table(timing: Timing) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Headings and rows of a table, a row for each component.

    Of the vehicles of a fleet the one whose component has the largest share is shown, by name.
    """
    busiest: dict[str, tuple[str, AnswerFigures]] = {}
    for vehicle, components in timing.vehicles.items():
        for component, figures in components.items():
            if component not in busiest or figures.period_share > busiest[component][1].period_share:
                busiest[component] = vehicle, figures
    fleet = len(timing.vehicles) > 1
    heads = ("median", "99 %", "worst", "period", "share of it", "overruns")
    return (
        ("wall time of", *(("vehicle",) if fleet else ()), *heads),
        [
            (
                component,
                *((vehicle,) if fleet else ()),
                *map(duration_text, (figures.median_s, figures.p99_s, figures.worst_s, figures.period_s)),
                _percent(figures.period_share),
                str(figures.longer),
            )
            for component, (vehicle, figures) in busiest.items()
        ],
    )


def _percent(share: float) -> str:
    return f"{_digits(100.0 * share)} %" if share >= _LEAST_SHARE else f"< {_digits(100.0 * _LEAST_SHARE)} %"


def slow_components(timing: Timing, *, on_the_whole: bool = False) -> dict[str, str]:
    """Return by how much each component was slower than real time on this machine, in words; others are left out.

    Of a planner one answer that took longer than its period is enough. The others answer many times a second, and a
    busy machine interrupts them now and then: they are slower if they do not keep pace on the whole, and so is a
    planner with ``on_the_whole``.
    """
    words = {}
    for component in dict.fromkeys(name for each in timing.vehicles.values() for name in each):
        found = {name: each[component] for name, each in timing.vehicles.items() if component in each}
        slow = {
            name: figures
            for name, figures in found.items()
            if not figures.keeps_pace or (component == PLANNER and figures.longer and not on_the_whole)
        }
        if not slow:
            continue
        longer, answers = (sum(getattr(each, key) for each in found.values()) for key in ("longer", "answers"))
        worst = max(slow, key=lambda name: slow[name].worst_s)
        of = f" of {worst}" if len(timing.vehicles) > 1 else ""
        of += " (its first)" if slow[worst].worst_s == slow[worst].first_s else ""
        consequence = _CONSEQUENCES[timing.plans_take] if component == PLANNER else ""
        words[component] = (
            f"{longer} of {counted(answers, 'answer')} took longer than the period of "
            f"{duration_text(slow[worst].period_s)}, worst {duration_text(slow[worst].worst_s)}{of}{consequence}"
        )
    return words


_CONSEQUENCES = {
    "no time": "; with --latency measured they are flown as late",
    "measured": "; their plans were as late in the run",
    "recorded": "; plans were as late as recorded, whatever these took",
}


def duration_text(seconds: float) -> str:
    """A time [s] with three digits, in s, ms or µs."""
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if seconds * factor >= 0.9995:
            return f"{_digits(seconds * factor)} {unit}"
    return f"{_digits(seconds * 1e6)} µs"


def _digits(value: float) -> str:
    return f"{value:.3g}" if value < 999.5 else f"{value:,.0f}"
