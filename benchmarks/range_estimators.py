"""Cost of an update of a range estimator: thread CPU time of the bank, of particle filters and of filterpy's filters.

    python -m benchmarks.range_estimators [--seconds 20] [--repetitions 7]

All estimators get the same readings of the same figure of eight, 100 a second, with two sensors and with four. Compiled
estimators run in one compiled loop (``mathnavi.studies.ranging.estimator_runs``): the bank as used in a run, the bank
if no hypothesis were ever dropped, a single filter of it, and 1000 particles. Plug-ins are called as by the closed
loop, reading by reading, Python included; ``range_particle`` adapts its number of particles (KLD sampling). What the
monitor of integrity adds to an update that does not alarm is the ratio to the same update without it, in turns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Interval
from rich.console import Console

from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, Ratio, alone
from benchmarks.progress import progress
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.studies.ranging.estimator_runs import (
    ALL_ALIVE,
    BANK_LOOP,
    EKF_LOOP,
    PARTICLE_LOOP,
    costs,
    monitor_costs,
    read,
)

SENSORS = {"2 rays": "2s", "4 rays": "4"}
CALLED = {"range_ekf": "filterpy EKF", "range_ukf": "filterpy UKF", "range_particle": "AMCL"}
MONITORED = {"3 rays": "3", "8 rays": "8"}
WATCHED = ("range_ekf", "feasible_set_bank", "range_ukf")
AT_MOST = 1.2  # times the update without the monitor
AT_LEAST = 20.0  # times cheaper than the particle filter, both compiled


@configuration
class Arguments:
    """Measure the cost of an update of each range estimator."""

    seconds: Annotated[float, Within(Interval(ge=1.0, le=3600.0), allowed="1 to 3600")] = 20.0
    """duration of the readings [s], 100 a second"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 7
    """number of runs of each estimator"""
    out: Path = Path("renders/out/range_estimators.json")
    """file of the figures"""


@dataclass(frozen=True, eq=False)
class RangeFindings:
    """Times of an update [us] of each range estimator."""

    seconds: float
    taken: Mapping[str, Mapping[str, Array]]  # by sensors and name, (R,)
    watched: Mapping[str, Mapping[str, tuple[Array, Array]]]  # (n,) of each update, with the monitor and without

    @property
    def title(self) -> str:
        return "an update of a range estimator"

    def comparisons(self) -> list[Comparison]:
        ratio_of: Ratio = "other / ours"
        rows = []
        for sensors, taken in self.taken.items():
            for name in (BANK_LOOP, ALL_ALIVE, EKF_LOOP):
                wanted = None if name == EKF_LOOP else AT_LEAST
                rows.append(
                    Comparison(
                        f"{name}, {sensors}", "us", taken[name], taken[PARTICLE_LOOP], PARTICLE_LOOP, ratio_of, wanted
                    )
                )
            for name, software in CALLED.items():
                ours = taken["feasible_set_bank"]
                rows.append(Comparison(f"called, {sensors}", "us", ours, taken[name], software, ratio_of))
        for sensors, watched in self.watched.items():
            for name, (ours, bare) in watched.items():
                what, ratio_of = f"{name} with its monitor, {sensors}", "ours / other"
                rows.append(Comparison(what, "us", ours, bare, "the same without", ratio_of, at_most=AT_MOST))
        return rows

    def show(self, console: Console) -> None:
        for sensors, taken in self.taken.items():
            share = float(np.median(taken[BANK_LOOP] / taken["feasible_set_bank"]))
            console.print(f"{sensors}: {100.0 * share:.0f} % of the plug-in's time is compiled.", highlight=False)

    def plain(self) -> dict[str, Any]:
        return {
            "seconds": self.seconds,
            "update_us": {
                sensors: {name: figures.tolist() for name, figures in taken.items()}
                for sensors, taken in self.taken.items()
            },
        }


def run(arguments: Arguments, console: Console) -> RangeFindings:
    """Run the estimators in turns."""
    taken = {}
    with progress(console, "range estimators", len(SENSORS)) as report:
        for k, (name, sensors) in enumerate(SENSORS.items()):
            readings = read(sensors, arguments.seconds, np.random.default_rng(0))
            taken[name] = costs(readings, arguments.repetitions)
            report(k + 1)
    watched = {
        name: monitor_costs(read(sensors, arguments.seconds, np.random.default_rng(0)), WATCHED)
        for name, sensors in MONITORED.items()
    }
    return RangeFindings(arguments.seconds, taken, watched)


def main(arguments: Arguments) -> None:
    alone("range_estimators", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
