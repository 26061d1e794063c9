"""A safety filter for commands from any source: of those that can be certified, the nearest to the proposed one.

A command u that is proposed at t for a period h is certified if C(pi) holds (``certificate``) for the plan pi that
starts at the estimate x^, holds u for h, and comes to rest on the target by the completion path behind it
(``kernels.stopping``). Then u itself is flown, and pi is stored. Otherwise the nearest of some commands near u that are
certified so; and where none is, the stored plan is tracked, which was certified whole when it was stored: the rule of
gatekeeper (D. Agrawal, R. Chen, D. Panagou, arXiv 2211.14361), of which model predictive shielding is a case. So at
every control step the vehicle is within the tracking bound of a plan that keeps h_min, the bounds and the map to rest.

The guarantee is over what the mission declares, estimates and gusts, and its state that of ``guarantee``, stepped with
every command. It is lost while the estimate is lost or worse than declared, for the stored plan is the best guess of
where the vehicle is; when the vehicle has left the tracking bound and nothing can be certified from where it is; and
before a first command is certified. From the next certified command on it is held.

**Any controller's planner and tracker, flown behind the safety filter**: its commands are filtered, its plans are not
certified.

    planner -> plan -> tracker -> proposed command -> filter -> command

The filter may lead the vehicle off the plan. A planner that starts its plans on the plan being flown would not notice,
so a plan from the estimate is requested where the vehicle is beyond the tracking bound of that plan.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound, remainder
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.guarantee import Evidence, Guarantee, doubt
from mathnavi.controllers.flight.kernels.stopping import Limits, completed, margin_of, nearest
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.boundary import Unusable, answered, guest, locked_plan, own_copy, usable_command
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.kernels import arc_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.tolerances import TIME_TOLERANCE

_ROUNDING = 1e-6  # of a period
_SLOW = 0.05  # bandwidth times period of a tracker on the plan itself, which has nothing to feed back
Flown = Literal["proposed", "nearest", "stored plan"]

CANDIDATES = 32
"""number of commands that are tried near one that cannot be certified"""


@dataclass(frozen=True)
class FilteredCommand:
    """A command, and the reason for it."""

    u: Array  # (nu,) of the actuators; of a point mass the acceleration (3,) [m/s^2]
    flown: Flown
    distance: float  # [m/s^2] of the acceleration that is flown from the proposed one
    reason: str  # why the proposed command is not certified; "" where it is flown
    margin: float  # [m] least clearance beyond h_min and the tracking bound until the plan that is flown has stopped
    announced: str  # why the guarantee is not held; "" while it is
    breach: bool  # True if the vehicle is outside the tracking bound of the plan stored before

    @property
    def intervened(self) -> bool:
        """True if another command than the proposed one is flown."""
        return self.flown != "proposed"

    def info(self) -> dict[str, Any]:
        """The decision as plain values by name."""
        return {
            "intervened": self.intervened,
            "flown": self.flown,
            "reason": self.reason,
            "distance": self.distance,
            "margin": self.margin,
            "guaranteed": not self.announced,
            "announced": self.announced,
            "breach": self.breach,
        }


class CommandFilter:
    """Filter of the commands of one point mass, one command per control period."""

    def __init__(self, mission: FlightMission, tracker: CriticallyDamped, candidates: int = CANDIDATES) -> None:
        """``tracker`` follows the stored plan. With more ``candidates`` a command is changed less, or as much.

        Raises ArgumentError if the tracker's bound leaves nothing to fly with, and for fewer than 0 candidates.
        """
        if candidates < 0:
            raise ArgumentError(f"candidates = {candidates!r}; allowed: a whole number >= 0")
        self.period = self.hold = tracker.period
        """time between two steps [s], for which a command is held"""
        self.bound = tracker.bound
        self.stored: Plan | None = None
        """plan that is flown unless a command is certified; None before the first step"""
        self._tracker, self._candidates = tracker, candidates
        self._certificate = Certificate.for_mission(mission, tracker.bound, tracker.held)
        self._limits = _limits(self._certificate, tracker.period)
        self._worst = mission.quality.worst(mission.gust)
        x, y, z = mission.target
        lowest = float(self._certificate.terrain.height(x, y)) + mission.clearance_min
        if not z >= lowest:  # NaN off the map
            raise ArgumentError(
                f"target = {mission.target!r}; allowed: a place on the map with z >= {lowest:.1f} m, what the least "
                "clearance and the tracking bound leave"
            )
        self._margins: Array | None = None  # (K,) [m] of the stored plan's arcs, once they are needed
        self._first = np.nan  # [m] margin of the stored plan at its start, where it is known
        self._certified = False  # True if the stored plan is
        self._t = -np.inf  # [s] of the last step
        self.guarantee = Guarantee()
        """guarantee, as of the last step"""
        self.evidence = Evidence()
        """evidence of the last step"""

    @staticmethod
    def for_mission(mission: FlightMission, bandwidth: float = FlightConfig.bandwidth) -> CommandFilter:
        """Build the filter of a mission with the tracker of the controller ``flight``; errors as of ``__init__``."""
        bound = tracking_bound(bandwidth, mission)
        return CommandFilter(mission, CriticallyDamped(mission.control_period, bandwidth, bound))

    def updated_with(self, messages: Sequence[Message]) -> None:
        """Update target and map from ``messages`` (``models.aerial.knowledge``)."""
        certificate = self._certificate.updated_with(messages)
        if certificate is self._certificate:
            return
        self._certificate, self._limits = certificate, _limits(certificate, self.period)
        if self.stored is not None:
            self._margins, self._first = None, np.nan
            ahead = remainder(self.stored, self._t)
            self._certified = self._certified and certificate.check_clearance(ahead) is None

    def step(self, t: float, estimate: Estimate, proposed: Array) -> FilteredCommand:
        """The command (3,) [m/s^2] to hold for a period from t [s] on, in place of a proposed one (3,).

        ArgumentError for arrays of another shape, and for a t that is not one period after the last.
        """
        x, u = estimate.x, np.asarray(proposed, dtype=np.float64)
        for name, value, shape in (("state", x, (6,)), ("proposed command", u, (3,))):
            if value.shape != shape:
                raise ArgumentError(f"the {name} has shape {value.shape}; allowed: {shape}")
        next_t = self._t + self.period
        if np.isfinite(self._t) and not abs(t - next_t) <= _ROUNDING * self.period:
            raise ArgumentError(
                f"t = {t!r} s; allowed: {next_t!r} s, a period of {self.period:.6g} s after the last step"
            )
        self._t = t
        answer, self.evidence = self._decided(t, estimate, x, u)
        self.guarantee.step(self.evidence)
        return dataclasses.replace(answer, announced=self.guarantee.announced)

    def _decided(self, t: float, estimate: Estimate, x: Array, u: Array) -> tuple[FilteredCommand, Evidence]:
        """The command in place of u (3,), and what it says of the guarantee."""
        finite = bool(np.isfinite(x).all())
        unsure = self.doubt(estimate) if finite else "the estimate is not finite"
        outside = "" if self.stored is None or not finite else self.bound.how_far(x - state_at(self.stored, t))
        if unsure:
            if self.stored is None:
                self._recover(t, x)
            return self._tracked(t, estimate, u, unsure, outside), self.guarantee.doubted(estimate, unsure)
        # A command that is certified is so from the estimate, wherever the stored plan leads.
        fast = self._certificate.speeding(x, self.bound)
        reason = "" if np.isfinite(u).all() else "it is not finite"
        if reason and not (self._certified and not outside):  # nothing is proposed, and no plan may be flown on
            u = np.zeros(3)
        reason = reason or self._adopt(x, u)
        if not reason:
            answer = FilteredCommand(u, "proposed", 0.0, "", self._margin(t), "", bool(outside))
            return answer, Evidence(fast=fast)
        nearest_command = self._nearest(t, estimate, u) if np.isfinite(u).all() else None
        if nearest_command is not None:
            distance = float(np.linalg.norm(nearest_command - u))
            answer = FilteredCommand(nearest_command, "nearest", distance, reason, self._margin(t), "", bool(outside))
            return answer, Evidence(fast=fast)
        uncertified = "" if self._certified and not outside else f"no command is certified: {reason}"
        if self.stored is None or outside:
            self._recover(t, x)
        return self._tracked(t, estimate, u, reason, outside), Evidence(uncertified=uncertified, fast=fast)

    def doubt(self, estimate: Estimate) -> str:
        """Reason why an estimate cannot be relied on; "" if it can."""
        return doubt(estimate, self._worst)

    def _adopt(self, x: Array, u: Array) -> str:
        """Store the plan behind a command (3,) if it is certified, and return ""; else return the reason why not."""
        margin, climb = margin_of(self._limits, x, u)
        if margin < 0.0:
            allowed = f"{self._certificate.speed_max:.2f} m/s and {self._certificate.acceleration_max:.2f} m/s^2"
            return f"{-margin:.3g} m too near to stop" if np.isfinite(margin) else f"beyond {allowed}"
        plan = Plan(*completed(self._limits, self._certificate.target, self._t, x, u, climb))
        if not len(plan.u):
            return "the vehicle stops off the map"
        refusal = self._certificate.check(plan)
        if refusal is not None:
            return refusal.message
        self._store(plan, certified=True)
        self._first = margin
        return ""

    def _nearest(self, t: float, estimate: Estimate, u: Array) -> Array | None:
        """The nearest certified command to u (3,) of those that are tried, whose plan is stored then."""
        stored = u if self.stored is None else self._command(t, estimate, self.stored)
        found = nearest(self._limits, estimate.x, u, stored, self._candidates)
        for k in np.argsort(np.linalg.norm(found - u, axis=1), kind="stable"):
            if not self._adopt(estimate.x, found[k]):
                command: Array = found[k]
                return command
        return None

    def _tracked(self, t: float, estimate: Estimate, proposed: Array, reason: str, outside: str) -> FilteredCommand:
        """Track the stored plan."""
        assert self.stored is not None
        u = self._command(t, estimate, self.stored)
        distance = float(np.linalg.norm(u - proposed))
        return FilteredCommand(u, "stored plan", distance, reason, self._margin(t), "", bool(outside))

    def _command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The tracker's command (3,), without feedback where the estimate is not finite."""
        if not np.isfinite(estimate.x).all():
            estimate = Estimate(t, state_at(plan, t))
        return self._tracker.command(t, estimate, plan)

    def _recover(self, t: float, x: Array) -> None:
        """Store a plan that stops at once, uncertified, if it has more clearance than the rest of the stored one."""
        if not np.isfinite(x).all():
            raise ArgumentError(f"the first state = {x.tolist()}; allowed: finite numbers")
        speed, a_max = float(np.linalg.norm(x[3:])), self._certificate.acceleration_max
        duration = max(speed / a_max, self.period)
        braking = -x[3:] / duration
        climb = margin_of(self._limits, x, braking)[1]
        plan = Plan(*completed(self._limits, self._certificate.target, t, x, braking, climb))
        if not len(plan.u):  # off the map
            arcs = ArcList.begin(t, x)
            arcs.add(braking, duration, FlightPhase.MANOEUVRE)
            arcs.rest()
            plan = arcs.plan(np.nan, np.nan)
        if self.stored is not None:
            present = self._certificate.clearances(remainder(self.stored, t))
            if not self._certificate.clearances(plan).min() > present.min():
                return
        self._store(plan, certified=False)

    def _store(self, plan: Plan, *, certified: bool) -> None:
        self.stored, self._certified = plan, certified
        self._margins, self._first = None, np.nan

    def _margin(self, t: float) -> float:
        """Least margin [m] of the stored plan from t [s] until it has stopped, of the present arc once it has."""
        assert self.stored is not None
        if t <= self.stored.t_start and not np.isnan(self._first):
            return self._first
        if self._margins is None:
            self._margins = self._certificate.clearances(self.stored) - self._certificate.clearance_min
        arc = min(max(arc_at(self.stored.t, t), 0), len(self._margins) - 1)
        stopped = int((self.stored.phase <= FlightPhase.MANOEUVRE).sum())
        return float(self._margins[arc : max(arc + 1, stopped)].min())


