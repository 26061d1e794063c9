"""The guarantee of one vehicle as a state machine: not yet, held, endangered, lost.

Every control step ends in one call of ``Guarantee.step`` with the evidence of that step, whatever the plug-ins did. The
first rule of ``RULES`` that applies to the evidence decides the state; a new state is announced by the event
"guarantee-STATE", the first one included. So what is announced follows from the evidence of the present step alone, and
never from what was forgotten to be reset.

While the guarantee is held, the vehicle is within the tracking bound of a plan that is certified whole, and no faster
than v_max. Planner (``certified``) and filter (``command_filter``) share the machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from mathnavi.interfaces.signals import Estimate, Status

_ROUNDING = 1e-3  # share of a declared deviation, and [m, m/s]


class GuaranteeState(Enum):
    """State of a guarantee; the value is part of the event that announces it."""

    NOT_YET = "not-yet"
    HELD = "held"
    ENDANGERED = "endangered"
    LOST = "lost"


@dataclass(frozen=True)
class Evidence:
    """Findings at a control step, each as the reason why it is not as it should be; "" where it is."""

    waiting: str = ""  # the estimator has not begun, and the guarantee neither
    doubt: str = ""  # the estimate cannot be relied on: it is missing, lost, or worse than declared
    untracked: str = ""  # the tracker's command cannot be used, so its bound is not kept
    uncertified: str = ""  # the plan that is flown from now on is not certified over what is known now
    outside: str = ""  # the vehicle was outside the tracking bound of its plan: now one from its estimate is flown
    danger: str = ""  # its plan was not safe over a new map: now one that is certified over it is flown
    fast: str = ""  # the vehicle is faster than v_max, and its plan brakes


NOTHING_WRONG = Evidence()


@dataclass(frozen=True)
class Rule:
    """A state, and the evidence that leads to it from any state."""

    state: GuaranteeState
    when: str  # in words, for the page on guarantees
    reason: Callable[[Evidence], str]  # "" if the rule does not apply


RULES = (
    Rule(GuaranteeState.NOT_YET, "the estimator has not begun, and nothing went wrong before", lambda e: e.waiting),
    Rule(GuaranteeState.LOST, "the estimate is missing, lost, or worse than declared", lambda e: e.doubt),
    Rule(GuaranteeState.LOST, "the tracker's command cannot be used", lambda e: e.untracked),
    Rule(GuaranteeState.LOST, "no certified plan is flown", lambda e: e.uncertified),
    Rule(
        GuaranteeState.ENDANGERED,
        "the vehicle was outside its tracking bound; a certified plan from its estimate takes over at once",
        lambda e: e.outside,
    ),
    Rule(
        GuaranteeState.ENDANGERED,
        "its plan was not safe over a new map; a plan that is certified over it takes over at once",
        lambda e: e.danger,
    ),
    Rule(GuaranteeState.ENDANGERED, "the vehicle is faster than $v_{\\max}$; its plan brakes", lambda e: e.fast),
    Rule(GuaranteeState.HELD, "otherwise", lambda _: "a certified plan is flown within its tracking bound"),
)


def doubt(estimate: Estimate, worst: tuple[float, float]) -> str:
    """Reason why a tracking bound cannot be relied on with an estimate; "" if it can.

    A DEGRADED estimate is judged by its covariance, and without one it cannot be relied on. ``worst`` are the declared
    standard deviations of its position [m] and velocity [m/s], at their worst.
    """
    if not estimate.status.usable or (estimate.covariance is None and estimate.status is not Status.OK):
        return str(estimate.status.value)
    if estimate.x.shape != (6,):
        return f"the estimate's state has shape {estimate.x.shape}; allowed: (6,)"
    gust = estimate.extra.get("gust")
    if gust is not None and not (gust.shape == (3,) and math.isfinite(gust.dot(gust))):
        return f"the estimate's gust is {gust.tolist()}; allowed: three finite numbers"
    if estimate.covariance is None:
        return ""
    if estimate.covariance.shape != (6, 6):
        return f"the estimate's covariance has shape {estimate.covariance.shape}; allowed: (6, 6)"
    variance = estimate.covariance.diagonal().tolist()
    for what, unit, (x, y, z), declared in (
        ("position", "m", variance[:3], worst[0]),
        ("velocity", "m/s", variance[3:], worst[1]),
    ):
        allowed = ((1.0 + _ROUNDING) * declared + _ROUNDING) ** 2
        if not (x <= allowed and y <= allowed and z <= allowed):  # nor is NaN
            deviation = float(np.sqrt(np.max((x, y, z))))
            return f"the estimate's {what} is off by {deviation:.3g} {unit}, one sigma; declared: {declared:.3g}"
    return ""


def _concluded(evidence: Evidence) -> tuple[GuaranteeState, str]:
    """Return the state that the first rule decides that applies to the evidence, and the reason."""
    for rule in RULES[-1:] if evidence is NOTHING_WRONG else RULES:  # the last rule is all that applies to nothing
        reason = rule.reason(evidence)
        if reason:
            return rule.state, reason
    raise RuntimeError("no rule applies")  # the last one always does


class Guarantee:
    """State of the guarantee of one vehicle, and the events that announce it."""

    def __init__(self) -> None:
        self.state: GuaranteeState | None = None
        """state since the last step; None before the first"""
        self.reason = ""
        """reason for the state"""
        self._events: list[tuple[str, str]] = []

    @property
    def held(self) -> bool:
        """True while the guarantee is held."""
        return self.state is GuaranteeState.HELD

    @property
    def begun(self) -> bool:
        """True once the estimator has answered as declared, or something went wrong."""
        return self.state not in (None, GuaranteeState.NOT_YET)

    def step(self, evidence: Evidence) -> GuaranteeState:
        """State that the evidence of a control step leads to."""
        state, reason = _concluded(evidence)
        if state is not self.state:
            self._events.append((f"guarantee-{state.value}", reason))
        self.state, self.reason = state, reason
        return state

    @property
    def announced(self) -> str:
        """Reason why the guarantee is not held; "" while it is."""
        return "" if self.held else self.reason

    def doubted(self, estimate: Estimate, reason: str) -> Evidence:
        """Evidence that an estimate is of which there is a ``doubt``: the guarantee has not begun yet, or is lost."""
        if not reason:
            return NOTHING_WRONG
        begins = estimate.status is Status.INITIALISING and not self.begun
        return Evidence(waiting=reason) if begins else Evidence(doubt=reason)

    def events(self) -> list[tuple[str, str]]:
        """Kind and message of the events since the last call."""
        events, self._events = self._events, []
        return events
