"""Extended Kalman filter (filterpy's) with external prediction: the caller supplies the predicted state."""

from __future__ import annotations

from typing import Any


def external_prediction_ekf(states: int, readings: int) -> Any:
    """Build the filter for n ``states`` and m ``readings``.

    Its ``predict(x)`` takes the predicted state x (n,), from the equations of motion, and propagates the covariance:
    P <- F P F' + Q with its ``F`` (n, n) and ``Q`` (n, n). States and readings must both be flat arrays: filterpy
    broadcasts a flat array and a column to a square matrix.
    """
    from filterpy.kalman import ExtendedKalmanFilter  # takes 0.7 s to import

    class ExternalPredictionEkf(ExtendedKalmanFilter):
        """Extended Kalman filter whose predicted state is an argument of ``predict``."""

        def predict_x(self, u: Any) -> None:
            self.x = u

    return ExternalPredictionEkf(states, readings)
