"""The contract of every installed entry of ``mathnavi.estimators``, those of other packages included.

An estimator is flown on every bench that fits the missions it is built for, by the type of ``build``'s argument
``mission``: a small simulated vehicle with the sensors that the estimator asks for. Those that declare what they are as
observers are held to Definition 2.1 of the thesis on a silent bench, one without noise whose start is known.
"""

from __future__ import annotations

import dataclasses
import math
import pickle
import re
import typing
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.ranging.observer import FEED_FORWARDS, FeedForward, RangeObserver, RangeObserverConfig
from mathnavi.estimators.velocity.possible import impossible
from mathnavi.interfaces.innovations import INNOVATION_STD, INNOVATIONS
from mathnavi.interfaces.observer_properties import ObserverProperties
from mathnavi.interfaces.protocols import Estimator, EstimatorPlugin, StateView
from mathnavi.interfaces.reading_counts import Unused, unused_in
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.sim.engine.loop import whole_ticks
from tests.contracts.benches import BENCHES, ONLY, Bench, Step, bench_of

PLUGINS = {entry.name: entry for entry in entry_points(group="mathnavi.estimators")}


def benches_of(plugin: Any) -> list[str]:
    """The benches whose missions a plug-in is built for, but for systems that it refuses."""
    fitting = [name for name in BENCHES if fits(plugin, bench_of(name, False).mission)]
    return fitting or [name for name in ONLY if fits(plugin, bench_of(name, False).mission)]


def fits(plugin: Any, mission: Any) -> bool:
    kind = typing.get_type_hints(plugin.build).get("mission")
    # What is estimated of a quadrotor is its point mass, and attitude and rate beside it: an estimator of any whole
    # state says something else.
    others = not isinstance(mission, kind or object)
    if others or (isinstance(mission, QuadrotorMission) and kind is not QuadrotorMission):
        return False
    try:
        plugin.build(plugin.Config(), mission)
    except ValueError as error:
        return kind is not None and not re.match("(system|beacons) = .*; allowed", str(error))
    except Exception:  # without a type hint it fits what it is built for without an error
        if kind is None:
            return False
        raise
    return True


FLOWN = [(name, bench) for name in sorted(PLUGINS) for bench in benches_of(PLUGINS[name].load())]


@pytest.fixture(scope="module", params=FLOWN, ids=" on ".join)
def flown(request: pytest.FixtureRequest) -> tuple[str, str]:
    """A plug-in and a bench that fits it, by name."""
    chosen: tuple[str, str] = request.param
    return chosen


@pytest.fixture
def plugin(flown: tuple[str, str]) -> type[EstimatorPlugin]:
    loaded: type[EstimatorPlugin] = PLUGINS[flown[0]].load()
    return loaded


@pytest.fixture
def bench(flown: tuple[str, str]) -> Bench:
    return bench_of(flown[1], False)


@pytest.fixture
def estimator(plugin: type[EstimatorPlugin], bench: Bench) -> Estimator:
    return plugin.build(plugin.Config(), bench.mission)


@pytest.fixture
def flight(flown: tuple[str, str]) -> list[Step]:
    return recorded(*flown).steps


@pytest.fixture
def estimates(flown: tuple[str, str]) -> Sequence[Estimate]:
    """Estimates of the plug-in on the flight, for the tests that only read them."""
    return recorded(*flown).estimates


@dataclass(frozen=True, eq=False)
class Record:
    """A flight, and what an estimator made of it."""

    steps: list[Step]
    handed_out: Sequence[Estimate]
    estimates: Sequence[Estimate]  # copies, each made as soon as it was handed out
    changed: Sequence[float]  # [s] times of the calls that changed what they were given


@cache
def recorded(name: str, bench: str) -> Record:
    """The flight shared by all tests of a plug-in on a bench."""
    plugin, built = PLUGINS[name].load(), bench_of(bench, False)
    estimator: Estimator = plugin.build(plugin.Config(), built.mission)
    steps = fly(plugin, bench, False, estimator)
    handed_out, estimates, changed = [], [], []
    for step in steps:
        given = [(step.command, step.command.copy()), *((m.value, m.value.copy()) for m in step.measurements)]
        estimate = estimator.update(step.t, step.measurements, step.command)
        handed_out.append(estimate)
        estimates.append(copied(estimate))
        if not all(np.array_equal(values, before, equal_nan=True) for values, before in given):
            changed.append(step.t)
    return Record(steps, handed_out, estimates, changed)


