"""``textbook-observer``: errors, escapes, and repeatability."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.textbook.observers import Example22, KazantzisKravaris
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.textbook import VEHICLE, TextbookConfig, TextbookObserver


def run(seed: int = 0, estimator: PluginSpec | None = None, **fields: object) -> RunData:
    return TextbookObserver.build(TextbookConfig(**fields), seed, estimator=estimator).run()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("system", "states"),
    [("example-2-2", 3), ("camera-and-flags", 3), ("krener-isidori", 2), ("kazantzis-kravaris", 2)],
)
def test_every_system_runs_with_an_estimator_that_comes_nearer(system: str, states: int) -> None:
    outcome = run(system=system, duration=2.0)
    arrays, summary = outcome.arrays, outcome.summary
    assert arrays["truth.x"].shape == arrays["estimate.x"].shape == (201, states)
    assert summary["error_end"] < 0.75 * summary["error_start"]
    assert not summary["escaped"]
    assert summary["lost_s"] == 0.0


def test_the_same_seed_gives_the_same_log_and_another_one_another() -> None:
    runs = [run(seed, system="krener-isidori", duration=0.5, noise=0.1).arrays for seed in (1, 1, 2)]
    assert set(runs[0]) == set(runs[1])
    for name, values in runs[0].items():
        np.testing.assert_array_equal(values, runs[1][name])
    assert (runs[0]["measurement.output"] != runs[2]["measurement.output"]).any()


def test_the_observer_of_example_2_2_converges_at_its_rate() -> None:
    outcome = run(
        estimator=PluginSpec.with_fields(Example22, alpha=6.0, beta=5.0), duration=8.0
    )  # poles -2, -3, and -1 of x_3
    assert outcome.success
    assert outcome.summary["decay_rate_per_s"] == pytest.approx(1.0, rel=0.15)


def test_an_escape_ends_the_run_and_is_no_success() -> None:
    outcome = run(system="example-2-1")
    assert outcome.summary["escaped"]
    assert outcome.summary["shortfall"] == "escaped"
    assert outcome.summary["escape_time_s"] == pytest.approx(1.908, abs=1e-3)
    assert not outcome.success
    assert outcome.recording.t[-1] == pytest.approx(1.91)
    assert np.isfinite(outcome.arrays["truth.x"]).all()
    assert np.isnan(outcome.arrays["measurement.output"][-1]).all()


def test_an_estimate_that_leads_away_is_no_success() -> None:
    printed = PluginSpec.with_fields(KazantzisKravaris, form="printed")
    outcome = run(system="kazantzis-kravaris", estimator=printed, duration=4.0)
    assert not outcome.success
    assert outcome.summary["error_end"] > 3.0 * outcome.summary["error_start"]


def test_an_unknown_distance_is_a_fourth_state() -> None:
    closed_loop = TextbookObserver.build(TextbookConfig("camera-and-flags", distance_known=False), 0)
    assert closed_loop.plant.state_names(VEHICLE)[3] == "d_0 [m]"


def test_errors_are_reported_state_by_state() -> None:
    config = TextbookConfig("camera-and-flags")
    errors = TextbookObserver.errors(config, np.array([[1.0, 2.0, 3.2]]), np.array([[0.0, 0.0, -3.2]]))
    assert list(errors) == ["x_1 [m]", "x_2 [m]", "phi [rad]"]
    assert errors["phi [rad]"][0] == pytest.approx(6.4 - 2.0 * np.pi)
