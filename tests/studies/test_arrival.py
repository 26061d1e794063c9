"""The study ``arrival`` reports fleets that do not arrive."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from mathnavi.studies.fleet.arrival import NOMINAL, Arrival, ArrivalConfig
from mathnavi.studies.framework.study import Setup


class NobodyArrives(Setup):
    """Every fleet hovers."""

    def fly_groups(self, groups: Any) -> Any:
        summary = dict.fromkeys(
            ("separation_min_m", "min_clearance_m", "separation_allowed_m", "solver_failures", "solve_ms_mean"), 1.0
        )
        summary |= {"arrived": False, "spread_s": None, "arrival_time_s": None, "replans": 1}
        summary |= {"ground_contacts": 0, "plans_not_admitted": 0}
        record = SimpleNamespace(summary=summary, timings={})
        return {key: [record] * len(trials) for key, trials in groups.items()}

    def compute(self, function: Any, arguments: Any, **named: Any) -> Any:
        return [None for _ in arguments]

    def flown(self, missions: Any) -> Any:
        mission = {"vehicles": {"a": {"target": (0.0, 0.0, 0.0)}}}
        recording = SimpleNamespace(t=np.array([0.0, 1.0]), truths={"a": np.zeros((2, 6))})
        return {
            NOMINAL: SimpleNamespace(config={"mission": mission}, recording=recording, summary={"arrival_time_s": None})
        }


def test_fleets_that_do_not_arrive_are_reported() -> None:
    store: Any = None  # nothing is flown
    result = Arrival.run(ArrivalConfig(seeds=1, sizes=1, steps=1, narrow=1), NobodyArrives("plain", store))
    claims = {claim.id: claim for claim in result.claims}
    for name in ("A.consensus-by-A12", "A.constraint", "A.penalty"):
        assert claims[name].measured.startswith("no fleet arrived")
        assert claims[name].holds is False
    assert claims["fleet.spread"].holds is False
