"""The extended Kalman filter of filterpy whose predicted state is an argument, as a class of a module: so that an
estimator that has one can be pickled. Importing it takes 0.7 s (``kalman_steps.external_prediction_ekf``).
"""

from __future__ import annotations

from typing import Any

from filterpy.kalman import ExtendedKalmanFilter


class ExternalPredictionEkf(ExtendedKalmanFilter):
    """Extended Kalman filter whose predicted state is an argument of ``predict``."""

    def predict_x(self, u: Any) -> None:
        self.x = u
