"""A mission is flown whole beside the bare steps of the same commands, and disturbed beside the same steps."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.mission_cost import DISTURBED, Arguments, MissionFindings, missions, run
from mathnavi.estimators.kalman import Kalman
from tests.flight import START, above, mountains, save


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> MissionFindings:
    terrain = mountains()
    mission = {"start": above(terrain, START, 600.0), "target": above(terrain, (START[0] + 300.0, START[1]), 600.0)}
    file = save(terrain, Path(tmp_path_factory.mktemp("terrain")) / "mountains.npz")
    with open(os.devnull, "w") as nowhere:
        return run(Arguments(terrain=file, repetitions=1), Console(file=nowhere), mission)


def test_both_missions_are_compared_with_bare_steps(found: MissionFindings) -> None:
    plain, disturbed = found.comparisons()
    assert (plain.software, plain.wanted, disturbed.wanted) == ("mujoco.mj_step", "<= 1.5", "<= 2.5")
    assert plain.ratio > 0.0
    assert found.seconds > 1.0
    assert len(found.plain()["disturbed_ms"]) == 1


def test_only_the_second_mission_is_disturbed() -> None:
    calm, disturbed = missions("jacksboro", {})
    assert calm.spec.estimator.plugin is not Kalman
    assert disturbed.spec.estimator.plugin is Kalman
    assert calm.spec.config.faults.gust_rms == 0.0
    assert disturbed.spec.config.faults.gust_rms == DISTURBED["faults.gust_rms"]