class TrackedCommandFilter:
    """Filter of the accelerations that a tracker flies with other actuators, for instance the rotors of a quadrotor.

    An acceleration is proposed for ``hold`` [s], which the tracker's bound takes as the time between plans, and starts
    on the plan being flown: the vehicle cannot jump onto its estimate. In between the tracker follows the plan.
    """

    def __init__(self, mission: FlightMission, tracker: Any, hold: float) -> None:
        """``mission`` is that of the point mass that ``tracker``, which states its ``bound``, keeps the vehicle near.

        Raises ValueError if the bound leaves nothing to fly with.
        """
        self.period, self.hold, self.bound = tracker.period, hold, tracker.bound
        self._tracker = tracker
        self._filter = CommandFilter(mission, CriticallyDamped(hold, _SLOW / hold, tracker.bound))
        self.guarantee = Guarantee()
        """guarantee, as of the last step"""
        self._decided: FilteredCommand | None = None
        self._next = -np.inf  # [s] at which a proposal is taken up

    def step(self, t: float, estimate: Estimate, proposed: Array) -> FilteredCommand:
        """The input (nu,) of the actuators from t [s] on; ``proposed`` (3,) [m/s^2] is taken up once a ``hold``.

        Raises ValueError as ``CommandFilter.step`` and the tracker do.
        """
        stored, inner = self._filter.stored, self._filter
        outside = "" if stored is None else self.bound.how_far(estimate.x - state_at(stored, t))
        if self._decided is None or t >= self._next - TIME_TOLERANCE:
            x = estimate.x if stored is None or outside else state_at(stored, t)
            self._decided = inner.step(t, dataclasses.replace(estimate, x=x), proposed)
            self._next, stored = t + self.hold, inner.stored
            evidence, outside = inner.evidence, "outside" if self._decided.breach else ""
        else:
            unsure = inner.doubt(estimate)
            evidence = dataclasses.replace(
                self.guarantee.doubted(estimate, unsure),
                uncertified=inner.evidence.uncertified or ("" if unsure else outside),
                fast=inner.evidence.fast,
            )
        assert stored is not None
        self.guarantee.step(evidence)
        u = self._tracker.command(t, estimate, stored)
        return dataclasses.replace(self._decided, u=u, announced=self.guarantee.announced, breach=bool(outside))


