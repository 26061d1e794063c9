"""Two rules that keep the plans of a fleet apart, on the same missions: agreement, and the delay check of RMADER.

The vehicles swap places: they start on a ring above a canyon, each opposite to its slot. Planner, certificate, zones
and network are the same, only the rule differs. Messages are delayed by as much as in the paper (0 to 300 ms), by more
than the delay check allows, lost, or cut off. The waiting time delta_DC of the delay check is tuned on other seeds: of
the values with which the fewest fleets come too close at 300 ms, the one with the earliest arrival.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.fleet import arrival_time
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.fleet.arrival import swapping
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult

GROUND = "canyon:5"
RING, UNEVEN, HEIGHT = 250.0, 0.02, 60.0  # [m] of the starts, drawn by so large a share, and [m] above the ground
LIMITS: Mapping[str, Any] = {
    **{"speed_max": 15.0, "acceleration_max": 6.0, "clearance_min": 10.0, "separation": 10.0, "slot_spacing": 20.0},
    **{"arrival_radius": 3.0, "planner.margin": 3.0},
}
OURS, THEIRS = "agreement", "delay_check"
LABELS = {OURS: "agreement", THEIRS: "delay check (RMADER)"}
COLOURS = {OURS: "#0d5fa8", THEIRS: "#d9731a"}
CONDITIONS: Mapping[str, Mapping[str, Any]] = {
    "300 ms": {"radio.delay": (0.3, 0.3)},
    "delays of 0 to 3 s": {"radio.delay": (0.0, 3.0)},
    "cut in two for 30 s": {"radio.partition": (3.0, 33.0)},
    "no delay": {},
    "100 ms": {"radio.delay": (0.1, 0.1)},
    "200 ms": {"radio.delay": (0.2, 0.2)},
    "300 ms, 30 % loss": {"radio.delay": (0.3, 0.3), "radio.loss": 0.3},
    "300 ms, 90 % loss": {"radio.delay": (0.3, 0.3), "radio.loss": 0.9},
}
DECLARED = ("no delay", "100 ms", "200 ms", "300 ms")  # conditions under which the delay check has a guarantee
TUNED_AT = "300 ms"
CHECKS = (0.5, 0.35, 0.75, 1.0)  # [s] values of delta_DC that are tried
TUNING_SEED = 1000  # the first of the tuning
STANDING = 0.05  # of v_max: slower is to stand still


@configuration
class FleetPeersConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 5
    """number of fleets of each size, in each condition, under each rule"""
    vehicles: Annotated[int, Interval(ge=2, le=32)] = 10
    """number of vehicles of the smallest fleet"""
    sizes: Annotated[int, Interval(ge=1, le=2)] = 2
    """number of sizes of fleets: the smallest, and one with twice as many vehicles"""
    conditions: Annotated[int, Interval(ge=1, le=len(CONDITIONS))] = len(CONDITIONS)
    """number of conditions of the network"""
    tuning: Count = 3
    """number of fleets on which the delay check is tuned"""
    checks: Annotated[int, Interval(ge=1, le=len(CHECKS))] = len(CHECKS)
    """number of values of delta_DC that are tried"""


class FleetPeers:
    """Fleets that swap places, kept apart by agreement and by the delay check of RMADER (A.8)."""

    Config = FleetPeersConfig
    quick = FleetPeersConfig(seeds=2, sizes=1, conditions=3, tuning=1, checks=2)
    title = "Rules of separation of fleets"
    on_terrain = False

    @staticmethod
    def run(config: FleetPeersConfig, setup: Setup) -> StudyResult:
        sizes = [config.vehicles * 2**k for k in range(config.sizes)]
        checks = CHECKS[: config.checks]
        tuned = setup.fly_groups({
            check: [
                fleet(sizes[0], TUNING_SEED + k, CONDITIONS[TUNED_AT], THEIRS, check) for k in range(config.tuning)
            ]
            for check in checks
        })  # fmt: skip
        check = best_check(tuned)
        groups = setup.fly_groups({
            (size, condition, rule): [fleet(size, seed, fields, rule, check) for seed in range(config.seeds)]
            for size in sizes
            for condition, fields in list(CONDITIONS.items())[: config.conditions]
            for rule in (OURS, THEIRS)
        })  # fmt: skip
        rows = [_row(*key, records) for key, records in groups.items()]
        tuning_rows = [{"delta_dc_s": value, **_figures(records)} for value, records in tuned.items()]
        return StudyResult(
            summary=(
                f"{config.seeds} fleets of each size that swap places above {GROUND}, "
                f"{sum(map(len, groups.values()))} flights in all, the same under both rules. delta_DC = {check:g} s, "
                f"tuned on {config.tuning} other fleets at {TUNED_AT}. Standing still: slower than {STANDING:.0%} of "
                "v_max between the start and the arrival.",
            ),
            rows=[*rows, *tuning_rows],
            tables=(_table(rows), _tuning_table(tuning_rows)),
            figure=_figure(groups),
            caption="(a) Least distance of any two vehicles over what they are to keep; dashed, what is required. "
            "(b) Arrival of the last vehicle.",
            claims=[claim(groups)],
        )


def fleet(vehicles: int, seed: int, fields: Mapping[str, Any], rule: str, check: float) -> Trial:
    """Return the trial of one fleet that swaps places; ``check`` [s] is delta_DC, used by the delay check only."""
    rings = RING * (1.0 + UNEVEN * np.random.default_rng(seed).uniform(-1.0, 1.0, vehicles))
    fields = {**LIMITS, **swapping(GROUND, vehicles, rings, HEIGHT), **fields, "separation_rule": rule}
    if rule == THEIRS:
        fields["delay_check"] = check
    return trial("simultaneous-arrival", seed, fields=fields, measure=f"{__name__}:standing")


def standing(outcome: RunData) -> dict[str, float]:
    """A measure: stops of all vehicles, and the mean time [s] that one stands still between start and arrival."""
    mission, t = outcome.config["mission"], outcome.recording.t
    stops, seconds = 0, 0.0
    for name, vehicle in mission["vehicles"].items():
        x = outcome.recording.truths[name]
        arrival = arrival_time(t, x, np.array(vehicle["target"]), mission["arrival_radius"])
        slow = np.linalg.norm(x[:, 3:6], axis=1) < STANDING * mission["speed_max"]
        slow &= np.logical_or.accumulate(~slow)  # from when it first moves
        slow &= ~(t >= arrival)
        stops += int(np.count_nonzero(slow[1:] & ~slow[:-1]))
        seconds += float(np.diff(t)[slow[:-1]].sum())
    return {"stops": stops, "standing_s": seconds / len(mission["vehicles"])}


def best_check(tuned: Mapping[float, Sequence[Record]]) -> float:
    """Return delta_DC [s] with the earliest mean arrival, of those with the fewest fleets that came too close."""
    return min(tuned, key=lambda check: (_close(tuned[check]), _mean(tuned[check], "arrival_time_s"), check))


def claim(groups: Mapping[tuple[int, str, str], Sequence[Record]]) -> Claim:
    """Evaluate the claim that agreement keeps vehicles apart in any network; report what the delay check does."""
    ours = [record for (_, _, rule), group in groups.items() for record in group if rule == OURS]
    declared, beyond = (
        [
            record
            for (_, condition, rule), group in groups.items()
            for record in group
            if rule == THEIRS and (condition in DECLARED) is within
        ]
        for within in (True, False)
    )
    first = [(key, group) for key, group in groups.items() if key[1] in DECLARED]
    times = {
        rule: _mean([record for key, group in first if key[2] == rule for record in group], "arrival_time_s")
        for rule in (OURS, THEIRS)
    }
    contacts = int(figures(ours, "ground_contacts").sum())
    return Claim(
        "fleet.peers", "target", "Fleets that swap places keep apart, whatever the delay or the loss of messages.",
        "A.8", "by agreement: no contact and no pair closer than the zone, whatever becomes of the messages; by the "
        "delay check of RMADER on the same missions: as measured",
        f"by agreement {_close(ours)} of {len(ours)} fleets too close, {contacts} contacts; by the delay check "
        f"{_close(declared)} of {len(declared)} at delays up to 300 ms, {_close(beyond)} of {len(beyond)} at longer "
        f"ones, loss and a cut; last arrival at delays up to 300 ms {times[OURS]:.1f} s by agreement, "
        f"{times[THEIRS]:.1f} s by the delay check",
        _close(ours) == 0 and contacts == 0,
    )  # fmt: skip


def _close(records: Sequence[Record]) -> int:
    """Count the fleets in which two vehicles came closer than allowed."""
    if not records:
        return 0
    return int((figures(records, "separation_min_m") < figures(records, "separation_allowed_m")).sum())


def _mean(records: Sequence[Record], key: str) -> float:
    """Return the mean of a figure; infinity if a fleet lacks it, as one that did not arrive lacks a time of arrival."""
    values = [record.summary[key] for record in records]
    return float("inf") if any(value is None for value in values) else float(np.mean(values))


def _figures(records: Sequence[Record]) -> dict[str, Any]:
    least = figures(records, "separation_min_m") / figures(records, "separation_allowed_m")
    return {
        "fleets": len(records),
        "arrived": int(figures(records, "arrived").sum()),
        "too_close": _close(records),
        "separation_over_allowed": float(least.min()),
        "contacts": int(figures(records, "ground_contacts").sum()),
        "arrival_time_s": _mean(records, "arrival_time_s"),
        "stops": float(figures(records, "stops").mean()),
        "standing_s": float(figures(records, "standing_s").mean()),
        "plans_adopted": float(figures(records, "plans_adopted").mean()),
    }


def _row(vehicles: int, condition: str, rule: str, records: Sequence[Record]) -> dict[str, Any]:
    return {"vehicles": vehicles, "network": condition, "rule": rule, **_figures(records)}


_COLUMNS = (
    ("all arrived", "{arrived} of {fleets}"), ("too close", "too_close"),
    ("least separation over required", "{separation_over_allowed:.3f}"), ("contacts", "contacts"),
    ("last arrival [s]", "{arrival_time_s:.1f}"), ("stops of a fleet", "{stops:.1f}"),
    ("standing [s]", "{standing_s:.1f}"), ("plans adopted", "{plans_adopted:.0f}"),
)  # fmt: skip


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    fleets = (("vehicles", "vehicles"), ("network", "network"), ("rule", lambda row: LABELS[row["rule"]]))
    return Table.of("Fleets that swap places", rows, (*fleets, *_COLUMNS))


def _tuning_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table.of("The delay check, tuned on other fleets", rows, (("delta_DC [s]", "{delta_dc_s:g}"), *_COLUMNS))


def _figure(groups: Mapping[tuple[int, str, str], Sequence[Record]]) -> Figure:
    with styled_figure((12.0, 4.6)) as page:
        left, right = page.subplots(1, 2)
        _draw(left, groups, "separation_min_m", "(a) least separation over required", "separation_allowed_m")
        left.axhline(1.0, color=INK, ls="--", lw=1.0)
        _draw(right, groups, "arrival_time_s", "(b) arrival of the last [s]")
        left.legend(loc="best", fontsize=8.0)
    return page


def _draw(
    axes: Axes, groups: Mapping[tuple[int, str, str], Sequence[Record]], key: str, title: str, over: str = ""
) -> None:
    places = list(dict.fromkeys((condition, size) for size, condition, _ in groups))
    drawn: set[str] = set()
    top = 0.0
    for (size, condition, rule), records in groups.items():
        values = np.asarray(figures(records, key), dtype=np.float64)
        values = values / figures(records, over) if over else values
        x = places.index((condition, size)) + (-0.12 if rule == OURS else 0.12)
        label = None if rule in drawn else LABELS[rule]
        drawn.add(rule)
        top = float(np.nanmax(np.append(values, top)))
        axes.plot(np.full(len(values), x), values, "o", ms=5, alpha=0.75, color=COLOURS[rule], label=label)
    axes.set_xticks(
        range(len(places)), [f"{condition}, {size}" for condition, size in places], rotation=30, ha="right", fontsize=8
    )
    axes.set(ylim=(0.0, 1.1 * top), title=title)