def copied(estimate: Estimate) -> Estimate:
    extra = {name: values.copy() for name, values in estimate.extra.items()}
    return dataclasses.replace(estimate, x=estimate.x.copy(), covariance=copy(estimate.covariance), extra=extra)


@cache
def motion_of(bench: str, silent: bool, every: int) -> list[tuple[Array, Array, StateView]]:
    """(x, u, what the sensors see) at every tick, each input held for so many ticks from its call on."""
    built = bench_of(bench, silent)
    x, u = built.start, np.zeros(len(built.input_at(0.0)))
    ticks = []
    for k in range(round(built.duration / built.dt) + 1):
        ticks.append((x, u, built.motion(x, u)))
        if k % every == 0:
            u = built.input_at(k * built.dt)
        x = built.step(x, u)
    return ticks


def fly(plugin: type[EstimatorPlugin], bench: str, silent: bool, estimator: Estimator) -> list[Step]:
    """The calls of a loop that flies the bench's inputs, each held from one call to the next."""
    built = bench_of(bench, silent)
    sensors = plugin.sensors(plugin.Config(), built.read or built.mission)
    every = whole_ticks(estimator.period, built.dt, "period")
    due = [whole_ticks(1.0 / s.rate, built.dt, s.name) if s.rate is not None else every for s in sensors]
    rng = np.random.default_rng(5)
    steps: list[Step] = []
    inbox: list[Measurement] = []
    for k, (x, u, truth) in enumerate(motion_of(bench, silent, every)):
        t = k * built.dt
        for sensor, ticks in zip(sensors, due, strict=True):
            value = sensor.read(truth, rng) if k % ticks == 0 else None
            if value is not None:
                inbox.append(Measurement(sensor.name, t, value))
        if k % every == 0:
            steps.append(Step(t, tuple(inbox), u.copy(), x))
            inbox = []
    return steps


@pytest.mark.parametrize(
    ("name", "bench"), [each for each in FLOWN if each[1] not in {"hyperbolic plane", *SYSTEMS}], ids=" on ".join
)
def test_it_can_be_pickled_and_goes_on_as_it_did(name: str, bench: str) -> None:
    """All but those of systems whose equations are functions within functions."""
    plugin, steps = PLUGINS[name].load(), recorded(name, bench).steps[:12]
    estimator = plugin.build(plugin.Config(), bench_of(bench, False).mission)
    for step in steps[:8]:
        estimator.update(step.t, step.measurements, step.command)
    again = pickle.loads(pickle.dumps(estimator))
    for step in steps[8:]:
        one, other = (each.update(step.t, step.measurements, step.command) for each in (estimator, again))
        np.testing.assert_array_equal(one.x, other.x)


def replay(estimator: Estimator, steps: Sequence[Step]) -> Iterator[tuple[Step, Estimate]]:
    for step in steps:
        yield step, estimator.update(step.t, step.measurements, step.command)


def test_there_are_estimators() -> None:
    assert {"full_state", "kalman", "missile_kalman", "quadrotor_state"} <= PLUGINS.keys()


def test_there_is_a_bench_for_each() -> None:
    assert set(PLUGINS) == {name for name, _ in FLOWN}, "this suite has no bench for the missions that one is built for"


def test_it_is_what_the_protocol_asks_for(plugin: type[EstimatorPlugin], bench: Bench, estimator: Estimator) -> None:
    """A frozen configuration with defaults, a period of whole ticks, and sensors with names of their own."""
    assert isinstance(estimator, Estimator)
    assert whole_ticks(estimator.period, bench.dt, "period") >= 1
    config = plugin.Config()
    assert dataclasses.is_dataclass(config)
    for field in dataclasses.fields(config):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(config, field.name, getattr(config, field.name))
    names = [sensor.name for sensor in plugin.sensors(config, bench.mission)]
    assert names
    assert len(set(names)) == len(names)


def test_an_estimate_is_finite_valid_at_its_time_and_of_the_right_shape(
    estimates: Sequence[Estimate], flight: list[Step], bench: Bench
) -> None:
    """What else it tells has the same names and shapes at every call; NaN stands for what there is not."""
    n = bench.size
    shapes = {name: values.shape for name, values in estimates[0].extra.items()}
    for step, estimate in zip(flight, estimates, strict=True):
        assert estimate.t == step.t
        assert estimate.x.shape == (n,)
        assert np.isfinite(estimate.x).all()
        assert isinstance(estimate.status, Status)
        if estimate.covariance is not None:
            assert estimate.covariance.shape == (n, n)
            assert np.isfinite(estimate.covariance).all()
        assert {name: values.shape for name, values in estimate.extra.items()} == shapes
        assert not any(np.isinf(values).any() for values in estimate.extra.values())


