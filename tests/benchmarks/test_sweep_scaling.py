"""Start-up and time of a flight are separated, and both ways fly every trial."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from benchmarks.sweep_scaling import MACHINE, OURS, POOL, Course, SweepFindings, pooled, side_by_side, swept
from mathnavi.sim.sweep import execution
from mathnavi.sim.sweep.trial import Trial, trial
from tests.flight import START, above, mountains, save
from tests.sim.here import Here


def short(tmp_path: Path, seeds: Sequence[int]) -> list[Trial]:
    terrain = mountains()
    start, near = above(terrain, START, 600.0), (START[0] + 300.0, START[1])
    target = above(terrain, near, 600.0)
    file = save(terrain, tmp_path / "mountains.npz")
    return [trial(seed=seed, terrain=file, start=start, target=target) for seed in seeds]


def test_a_flights_time_is_counted_from_when_every_worker_may_have_flown_one() -> None:
    course = Course.from_ends([3.0, 4.0, 5.0, 6.0, 7.0, 7.0], 2, 8.0)
    assert (course.start, course.interval, course.whole) == (4.0, 0.75, 8.0)


@pytest.mark.parametrize("run", [swept, pooled, side_by_side])
def test_every_trial_is_flown(tmp_path: Path, run: Callable[[Sequence[Trial], int], Course]) -> None:
    course = run(short(tmp_path, range(3)), 1)
    assert 0.0 < course.start < course.whole
    assert 0.0 < course.interval < course.whole


def test_a_trial_that_fails_is_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution, "Worker", lambda path: Here())
    outside = trial(terrain=save(mountains(), tmp_path / "mountains.npz"), start=(-1.0, 0.0, 0.0))
    with pytest.raises(RuntimeError, match="trial of seed 0: raised"):
        swept([outside], 1)


def test_two_workers_are_compared_with_one_and_with_the_pool() -> None:
    one, two, machine = Course(1.0, 0.4, 9.0), Course(1.0, 0.2, 5.0), Course(1.0, 0.25, 5.0)
    courses = {(by, count): [course] for by in (OURS, POOL) for count, course in ((1, one), (2, two))}
    rows = SweepFindings(20, 2, courses | {(MACHINE, 1): [one], (MACHINE, 2): [machine]}).comparisons()
    assert [row.ratio for row in rows] == pytest.approx([2.0, 1.6, 1.25, 1.8, 1.0, 1.0, 1.0])
    assert [row.wanted for row in rows] == [">= 1.9", "", "", "", "", "", ""]
