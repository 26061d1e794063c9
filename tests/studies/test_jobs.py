"""A study computes through its store: results in order, what goes wrong named, and nothing twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.errors import TerrainError
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.execution import Progress
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.framework.study import Jobs, Setup, StudyError, TerrainReference
from tests.sim.sweep.computations import Walk, mishap, returned, walked


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "trials.db") as opened:
        yield opened


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_arguments(workers: int, store: Store) -> None:
    seen: list[Progress] = []
    assert Setup(None, store, workers, seen.append).compute(returned, [3, 1, 2, 1]) == [3, 1, 2, 1]
    assert {progress.total for progress in seen} == {3}


def test_jobs_of_several_kinds_come_by_their_keys(store: Store) -> None:
    jobs = Jobs()
    jobs.add("plain", returned, [1, 2])
    jobs.add(("walk", 0), walked, [Walk(4, 7)], offset=1.0)
    jobs.add("plain", returned, ["three"])
    done = jobs.done(Setup(None, store))
    assert done["plain"] == [1, 2, "three"]
    np.testing.assert_array_equal(done["walk", 0][0].path, walked(Walk(4, 7), offset=1.0).path)
    assert {record.seed for record in store.jobs(store.job_endings())} == {0, 7}


def test_what_is_raised_in_a_job_names_function_and_arguments(store: Store) -> None:
    with pytest.raises(StudyError, match=r"computations:mishap raised: RuntimeError: out of order; arguments: .*raise"):
        Setup(None, store).compute(mishap, ["fine", "raise"])
    assert len(store.job_endings()) == 2


def test_a_run_for_a_picture_is_stored_without_what_the_clock_says(store: Store) -> None:
    mission = trial("safe-flight", 1, fields={"terrain": "canyon:3", "drawn_separation": (0.15, 0.2)})
    setup = Setup("canyon:3", store)
    first = setup.flown({"it": mission})["it"]
    assert len(store.job_endings()) == 1
    again, here = setup.flown({"it": mission})["it"], mission.flown()
    assert again.summary == first.summary
    assert not [name for name in first.summary if name.startswith("solve_ms") or name.endswith("_wall_s")]
    arrays = here.arrays
    assert first.arrays.keys() == again.arrays.keys() == arrays.keys()
    for name, array in arrays.items():
        assert first.arrays[name].tobytes() == again.arrays[name].tobytes() == array.tobytes(), name
    assert first.config == here.config
    assert first.recording.events == here.recording.events


def test_a_terrain_that_changed_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "hill.npz"
    ground = HeightField(np.zeros((3, 3)), 10.0, "hill")
    write_npz(ground, file)
    assert TerrainReference(str(file), ground.digest).ground.digest == ground.digest
    with pytest.raises(TerrainError, match="changed"):
        _ = TerrainReference("jacksboro", ground.digest).ground
    assert TerrainReference("jacksboro", load_terrain("jacksboro").digest).ground.name == "jacksboro"
