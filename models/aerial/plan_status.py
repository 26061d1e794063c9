"""Reasons of a flight's certificate for refusing a plan, and the phases of a flight."""

from __future__ import annotations

from enum import Enum, IntEnum


class FlightStatus(Enum):
    """Reason for refusing a flight plan; the value is the message for the user."""

    WRONG_START = "the plan does not start on the plan that is being flown"
    LOW_CLEARANCE = "the plan comes closer to the ground than allowed"
    OFF_MAP = "the plan leaves the map"
    BOUNDS = "the plan exceeds the speed or acceleration bound"
    NOT_TRACKABLE = "the plan changes faster than the tracker can follow within its bound"
    DEADLINE = "the plan ends after the deadline"
    NO_ARRIVAL = "the plan does not come to rest at the target"


class FlightPhase(IntEnum):
    """Phase of an arc of a flight plan: the optimised part, the safety manoeuvre, the completion path (A.4)."""

    OPTIMISED = 0
    MANOEUVRE = 1
    HOVER = 2
    CLIMB = 3
    CRUISE = 4
    DESCENT = 5
