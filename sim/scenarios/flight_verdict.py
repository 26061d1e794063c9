"""Requirements on a certified flight: it arrives by its deadline, and touches nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mathnavi.controllers.flight.certified import Certified
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.interfaces.errors import MissionError
from mathnavi.sim.interfaces.protocols import Planner
from mathnavi.sim.scenarios.requirements import Requirement, evaluate


def longest_flight(duration: float, deadline_factor: float, speed_max: float, most: float) -> float:
    """``duration`` [s] as whole ticks [s]; MissionError where it is more than is logged, ``most`` [s]."""
    ticks = math.ceil(duration / TICK) * TICK
    if ticks > most:
        raise MissionError(
            f"deadline_factor = {deadline_factor:g} at speed_max = {speed_max:g} m/s lets the flight take {ticks:.0f} "
            f"s; allowed: {most:.0f} s, so be sooner or faster"
        )
    return ticks


def due(recording: Recording, name: str, planner: Planner, deadline_factor: float, deadline: float) -> float:
    """The time [s] by which a vehicle must have arrived.

    It counts from the plan that was flown first, which started from the estimate; ``deadline`` [s] is that of the plan
    from the true start, which holds for a planner without a certificate.
    """
    if not isinstance(planner, Certified):
        return deadline
    flown = recording.agents[name].plans[:1]
    return min([*(t + deadline_factor * (plan.t_end - t) for t, plan in flown), 2.0 * deadline])


def verdict(
    summary: Mapping[str, Any], due: float, clearance_min: float, speed_max: float
) -> tuple[dict[str, Any], bool]:
    """The summary of a flight, with what it falls short of, and whether all requirements are met.

    ``due`` [s], ``clearance_min`` [m] and ``speed_max`` [m/s] are the limits.
    """
    in_time = [Requirement("arrival_time_s", most=due)] if summary["arrived"] else []
    safe = Requirement("ground_contacts", most=0), Requirement("min_clearance_m", least=clearance_min)
    requirements = [Requirement("arrived", least=True), *in_time, *safe]
    return evaluate(summary, requirements, reported=[Requirement("speed_max_m_s", most=speed_max)])
