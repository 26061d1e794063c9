"""Holes in the guarantee, for the study ``hunt``: detection in a mission, and four controllers that have one.

A mission shows a hole by a violation that no event announced; ``violations`` returns the first and its time.

Each of the controllers lacks one part of the guarantee. They are addressed as
"mathnavi.studies.flight.guarantee_holes:NoClearanceCheck", and are not installed plug-ins. Otherwise they are the
controller ``flight``: faults act on the planner, before its plans are certified.

    NoClearanceCheck    a plan is flown at any height; the planner keeps its soft clearance at the nodes
    NoStartCheck        a plan is flown from any start; the planner predicts its start at constant velocity
    LatePlansFlown      a plan that is ready after its start is flown from when it is ready
    HalvedBound         plans are certified for half the distance that the tracker can have from them
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations
from typing import Any

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, Refusal, TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.plugin import planner as flight_planner
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Event, Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.quadrotor.entity import REACH
from mathnavi.models.terrain.height_field import HIGHEST, HeightField
from mathnavi.models.terrain.hill import hills_of, with_hills
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.scenarios.closed_loop import RunData

GUARANTEE = "guarantee-"  # begins the kind of an event that announces a state of the guarantee, HELD among others
HELD = "guarantee-held"
UNGUARANTEED = "separation-unguaranteed"
DELAYS = ("deadline-lost", "deadline-moved", "missed-pass", "arrival-lost")
CONTACTS = ("ground-contact", "vehicle-contact")
_ROUNDING = 1e-6  # of a speed, and of an acceleration
ANNOUNCED = 1.0  # the margin of a mission whose violation was announced: of no interest


@dataclass(frozen=True)
class _Found:
    """Least relative margin of one bound, and when and of which vehicles it was."""

    kind: str
    margin: float
    t: float  # [s] of the first violation, or of the least margin
    vehicles: tuple[str, ...]


def violations(outcome: RunData) -> dict[str, Any]:
    """A measure: the least relative margin of a mission, and its first violation.

    ``relative_margin`` is the least of (clearance - h_min) / h_min, (separation - d_s) / d_s, (v_max - speed) / v_max,
    (a_max - |u|) / a_max of commands u, if that is negative, and (deadline - arrival) / deadline, and ``ANNOUNCED`` if
    every violation was announced: a search for a silent violation minimises it. A violation at a hill that no map shows
    yet cannot be announced, and counts as announced. A flight behind the filter promises no deadline.
    """
    found = [_clearance(outcome), *_separation(outcome), *_speed(outcome), *_acceleration(outcome), *_deadline(outcome)]
    margin = min(each.margin for each in found)
    broken = sorted((each for each in found if each.margin < 0.0), key=lambda each: (each.t, each.kind))
    silent = [
        each
        for each in broken
        if not (_announced(each, outcome.events) or (each.kind == "clearance" and _uncharted(outcome, each.t)))
    ]
    first = next(iter(silent or broken), None)
    return {
        "violated": bool(broken),
        "silently_violated": bool(silent),
        "violation": "" if first is None else first.kind,
        "violation_s": None if first is None else first.t,
        "relative_margin": ANNOUNCED if broken and not silent else margin,
    }


def clearance_in_bounds(outcome: RunData) -> dict[str, Any]:
    """A measure: the margin of clearance, in units of the vertical tracking bound that the controller declares."""
    bound = outcome.config["mission"]["tracking_bound"]["vertical"]
    return {"clearance_in_bounds": outcome.summary["clearance_margin_m"] / bound}


def _clearance(outcome: RunData) -> _Found:
    h_min = outcome.config["fields"]["clearance_min"]
    margin = outcome.summary["clearance_margin_m"] / max(h_min, 1.0)
    contacts = [(event.t, event.agent) for event in outcome.events if event.kind in CONTACTS]
    t, name = min(contacts if contacts and margin >= 0.0 else [*contacts, _lowest(outcome, h_min)])
    return _Found("clearance", min(margin, -1.0) if contacts else margin, t, (name,))


def _lowest(outcome: RunData, h_min: float) -> tuple[float, str]:
    """Return the time [s] of the first sample below ``h_min`` [m], or of the lowest one, and of which vehicle."""
    config = outcome.config
    reach = REACH if config["scenario"] == "quadrotor-canyon" else 0.0
    ground = _ground(config["terrain"]["path"], tuple(map(tuple, config["fields"].get("uncharted", ()))), reach)
    t, first, lowest = outcome.recording.t, (math.inf, ""), (math.inf, 0.0, "")
    for name, x in outcome.recording.truths.items():
        above = np.nan_to_num(x[:, 2] - ground.height(x[:, 0], x[:, 1]), nan=-np.inf)  # off the map
        k = int(above.argmin())
        lowest = min(lowest, (float(above[k]), float(t[k]), name))
        if above[k] < h_min:
            first = min(first, (float(t[np.argmax(above < h_min)]), name))
    return first if first[0] < math.inf else lowest[1:]


def _speed(outcome: RunData) -> list[_Found]:
    """Margins of the speeds of point masses and of quadrotors; those of a fleet one by one."""
    most = outcome.config["fields"].get("speed_max")
    if most is None:
        return []
    place = slice(7, 10) if outcome.config["scenario"] == "quadrotor-canyon" else slice(3, 6)
    found = []
    for name, x in outcome.recording.truths.items():
        found.append(_most("speed", np.linalg.norm(x[:, place], axis=1), most, outcome.recording.t, name))
    return found


def _acceleration(outcome: RunData) -> list[_Found]:
    """Margins of the commanded accelerations of point masses that are broken: a planner may use all of a_max."""
    most, recording = outcome.config["fields"].get("acceleration_max"), outcome.recording
    if most is None or outcome.config["scenario"] == "quadrotor-canyon":
        return []
    commands = {name: agent.commands[: recording.length - 1] for name, agent in recording.agents.items()}
    found = [_most("acceleration", np.linalg.norm(u, axis=1), most, recording.t, name) for name, u in commands.items()]
    return [each for each in found if each.margin < 0.0]


def _most(kind: str, figures: Array, most: float, t: Array, name: str) -> _Found:
    """Return the least margin of some ``figures`` (n,) at times t to a greatest value, and when it is first broken."""
    allowed = most * (1.0 + _ROUNDING)
    above = figures > allowed
    k = int(np.argmax(above)) if above.any() else int(figures.argmax())
    return _Found(kind, (allowed - float(figures.max())) / most, float(t[k]), (name,))


@lru_cache(maxsize=8)
def _ground(path: str, hills: tuple[tuple[float, ...], ...], reach: float) -> HeightField:
    ground = with_hills(load_terrain(path), hills_of(hills))
    return ground.inflated(reach, reach) if reach > 0.0 else ground


def _uncharted(outcome: RunData, t: float) -> bool:
    """Return True if at ``t`` [s] there are hills that no map shows yet, and the mapped ground was kept clear."""
    config = outcome.config
    fields = config["fields"]
    if not fields.get("uncharted") or t >= fields["uncharted_time"]:
        return False
    ground, until = _ground(config["terrain"]["path"], (), 0.0), outcome.recording.t <= t
    return all(
        bool((x[until, 2] - ground.height(x[until, 0], x[until, 1]) >= fields["clearance_min"]).all())
        for x in outcome.recording.truths.values()
    )


def _separation(outcome: RunData) -> list[_Found]:
    margin = outcome.summary.get("separation_margin_m")
    if margin is None:
        return []
    least = outcome.summary["separation_allowed_m"]
    truths = outcome.recording.truths
    return [_Found("separation", margin / least, _nearest(outcome.recording.t, truths, least), tuple(truths))]


def _nearest(t: Array, truths: Mapping[str, Array], least: float) -> float:
    """Return the time [s] of the first sample at which two vehicles are nearer than ``least`` [m], or are nearest."""
    distance = np.min(
        [np.linalg.norm(a[:, :3] - b[:, :3], axis=1) for a, b in combinations(truths.values(), 2)], axis=0
    )
    return float(t[np.argmax(distance < least)] if (distance < least).any() else t[distance.argmin()])


def _deadline(outcome: RunData) -> list[_Found]:
    left, deadline = outcome.summary["deadline_left_s"], outcome.summary["deadline_s"]
    promised = left is not None and not outcome.config["fields"].get("filter", False)
    return [_Found("deadline", left / deadline, deadline, tuple(outcome.recording.truths))] if promised else []


def _announced(found: _Found, events: Sequence[Event]) -> bool:
    """Return True if an event until the violation announced the loss of this guarantee, and no later one its return."""
    if found.kind == "deadline" and any(event.kind in DELAYS and event.t < found.t for event in events):
        return True
    apart = found.kind == "separation" and any(event.kind == UNGUARANTEED and event.t <= found.t for event in events)
    return apart or not guaranteed_at(found.t, [event for event in events if event.agent in found.vehicles])


def guaranteed_at(t: float, events: Sequence[Event]) -> bool:
    """Return True if no vehicle had announced by ``t`` [s] that its guarantee is not held, or all that it is again."""
    last = {event.agent: event.kind for event in events if event.kind.startswith(GUARANTEE) and event.t <= t}
    return all(kind == HELD for kind in last.values())


# ---- controllers with a hole

Parts = tuple[Planner, Tracker]


def _certified(
    planner: Planner,
    mission: FlightMission,
    tracker: CriticallyDamped,
    *,
    certificate: type[Certificate] = Certificate,
    kind: type[Certified] = Certified,
) -> Certified:
    """Return the planner behind a certificate, as made by ``Certified.for_mission``, with the given classes."""
    sound = Certificate.for_mission(mission, tracker.bound, tracker.held)
    made = certificate(**{entry.name: getattr(sound, entry.name) for entry in dataclasses.fields(sound)})
    fallback = partial(StopAndHover, period=planner.period)
    worst = mission.quality.worst(mission.gust)
    return kind(planner, fallback, made, tracker.bound, mission.deadline_factor, worst, mission.start_state)


class BlindCertificate(Certificate):
    """Certificate that requires no clearance, only a plan over the map."""

    def check_clearance(self, plan: Plan) -> Refusal | None:
        return Certificate.check_clearance(dataclasses.replace(self, clearance_min=-HIGHEST), plan)


class NoClearanceCheck(FlightController):
    """Controller that flies plans at any height."""

    certifier = partial(_certified, certificate=BlindCertificate)


class ConstantVelocityStart:
    """Planner whose plans start where the vehicle would be at constant velocity."""

    def __init__(self, planner: Planner) -> None:
        self.period = planner.period
        self._planner = planner

    def plan(self, request: PlanRequest) -> Plan:
        """Return the plan from the predicted start."""
        x = request.estimate.x
        start = np.concatenate([x[:3] + (request.t_start - request.t) * x[3:], x[3:]])
        estimate = Estimate(request.t_start, start)
        return self._planner.plan(dataclasses.replace(request, estimate=estimate, current=None))


class CertifiedFromAnywhere(Certified):
    """Certified planner that accepts any start of a plan."""

    def _examined(self, plan: Plan, request: PlanRequest) -> Plan:
        if not plan.ok:
            return plan
        here = Estimate(plan.t_start, plan.x[0])
        return super()._examined(plan, dataclasses.replace(request, estimate=here, current=None))


class NoStartCheck(FlightController):
    """Controller that flies plans from any start."""

    certifier = partial(_certified, kind=CertifiedFromAnywhere)

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        planner, tracker = FlightController.build(config, mission)
        return ConstantVelocityStart(planner), tracker


class CertifiedTooEarly(Certified):
    """Certified planner that certifies plans for the requested start, and delays late ones until they are ready."""

    def plan(self, request: PlanRequest) -> Plan:
        """Return the plan; a late one starts later than it was certified for."""
        plan = super().plan(request)
        late = plan.ready - plan.t_start if plan.ok else 0.0
        return dataclasses.replace(plan, t=plan.t + late) if late > 0.0 else plan


class LatePlansFlown(FlightController):
    """Controller that flies plans that are ready after their start."""

    certifier = partial(_certified, kind=CertifiedTooEarly)


class HalvedBound(FlightController):
    """Controller that certifies plans for half of the tracking bound."""

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        whole = tracking_bound(config.bandwidth, mission)
        held = None if whole.held is None else 0.5 * whole.held
        half = TrackingBound(
            0.5 * whole.horizontal, 0.5 * whole.vertical, 0.5 * whole.speed, 0.5 * whole.feedback, held
        )
        tracker = CriticallyDamped(mission.control_period, config.bandwidth, whole)
        tracker.bound = half
        return flight_planner(config, mission, half), tracker
