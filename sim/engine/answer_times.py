"""Wall-clock times of the answers of an agent's components, and the simulated delays that are made of them.

A planner that computes for 1.5 s once a second flies in simulated time as well as one that needs a millisecond. So each
answer is timed, by a monotonic clock that stands still while the machine is suspended. These times differ from run to
run and stay out of the log.

``Latency`` makes them part of the simulation: a plan that is requested at t is available at t + delay, with the delay
that was measured, or one that was recorded in an earlier run, which gives the same log again. Requests do not wait for
each other, as if each had its own processor.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mathnavi.interfaces.errors import RunFolderError

ESTIMATOR, PLANNER, MONITOR, TRACKER, COORDINATOR = "estimator", "planner", "monitor", "tracker", "coordinator"
COMPONENTS = (ESTIMATOR, PLANNER, MONITOR, TRACKER, COORDINATOR)


@dataclass
class AnswerTimes:
    """Wall-clock times of the answers of one component; ``period`` is the time from one answer to the next."""

    period: float  # [s]
    seconds: array[float] = field(default_factory=lambda: array("d"))  # [s] of each answer


@dataclass(frozen=True)
class Latency:
    """Simulated time that plans take: what their planners' answers took on this machine, or what was recorded."""

    recorded: Mapping[str, Sequence[float]] | None = None  # [s] by vehicle, one for each request; None: measured

    def delay(self, vehicle: str, request: int, t: float, measured: float) -> float:
        """Return the delay [s] of the answer to a request, counted from 0, that took ``measured`` [s].

        ``t`` [s] is the time of the request. Raises RunFolderError if the recorded run had fewer requests.
        """
        if self.recorded is None:
            return measured
        known = self.recorded.get(vehicle, ())
        if request >= len(known):
            raise RunFolderError(
                f"{vehicle} requests plan {request + 1} at {t:g} s, and the recorded run has the delays of {len(known)}"
            )
        return known[request]
