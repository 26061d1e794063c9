"""A field of an estimator's configuration that is out of its range is refused by its name."""

from __future__ import annotations

import math
from importlib.metadata import entry_points
from typing import Any

import pytest

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.full_state import FullStateConfig
from mathnavi.estimators.invariant.floating_base import FloatingBaseIekfConfig
from mathnavi.estimators.ranging.observer import RangeObserverConfig
from mathnavi.estimators.ranging.particle import RangeParticleConfig
from mathnavi.estimators.ranging.pose_filter import PoseFilterConfig
from mathnavi.estimators.ranging.unscented import RangeUkfConfig
from mathnavi.estimators.textbook.observers import Example22Config, KazantzisKravarisConfig, OutputInjectionConfig
from mathnavi.estimators.velocity.filtered_differences import FilteredDifferencesConfig
from mathnavi.estimators.velocity.kalman import LagrangianEkfConfig, LagrangianUkfConfig
from tests.contracts.test_planners import numbers

PLUGINS = {entry.name: entry for entry in entry_points(group="mathnavi.estimators")}
WIDER = {
    "Example22Config": ("alpha", "beta"), "FeasibleSetBankConfig": ("lowest", "misfit", "seed"),
    "FilteredDifferencesConfig": ("cutoff",), "KazantzisKravarisConfig": ("order",),
    "FloatingBaseIekfConfig": ("gyro_bias", "accelerometer_bias"),
    "RangeObserverConfig": ("k_v", "k_q"), "RangeParticleConfig": ("spread", "seed"),
    "RangeUkfConfig": ("beta", "kappa"), "TextbookEkfConfig": ("process",),
}  # fmt: skip
"""Fields that may be 0, negative or infinite."""


@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_a_number_that_is_none_or_not_positive_is_refused(name: str) -> None:
    for config, field, real in numbers(PLUGINS[name].load().Config):
        values = [math.nan] if real else []
        if field not in WIDER.get(config.__name__, ()):
            values += [math.inf, -math.inf, -1.0, 0.0] if real else [0, -1]
        for value in values:
            with pytest.raises(ValueError, match=rf"{field} = .*; allowed"):
                config(**{field: value})


@pytest.mark.parametrize(
    ("config", "fields"),
    [
        (FullStateConfig, {"rate": 0.0}), (FullStateConfig, {"rate": math.nan}),
        (KalmanConfig, {"start_position_std": 0.0}), (KalmanConfig, {"start_position_std": math.nan}),
        (PoseFilterConfig, {"gate": 1.0}), (RangeUkfConfig, {"beta": -1.0}), (RangeUkfConfig, {"kappa": -4.0}),
        (RangeObserverConfig, {"k_v": -1.0}), (RangeObserverConfig, {"k_v": math.inf}),
        (RangeObserverConfig, {"window": 1}), (RangeObserverConfig, {"window": 4}),
        (RangeObserverConfig, {"order": 101}), (RangeObserverConfig, {"window": 3, "order": 3}),
        (RangeObserverConfig, {"z_0": (math.nan, 1.0, 2.0)}),
        (RangeParticleConfig, {"max_particles": 10**7}),
        (RangeParticleConfig, {"max_particles": 10, "min_particles": 500}),
        (RangeParticleConfig, {"cell_heading": 3.0}), (RangeParticleConfig, {"recovery_fast": 20.0}),
        (RangeParticleConfig, {"seed": -1}), (FilteredDifferencesConfig, {"cutoff": -1.0}),
        (FloatingBaseIekfConfig, {"gyro_bias": -1.0}), (FloatingBaseIekfConfig, {"accelerometer_bias": math.inf}),
        (LagrangianEkfConfig, {"gate": 1.0}), (LagrangianUkfConfig, {"alpha": 0.5}),
        (Example22Config, {"beta": 1e12}), (OutputInjectionConfig, {"poles": (-1.0, -1e12)}),
        (KazantzisKravarisConfig, {"form": "other"}),
    ],
)  # fmt: skip
def test_a_field_beyond_its_own_ends_is_refused(config: Any, fields: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=rf"{list(fields)[-1]} = .*; allowed"):
        config(**fields)
