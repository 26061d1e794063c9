"""filterpy's extended Kalman filter, told where the equations of motion lead instead of multiplying by F."""

from __future__ import annotations

from typing import Any


def carried_filter(states: int, readings: int) -> Any:
    """A filter whose ``predict(x)`` takes the predicted state (n,) and carries its covariance on by its ``F``, ``Q``.

    State and readings have to be flat: filterpy makes a square of a flat one and a column.
    """
    from filterpy.kalman import ExtendedKalmanFilter  # takes .7 s to import

    class Carried(ExtendedKalmanFilter):
        def predict_x(self, u: Any) -> None:
            self.x = u

    return Carried(states, readings)
