"""The bank finds the robot from anywhere, finds it again, and says when it does not know."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from scipy.special import chdtri

import mathnavi as mn
from mathnavi.estimators.ranging.bank_kernels import (
    Hypotheses,
    Scoring,
    apart,
    condition_each,
    drop,
    no_hypotheses,
)
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank, FeasibleSetBankConfig
from mathnavi.estimators.ranging.kalman_kernels import RaySensors, no_innovations
from mathnavi.estimators.ranging.noise_kernels import WINDOW, declared_noise
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.field.curve import BEAN, Curve
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.kernels import rays_at
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from tests.estimators.ranging.runs import with_ranges
from tests.estimators.ranging.walls import FIELD, SENSORS
from tests.ranging import Step, driven


def mission(sensors: str = "2s", curve: Wall = FIELD, *, noise: bool = True, outliers: float = 0.0) -> RangingMission:
    return RangingMission(
        curve,
        tuple(math.radians(angle) for angle in SENSORS[sensors]),
        RangeQuality(0.05, outliers=outliers) if noise else RangeQuality(),
        OdometryQuality((0.05, 0.05), 0.02) if noise else OdometryQuality(),
    )


def drawn(curve: Curve, rng: np.random.Generator) -> Array:
    """A start (3,) from which the figure of eight stays within the wall."""
    while True:
        start = curve.draw(rng, 0.2)
        path = driven(RangingMission(curve, (0.0,), period=0.1), start, 8.0)
        if all(curve.contains(step.truth[:2], 0.2) for step in path):
            return start


STARTS = [drawn(FIELD, np.random.default_rng(seed)) for seed in (1, 2, 3)]


def estimates_of(
    task: RangingMission, steps: Sequence[Step] | Iterator[Step], **fields: object
) -> list[tuple[Step, Estimate]]:
    bank = FeasibleSetBank(FeasibleSetBankConfig(**fields), task)  # type: ignore[arg-type]
    return [(step, bank.update(step.t, step.measurements, step.command)) for step in steps]


def last_errors(
    task: RangingMission, estimates: list[tuple[Step, Estimate]], seconds: float = 1.0
) -> tuple[float, float]:
    """The largest of the last so many seconds, [m] and [rad]."""
    tail = estimates[-round(seconds / task.period) :]
    position, heading = zip(*(task.error(estimate.x, step.truth) for step, estimate in tail), strict=True)
    return max(position), max(heading)


@pytest.mark.parametrize("curve", [FIELD, BEAN], ids=lambda curve: curve.name.split()[0])
@pytest.mark.parametrize("sensors", ["2s", "2t", "4"])
def test_it_finds_the_robot_from_anywhere(sensors: str, curve: Curve) -> None:
    task = mission(sensors, curve)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        estimates = estimates_of(task, driven(task, drawn(curve, rng), 5.0, rng=rng))
        position, heading = last_errors(task, estimates)
        assert position < 0.15
        assert heading < 0.15
        assert estimates[-1][1].status is Status.OK


def thinned(step: Step, k: int, reads: Callable[[int], Sequence[bool]]) -> Step:
    """A step that lacks the ranges of the rays that are not read at call k."""
    return with_ranges(step, lambda ranges: np.where(reads(k), ranges, np.nan))


@pytest.mark.parametrize(
    ("reads", "sensors"),
    [
        (lambda k: [k % 5 == 0] * 2, "2s"),  # wheels at 50 Hz, a lidar at 10 Hz
        (lambda k: [k % 10 == 3] * 4, "4"),
        (lambda k: [k % 4 == ray for ray in range(4)], "4"),  # sonars that are fired in turn
        (lambda k: [k % 12 == 3 * ray for ray in range(4)], "4"),
        (lambda k: [k % 7 == 0, k % 5 == 0], "2s"),
    ],
    ids=["a fifth", "a tenth", "in turn", "seldom and in turn", "each at its own rate"],
)
def test_it_starts_where_ranges_come_more_seldom_than_odometry(
    reads: Callable[[int], Sequence[bool]], sensors: str
) -> None:
    task = dataclasses.replace(mission(sensors), period=0.02)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        steps = [thinned(step, k, reads) for k, step in enumerate(driven(task, drawn(FIELD, rng), 8.0, rng=rng))]
        estimates = estimates_of(task, steps)
        position, heading = last_errors(task, estimates)
        assert position < 0.2
        assert heading < 0.2
        assert estimates[-1][1].status is Status.OK


def test_a_sensor_may_be_named_a_turn_apart_and_four_across_find_the_robot() -> None:
    """0, 90, 180, -90 degrees: rays in two lines, of which either is at its own images in the ellipse."""
    named = mission("4")
    task = dataclasses.replace(named, angles=tuple(math.radians(angle) for angle in (0.0, 90.0, 180.0, -90.0)))
    for seed in range(6):
        start = drawn(FIELD, np.random.default_rng(seed))
        one, other = (
            estimates_of(each, driven(each, start, 2.0, rng=np.random.default_rng(seed + 100)))
            for each in (task, named)
        )
        assert max(last_errors(task, one)) < 0.15
        np.testing.assert_allclose(one[-1][1].x, other[-1][1].x, atol=1e-6)


@pytest.mark.parametrize("sensors", ["2s", "3"])
def test_without_noise_the_error_vanishes(sensors: str) -> None:
    task = mission(sensors, noise=False)
    for start in STARTS:
        estimates = estimates_of(task, driven(task, start, 6.0))
        assert last_errors(task, estimates) < (1e-3, 1e-3)


@pytest.mark.parametrize("readings", [9, 10])
def test_odometry_leads_the_first_hypotheses_on_from_the_middle_of_the_readings(readings: int) -> None:
    """Of an even number, from between two of them."""
    task = mission("4", noise=False)
    steps = itertools.islice(driven(task, STARTS[0], 1.0), readings)
    step, estimate = estimates_of(task, steps, readings=readings)[-1]
    assert min(task.error(pose, step.truth)[0] for pose in estimate.extra["hypotheses"] if np.isfinite(pose[0])) < 1e-3


def test_no_first_hypothesis_contradicts_the_readings() -> None:
    task = mission("4")
    for seed, start in enumerate(STARTS):
        steps = itertools.islice(driven(task, start, 1.0, rng=np.random.default_rng(seed)), 10)
        step, estimate = estimates_of(task, steps)[-1]
        ranges = task.curve.ranges(step.truth, task.alpha)[0]
        poses = [pose for pose in estimate.extra["hypotheses"] if np.isfinite(pose[0])]
        assert max(np.abs(task.curve.ranges(pose, task.alpha)[0] - ranges).max() for pose in poses) < 1.0


def test_until_one_hypothesis_is_twice_as_likely_as_all_beyond_its_errors_it_is_initialising() -> None:
    task = mission()
    estimates = [each for _, each in estimates_of(task, driven(task, STARTS[0], 2.5, rng=np.random.default_rng(0)))]
    known = [estimate.status is Status.OK for estimate in estimates]
    assert not any(known[:10])  # the tenth has hypotheses, which nothing has been asked of yet
    assert known[-1]
    for estimate, is_known in zip(estimates[9:], known[9:], strict=True):
        weights = estimate.extra["weights"]
        assert np.nansum(weights) == pytest.approx(1.0)
        assert is_known or np.nanmax(weights) < 2.0 / 3.0 or "do not confirm" in estimate.message
        if is_known:  # whatever is beyond the errors that it declares is half as likely at most
            assert estimate.covariance is not None
            d = estimate.extra["hypotheses"][:, :3] - estimate.x
            d[:, 2] = np.arctan2(np.sin(d[:, 2]), np.cos(d[:, 2]))
            beyond = np.einsum("ki,ki->k", d, np.linalg.solve(estimate.covariance, d.T).T) > chdtri(3, 0.01)
            assert np.nansum(weights[beyond]) <= 0.5 * np.nanmax(weights)
    assert estimates[8].covariance is None
    assert estimates[9].covariance is not None


@pytest.mark.parametrize(("sensors", "hypotheses"), [("2s", 16), ("4", 1)])
def test_a_robot_that_is_carried_away_is_found_again_and_the_status_shows_it(sensors: str, hypotheses: int) -> None:
    task, rng = mission(sensors), np.random.default_rng(3)
    before = list(driven(task, STARTS[0], 3.0, rng=rng))
    after = [
        dataclasses.replace(
            step,
            t=step.t + 3.0,
            measurements=tuple(dataclasses.replace(each, t=each.t + 3.0) for each in step.measurements),
        )
        for step in driven(task, STARTS[1], 4.0, rng=rng)
    ][1:]
    estimates = estimates_of(task, [*before, *after], hypotheses=hypotheses)
    again = [step.t for step, estimate in estimates if estimate.status is Status.INITIALISING and step.t > 3.0]
    assert again
    assert again[0] < 3.5
    assert max(last_errors(task, estimates)) < 0.15


@pytest.mark.parametrize("seed", [1, 16])
def test_two_rays_are_not_sure_of_a_pose_that_the_way_to_it_contradicts(seed: int) -> None:
    """A hypothesis that follows two rays for a while, by its own motion, is no pose that is known."""
    rng = np.random.default_rng(seed)
    wall = mn.wall_through([(0.0, 0.0), (3.0, -0.4), (6.0, 0.2), (5.8, 3.1), (2.7, 3.6), (0.3, 3.0)], order=8)
    angles, pose = [0.0, 0.5 * math.pi], np.array([1.6, 1.2, rng.uniform(-math.pi, math.pi)])
    bank = mn.FeasibleSetBank(wall, angles, range_noise=0.01, period=0.02)
    first_sure = None
    for k in range(300):  # within the wall for all of them
        pose += 0.02 * np.array([0.5 * np.cos(pose[2] + 0.006), 0.5 * np.sin(pose[2] + 0.006), 0.6])
        estimate = bank.step(0.02, wall.ranges(pose, angles)[0], odometry=[0.5, 0.6])
        if estimate.status is Status.OK:
            first_sure = k if first_sure is None else first_sure
            assert np.hypot(*(estimate.pose - pose)[:2]) < 0.1
    assert first_sure is not None
    assert first_sure >= 50  # a second of motion at least


def test_outliers_are_survived() -> None:
    task, rng = mission("4", outliers=0.2), np.random.default_rng(1)

    def corrupted(ranges: Array) -> Array:
        return np.where(rng.random(len(ranges)) < 0.2, rng.uniform(0.1, 7.0, len(ranges)), ranges)

    steps = [with_ranges(s, corrupted) for s in driven(task, STARTS[1], 5.0, rng=np.random.default_rng(2))]
    estimates = estimates_of(task, steps)
    assert max(last_errors(task, estimates)) < 0.15
    assert all(estimate.status is Status.OK for _, estimate in estimates[100:])


ROOM = Polygon((((0.0, 0.0), (8.0, 0.0), (8.0, 4.0), (11.0, 4.0), (11.0, 6.0), (0.0, 6.0)),))
EIGHT, KNOWN = np.linspace(-3.0, 2.5, 8), (3.0, 2.5, 0.3)


def room_mission() -> RangingMission:
    known = KnownStart(KNOWN, (0.1, 0.1, 0.1))
    return dataclasses.replace(mission(curve=ROOM, outliers=0.1), angles=tuple(EIGHT.tolist()), start=known)


def test_errors_of_a_map_that_stay_widen_the_covariance() -> None:
    """Errors of the same size, drawn anew for each reading or once."""
    deviation = []
    for stays in (False, True):
        rng, offsets = np.random.default_rng(3), np.random.default_rng(4).standard_normal(8)

        def off(ranges: Array) -> Array:
            return ranges * (1.0 + 0.05 * (offsets if stays else rng.standard_normal(8)))  # noqa: B023

        steps = driven(room_mission(), np.array(KNOWN), 4.0)
        _, last = estimates_of(room_mission(), [with_ranges(s, off) for s in steps])[-1]
        assert last.covariance is not None
        deviation.append(math.sqrt(np.trace(last.covariance[:2, :2])))
    assert deviation[1] > 1.5 * deviation[0]


@pytest.mark.parametrize("unmapped", [0, 1, 4])
def test_where_the_map_lacks_much_of_what_is_there_the_estimate_is_degraded(unmapped: int) -> None:
    """Of eight beams, one or four end on what is not on the map, from 2 s on."""
    rng = np.random.default_rng(3)

    def hidden(ranges: Array) -> Array:
        return np.where(np.arange(8) < unmapped, rng.uniform(0.2, 0.7, 8) * ranges, ranges)

    steps = driven(room_mission(), np.array(KNOWN), 4.0, rng=np.random.default_rng(4))
    estimates = estimates_of(room_mission(), [with_ranges(s, hidden) if s.t >= 2.0 else s for s in steps], misfit=30.0)
    assert all(each.status is Status.OK for step, each in estimates if 0.5 < step.t < 2.0)
    late = {each.status for step, each in estimates if step.t > 2.5}
    assert late == {Status.DEGRADED if unmapped == 4 else Status.OK}


def test_lost_rays_are_done_without() -> None:
    task, rng = mission("4"), np.random.default_rng(1)
    steps = [
        with_ranges(s, lambda ranges: np.where(rng.random(len(ranges)) < 0.6, np.nan, ranges))
        for s in driven(task, STARTS[1], 5.0, rng=np.random.default_rng(2))
    ]
    assert max(last_errors(task, estimates_of(task, steps))) < 0.15


@pytest.mark.parametrize("nonsense", [np.nan, np.inf, -np.inf, -1.0, 0.0, 1e300])
def test_nonsense_is_no_range(nonsense: float) -> None:
    """The estimate goes on by odometry, and after the timeout it is lost."""
    task = mission("4", noise=False)
    steps = list(driven(task, STARTS[0], 3.0))
    good, bad = steps[:150], [with_ranges(step, lambda r: np.full_like(r, nonsense)) for step in steps[150:]]
    estimates = estimates_of(task, [*good, *bad])
    assert all(np.isfinite(estimate.x).all() for _, estimate in estimates)
    assert estimates[195][1].status is Status.OK
    assert estimates[-1][1].status is Status.LOST
    assert last_errors(task, estimates)[0] < 0.02


def test_where_the_start_is_known_it_is_one_filter_that_stays_on_the_truth() -> None:
    start = STARTS[0]
    task = dataclasses.replace(mission(noise=False), start=KnownStart(tuple(start), (0.3, 0.3, 0.3)))
    estimates = estimates_of(task, driven(task, start, 2.0))
    assert all(np.isfinite(estimate.extra["scores"]).sum() == 1 for _, estimate in estimates)
    assert max(last_errors(task, estimates, 2.0)) < 1e-9
    unread = FeasibleSetBank(FeasibleSetBankConfig(), task).update(0.0, [], np.zeros(2))
    np.testing.assert_allclose(np.array(unread.covariance), 0.09 * np.eye(3))


def test_the_bias_of_odometry_is_found() -> None:
    """With it the heading would be off by 2 % of what was turned, and no range would show it while there are none."""
    task = mission("4")
    steps = list(driven(task, STARTS[0], 14.0, rng=np.random.default_rng(0)))
    blind = [with_ranges(step, lambda ranges: np.full_like(ranges, np.nan)) for step in steps[1000:]]
    estimates = estimates_of(task, [*steps[:1000], *blind])
    unbiased = estimates[999][0].truth
    naive = [unbiased]
    for step in steps[1000:]:
        naive.append(task.flow(naive[-1], step.measurements[1].value, task.period))
    error = task.error(naive[-1], steps[-1].truth)[0]
    assert task.error(estimates[-1][1].x, steps[-1].truth)[0] < 0.6 * error


def test_it_knows_how_good_it_is() -> None:
    """The average NEES of 40 runs, with limits that one of 1000 consistent filters is beyond."""
    task, squares = mission("4"), []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        bias = dataclasses.replace(task.odometry, bias=float(rng.choice((-0.02, 0.02))))
        *_, (step, estimate) = estimates_of(
            task, driven(dataclasses.replace(task, odometry=bias), drawn(FIELD, rng), 2.0, rng=rng)
        )
        error = task.difference(estimate.x, step.truth)
        assert estimate.covariance is not None
        squares.append(error @ np.linalg.solve(estimate.covariance, error))
    assert 1.9 < np.mean(squares) < 4.4


def test_the_same_seed_is_the_same_estimate_and_another_is_not() -> None:
    task = mission()
    steps = list(driven(task, STARTS[0], 0.5, rng=np.random.default_rng(0)))
    first, second, other = (estimates_of(task, steps, seed=seed) for seed in (1, 1, 2))
    for (_, one), (_, same) in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.extra["hypotheses"], same.extra["hypotheses"])
    assert not np.array_equal(first[-1][1].extra["hypotheses"], other[-1][1].extra["hypotheses"], equal_nan=True)


def test_hypotheses_fade_until_one_is_left() -> None:
    task = mission("2t")
    estimates = estimates_of(task, driven(task, STARTS[0], 8.0, rng=np.random.default_rng(0)))
    alive = [int(np.isfinite(estimate.extra["scores"]).sum()) for _, estimate in estimates[9:]]
    assert alive[0] > 8
    assert alive[-1] == 1
    more = [later - earlier for earlier, later in itertools.pairwise(alive) if later > earlier]
    assert len(more) < 5  # poses that fit the way as well as the best, found when it is to be confirmed
    for _, estimate in estimates[9:]:
        assert np.nanmax(estimate.extra["scores"]) == 0.0
        best = int(np.nanargmax(estimate.extra["scores"]))
        np.testing.assert_array_equal(estimate.extra["hypotheses"][best], estimate.x)


def hypotheses_at(x: Array, deviation: float, rays: int) -> Hypotheses:
    """Hypotheses at states x (K, 4) with a standard deviation [m, rad], all as likely."""
    bank = no_hypotheses(len(x), rays, WINDOW)
    bank.x[:], bank.P[:], bank.score[:] = x, deviation**2 * np.eye(4), 0.0
    return bank


def test_twins_under_the_symmetry_of_the_wall_are_one() -> None:
    x = np.array([[0.5, 0.2, 0.3, 0.0], [-0.5, -0.2, 0.3 + math.pi, 0.0], [0.5, -0.2, 0.3, 0.0], [1.0, 0.2, 0.3, 0.0]])
    bank, scoring, centre = hypotheses_at(x, 1e-2, 2), Scoring(0.995, 0.98, -20.0, 1.0), FIELD.centre
    bank.score[:] = [0.0, -1.0, -1.0, -30.0]
    drop(bank, 0, scoring, (FIELD.symmetry, *centre))
    np.testing.assert_array_equal(np.isnan(bank.score), [False, True, False, True])
    bank.score[:] = [0.0, -1.0, -1.0, -3.0]
    drop(bank, 0, scoring, (1, *centre))
    assert np.isfinite(bank.score).all()


def test_a_hypothesis_within_the_errors_of_the_best_is_no_doubt_about_it() -> None:
    x = np.array([[0.5, 0.2, 0.3, 0.0], [0.53, 0.2, 0.3, 0.0], [-0.53, -0.2, 0.3 + math.pi, 0.0], [0.6, 0.2, 0.3, 0.0]])
    bank = hypotheses_at(x, 1e-2, 2)
    symmetry = (FIELD.symmetry, *FIELD.centre)
    np.testing.assert_array_equal(apart(bank, 0, symmetry, 11.3), [False, False, False, True])
    np.testing.assert_array_equal(apart(bank, 0, symmetry, 8.0), [False, True, True, True])
    bank.score[1] = np.nan
    np.testing.assert_array_equal(apart(bank, 0, (1, *FIELD.centre), 11.3), [False, False, True, True])


def test_scores_are_how_likely_the_hypotheses_are() -> None:
    alpha, truth = np.array([-1.0, 0.0, 1.0]), np.array([0.5, 0.2, 0.3, 0.0])
    bank = hypotheses_at(np.array([[0.8, 0.2, 0.3, 0.0], truth, truth]), 0.1, 3)
    bank.score[2] = np.nan
    z, sensors = FIELD.ranges(truth[:3], alpha)[0], RaySensors(rays_at(alpha), 0.05, 1e-4, 15.0, 0.0, 8.0)
    scoring, noise = Scoring(0.995, 0.98, -20.0, 1.0), declared_noise(0.0)
    best, nis, rays = condition_each(bank, 0, z, FIELD.wall, sensors, noise, scoring, no_innovations(3))
    assert (best, rays) == (1, 3)
    assert nis == pytest.approx(0.0, abs=1e-9)
    assert bank.score[1] == 0.0
    assert bank.score[0] < -0.5
    assert np.isnan(bank.score[2])
    assert bank.misfit[1] == pytest.approx(0.98)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("hypotheses", 0), ("candidates", 0), ("readings", 0), ("projections", 0), ("deviation", (0.0, 0.1, 0.1)),
        ("deviation", (math.nan, 0.1, 0.1)), ("forgetting", 1.0), ("forgetting", math.nan), ("lowest", 0.0),
        ("misfit", 1.0), ("gate", 0.0), ("timeout", 0.0), ("timeout", math.inf), ("seed", -1),
    ],
)  # fmt: skip
def test_a_field_out_of_its_range_is_refused(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*; allowed: "):
        FeasibleSetBankConfig(**{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("readings", [1, 2, 9])
@pytest.mark.parametrize("hypotheses", [1, 3])
def test_few_readings_and_hypotheses_do_too(readings: int, hypotheses: int) -> None:
    task = mission("4", noise=False)
    estimates = estimates_of(task, driven(task, STARTS[0], 3.0), readings=readings, hypotheses=hypotheses)
    assert all(estimate.extra["hypotheses"].shape == (hypotheses, 3) for _, estimate in estimates)
    assert all(np.isfinite(estimate.x).all() for _, estimate in estimates)
