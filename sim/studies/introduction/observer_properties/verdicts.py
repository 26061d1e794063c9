"""Verdicts on whether an estimator keeps what it declares in the terms of Table 2.1 of the thesis, judged by its runs.

Runs can refute a promise, and cannot prove one: global attraction is refuted by one start from which nothing is found,
and the weakest entries, an operation that is nowhere restricted or a system that is to stay near a state, by none. What
an estimator says that it does *not* do, to converge under every input for one, has to be seen not to happen.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mathnavi.sim.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.introduction.observer_properties.measures import Decay

STAYS = 1e-3  # in the units of the state: largest error within a second of what starts on the truth and stays there
MOST = 0.9  # of the starts nearby, from which a local observer converges
CLOSE = 2.0  # times its start, that the error of an observer of local operation keeps below
RATES = {
    Decay.NONE: Rate.NONE,
    Decay.ASYMPTOTIC: Rate.ASYMPTOTIC,
    Decay.EXPONENTIAL: Rate.EXPONENTIAL,
    Decay.FINITE_TIME: Rate.FINITE_TIME,
}


@dataclass(frozen=True)
class PropertyVerdict:
    """An entry of Table 2.1 for one estimator, declared and measured."""

    name: str  # of the property
    declared: str
    measured: str
    kept: bool


@dataclass(frozen=True)
class PropertyRuns:
    """The runs of one estimator, none with noise."""

    drifts: Sequence[float]  # the largest error within a second, of runs that start on the truth
    near: Sequence[Record]
    far: Sequence[Record]
    inputs: Mapping[str, Sequence[Record]]  # as near, by the input

    @property
    def drift(self) -> float:
        """The largest error within a second from the truth."""
        return max(self.drifts)

    @property
    def rate(self) -> Rate:
        """The most frequent way in which errors fall from nearby."""
        return RATES[Decay(Counter(int(record.summary["decay"]) for record in self.near).most_common(1)[0][0])]

    @property
    def failing(self) -> list[str]:
        """The inputs under which it does not converge from most of the starts."""
        return [name for name, runs in self.inputs.items() if found(runs).value <= 0.5]

    @property
    def peak(self) -> float:
        """The largest error of a run from nearby over that of its start."""
        return float((figures(self.near, "largest") / figures(self.near, "start")).max())


def found(runs: Sequence[Record]) -> Proportion:
    """The share of runs whose error has gone."""
    return rate(sum(bool(record.summary["found"]) for record in runs), len(runs))


def verdicts(declared: ObserverProperties, e: PropertyRuns, depends: bool) -> list[PropertyVerdict]:
    """Property 2.1 and the entries of Table 2.1, declared beside measured.

    ``depends`` says whether the plug-in has been seen to fail under some input, of this system or of another.
    """
    near, far = found(e.near), found(e.far)
    decays = Counter(RATES[Decay(int(record.summary["decay"]))].value for record in e.near)
    under = ", ".join(f"{name} {found(runs).events}/{found(runs).trials}" for name, runs in e.inputs.items())
    return [
        PropertyVerdict(
            "stays on the truth", "yes" if declared.stays_on_truth else "no",
            f"{e.drift:.1e} off within 1 s, {len(e.drifts)} runs", declared.stays_on_truth is (e.drift <= STAYS),
        ),
        PropertyVerdict(
            "domain of attraction", declared.domain_of_attraction.value,
            f"near {near.text()}; anywhere {far.text()}", _attracts(declared, e),
        ),
        PropertyVerdict(
            "rate", declared.rate.value,
            f"{e.rate.value}: " + ", ".join(f"{name} {count}/{len(e.near)}" for name, count in decays.most_common()),
            _strength(e.rate) >= _strength(declared.rate) if declared.rate is not Rate.NONE
            else e.rate is Rate.NONE,
        ),
        PropertyVerdict(
            "input dependence", declared.input_dependence.value, under,
            depends if declared.input_dependence is InputDependence.NON_UNIFORM else not e.failing,
        ),
        PropertyVerdict(
            "observer's domain of operation", declared.observer_domain.value,
            f"error at most {e.peak:.2g} of its start",
            declared.observer_domain is Domain.GLOBAL or e.peak <= CLOSE,
        ),
        PropertyVerdict(
            "system's domain of operation", declared.system_domain.value, f"near {near.text()}, states from all over",
            declared.system_domain is not Domain.GLOBAL or _attracts(declared, e),
        ),
    ]  # fmt: skip


def _attracts(declared: ObserverProperties, e: PropertyRuns) -> bool:
    """Tell whether starts converge as they should: all for global, most of those nearby for less, few for none.

    What converges from nowhere may come close, if it does not come closer.
    """
    near, far = found(e.near), found(e.far)
    if declared.domain_of_attraction is Domain.GLOBAL:
        return near.events + far.events == near.trials + far.trials
    if declared.domain_of_attraction is Domain.NONE:
        return near.value <= 0.5 or e.rate is Rate.NONE
    return near.value >= MOST


def _strength(rate: Rate) -> int:
    return list(RATES.values()).index(rate)
