"""One filter of a flight among beacons: prediction, and conditioning on a number after the other (``flight``)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.beacons.flight_geometry import mirrored
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacon_readings import DIFFERENCE, BeaconRows, curvature_effects

_I3 = np.eye(3)


@dataclass
class Side:
    """A filter on one side of the plane of the beacons.

    While differences of an instant are used its state has one number more: the noise n_0 of the arrival from beacon 0,
    which they share, so that what is left of their noise is independent.
    """

    x: Array  # (9,) p [m], v [m/s], g [m/s^2]; (10,) with n_0 [m]
    P: Array  # (9, 9), (10, 10)
    gained: float = 0.0  # logarithm of the likelihood of the readings of an instant

    def predict(self, F: Array, B: Array, Q: Array) -> None:
        """Predict by F (9, 9), the effect B (9,) of the input and the noise Q (9, 9)."""
        self.x = F @ self.x + B
        self.P = F @ self.P @ F.T + Q

    def share(self, variance: float | None) -> None:
        """Add the noise of an arrival, of a variance [m^2], to the state; None: remove it."""
        x, P = self.x[:9], self.P[:9, :9]
        if variance is not None:
            x, P = np.append(x, 0.0), np.pad(P, (0, 1))
            P[9, 9] = variance
        self.x, self.P = x, P

    def expected(self, rows: BeaconRows, k: int) -> tuple[float, Array, float]:
        """Expected number of row k, its derivative (3,), and the variance of a reading of it but for what P says of
        the derivative.
        """
        h, u, D = rows.at(k, self.x[:3])
        mean, variance = curvature_effects(self.P[:3, :3], D)
        return h + mean - (self.x[9] if rows.kinds[k] == DIFFERENCE else 0.0), u, float(rows.variance[k]) + variance

    def spread(self, H: Array, R: float, *, shared: bool = False) -> tuple[Array, float]:
        """P H' and the variance S of an innovation, with H (3,) of the position and noise of variance R; it has -n_0
        besides if ``shared``.
        """
        PH = self.P[:, :3] @ H
        if not shared:
            return PH, float(H @ PH[:3]) + R
        PH = PH - self.P[:, 9]
        return PH, float(H @ PH[:3] - PH[9]) + R

    def condition(self, PH: Array, nu: float, S: float) -> None:
        """Condition on an innovation nu of ``spread``."""
        self.x = self.x + PH * (nu / S)
        self.P = self.P - PH[:, None] * (PH / S)

    def image(self, centre: Array, normal: Array) -> Side:
        """Mirror image in a plane."""
        M: Array = np.asarray(np.kron(_I3, _I3 - 2.0 * np.outer(normal, normal)), np.float64)
        x = M @ self.x
        x[:3] = mirrored(self.x[:3], centre, normal)
        return Side(x, M @ self.P @ M.T)
