from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from mathnavi.estimators.velocity.filtered_differences import FilteredDifferences, FilteredDifferencesConfig
from mathnavi.interfaces.signals import Estimate, Measurement, Status
from mathnavi.models.manifold.manifold import Manifold
from mathnavi.sim.metrics.tuning import RecordedCall
from tests.estimators.velocity.runs import (
    FILTERS,
    MODELLED,
    PLUGINS,
    SYSTEMS,
    mission_of,
    moving,
    recorded,
    replayed,
    velocity_error,
)


def built(name: str, mission: object, **fields: object) -> object:
    return PLUGINS[name].build(PLUGINS[name].Config(**fields), mission)


def fits(name: str, system_name: str) -> bool:
    """Return whether an observer is for this system: one on SO(3) is for bodies that turn."""
    return name != "attitude_iekf" or system_name == "rigid body"


def is_a_state(manifold: Manifold, estimate: Estimate) -> bool:
    """Return whether x is on the manifold and v tangent to it."""
    x, v = estimate.x[: manifold.size], estimate.x[manifold.size :]
    tangent = manifold.vector(x, manifold.components(x, v))
    return bool(np.allclose(manifold.check(x), x, atol=1e-9) and np.allclose(tangent, v, atol=1e-8))


@pytest.mark.parametrize("system_name", sorted(SYSTEMS))
@pytest.mark.parametrize("name", MODELLED)
def test_a_model_finds_the_velocity_exactly_where_there_is_no_noise(name: str, system_name: str) -> None:
    system, start = moving(system_name, 0.8)
    calls = recorded(mission_of(system), start, 3.0)
    *_, last = replayed(built(name, mission_of(system)), calls)
    assert velocity_error(system.manifold, last, calls[-1].truth) < 1e-7


@pytest.mark.parametrize("name", MODELLED)
def test_the_error_decays_exponentially(name: str) -> None:
    """By a factor at least every half second; sigma points are off by a bias of second order in their covariance."""
    system, start = moving("rigid body", 1.0)
    calls = recorded(mission_of(system), start, 2.0)
    found = replayed(built(name, mission_of(system)), calls)
    errors = [velocity_error(system.manifold, found[k], calls[k].truth) for k in (50, 100, 150, 200)]
    assert all(after < max(0.1 * before, 1e-7) for before, after in itertools.pairwise(errors))


@pytest.mark.parametrize(
    ("name", "system_name"),
    [(name, system) for name in sorted(PLUGINS) for system in sorted(SYSTEMS) if fits(name, system)],
)
def test_an_estimate_is_a_tangent_vector_at_a_point_of_the_manifold(name: str, system_name: str) -> None:
    system, start = moving(system_name, 0.5)
    mission = mission_of(system, noise=0.01, dropout=0.3)
    calls = recorded(mission, start, 1.0)
    started = [e for e in replayed(built(name, mission), calls) if e.status is not Status.INITIALISING]
    assert all(is_a_state(system.manifold, estimate) for estimate in started)


@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_outliers_are_refused_and_counted(name: str) -> None:
    """One reading in a hundred is a radian off, and the estimate is nearly what it would have been without those."""
    system, start = moving("rigid body", 1.0)
    clean, jumping = mission_of(system, noise=1e-3), mission_of(system, noise=1e-3, jump=0.01, jump_size=1.0)
    calls = recorded(jumping, start, 4.0)
    found = replayed(built(name, jumping), calls)
    undisturbed = replayed(built(name, clean), recorded(clean, start, 4.0))
    jumps = 0
    for call in calls:
        error = system.manifold.coordinates(call.truth[:4], call.measurements[0].value)
        jumps += float(np.abs(error).max()) > 0.5
    assert jumps > 2
    assert found[-1].extra["refused"] == jumps
    worst, expected = (
        max(velocity_error(system.manifold, e, c.truth) for e, c in zip(each[200:], calls[200:], strict=True))
        for each in (found, undisturbed)
    )
    assert worst < 1.5 * expected
    declared, usual = (np.mean([e.extra["deviation"][3:] for e in each[200:]]) for each in (found, undisturbed))
    assert declared < 1.2 * usual  # what was refused is no error