TRUTH = ("full_state", "quadrotor_state")
"""plug-ins that read the true state, which nothing is predicted for"""
ABSENT = ("filtered_differences",)
"""plug-ins without a model that predicts a reading"""


def innovations_of(estimates: Sequence[Estimate]) -> tuple[Array, Array]:
    """Published innovations (n, m) and their standard deviations (n, m)."""
    nu, deviation = (np.array([each.extra[name] for each in estimates]) for name in (INNOVATIONS, INNOVATION_STD))
    return nu, deviation


def test_it_publishes_innovations_with_their_standard_deviations_or_neither(
    flown: tuple[str, str], estimates: Sequence[Estimate], flight: list[Step]
) -> None:
    """Both arrays are of one shape and NaN alike; of readings that come with every second call or less often, NaN in
    between.

    Every estimator of mathnavi that reads numbers has them; a plug-in of somebody else may.
    """
    named = {name for name in (INNOVATIONS, INNOVATION_STD) if name in estimates[0].extra}
    own = PLUGINS[flown[0]].value.startswith("mathnavi.") and flown[0] not in TRUTH
    assert len(named) in ((2,) if own else (0, 2)), f"it publishes {named} alone"
    if not named:
        return
    nu, deviation = innovations_of(estimates)
    assert nu.ndim == 2
    assert nu.shape == deviation.shape
    np.testing.assert_array_equal(np.isnan(nu), np.isnan(deviation))
    known = np.isfinite(nu)
    assert (deviation[known] > 0.0).all()
    assert np.isfinite(deviation[known]).all()
    assert known.any() == (flown[0] not in ABSENT)
    silent = np.array([not any(np.isfinite(each.value).any() for each in step.measurements) for step in flight])
    assert not known[silent].any()


