"""Where a flight begins and where it shall end, as parameters of the problems."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from mathnavi.controllers.missile.problem import END
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.mission import Target
from mathnavi.sim.interfaces.signals import Array


@dataclass(frozen=True, eq=False)
class TerminalCondition:
    """The end of a flight of unknown duration T: at ``place`` + ``velocity`` T, in an attitude and with a drift."""

    place: Array  # (3,) [m] Earth frame, where the target is at the start of the flight
    velocity: Array  # (3,) [m/s]
    theta: float  # [rad]
    psi: float = 0.0  # [rad]
    v: float = 0.0  # [m/s]
    w: float = 0.0  # [m/s]

    @staticmethod
    def at(target: Target, t: float, aspect_angle: float, *, lead: bool) -> TerminalCondition:
        """At a target as it is known, for a flight that starts at t [s]; without ``lead`` as if it stood still."""
        velocity = np.array(target.velocity) if lead else np.zeros(3)
        return TerminalCondition(target.at(t), velocity, aspect_angle)

    def after(self, T: float) -> Array:
        """(3,) where the target is after T [s]."""
        place: Array = self.place + T * self.velocity
        return place

    def parameters(self, start: Array, coordinates: Coordinates) -> Array:
        """(np,) of ``problem.guidance_problem`` from the state ``start`` (nx,)."""
        values = {
            **dict(zip(("x_e", "y_e", "z_e"), self.place.tolist(), strict=True)),
            **{name: getattr(self, name) for name in ("theta", "psi", "v", "w")},
        }
        rates = dict(zip(("x_e", "y_e", "z_e"), self.velocity.tolist(), strict=True))
        end: list[float] = []
        for name in END:
            if name in coordinates.states:
                end.append(values[name])
                if name in rates:
                    end.append(rates[name])
        return np.concatenate([start, end])

    def missed_by(self, end: Array, T: float, coordinates: Coordinates) -> TerminalCondition:
        """How far off the state ``end`` (nx,) after T [s] is, component by component."""
        x = coordinates.in_space(end)
        theta = wrapped(x[5] - self.theta)
        return TerminalCondition(
            x[7:] - self.after(T), np.zeros(3), theta, x[6] - self.psi, x[1] - self.v, x[2] - self.w
        )

    @property
    def size(self) -> float:
        """[m] of a miss, a radian counted as 10 m and 1 m/s as 1 m."""
        return math.hypot(*self.place, 10.0 * self.theta, 10.0 * self.psi, self.v, self.w)

    def corrected_for(self, miss: TerminalCondition) -> TerminalCondition:
        """The aim that is as far off on the other side, so that a flight which misses so comes to the target."""
        return dataclasses.replace(
            self,
            place=self.place - miss.place,
            **{name: getattr(self, name) - getattr(miss, name) for name in ("theta", "psi", "v", "w")},
        )
