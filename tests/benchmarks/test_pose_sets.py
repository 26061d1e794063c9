"""The sets of poses that are compared: ours has the truth, and another method is asked about the same ranges."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from benchmarks.pose_sets import ANGLES, ROOMS, Arguments, run


class Voxels(ModuleType):
    """A method whose answers are two poses, neither of them true."""

    BoxExtent = Segment = staticmethod(lambda *numbers: numbers)

    def __init__(self) -> None:
        super().__init__("vbfdml2")
        self.ranges: list[float] = []

    def preprocess_scene(self, *_: Any) -> list[str]:
        return ["distances", "mask"]

    def marching_voxels(
        self, distances: str, extent: Any, dx: float, dy: float, angle: float, rho: float, _: bool
    ) -> str:
        assert (distances, dx, dy) == ("distances", 0.0, 0.0)
        assert angle in ANGLES
        self.ranges.append(rho)
        return "voxels"

    def conv3d(self, voxels: str, _: bool) -> str:
        return voxels

    def do_intersect(self, one: str, other: str, _: bool) -> str:
        assert one == other == "voxels"
        return one

    def predict(self, *_: Any) -> list[SimpleNamespace]:
        return [SimpleNamespace(x=-50.0, y=0.0, theta=0.0)] * 2


@pytest.mark.parametrize("at_hand", [False, True])
def test_the_truth_is_among_ours_and_the_other_reads_the_same_ranges(
    at_hand: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rival = Voxels() if at_hand else None
    monkeypatch.setitem(sys.modules, "vbfdml2", rival)
    found = run(Arguments(trials=3, voxels=10), Console(quiet=True))
    assert found.rooms.keys() == ROOMS.keys()
    assert all(each.ours.has_truth == 1.0 and each.ours.listed >= 1.0 for each in found.rooms.values())
    assert found.rooms["furnished"].ours.proved == 1.0
    assert len(found.comparisons()) == (3 if at_hand else 0)
    if rival is not None:
        assert len(rival.ranges) == 3 * 3 * len(ANGLES)
        assert np.isfinite(rival.ranges).all()
        answers = found.rooms["convex"].rival
        assert answers is not None
        assert (answers.has_truth, answers.listed) == (0.0, 2.0)
