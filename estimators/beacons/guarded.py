"""The monitor of a robot's filter among beacons at known places."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, cast

from scipy.special import chdtri

from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.beacons.witness import RobotBeaconWitness, pace_of
from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.timeout_monitor import worst
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status

_CALM = 32  # readings in sequence that agree with an estimate that is lost
_COST = 3e-4  # [s] of an update that is run again
_SEPARATE, _DOUBTED = float(chdtri(3, 1e-4)), 3.0  # square of a separation that is in doubt, and for how long [s]


class DoubtingFilter(Estimator, Protocol):
    """A filter among beacons that judges all its readings together."""

    model: BeaconModel

    def doubt(self, t: float) -> tuple[Status, str]:
        """Status at t [s] by that, and why."""
        ...

    def separate_again(self) -> None:
        """Begin the filters beside it at its state: those that were led astray say nothing."""
        ...

    def mistrust(self) -> bool:
        """Explain an alarm by the odometry, where that is as likely as any beacon; False where it is not."""
        ...


class GuardedRobot(Guarded):
    """The filter with its monitor.

    What nothing explains is remembered: innovations are small again once the estimate has followed it.
    """

    def __init__(self, made: DoubtingFilter, anywhere: Callable[[], Estimator]) -> None:
        """``anywhere`` makes one that begins anywhere."""
        mission = made.model.mission
        most_out = min(2, max(len(mission.beacons) - 2, 1))
        witness = RobotBeaconWitness(made.model)
        self._separate = -math.inf  # [s] last time when a separation was in doubt
        super().__init__(made, witness, most_out=most_out, cost=_COST, rival=anywhere, pace=pace_of(mission))

    @property
    def _filter(self) -> DoubtingFilter:
        """The filter next to which the monitor is now."""
        return cast(DoubtingFilter, self.estimator)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        estimate = super().update(t, measurements, command)
        now, witness = self._filter, self._now.witness
        assert isinstance(witness, RobotBeaconWitness)
        if self._state is Status.LOST and witness.calm >= _CALM:
            now.separate_again()
            witness.calm = 0
        status, message = now.doubt(t)
        if estimate.extra["separation"].max() > _SEPARATE:
            self._separate = t
        if status is Status.OK and t - self._separate < _DOUBTED:
            status, message = Status.DEGRADED, "differs from what it is without one of its beacons, or of odometry"
        if worst(status, estimate.status) is estimate.status:
            return estimate
        return replace(estimate, status=status, message=message)

    def _alarmed(self, stuck: frozenset[int], what: str, channel: int) -> None:
        if not stuck and self._filter.mistrust():
            self._now.witness.clear()
            self._quiet, self._snapshots, self._search = 0, [], None
            return
        super()._alarmed(stuck, what, channel)