@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_q_and_minus_q_are_one_reading(name: str) -> None:
    system, start = moving("rigid body", 1.0)
    mission = mission_of(system, noise=1e-3)
    calls = recorded(mission, start, 0.5)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], len(calls))
    turned = [
        replace(call, measurements=tuple(replace(m, value=sign * m.value) for m in call.measurements))
        for sign, call in zip(signs, calls, strict=True)
    ]
    found, expected = replayed(built(name, mission), turned), replayed(built(name, mission), calls)
    for one, other in zip(found, expected, strict=True):
        assert one.x[4:] == pytest.approx(other.x[4:], abs=1e-9)
        assert abs(one.x[:4] @ other.x[:4]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_a_system_that_was_put_elsewhere_is_found_again(name: str) -> None:
    """Readings that are refused too often are accepted; for 5 s it may be the sensor that has leapt."""
    system, start = moving("rigid body", 0.3)
    mission = mission_of(system, noise=1e-3)
    calls = recorded(mission, start, 1.0)
    turned = np.concatenate([system.manifold.point(calls[-1].truth[:4], np.array([1.5, -1.0, 0.5])), np.full(3, 0.3)])
    moved = [delayed(call, 1.01) for call in recorded(mission, turned, 5.5, seed=2)]
    estimator = built(name, mission)
    replayed(estimator, calls)
    *_, last = replayed(estimator, moved)
    assert last.status is Status.OK
    assert system.manifold.distance(last.x[:4], moved[-1].truth[:4]) < 0.01
    assert velocity_error(system.manifold, last, moved[-1].truth) < 0.3


def delayed(call: RecordedCall, dt: float) -> RecordedCall:
    later = tuple(dataclasses.replace(reading, t=reading.t + dt) for reading in call.measurements)
    return dataclasses.replace(call, t=call.t + dt, measurements=later)


BAD = {
    "NaN": np.full(4, math.nan),
    "infinite": np.full(4, math.inf),
    "too short": np.array([1.0, 0.0]),
    "off the manifold": np.array([2.0, 0.0, 0.0, 0.0]),
}


@pytest.mark.parametrize("bad", sorted(BAD))
@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_what_is_no_point_is_as_good_as_no_reading(name: str, bad: str) -> None:
    system, start = moving("rigid body", 0.3)
    mission = mission_of(system, noise=1e-3)
    calls = recorded(mission, start, 0.6)

    def with_last_half(measurements: tuple[Measurement, ...], call: RecordedCall) -> RecordedCall:
        return dataclasses.replace(call, measurements=measurements) if call.t > 0.3 else call

    broken = [with_last_half((Measurement("position", c.t, BAD[bad]),), c) for c in calls]
    missing = [with_last_half((), c) for c in calls]
    for one, other in zip(replayed(built(name, mission), broken), replayed(built(name, mission), missing), strict=True):
        np.testing.assert_array_equal(one.x, other.x)
        assert one.status is other.status


@pytest.mark.parametrize("name", sorted(PLUGINS))
def test_an_old_reading_and_a_second_one_at_the_same_time_change_nothing(name: str) -> None:
    system, start = moving("rigid body", 0.3)
    mission = mission_of(system, noise=1e-3)
    calls = recorded(mission, start, 0.5)
    stale = Measurement("position", 0.0, calls[0].measurements[0].value)
    doubled = [dataclasses.replace(c, measurements=(*c.measurements, *c.measurements, stale)) for c in calls]
    for one, other in zip(replayed(built(name, mission), doubled), replayed(built(name, mission), calls), strict=True):
        np.testing.assert_array_equal(one.x, other.x)


@pytest.mark.parametrize("name", MODELLED)
def test_a_prediction_out_of_all_bounds_is_lost_and_not_spread(name: str) -> None:
    """A force that no number holds; with sane ones the observer starts anew."""
    system, start = moving("hyperbolic", 0.0)
    mission = mission_of(system)
    estimator = built(name, mission)
    y = start[:3]
    held = -system.force(y, np.zeros(3), np.zeros(3))  # the force with which the system stays where it is
    estimator.update(0.0, (Measurement("position", 0.0, y),), held)
    blown = estimator.update(0.01, (), np.full(3, 1e200))
    assert blown.status is Status.LOST
    np.testing.assert_array_equal(blown.x, np.concatenate([y, np.zeros(3)]))
    back = estimator.update(0.02, (Measurement("position", 0.02, y),), held)
    assert back.status is Status.DEGRADED  # nothing is known of the velocity
    for t in 0.02 + 0.01 * np.arange(1, 120):
        later = estimator.update(t, (Measurement("position", t, y),), held)
    assert later.status is Status.OK
    assert back.extra["restarts"] == 1.0


@pytest.mark.parametrize("name", FILTERS)
def test_what_a_filter_believes_of_its_readings_is_what_is_true(name: str) -> None:
    """The innovations of a run are chi-square distributed, of n degrees: their mean is n."""
    system, start = moving("sphere", 0.5)
    mission = mission_of(system, noise=0.01)
    calls = recorded(mission, start, 8.0)
    nis = np.array([e.extra["nis"] for e in replayed(built(name, mission, acceleration=0.01), calls)])
    settled = nis[100:, 0]
    assert np.mean(settled) == pytest.approx(2.0, abs=4.0 * 2.0 / math.sqrt(len(settled)))


def test_the_speed_of_a_steady_motion_is_found_across_missing_readings() -> None:
    """Of ten readings nine are lost, and the difference is over the time between those that are there."""
    system, start = moving("rigid body", 0.5)
    mission = mission_of(system)
    calls = [
        call if k % 10 == 0 else dataclasses.replace(call, measurements=())
        for k, call in enumerate(recorded(mission, start, 2.0))
    ]
    for cutoff in (0.0, 5.0):
        *_, last = replayed(built("filtered_differences", mission, cutoff=cutoff), calls)
        assert velocity_error(system.manifold, last, calls[-1].truth) < 1e-6


def test_differences_at_rest_have_the_noise_that_theory_says() -> None:
    """sigma sqrt(2) / h on each axis, of a reading at every h."""
    system, start = moving("rigid body", 0.0)
    mission = mission_of(system, noise=1e-3)
    found = replayed(built("filtered_differences", mission, cutoff=0.0), recorded(mission, start, 8.0))
    rates = np.array([e.x[4:] for e in found[1:]])
    assert np.std(rates) == pytest.approx(1e-3 * math.sqrt(2.0) / 0.01, rel=0.05)


def test_the_high_gain_observer_has_the_noise_that_theory_says() -> None:
    """sigma omega^1.5 sqrt(h) / 2 on each axis."""
    system, start = moving("rigid body", 0.0)
    mission = mission_of(system, noise=1e-2)
    found = replayed(built("high_gain", mission, bandwidth=5.0), recorded(mission, start, 60.0))
    rates = np.array([e.x[4:] for e in found[200:]])
    assert np.std(rates) == pytest.approx(0.5 * 1e-2 * 5.0**1.5 * math.sqrt(0.01), rel=0.15)


@pytest.mark.parametrize("bandwidth", [1.0, 1e2, 1e4])
def test_the_high_gain_observer_is_stable_at_any_rate_of_readings(bandwidth: float) -> None:
    system, start = moving("rigid body", 0.5)
    calls = recorded(mission_of(system), start, 20.0)
    *_, last = replayed(built("high_gain", mission_of(system), bandwidth=bandwidth), calls)
    assert velocity_error(system.manifold, last, calls[-1].truth) < 1e-5


def test_a_cutoff_that_the_readings_are_too_slow_for_is_refused() -> None:
    system, _ = moving("flat", 0.0)
    with pytest.raises(ValueError, match=r"cutoff = 50\.0; allowed: below half the rate of readings, 50 Hz"):
        FilteredDifferences.build(FilteredDifferencesConfig(cutoff=50.0), mission_of(system))


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_notices_nothing_where_the_frame_jumps(name: str) -> None:
    """The same motion on the sphere, about an axis that leads it across p_0 = 0 and one that does not.

    The spaces look alike from both, so the standard deviations along and across the motion are the same.
    """
    system, _ = moving("sphere", 0.0)
    free = dataclasses.replace(system, potential=lambda p: 0.0 * p[0])
    mission = mission_of(free)
    deviations = []
    for start, v in (([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), ([0.0, 0.6, 0.8], [0.0, -0.8, 0.6])):
        calls = recorded(mission, np.array(start + v), 3.0)
        found = replayed(built(name, mission), calls)
        crossed = {bool(call.truth[0] < 0.0) for call in calls}
        deviations.append((len(crossed), np.array([np.linalg.norm(e.extra["deviation"][2:]) for e in found])))
        assert velocity_error(free.manifold, found[-1], calls[-1].truth) < 1e-6
    assert {crossings for crossings, _ in deviations} == {1, 2}
    np.testing.assert_allclose(deviations[0][1], deviations[1][1], rtol=1e-4)