def _limits(certificate: Certificate, period: float) -> Limits:
    return Limits(
        certificate.terrain.z, certificate.terrain.spacing, certificate.clearance_min, certificate.border,
        certificate.speed_max, certificate.acceleration_max, certificate.cruise_level, period,
    )  # fmt: skip


_NO_COMMAND = np.full(3, np.nan)


class FilteredTracker:
    """Tracker whose commands are filtered; one that raises, or has no plan to track, proposes nothing."""

    without_plan = True
    """it is called at every control step, with a plan or without"""

    def __init__(self, tracker: Tracker, command_filter: CommandFilter) -> None:
        self.period, self.bound = command_filter.period, command_filter.bound
        self._tracker, self._filter, self._guest = tracker, command_filter, guest(tracker)
        self._proposed, self._next = _NO_COMMAND, -np.inf  # the command held, and when the next is due [s]
        self._steps = self._interventions = 0
        self._least = np.inf  # [m] margin so far
        self._usable, self._breach = True, False
        self._events: list[tuple[str, str]] = []

    def command(self, t: float, estimate: Estimate, plan: Plan | None) -> Array:
        """The filtered command (3,) [m/s^2] to hold from t [s] on."""
        if t >= self._next - TIME_TOLERANCE:
            self._proposed, self._next = self._asked(t, estimate, plan), t + self._tracker.period
        answer = self._filter.step(t, estimate, self._proposed)
        self._steps += 1
        self._interventions += answer.intervened
        self._least = min(self._least, answer.margin)
        if answer.breach and not self._breach:
            self._events.append(("tracking-breach", "of the plan behind the filtered commands"))
        self._breach = answer.breach
        return answer.u

    def events(self) -> Sequence[tuple[str, str]]:
        """Kind and message of the events since the last call."""
        events, self._events = self._events, []
        return [*events, *self._filter.guarantee.events()]

    def figures(self) -> dict[str, Any]:
        """Figures of a run: the share of commands that were changed, and the least margin [m]."""
        share = self._interventions / self._steps if self._steps else 0.0
        return {"filtered_share": share, "filter_margin_min_m": self._least if self._steps else None}

    def _asked(self, t: float, estimate: Estimate, plan: Plan | None) -> Array:
        """The command (3,) that the tracker proposes; NaN if none exists."""
        if plan is None:
            return _NO_COMMAND
        if self._guest:
            estimate, plan = own_copy(estimate), locked_plan(plan)
        answer = answered(lambda: self._tracker.command(t, estimate, plan))
        command = answer if isinstance(answer, Unusable) else usable_command(answer, (3,))
        usable, before = not isinstance(command, Unusable), self._usable
        self._usable = usable
        if isinstance(command, Unusable):
            if before:
                self._events.append(("command-unusable", f"{command.reason}; nothing is proposed"))
            return _NO_COMMAND
        return command


