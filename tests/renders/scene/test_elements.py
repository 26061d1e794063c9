"""Where motions are and what of lines is shown at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.renders.scene.elements import Layer, Lines, Motion, raised

T = np.array([0.0, 1.0, 2.0, 3.0])
POINTS = np.column_stack([10.0 * T, np.zeros(4), np.zeros(4)])
LAYER = Layer("path")


def lines(**more: object) -> Lines:
    return Lines(LAYER, POINTS, np.array([0, 4]), LAYER.colour, **more)  # type: ignore[arg-type]


def test_a_motion_is_linear_between_its_poses_and_stays_at_its_ends() -> None:
    half = math.sqrt(0.5)
    quat = np.array([[1.0, 0.0, 0.0, 0.0], [-half, 0.0, 0.0, -half], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    motion = Motion(T, POINTS, quat, ground=np.array([0.0, 2.0, 4.0, 6.0]))
    for t, x in ((-1.0, 0.0), (0.5, 5.0), (9.0, 30.0)):
        pose = motion.at(t)
        assert pose is not None
        assert (pose.pos[0], pose.ground) == pytest.approx((x, 0.2 * x))
        assert np.linalg.norm(pose.quat) == pytest.approx(1.0)
    between = motion.at(0.5)
    assert between is not None
    assert 2.0 * math.atan2(between.quat[3], between.quat[0]) == pytest.approx(math.pi / 4.0)  # the shorter way round


def test_a_motion_is_there_only_while_it_is_shown() -> None:
    motion = Motion(T, POINTS, shown=((1.0, 2.0),))
    assert [motion.at(t) is not None for t in (0.9, 1.0, 2.0, 2.1)] == [False, True, True, False]


def test_a_path_ends_in_the_present_and_what_is_ahead_begins_there() -> None:
    (past,) = lines(times=T, cut="past").at(1.5)
    assert past[:, 0].tolist() == [0.0, 10.0, 15.0]
    (recent,) = lines(times=T, cut="past", trail=1.0).at(2.5)
    assert recent[:, 0].tolist() == [10.0, 20.0, 25.0]
    (ahead,) = lines(times=T, cut="ahead").at(1.5)
    assert ahead[:, 0].tolist() == [15.0, 20.0, 30.0]
    assert lines(times=T, cut="ahead").at(3.0) == []
    (whole,) = lines().at(1.5)
    assert len(whole) == 4


def test_the_lines_of_a_frame_are_shown_until_those_of_the_next() -> None:
    own = Lines(
        LAYER, POINTS, np.array([0, 2, 4]), LAYER.colour, frames=np.array([0, 1, 2]), starts=np.array([0.5, 2.0]),
        end=3.0,
    )  # fmt: skip
    shown = {t: [part[0, 0] for part in own.at(t)] for t in (0.0, 0.5, 1.9, 2.0, 3.0, 3.1)}
    assert shown == {0.0: [], 0.5: [0.0], 1.9: [0.0], 2.0: [20.0], 3.0: [20.0], 3.1: []}


def test_heights_are_multiplied_above_the_lowest() -> None:
    assert raised(np.array([1.0, 2.0, 30.0]), 10.0, 1.5).tolist() == [1.0, 2.0, 40.0]
