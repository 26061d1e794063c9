"""The observer (C.5) as a plug-in, driven without MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mathnavi.estimators.ranging.observer import FEED_FORWARDS, FeedForward, RangeObserver, RangeObserverConfig
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.field.curve import BEAN
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from tests.estimators.ranging.runs import with_ranges
from tests.estimators.ranging.walls import FIELD, SENSORS
from tests.ranging import Step, driven, still

START = np.array([1.0, -0.4, 1.5])
NOISY = {"ranging": RangeQuality(0.05), "odometry": OdometryQuality((0.05, 0.05), 0.02)}
LOCKING: tuple[FeedForward, ...] = ("s", "rho_dot", "manifold")


def mission(sensors: str = "2s", start: tuple[float, float, float] | None = None, **more: object) -> RangingMission:
    angles = tuple(math.radians(angle) for angle in SENSORS[sensors])
    made = RangingMission(FIELD, angles, start=None if start is None else KnownStart(start))
    return replace(made, **more)  # type: ignore[arg-type]


def followed(observer: RangeObserver, steps: list[Step]) -> list[Estimate]:
    return [observer.update(step.t, step.measurements, step.command) for step in steps]


def observer(at: RangingMission, **fields: object) -> RangeObserver:
    return RangeObserver.build(RangeObserverConfig(**fields), at)  # type: ignore[arg-type]


@pytest.mark.parametrize(("feedforward", "error"), [("s", 2e-4), ("rho_dot", 2e-4), ("manifold", 1e-10)])
@pytest.mark.parametrize("gain", [1.0, 300.0])
def test_with_a_feed_forward_it_stays_on_the_truth(feedforward: FeedForward, error: float, gain: float) -> None:
    """Property 2.1; declared, and so."""
    config = RangeObserverConfig(feedforward=feedforward, k_v=gain, k_q=gain)
    assert RangeObserver.properties(config).stays_on_truth
    at, steps = mission(start=(1.0, -0.4, 1.5)), list(driven(mission(), START, 8.0))
    for step, estimate in zip(steps, followed(RangeObserver.build(config, at), steps), strict=True):
        assert max(at.error(estimate.x, step.truth)) <= error


def test_the_print_does_not() -> None:
    config = RangeObserverConfig(feedforward="none", k_v=5.0, k_q=1.0)
    assert not RangeObserver.properties(config).stays_on_truth
    at, steps = mission("4", start=(1.0, -0.4, 1.5)), list(driven(mission("4"), START, 4.0))
    *_, last = followed(RangeObserver.build(config, at), steps)
    assert at.error(last.x, steps[-1].truth)[0] >= 1e-3


@pytest.mark.parametrize("feedforward", LOCKING)
@pytest.mark.parametrize("sensors", ["2s", "4"])
def test_it_finds_the_robot_from_afar(feedforward: FeedForward, sensors: str) -> None:
    at, steps = mission(sensors, start=(-1.0, 0.3, 0.5)), list(driven(mission(sensors), START, 20.0))
    estimates = followed(observer(at, feedforward=feedforward, k_v=3.0, k_q=3.0), steps)
    assert max(at.error(estimates[-1].x, steps[-1].truth)) <= 1e-2


@pytest.mark.parametrize("sensors", ["2s", "2t", "4"])
def test_it_finds_the_robot_in_noise_without_knowing_the_start(sensors: str) -> None:
    at = mission(sensors, **NOISY)
    steps = list(driven(at, START, 20.0, rng=np.random.default_rng(3)))
    errors = np.array(
        [
            at.difference(estimate.x, step.truth)
            for step, estimate in zip(steps, followed(observer(at), steps), strict=True)
            if step.t > 15.0
        ]
    )
    assert np.sqrt(np.square(errors[:, :2]).sum(axis=1).mean()) <= 0.2
    assert np.sqrt(np.square(errors[:, 2]).mean()) <= 0.1


def test_standing_still_it_does_not_with_two_rays() -> None:
    """Its convergence depends on the input, as it declares."""
    at = mission(start=(0.5, -0.2, 1.0))
    steps = list(driven(at, START, 20.0, still))
    *_, last = followed(observer(at, feedforward="manifold"), steps)
    assert max(at.error(last.x, steps[-1].truth)) >= 0.05
    assert last.extra["value"][0] <= 1e-6  # though what it sees fits


@pytest.mark.parametrize("feedforward", list(FEED_FORWARDS))
@pytest.mark.parametrize("more", [{}, NOISY])
def test_whatever_the_readings_are_the_estimate_is_finite_and_within_the_wall(
    feedforward: FeedForward, more: dict[str, object]
) -> None:
    rng = np.random.default_rng(5)
    at = mission("3", **more)
    made = observer(at, feedforward=feedforward)
    values = [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-12, 0.5, 2.0, 7.0, 1e4, 1e300]
    for k in range(600):
        readings = [Measurement("ranges", 0.01 * k, rng.choice(values, 3))]
        readings.append(Measurement("odometry", 0.01 * k, rng.choice([*values, 1.0, -2.0], 2)))
        estimate = made.update(0.01 * k, readings[: rng.integers(0, 3)], rng.uniform(-2.0, 2.0, 2))
        assert np.isfinite(estimate.x).all()
        assert FIELD.contains(estimate.x)
        assert np.isfinite(estimate.extra["z"]).all()
        assert np.isfinite(estimate.extra["value"]).all()


def test_a_ray_that_is_lost_for_seconds_hardly_matters() -> None:
    at, steps = mission("3", start=(1.0, -0.4, 1.5)), list(driven(mission("3"), START, 8.0))
    for k, step in enumerate(steps):
        if 200 <= k < 500:
            step.measurements[0].value[1] = np.nan
    for step, estimate in zip(steps, followed(observer(at), steps), strict=True):
        assert max(at.error(estimate.x, step.truth)) <= 1e-4


@pytest.mark.parametrize("feedforward", list(FEED_FORWARDS))
def test_without_any_range_it_follows_the_odometry_and_says_that_it_is_lost(feedforward: FeedForward) -> None:
    at, steps = mission(start=(1.0, -0.4, 1.5)), list(driven(mission(), START, 6.0))
    made = observer(at, feedforward=feedforward, k_v=50.0, k_q=50.0)
    followed(made, steps[:200])
    blind = [made.update(s.t, s.measurements[1:], s.command) for s in steps[200:400]]
    assert [estimate.status for estimate in blind] == [Status.OK] * 50 + [Status.LOST] * 150
    moved = at.difference(blind[-1].x, steps[399].truth) - at.difference(blind[10].x, steps[210].truth)
    if feedforward != "none":
        assert np.abs(moved).max() <= 1e-4
    again = followed(made, steps[400:])
    assert [again[k].status for k in (0, 49)] == [Status.DEGRADED] * 2
    assert again[-1].status is Status.OK
    assert np.isfinite(again[-1].x).all()


def test_odometry_is_taken_where_it_is_there_and_the_command_where_it_is_not() -> None:
    at, steps = mission(start=(1.0, -0.4, 1.5)), list(driven(mission(), START, 3.0))
    with_odometry, with_command, without = observer(at), observer(at), observer(at)
    for step in steps:
        whole = with_odometry.update(step.t, step.measurements, np.full(2, 9.0))
        commanded = with_command.update(step.t, step.measurements[:1], step.command)
        lazy = without.update(step.t, step.measurements[:1], np.zeros(2))
    np.testing.assert_array_equal(whole.x, commanded.x)
    assert max(at.error(whole.x, steps[-1].truth)) <= 1e-4
    assert max(at.error(lazy.x, steps[-1].truth)) > 1e-3


def test_the_state_starts_as_configured() -> None:
    at, (step, *_) = mission(), list(driven(mission(), START, 0.1))
    z_0 = (5.0, 1.0, 1.4)
    still_there = observer(at, z_0=z_0, k_v=0.0, k_q=0.0, feedforward="none")
    np.testing.assert_allclose(still_there.update(0.0, step.measurements, step.command).extra["z"], z_0)


def test_z_and_the_values_are_reported_beside_the_pose() -> None:
    at, steps = mission("3", start=(1.0, -0.4, 1.5)), list(driven(mission("3"), START, 2.0))
    for step, estimate in zip(steps, followed(observer(at, feedforward="manifold"), steps), strict=True):
        s = at.curve.ranges(step.truth, at.alpha)[1]
        error = estimate.extra["z"] - np.append(s, step.truth[2])
        assert np.abs((error + np.pi) % (2.0 * np.pi) - np.pi).max() <= 1e-9
        assert estimate.extra["value"].shape == (2,)
        assert estimate.extra["value"].max() <= 1e-18


def test_it_initialises_until_a_reading_is_at_the_centre_of_its_window() -> None:
    at = mission(start=(1.0, -0.4, 1.5), **NOISY)
    steps = list(driven(at, START, 1.0, rng=np.random.default_rng(0)))
    statuses = [estimate.status for estimate in followed(observer(at, window=41), steps)]
    assert statuses[:20] == [Status.INITIALISING] * 20
    assert all(each.usable for each in statuses[20:])


def errors_and_covariances(at: RangingMission, steps: list[Step], made: RangeObserver) -> tuple[Array, Array, Array]:
    """Errors (n, 3), covariances (n, 3, 3), and whether the estimates are OK (n,)."""
    found = followed(made, steps)
    differences = [at.difference(e.x, step.truth) for e, step in zip(found, steps, strict=True)]
    covariances = [np.full((3, 3), np.nan) if e.covariance is None else e.covariance for e in found]
    return np.array(differences), np.array(covariances), np.array([e.status is Status.OK for e in found])


@pytest.mark.parametrize(("sensors", "feedforward"), [("2s", "s"), ("4", "rho_dot"), ("4", "none")])
def test_the_accuracy_that_it_declares_is_kept(sensors: str, feedforward: FeedForward) -> None:
    """It has no covariance of its own, and declares that of its gains; as printed it declares its lag too."""
    squares = []
    for seed in range(2):
        rng = np.random.default_rng(40 + seed)
        at = mission(sensors, **NOISY)
        off = START + 0.05 * rng.standard_normal(3)
        at = replace(at, start=KnownStart((off[0], off[1], off[2]), (0.05, 0.05, 0.05)))
        steps = list(driven(at, START, 6.0, rng=rng))
        d, P, ok = errors_and_covariances(at, steps, observer(at, feedforward=feedforward))
        assert not sure_and_wrong(np.array([step.t for step in steps]), ok, d, P).any()
        squares.append([error @ np.linalg.solve(C, error) for error, C in zip(d[200::10], P[200::10], strict=True)])
    if feedforward != "none":
        assert ok.mean() > 0.85
        assert 0.5 < np.median(squares) < 6.0  # of three degrees of freedom


def test_what_it_declares_is_no_wider_than_its_errors() -> None:
    shares = []
    for seed in range(3):
        at = mission("4", start=(1.0, -0.4, 1.5), **NOISY)
        steps = list(driven(at, START, 4.0, rng=np.random.default_rng(60 + seed)))
        d, P, _ = errors_and_covariances(at, steps, observer(at))
        shares.append(np.abs(d[200:]) / np.sqrt(np.einsum("kii->ki", P[200:])))
    median = np.median(np.concatenate(shares), axis=0)  # 0.67 of a Gaussian
    assert (median > 0.35).all()
    assert (median < 1.2).all()


def test_with_a_ray_that_is_blocked_it_is_doubted_until_it_is_right_without_it() -> None:
    at = mission("4", start=(1.0, -0.4, 1.5), **NOISY)
    steps = list(driven(at, START, 6.0, rng=np.random.default_rng(8)))
    blocked = [step if k < 250 else with_ranges(step, first_at(0.3)) for k, step in enumerate(steps)]
    d, P, ok = errors_and_covariances(at, blocked, observer(at))
    assert ok[200:250].all()
    assert not sure_and_wrong(np.array([step.t for step in steps]), ok, d, P).any()
    assert not ok[280:500].any()


def first_at(value: float) -> Callable[[Array], Array]:
    """A change of ranges (l,): the first reads ``value``."""
    return lambda rho: np.array([value, *rho[1:]])


def test_a_wall_that_is_not_convex_will_do() -> None:
    at = replace(mission("4", start=(0.5, 0.4, 0.2)), curve=BEAN)
    steps = list(driven(at, np.array([0.7, 0.3, 0.4]), 10.0))
    *_, last = followed(observer(at, k_v=3.0, k_q=3.0), steps)
    assert max(at.error(last.x, steps[-1].truth)) <= 1e-2


def test_windows_and_orders_are_chosen_by_the_mission_and_the_fit() -> None:
    printed, ours = RangeObserverConfig(feedforward="none"), RangeObserverConfig()
    assert (printed.fits_innovation, ours.fits_innovation) == (False, True)
    assert [printed.fit(exact) for exact in (True, False)] == [(3, 2), (101, 3)]
    assert [ours.fit(exact) for exact in (True, False)] == [(3, 1), (101, 1)]
    assert RangeObserverConfig(fitted="ranges", window=21, order=5).fit(True) == (21, 5)


def test_a_start_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"z_0 .*; allowed"):
        observer(mission(), z_0=(1.0, 2.0))
