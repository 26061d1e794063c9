"""Everyone who is timed gets the same readings, and the compiled loops do what the plug-ins do."""

from __future__ import annotations

import numpy as np
import pytest
from rich.console import Console

from benchmarks.range_estimators import Arguments, RangeFindings, run
from mathnavi.studies.ranging.estimator_runs import (
    ALL_ALIVE,
    BANK_LOOP,
    EKF_LOOP,
    PARTICLE_LOOP,
    PLUGINS,
    costs,
    monitor_costs,
    read,
)


def test_every_repetition_times_every_estimator() -> None:
    taken = costs(read("4", 1.0, np.random.default_rng(0)), 2)
    assert set(taken) == {ALL_ALIVE, BANK_LOOP, EKF_LOOP, PARTICLE_LOOP, *PLUGINS.values()}
    assert all(figures.shape == (2,) and (figures > 0.0).all() for figures in taken.values())
    assert np.median(taken[EKF_LOOP]) < np.median(taken[ALL_ALIVE]) < np.median(taken[PARTICLE_LOOP])


def test_the_same_seed_is_the_same_readings_and_another_is_not() -> None:
    one, same, other = (read("2s", 1.0, np.random.default_rng(seed)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.ranges, same.ranges)
    np.testing.assert_array_equal(one.inputs, same.inputs)
    assert one.ranges.shape == (100, 2)
    assert not np.array_equal(one.ranges, other.ranges)


def test_ratios_are_those_of_neighbours() -> None:
    taken = {name: np.array([1.0, 2.0]) for name in (BANK_LOOP, ALL_ALIVE, EKF_LOOP, "feasible_set_bank")}
    taken |= {name: np.array([30.0, 80.0]) for name in (PARTICLE_LOOP, "range_ekf", "range_ukf", "range_particle")}
    watched = {"bank": (np.array([11.0, 24.0]), np.array([10.0, 20.0])), "ekf": (np.full(2, 13.0), np.full(2, 10.0))}
    findings = RangeFindings(1.0, {"2 rays": taken}, {"3 rays": watched})
    rows = findings.comparisons()
    assert [row.ratio for row in rows] == [35.0] * 6 + [pytest.approx(1.15), pytest.approx(1.3)]
    assert [row.holds for row in rows] == [True, True, None, None, None, None, True, False]
    assert findings.plain()["update_us"]["2 rays"][BANK_LOOP] == [1.0, 2.0]


def test_an_update_is_timed_with_its_monitor_and_without() -> None:
    with_, without = monitor_costs(read("3", 2.0, np.random.default_rng(0)), ("range_ekf",))["range_ekf"]
    assert with_.shape == without.shape == (100,)
    assert 0.0 < np.median(without) < np.median(with_)


def test_it_runs_and_tells_how_much_is_compiled() -> None:
    console = Console(record=True, width=120)
    run(Arguments(seconds=1.0, repetitions=1), console).show(console)
    assert "of the plug-in's time is compiled" in console.export_text()


@pytest.mark.parametrize(("field", "value"), [("repetitions", 0), ("seconds", 0.5), ("seconds", float("nan"))])
def test_a_field_out_of_its_range_is_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*; allowed: "):
        Arguments(**{field: value})  # type: ignore[arg-type]
