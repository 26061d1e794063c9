"""An estimator of a pose is not OK while it is wrong, names the ray at fault, and is right again at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.integrity.guard import alone
from mathnavi.estimators.integrity.ranging import guarded
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBank
from mathnavi.estimators.ranging.pose_filter import RangeEkf, RangeIekf
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging.integrity_judging import Watched
from mathnavi.studies.ranging.pose_integrity import watched

PERIOD, NOISE, ODOMETRY = 0.02, 0.02, (0.02, 0.02)
WALL = mn.wall_through([(0.0, 0.0), (4.0, -0.2), (4.6, 2.0), (2.4, 3.2), (0.2, 2.4)], order=8)
ANGLES = (0.0, math.pi / 2.0, -1.75)
SECONDS, BEGIN, END = 16.0, 4.0, 8.0  # [s] of a drive, and of its fault
FIRST, LAST = round(BEGIN / PERIOD), round(END / PERIOD)


class Drive(NamedTuple):
    """Truth (k, 3), and the readings of an ideal robot (k, 3), (k, 2)."""

    x: Array
    ranges: Array
    odometry: Array


def driven(seed: int, kidnapped: bool = False) -> Drive:
    """A drive on circles that change, with noise as declared."""
    rng = np.random.default_rng(seed)
    mission = mn.RangingMission(WALL, ANGLES, period=PERIOD)
    x, poses, inputs = np.array([2.0, 1.2, 0.3]), [], []
    for k in range(round(SECONDS / PERIOD)):
        if kidnapped and k == FIRST:
            x = np.array([3.4, 1.8, 2.0])
        u = np.array([0.25, 0.6 * math.copysign(1.0, math.sin(0.35 * k * PERIOD + 0.5))])
        x = mission.flow(x, u, PERIOD)
        poses.append(x)
        inputs.append(u)
    truth = np.array(poses)
    ranges = np.array([WALL.ranges(pose, ANGLES)[0] for pose in truth])
    noise = NOISE * rng.standard_normal(ranges.shape)
    return Drive(truth, ranges + noise, np.array(inputs) + ODOMETRY * rng.standard_normal((len(truth), 2)))


def found_by_bank(mission: mn.RangingMission) -> FeasibleSetBank:
    return FeasibleSetBank(FeasibleSetBank.Config(), mission)


def estimates(
    kind: Any, drive: Drive, known: bool = True, alone: bool = False, off: tuple[float, float] = (0.0, 0.0)
) -> list[Estimate]:
    start = mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)) if known else None
    ranging, odometry = mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY)
    mission = mn.RangingMission(WALL, ANGLES, ranging, odometry, map_deviation=off, start=start, period=PERIOD)
    build, finder = partial(kind, kind.Config()), None if kind is FeasibleSetBank else found_by_bank
    estimator: Any = build(mission) if alone else guarded(build, mission, finder=finder)
    found = []
    for k, (z, u) in enumerate(zip(drive.ranges, drive.odometry, strict=True)):
        t = PERIOD * (k + 1)
        found.append(estimator.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u))
    return found


def sure_and_wrong(found: list[Estimate], drive: Drive) -> float:
    """Time [s] in stretches of more than a second in which an estimate is OK and off by more than three deviations."""
    wrong = []
    for estimate, x in zip(found, drive.x, strict=True):
        d = estimate.x - x
        d[2] = math.remainder(d[2], 2.0 * math.pi)
        sure = estimate.status is Status.OK and estimate.covariance is not None
        wrong.append(sure and bool((np.abs(d) > 3.0 * np.sqrt(np.diag(estimate.covariance))).any()))
    edges = np.flatnonzero(np.diff([0, *np.array(wrong, dtype=int), 0]))
    lengths = edges[1::2] - edges[::2]
    return PERIOD * float(lengths[lengths > 1.0 / PERIOD].sum())


def blocked(z: Array) -> Array:
    return np.full_like(z, 0.3)


def stuck(z: Array) -> Array:
    return np.full_like(z, z[0])


def scaled(z: Array) -> Array:
    return 1.1 * z


def offset(z: Array) -> Array:
    return z + 0.1


@pytest.mark.parametrize("kind", [RangeEkf, RangeIekf, FeasibleSetBank], ids=lambda kind: kind.__name__)
def test_as_declared_nothing_alarms(kind: Any) -> None:
    """The words are those of the estimator alone."""
    for seed in range(2):
        drive, known = driven(seed), kind is not FeasibleSetBank
        found, bare = estimates(kind, drive, known), estimates(kind, drive, known, alone=True)
        assert [each.status for each in found] == [each.status for each in bare]
        assert all(each.status is Status.OK for each in found[100:])
        assert not any(each.extra["left_out"].any() for each in found)


@pytest.mark.parametrize("fault", [blocked, stuck, scaled, offset], ids=lambda fault: fault.__name__)
@pytest.mark.parametrize(("kind", "ray"), [(RangeEkf, 0), (RangeEkf, 2), (FeasibleSetBank, 1)])
def test_a_ray_at_fault_is_named_left_out_and_used_again(kind: Any, ray: int, fault: Callable[[Array], Array]) -> None:
    drive = driven(3)
    drive.ranges[FIRST:LAST, ray] = fault(drive.ranges[FIRST:LAST, ray])
    found = estimates(kind, drive, known=kind is not FeasibleSetBank)
    assert sure_and_wrong(found, drive) == 0.0
    named = [np.flatnonzero(each.extra["left_out"]).tolist() == [ray] for each in found[FIRST:LAST]]
    assert np.mean(named) > (0.8 if fault is stuck else 0.88)  # what is stuck is right until the robot has moved
    during = found[(FIRST + LAST) // 2]
    assert during.status is Status.DEGRADED
    assert f"ray {ray}" in during.message
    pairs = zip(found[FIRST:], drive.x[FIRST:], strict=True)
    assert max(np.hypot(*(each.x - x)[:2]) for each, x in pairs if each.status.usable) < 0.02
    assert found[-1].status is Status.OK
    assert not found[-1].extra["left_out"].any()


@pytest.mark.parametrize("kind", [RangeEkf, FeasibleSetBank], ids=lambda kind: kind.__name__)
def test_a_robot_that_is_carried_away_is_lost_and_found(kind: Any) -> None:
    drive = driven(5, kidnapped=True)
    found = estimates(kind, drive, known=kind is not FeasibleSetBank)
    assert sure_and_wrong(found, drive) == 0.0
    assert found[FIRST + 10].status is not Status.OK
    assert found[-1].status is Status.OK
    assert np.hypot(*(found[-1].x - drive.x[-1])[:2]) < 0.05


def test_the_first_word_of_a_local_filter_is_not_trusted_where_the_start_is_unknown() -> None:
    drive = driven(7)
    found = estimates(RangeEkf, drive, known=False)
    assert found[0].status is not Status.OK
    assert found[50].status is not Status.OK
    assert sure_and_wrong(found, drive) == 0.0
    assert found[-1].status is Status.OK


@pytest.mark.parametrize(
    "name",
    [
        "range_ekf",
        "range_iekf",
        "range_ukf",
        "range_particle",
        "moving_horizon",
        "feasible_set_bank",
        "range_certified",
    ],
)
def test_every_estimator_of_a_pose_that_the_command_line_names_has_its_monitor(name: str) -> None:
    drive, plugin = driven(3), load("estimators", name)
    drive.ranges[50:, 1] = 0.3
    start = mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05))
    ranging, odometry = mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY)
    mission = mn.RangingMission(WALL, ANGLES, ranging, odometry, start=start, period=PERIOD)
    estimator = plugin.build(plugin.Config(), mission)
    for k, (z, u) in enumerate(zip(drive.ranges[:70], drive.odometry, strict=False)):
        t = PERIOD * (k + 1)
        readings = (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u))
        found = estimator.update(t, readings, u)
        if k == 45:
            assert found.status is Status.OK
    assert found.extra["left_out"].shape == (4,)
    assert found.status is not Status.OK


def test_the_estimator_without_its_monitor_is_the_one_that_was_built() -> None:
    mission = mn.RangingMission(WALL, ANGLES, period=PERIOD)
    guard, bare = guarded(partial(RangeEkf, RangeEkf.Config()), mission), RangeEkf(RangeEkf.Config(), mission)
    assert isinstance(alone(guard), RangeEkf)
    assert alone(bare) is bare


def test_a_start_that_is_off_by_as_much_as_declared_is_the_fault_of_no_ray() -> None:
    """Linearised about it, a filter may be wrong for a moment, whose covariance is small already."""
    words = set()
    for seed in range(8):
        drive = driven(20 + seed)
        off = 0.05 * np.random.default_rng(seed).standard_normal(3)
        found = estimates(RangeEkf, drive._replace(x=drive.x + off))
        assert not any(each.extra["left_out"].any() for each in found), seed
        assert all(each.status is Status.OK for each in found[150:]), seed
        words |= {each.status for each in found[:150]}
    assert words <= {Status.OK, Status.DEGRADED}


@pytest.mark.parametrize("kind", [RangeEkf, RangeIekf], ids=lambda kind: kind.__name__)
def test_odometry_that_is_wrong_is_named_left_out_and_used_again(kind: Any) -> None:
    drive = driven(9)
    drive.odometry[FIRST:LAST] *= 1.3
    found = estimates(kind, drive)
    assert sure_and_wrong(found, drive) == 0.0
    named = [np.flatnonzero(each.extra["left_out"]).tolist() for each in found]
    assert named[LAST - 50] == [3]
    assert sum(each not in ([], [3]) for each in named) < 30
    assert "odometry" in found[LAST - 50].message
    assert Status.LOST not in {each.status for each in found}
    errors = np.array([np.hypot(*(each.x - x)[:2]) for each, x in zip(found, drive.x, strict=True)])
    assert errors.max() < 0.2
    assert named[-1] == []


def test_a_ray_that_drifts_is_not_taken_for_wheels_that_slip() -> None:
    for seed in range(3):
        drive = driven(60 + seed)
        drive.ranges[FIRST:LAST, seed] += 0.04 * PERIOD * np.arange(LAST - FIRST)
        assert sure_and_wrong(estimates(FeasibleSetBank, drive, known=False), drive) == 0.0, seed


def test_a_search_takes_a_share_of_each_update() -> None:
    calls = [0]

    class Counted(RangeEkf):
        """A filter that counts the updates of all its copies."""

        def update(self, *given: Any) -> Estimate:
            calls[0] += 1
            return super().update(*given)

    drive, counts = driven(3), list[int]()
    drive.ranges[FIRST:LAST, 0] += 0.1
    mission = mn.RangingMission(
        WALL, ANGLES, mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY), period=PERIOD,
        start=mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)),
    )  # fmt: skip
    guard = guarded(partial(Counted, Counted.Config()), mission, cost=1e-3)
    for k, (z, u) in enumerate(zip(drive.ranges[:LAST], drive.odometry, strict=False)):
        t, calls[0] = PERIOD * (k + 1), 0
        found = guard.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u)
        counts.append(calls[0])
    assert max(counts) == 1 + round(0.2 * PERIOD / 1e-3)
    assert sum(counts) > 200 + LAST
    assert found.extra["left_out"].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_of_particles_a_ray_at_fault_is_found_by_a_filter_that_stands_in() -> None:
    plugin, drive = load("estimators", "range_particle"), driven(3)
    drive.ranges[150:, 1] += 0.2
    mission = mn.RangingMission(
        WALL, ANGLES, mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY), period=PERIOD,
        start=mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)),
    )  # fmt: skip
    estimator, extras = (
        plugin.build(plugin.Config(min_particles=200, max_particles=400), mission),
        set[tuple[str, ...]](),
    )
    for k, (z, u) in enumerate(zip(drive.ranges[:210], drive.odometry, strict=False)):
        t = PERIOD * (k + 1)
        found = estimator.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u)
        extras.add(tuple(found.extra))
    assert found.extra["left_out"].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert len(extras) == 1
    assert np.hypot(*(found.x - drive.x[209])[:2]) < 0.06


def test_the_same_readings_give_the_same_estimates_bit_for_bit() -> None:
    drive = driven(3)
    drive.ranges[FIRST:LAST, 0] = 0.3
    one, other = (estimates(RangeEkf, drive) for _ in range(2))
    assert all((a.x == b.x).all() and a.status is b.status for a, b in zip(one, other, strict=True))


def test_an_estimate_that_is_not_finite_is_lost_and_begins_again() -> None:
    class Broken(RangeEkf):
        """A filter whose covariance is lost after its tenth reading."""

        count = 0

        def update(self, *given: Any) -> Estimate:
            estimate, self.count = super().update(*given), self.count + 1
            broken = estimate.covariance is not None and 10 < self.count < 1000
            return replace(estimate, covariance=np.full((3, 3), math.nan)) if broken else estimate

    class Sound(Broken):
        count = 1000

    drive, made = driven(3), list[RangeEkf]()

    def build(mission: mn.RangingMission) -> RangeEkf:
        made.append((Sound if made else Broken)(RangeEkf.Config(), mission))
        return made[-1]

    start = mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05))
    ranging, odometry = mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY)
    guard = guarded(
        build, mn.RangingMission(WALL, ANGLES, ranging, odometry, start=start, period=PERIOD), finder=found_by_bank
    )
    found = []
    for k, (z, u) in enumerate(zip(drive.ranges, drive.odometry, strict=True)):
        t = PERIOD * (k + 1)
        found.append(guard.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u))
    assert all(each.status is not Status.OK for each in found if not np.isfinite(each.covariance).all())
    assert any(each.status is Status.LOST for each in found)
    assert len(made) == 2
    assert found[-1].status is Status.OK


def test_an_estimator_that_fails_without_a_ray_explains_nothing_and_goes_on() -> None:
    class Needy(RangeEkf):
        """A filter that needs the first ray."""

        def update(self, t: float, measurements: Any, command: Array) -> Estimate:
            if np.isnan(measurements[0].value[0]):
                raise np.linalg.LinAlgError("singular")
            return super().update(t, measurements, command)

    drive = driven(3)
    drive.ranges[FIRST:LAST, 2] = 0.3
    named = [np.flatnonzero(each.extra["left_out"]).tolist() for each in estimates(Needy, drive)]
    assert named[(FIRST + LAST) // 2] == [2]
    drive = driven(3)
    drive.ranges[FIRST:LAST, 0] = 0.3
    found = estimates(Needy, drive)
    assert not any(each.extra["left_out"][0] for each in found)
    assert sure_and_wrong(found, drive) == 0.0


def two_rays(seed: int, scale: float = 0.0) -> list[tuple[Array, Estimate]]:
    """Poses, and estimates of a bank with two rays that does not know its start, on a circle that is read exactly.

    ``scale`` is the declared deviation of the odometry's scale.
    """
    angles = (0.0, 0.5 * math.pi)
    odometry = OdometryQuality((0.005, 0.005), scale)
    mission = mn.RangingMission(WALL, angles, RangeQuality(absolute=0.01), odometry, period=PERIOD)
    rng = np.random.default_rng(seed)
    v, radius, side, at = rng.uniform(0.3, 0.6), rng.uniform(0.5, 0.7), rng.choice((-1.0, 1.0)), rng.uniform(-3.0, 3.0)
    x = np.array([2.1 + radius * math.cos(at), 1.4 + radius * math.sin(at), at + side * 0.5 * math.pi])
    u = np.array([v, side * v / radius])
    bank, told = FeasibleSetBank.build(FeasibleSetBank.Config(), mission), []
    for k in range(400):
        x = mission.flow(x, u, PERIOD)
        t = (k + 1) * PERIOD
        read = [Measurement("ranges", t, WALL.ranges(x, angles)[0]), Measurement("odometry", t, u)]
        told.append((x, bank.update(t, read, u)))
    return told


@pytest.mark.parametrize(("seed", "scale"), [(35, 0.0), (47, 0.02)])
def test_of_two_rays_none_is_left_out_while_the_pose_itself_may_be_another(seed: int, scale: float) -> None:
    assert not any(estimate.extra["left_out"].any() for _, estimate in two_rays(seed, scale))


def test_noise_that_was_larger_is_no_evidence_once_it_is_as_declared() -> None:
    drive, rng = driven(20), np.random.default_rng(20)
    drive.ranges[FIRST:LAST] += 2.0 * NOISE * rng.standard_normal((LAST - FIRST, len(ANGLES)))
    found = estimates(RangeEkf, drive)
    assert "times the declared noise" in found[LAST - 1].message
    assert Status.LOST not in {each.status for each in found}
    assert all(each.status is Status.OK for each in found[LAST + round(4.5 / PERIOD) :])


def test_what_wheels_that_slip_explain_alone_is_not_ok() -> None:
    """Ranges that are late turn the pose; after a turn the other way round, the bank takes that for slip."""
    drive = driven(20)
    true = np.array([WALL.ranges(x, ANGLES)[0] for x in drive.x])
    drive.ranges[FIRST:LAST] += true[FIRST - 3 : LAST - 3] - true[FIRST:LAST]
    found = estimates(FeasibleSetBank, drive, known=False)
    doubted = next(k for k, each in enumerate(found) if "its wheels slip" in each.message)
    assert doubted < LAST
    assert {each.status for each in found[doubted : doubted + round(5.0 / PERIOD)]} == {Status.DEGRADED}
    assert found[-1].status is Status.OK


@pytest.mark.parametrize(("seed", "found_again"), [(24, False), (38, True)])
def test_where_two_rays_of_three_are_stuck_no_pose_is_sure_and_a_rival_finds_it_again(
    seed: int, found_again: bool
) -> None:
    drive = driven(seed)
    for ray in np.random.default_rng(seed).permutation(3)[:2]:
        drive.ranges[FIRST:LAST, ray] = drive.ranges[FIRST, ray]
    found = estimates(FeasibleSetBank, drive, known=False)
    assert sure_and_wrong(found, drive) == 0.0
    if found_again:
        assert found[-1].status is Status.OK
        assert np.hypot(*(found[-1].x - drive.x[-1])[:2]) < 0.05


def test_a_search_that_takes_long_is_given_up_once_nothing_alarms() -> None:
    drive, rng = driven(3), np.random.default_rng(3)
    during = slice(FIRST, FIRST + 40)
    drive.ranges[during] += 4.0 * NOISE * rng.standard_normal((40, len(ANGLES)))
    mission = mn.RangingMission(
        WALL, ANGLES, mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY), period=PERIOD,
        start=mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)),
    )  # fmt: skip
    guard, words = guarded(partial(RangeEkf, RangeEkf.Config()), mission, cost=PERIOD), list[Status]()
    for k, (z, u) in enumerate(zip(drive.ranges, drive.odometry, strict=True)):
        t = PERIOD * (k + 1)
        words.append(guard.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u).status)
    assert words[FIRST + 40] is Status.DEGRADED
    assert set(words[-50:]) == {Status.OK}


def test_a_filter_that_refuses_its_readings_since_an_alarm_begins_again() -> None:
    """One that calls itself lost then is not waited for."""
    plugin, drive = load("estimators", "moving_horizon"), driven(5, kidnapped=True)
    mission = mn.RangingMission(
        WALL, ANGLES, mn.RangeQuality(absolute=NOISE), mn.OdometryQuality(noise=ODOMETRY), period=PERIOD,
        start=mn.KnownStart(tuple(drive.x[0]), (0.05, 0.05, 0.05)),
    )  # fmt: skip
    estimator, own = plugin.build(plugin.Config(), mission), set[Status]()
    for k, (z, u) in enumerate(zip(drive.ranges, drive.odometry, strict=True)):
        t = PERIOD * (k + 1)
        found = estimator.update(t, (mn.Measurement("ranges", t, z), mn.Measurement("odometry", t, u)), u)
        own.add(found.status)
        if k > FIRST + 50 and found.status is Status.OK:
            break
    assert Status.LOST in own
    assert found.status is Status.OK
    assert np.hypot(*(found.x - drive.x[k])[:2]) < 0.05


@pytest.mark.parametrize("kind", [RangeEkf, FeasibleSetBank], ids=lambda kind: kind.__name__)
def test_how_far_a_map_may_be_off_is_part_of_the_covariance_and_of_nothing_else(kind: Any) -> None:
    """The walls are beside their true place: readings do not tell, the covariance and the protection level do."""
    drive, known = driven(5), kind is not FeasibleSetBank
    c, s = math.cos(-0.015), math.sin(-0.015)
    true = drive.x.copy()
    true[:, :2] = true[:, :2] @ np.array([[c, s], [-s, c]]) + [0.06, -0.05]
    true[:, 2] += -0.015
    as_drawn, declared = estimates(kind, drive, known), estimates(kind, drive, known, off=(0.05, 0.01))
    assert all((one.x == other.x).all() for one, other in zip(as_drawn, declared, strict=True))
    beside = drive._replace(x=true)
    assert sure_and_wrong(as_drawn, beside) > 5.0
    assert sure_and_wrong(declared, beside) == 0.0
    added = declared[-1].covariance - as_drawn[-1].covariance
    assert np.allclose(added, np.diag([0.05**2, 0.05**2, 0.01**2]))
    assert np.allclose(declared[-1].extra["protection"] - as_drawn[-1].extra["protection"], [0.15, 0.03])


def test_every_estimator_within_walls_declares_a_map_that_may_be_off_or_refuses_it() -> None:
    from mathnavi.models.unicycle.mission import RangingMission

    start = mn.KnownStart((2.0, 1.2, 0.3), (0.05, 0.05, 0.05))
    mission = RangingMission(WALL, ANGLES, mn.RangeQuality(absolute=NOISE), start=start, period=PERIOD)
    moved = replace(mission, map_deviation=(0.05, 0.01))
    rho = WALL.ranges(np.array(start.pose), ANGLES)[0]
    readings = mn.Measurement("ranges", PERIOD, rho), mn.Measurement("odometry", PERIOD, np.zeros(2))
    for name in ("feasible_set_bank", "range_ekf", "range_iekf", "range_ukf", "range_particle", "moving_horizon"):
        kind: Any = load("estimators", name)
        P, Q = (
            kind.build(kind.Config(), each).update(PERIOD, readings, np.zeros(2)).covariance
            for each in (mission, moved)
        )
        assert np.allclose(Q - P, np.diag([0.05**2, 0.05**2, 0.01**2]), atol=1e-6), name
    for name in ("range_observer", "range_certified"):
        kind = load("estimators", name)
        with pytest.raises(mn.MissionError, match=r"map_deviation = \(0.05, 0.01\) with"):
            kind.build(kind.Config(), moved)


@pytest.mark.parametrize("off", [(-0.05, 0.0), (0.0, math.nan), (0.0, -1.0)])
def test_a_map_deviation_is_not_negative(off: tuple[float, float]) -> None:
    with pytest.raises(FieldError, match="map_deviation"):
        mn.RangingMission(WALL, ANGLES, map_deviation=off)


def test_a_pose_found_again_while_the_wall_is_not_where_the_map_has_it_is_as_unsure_as_a_fault_may_make_it() -> None:
    done = watched(Watched("feasible_set_bank", "wall 0.1 m wider", 5002, monitored=True))
    assert done.position == done.rest == 0.0  # without, 14 % of the time
    assert done.recovered < 12.0