def test_its_innovations_are_as_large_as_it_says(flown: tuple[str, str], estimates: Sequence[Estimate]) -> None:
    """The mean of e^2, e = nu / std, is about 1 over the later three quarters of a flight on which all is as declared.

    The mean of N squares of a Gaussian sequence with autocorrelation r_1 from one to the next has about the variance
    2 / N', N' = N (1 - r_1^2) / (1 + r_1^2): one is asked to be within four of its deviations above 1. An observer with
    constant gains forgets its start slowly, so that its N' is small. Below 1 there is no such limit, for a mission
    declares what there may be: the bench that moves least does with a third of its declared speed.
    """
    if INNOVATIONS not in estimates[0].extra or flown[0] in ABSENT:
        return
    nu, deviation = innovations_of(estimates[len(estimates) // 4 :])
    columns = [e[np.isfinite(e)] for e in (nu / deviation).T]
    columns = [e for e in columns if len(e) > 2]
    squares, products = (sum(float(each @ other) for each, other in pairs) for pairs in (
        [(e, e) for e in columns], [(e[1:], e[:-1]) for e in columns]
    ))  # fmt: skip
    count, correlation = sum(map(len, columns)), min(max(products / squares, 0.0), 0.999)
    independent = count * (1.0 - correlation**2) / (1.0 + correlation**2)
    assert 0.05 < squares / count < 1.0 + 4.0 * math.sqrt(2.0 / independent)


class Unhinted:
    """An estimator's plug-in that says nothing of its mission's type: a range filter's, of somebody else."""

    Config = RangeObserverConfig

    @staticmethod
    def build(config, mission):  # type: ignore[no-untyped-def]
        return RangeObserver(config, mission)


def test_a_plugin_without_type_hints_is_flown_where_it_can_be_built() -> None:
    benches = benches_of(Unhinted)
    assert benches == benches_of(RangeObserver)


def test_a_covariance_is_symmetric_and_positive_semidefinite(estimates: Sequence[Estimate]) -> None:
    for estimate in [*estimates[:300], *estimates[300:][-300:]]:
        if estimate.covariance is not None:
            P = estimate.covariance
            assert np.abs(P - P.T).max() <= 1e-6 * np.abs(P).max(), "as the loop takes it: symmetric to rounding"
            least, *_, largest = np.linalg.eigvalsh(P)
            assert least >= -1e-9 * max(largest, 1.0)


def test_no_estimate_of_a_mechanism_that_is_faster_than_its_mission_allows_is_ok(flown: tuple[str, str]) -> None:
    """Each flight is much faster than the mission now says, whichever way the estimator looks at its readings."""
    mission = bench_of(flown[1], False).mission
    if not isinstance(mission, LagrangianMission):
        return
    plugin, slower = PLUGINS[flown[0]].load(), dataclasses.replace(mission, speed_max=1e-3)
    for step, estimate in replay(plugin.build(plugin.Config(), slower), recorded(*flown).steps):
        wrong = impossible(slower, estimate.x, estimate.covariance)
        assert not (wrong and estimate.status is Status.OK), f"at {step.t:g} s: it {wrong}"
    assert estimate.status is not Status.OK  # also of one that refuses its readings, and has no velocity


def test_neither_what_it_is_given_nor_what_it_handed_out_is_changed(flown: tuple[str, str]) -> None:
    record = recorded(*flown)
    assert record.changed == []
    for estimate, then in zip(record.handed_out, record.estimates, strict=True):
        assert same(estimate, then)


def same(one: Estimate, other: Estimate) -> bool:
    return one.status is other.status and np.array_equal(one.x, other.x)


def unexplained(estimates: Sequence[Estimate]) -> set[Status]:
    """Statuses other than OK that come without a message."""
    return {estimate.status for estimate in estimates if estimate.status is not Status.OK and not estimate.message}


def test_before_its_first_reading_it_is_initialising(estimator: Estimator, flight: list[Step]) -> None:
    for step in flight[:10]:
        estimate = estimator.update(step.t, (), step.command)
        assert estimate.status is Status.INITIALISING
        assert estimate.message.startswith("waits ")


def scribbled(estimator: Estimator, steps: Sequence[Step]) -> Iterator[Estimate]:
    """Copies of the estimates, which are made unusable after that, with readings of a stranger among those given."""
    for step in steps:
        noise = Measurement("a-strangers-sensor", step.t, np.full(2, 1e9))
        estimate = estimator.update(step.t, (noise, *step.measurements), step.command)
        yield copied(estimate)
        for array in (estimate.x, estimate.covariance, *estimate.extra.values()):
            if array is not None and array.flags.writeable:
                array[...] = np.nan


def test_the_same_readings_give_the_same_estimates_until_they_are_missing_which_is_survived_and_in_the_end_reported(
    estimator: Estimator, flight: list[Step], estimates: Sequence[Estimate]
) -> None:
    """Neither readings of other sensors nor what becomes of its estimates reach the estimator."""
    middle = len(flight) // 2
    fed = list(scribbled(estimator, flight[:middle]))
    differing = [
        step.t for step, one, other in zip(flight, fed, estimates[:middle], strict=False) if not same(one, other)
    ]
    assert differing == []
    assert fed[-1].status is Status.OK
    assert (unused_in(fed[-1].extra) or {})[Unused.UNKNOWN_SENSOR.value] == middle
    starved = [estimator.update(step.t, (), step.command) for step in flight[middle:]]
    assert np.isfinite([estimate.x for estimate in starved]).all()
    assert starved[-1].status is Status.LOST
    assert unexplained(starved) == set()


def test_it_finds_back_when_the_readings_come_back(estimator: Estimator, flight: list[Step], bench: Bench) -> None:
    third, sixth = len(flight) // 3, len(flight) // 6
    gap = [dataclasses.replace(step, measurements=()) for step in flight[third : third + sixth]]
    steps, answers = zip(*replay(estimator, [*flight[:third], *gap, *flight[third + sixth :]]), strict=True)
    last, estimate = steps[-1], answers[-1]
    assert estimate.status is Status.OK
    assert unexplained(answers) == set()
    assert np.all(bench.error(estimate, last) <= bench.tolerance)


def later(step: Step, seconds: float) -> Step:
    """The same call and readings, so much later."""
    measurements = tuple(dataclasses.replace(each, t=each.t + seconds) for each in step.measurements)
    return dataclasses.replace(step, t=step.t + seconds, measurements=measurements)


@pytest.mark.honoured("sensor log", "gap longer than declared")
def test_after_an_hour_without_readings_it_is_ok_only_where_it_is_right(
    estimator: Estimator, flight: list[Step], bench: Bench
) -> None:
    third, sixth = len(flight) // 3, len(flight) // 6
    answers = list(replay(estimator, [*flight[:third], *(later(step, 3600.0) for step in flight[third:][:sixth])]))
    assert all(np.isfinite(estimate.x).all() for _, estimate in answers)
    wrong = [
        step.t
        for step, estimate in answers[third:]
        if estimate.status is Status.OK and not np.all(bench.error(estimate, step) <= bench.tolerance)
    ]
    assert wrong == []


def test_it_is_not_ok_while_one_of_several_sensors_has_been_missing_for_longer_than_declared(
    plugin: type[EstimatorPlugin], flight: list[Step], bench: Bench
) -> None:
    config = plugin.Config()
    names = [sensor.name for sensor in plugin.sensors(config, bench.mission)]
    if len(names) == 1:
        pytest.skip("it has one sensor")
    short = {field.name: 0.2 for field in dataclasses.fields(config) if field.name in ("timeout", "imu_gap")}
    third = len(flight) // 3
    end = next(k for k, step in enumerate(flight) if step.t > flight[third].t + (0.3 if short else 0.6))
    for name in names:
        without = [
            dataclasses.replace(step, measurements=tuple(each for each in step.measurements if each.name != name))
            for step in flight[third:end]
        ]
        estimator = plugin.build(dataclasses.replace(config, **short), bench.mission)
        answers = [each for _, each in replay(estimator, [*flight[:third], *without, flight[end]])]
        assert Status.OK not in [each.status for each in answers[end - 1 :]], name
        assert unexplained(answers) == set(), name


def test_a_reading_that_is_not_finite_is_counted_and_not_used(estimator: Estimator, flight: list[Step]) -> None:
    third = len(flight) // 3
    broken = [
        dataclasses.replace(
            step,
            measurements=tuple(dataclasses.replace(m, value=np.full(len(m.value), np.inf)) for m in step.measurements),
        )
        for step in flight[third:][:5]
    ]
    *_, (_, estimate) = replay(estimator, [*flight[:third], *broken])
    assert np.isfinite(estimate.x).all()
    assert (unused_in(estimate.extra) or {}).get(Unused.NOT_FINITE.value, 0) >= sum(
        len(step.measurements) for step in broken
    )


def test_it_converges_on_a_simulated_vehicle(estimates: Sequence[Estimate], flight: list[Step], bench: Bench) -> None:
    for step, estimate in zip(flight, estimates, strict=True):
        if step.t > 0.5 * bench.duration:
            assert estimate.status is Status.OK
            assert np.all(bench.error(estimate, step) <= bench.tolerance)


def largest_error(plugin: type[EstimatorPlugin], config: Any, bench: str) -> Array:
    """(n,) magnitudes, over a silent flight, once it is initialised."""
    built = bench_of(bench, True)
    estimator = plugin.build(config, built.mission)
    errors = [
        built.error(estimate, step)
        for step, estimate in replay(estimator, fly(plugin, bench, True, estimator))
        if estimate.status is Status.OK
    ]
    largest: Array = np.max(errors, axis=0)
    return largest


def test_an_observer_stays_on_the_truth_if_it_says_so_and_leaves_it_if_not(
    flown: tuple[str, str], plugin: type[EstimatorPlugin]
) -> None:
    """Property 2.1: started on the truth, without noise, an observer stays there once it is initialised."""
    if not hasattr(plugin, "properties"):
        pytest.skip("it does not call itself an observer")
    if bench_of(flown[1], True).read is not None:
        pytest.skip("its properties are those of an observer that is given all places")
    stays, config = bench_of(flown[1], True).stays, plugin.Config()
    properties: ObserverProperties = plugin.properties(config)
    assert isinstance(properties, ObserverProperties)
    error = largest_error(plugin, config, flown[1])
    assert bool(np.all(error <= stays)) == properties.stays_on_truth, error


@pytest.mark.parametrize("feedforward", FEED_FORWARDS)
def test_the_range_observer_stays_on_the_truth_with_any_feed_forward_and_leaves_it_as_printed(
    feedforward: FeedForward,
) -> None:
    """Without one the right side of (C.5) is nought on the truth, and the truth moves on."""
    bench, config = bench_of("ranging", True), RangeObserverConfig(feedforward=feedforward)
    error, stays = largest_error(RangeObserver, config, "ranging"), RangeObserver.properties(config).stays_on_truth
    assert stays == (feedforward != "none")
    assert np.all(error <= bench.stays) if stays else np.any(error > 200.0 * bench.stays), error