class FilteredPlanner:
    """Planner that plans from the estimate where the filter has led the vehicle off its plan."""

    def __init__(self, planner: Planner, bound: TrackingBound, command_filter: CommandFilter) -> None:
        """``bound`` is that of the planner's own tracker."""
        self.period, self.wrapped = planner.period, planner
        self._bound, self._filter = bound, command_filter

    def plan(self, request: PlanRequest) -> Plan:
        """Return the planner's plan."""
        self._filter.updated_with(request.messages)
        current = request.current
        if current is None or not self._bound.broken_by(request.estimate.x - state_at(current, request.t)):
            return self.wrapped.plan(request)
        return self.wrapped.plan(dataclasses.replace(request, t_start=request.t, current=None))

    def monitor(self, request: PlanRequest) -> Plan | None:
        """Pass messages that arrive between two planning instants on to the planner."""
        self._filter.updated_with(request.messages)
        monitor = getattr(self.wrapped, "monitor", None)
        answer: Plan | None = None if monitor is None else monitor(request)
        return answer


def filtered(planner: Planner, tracker: Any, command_filter: CommandFilter) -> tuple[FilteredPlanner, FilteredTracker]:
    """Wrap planner and tracker of a controller with the filter; ``tracker`` states its ``bound``."""
    return FilteredPlanner(planner, tracker.bound, command_filter), FilteredTracker(tracker, command_filter)
