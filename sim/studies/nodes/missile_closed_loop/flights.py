"""The kinds of flights that the study of the missile's closed loop flies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mathnavi.sim.sweep.trial import Trial, trial

CASES = ("SM", "SM2", "SM3", "FAST")
VEHICLE = "missile"
ONCE = 1e3  # [s] replan period: one plan is flown to its end
HEAVIER = {"mismatch.mass": 1.1, "mismatch.inertia": 1.1}
ROUGH = {**HEAVIER, "mismatch.force": 0.95, "gust.force": (400.0, 0.0, 0.0), "gust.torque": (0.0, 20.0, 0.0)}
NOISY = {"noise.position": 1.0, "noise.velocity": 0.5, "noise.angle": 0.5, "noise.rate": 0.5}
AUTOPILOTS = {"open-loop": "#6b7785", "feedback-linearisation": "#c2183b", "tvlqr": "#1b7fbd"}


@dataclass(frozen=True)
class Kind:
    """Flights of one kind: the same fields over cases or seeds."""

    name: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    autopilot: str = "feedback-linearisation"
    period: float | None = ONCE  # [s] None: the planner's own
    estimator: str = "full_state"
    seeded: bool = False  # flown over seeds, in the case SM; otherwise once in every case

    def trials(self, cases: int, seeds: int) -> list[Trial]:
        flights = [("SM", seed) for seed in range(seeds)] if self.seeded else [(case, 0) for case in CASES[:cases]]
        planner: dict[str, Any] = {"planner.autopilot": self.autopilot}
        if self.period is not None:
            planner["planner.replan_period"] = self.period
        return [
            trial("missile-guidance", seed, estimator=self.estimator, fields={"case": case, **planner, **self.fields})
            for case, seed in flights
        ]


def _each(name: str, fields: Mapping[str, Any]) -> tuple[Kind, ...]:
    return tuple(Kind(f"{name}, {autopilot}", fields, autopilot) for autopilot in AUTOPILOTS)


OPEN_LOOP = Kind("as modelled, open-loop, 1 kHz", {"control_rate": 1000.0}, "open-loop")
HEAVIER_KINDS, ROUGH_KINDS = _each("mass and inertia +10 %", HEAVIER), _each("and force -5 %, gust", ROUGH)
APPROACHING = Kind("target at +30 m/s", {"target_velocity": (30.0, 0.0, 0.0)}, period=None)
RECEDING = Kind("target at -30 m/s", {"target_velocity": (-30.0, 0.0, 0.0)}, period=None)
ACROSS = {"dimension": "spatial", "target": (700.0, 150.0, 0.0)}
TURNED = {"dimension": "spatial", "start_heading": 40.0}
JOINT = {"planner.spatial": "joint"}
DECOUPLED = {  # pitch and yaw planners together, and the same flight as one problem in all states
    "target 150 m aside": (
        Kind("in space, target 150 m aside", ACROSS, period=None),
        Kind("in space, target 150 m aside, one problem", {**ACROSS, **JOINT}, period=None),
    ),
    "40° off": (
        Kind("in space, 40° off", TURNED, period=None),
        Kind("in space, 40° off, one problem", {**TURNED, **JOINT}, period=None),
    ),
}
WITHOUT_LEAD = Kind("target at +30 m/s, without lead", {**APPROACHING.fields, "planner.lead": False}, period=None)
CLAIMED = (OPEN_LOOP, *HEAVIER_KINDS, *ROUGH_KINDS, APPROACHING, RECEDING, WITHOUT_LEAD)  # what the claims are about
KINDS = (
    OPEN_LOOP,
    *HEAVIER_KINDS,
    *ROUGH_KINDS,
    Kind("the same, planned again", ROUGH, period=None),
    APPROACHING,
    RECEDING,
    WITHOUT_LEAD,
    Kind("target turns at 2 s, announced .5 s late",
         {"target_change": ((2.0, 20.0, 0.0, 0.0),), "target_announcement_delay": 0.5}, period=None),
    Kind("normal force limited to 2.5 kN", {"actuator.normal": 2500.0}, period=None),
    Kind("target 4 km away", {"target": (4000.0, 0.0, 0.0)}, period=None),
    Kind("thrusters 20 ms late, which is not declared", {"actuator.delay": 0.02, "actuator.declared_delay": 0.0},
         period=None),
    Kind("thrusters 150 ms late", {"actuator.delay": 0.15}, period=None),
    Kind("thrusters 150 ms late, 120 ms declared", {"actuator.delay": 0.15, "actuator.declared_delay": 0.12},
         period=None),
    Kind("noise, raw", NOISY, period=None, seeded=True),
    Kind("noise, missile_kalman", NOISY, period=None, estimator="missile_kalman", seeded=True),
    Kind("noise, rough, missile_kalman", {**NOISY, **ROUGH}, period=None, estimator="missile_kalman", seeded=True),
    Kind("in space, 20° off, target at 30 m/s across, rough",
         {**ROUGH, "dimension": "spatial", "start_heading": 20.0, "target_velocity": (0.0, 30.0, 0.0)}, period=None),
    *(kind for pair in DECOUPLED.values() for kind in pair),
    Kind("30 % of the solves fail, rough", {**ROUGH, "faults.solver_failure_rate": 0.3}, period=None, seeded=True),
)  # fmt: skip


def selected_kinds(others: int, pairs: int) -> tuple[Kind, ...]:
    """Kinds of flights that the claims need, with so many of the pairs of ``DECOUPLED``, and so many of the others."""
    paired = [kind for pair in DECOUPLED.values() for kind in pair]
    rest = [kind for kind in KINDS if kind not in CLAIMED and kind not in paired]
    asked = (*CLAIMED, *paired[: 2 * pairs], *rest[:others])
    return tuple(kind for kind in KINDS if kind in asked)


OTHERS, PAIRS = len(KINDS) - len(CLAIMED) - 2 * len(DECOUPLED), len(DECOUPLED)
