"""All poses that explain one set of ranges in a room: ours, and those of few distance-measurement localization.

    python -m benchmarks.pose_sets [--trials 25] [--voxels 80]

A robot that stands still has read eight ranges, evenly spread. Ours is ``PoseCertificate``: branch and bound, which
proves that the listed poses are all there are, or says that it is undecided. The other is vbfdml2, which intersects the
voxels of the poses that explain each range; its table of distances is made once for a room, and not timed. It is built
from github.com/TAU-CGL/vb-fdml2-public, needs CGAL, and is found through ``PYTHONPATH``. An answer counts as the truth
within 0.3 m and 0.3 rad.
"""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge
from rich.console import Console

from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, Ratio, alone
from benchmarks.progress import progress
from mathnavi.estimators.ranging.pose_certificate import PoseCertificate, PoseCertificateConfig
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

ROOMS = {
    "convex": (((0.0, 0.0), (5.0, 0.4), (4.6, 3.2), (0.3, 2.8)),),
    "L-shaped": (((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (3.5, 4.0), (3.5, 5.2), (0.0, 5.2)),),
    "furnished": (
        ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (3.5, 4.0), (3.5, 5.2), (0.0, 5.2)),
        ((1.0, 1.2), (2.4, 1.2), (2.4, 2.0), (1.0, 2.0)),
    ),
}
ANGLES = tuple(2.0 * math.pi * k / 8 for k in range(8))
NOISE, NEAR, BORDER = 0.02, 0.3, 0.05  # [m], [m, rad], [m]
NOWHERE = np.array([1e3, 1e3, 0.0])  # a pose that explains nothing, so that all that do are listed
RATIO: Ratio = "other / ours"


@configuration
class Arguments:
    """Compare the sets of poses that explain one set of ranges."""

    trials: Annotated[int, Within(Ge(1), allowed=">= 1")] = 25
    """number of random poses in each room"""
    voxels: Annotated[int, Within(Ge(10), allowed=">= 10")] = 80
    """number of voxels of vbfdml2 along each axis"""
    out: Path = Path("renders/out/pose_sets.json")
    """file of the figures"""


class Answers(NamedTuple):
    """Answers of a method in a room."""

    taken: Array  # (R,) [s]
    proved: float  # share of trials in which the listed poses are proved to be all
    listed: float  # poses, mean
    has_truth: float  # share of trials in which the truth is among them


class RoomFindings(NamedTuple):
    """Answers of both methods in a room."""

    ours: Answers
    rival: Answers | None


@dataclass(frozen=True, eq=False)
class PoseSetFindings:
    """Findings by room."""

    rooms: dict[str, RoomFindings]

    @property
    def title(self) -> str:
        return "all poses that explain eight ranges"

    def comparisons(self) -> list[Comparison]:
        return [
            Comparison(f"{name} room", "ms", 1e3 * each.ours.taken, 1e3 * each.rival.taken, "vbfdml2", RATIO)
            for name, each in self.rooms.items()
            if each.rival is not None
        ]

    def show(self, console: Console) -> None:
        for name, each in self.rooms.items():
            for method, answers in (("ours", each.ours), ("vbfdml2", each.rival)):
                said = "not at hand"
                if answers is not None:
                    said = (
                        f"{answers.listed:.1f} poses, the truth among them in {answers.has_truth:.0%} of the trials, "
                        f"proved to be all in {answers.proved:.0%}"
                    )
                console.print(f"{name} room, {method}: {said}", highlight=False)

    def plain(self) -> dict[str, Any]:
        return {
            name: {
                method: answers._asdict() | {"taken": answers.taken.tolist()}
                for method, answers in (("ours", each.ours), ("vbfdml2", each.rival))
                if answers is not None
            }
            for name, each in self.rooms.items()
        }


class Rival:
    """vbfdml2 in one room; its table of distances is made here."""

    def __init__(self, module: Any, room: Polygon, voxels: int) -> None:
        self._module, corners = module, room.outlines[0]
        low, high = corners.min(axis=0) - BORDER, corners.max(axis=0) + BORDER
        self._extent = module.BoxExtent(*(high - low).tolist(), 2.0 * math.pi, *(0.5 * (low + high)).tolist(), 0.0)
        scene = [module.Segment(*row) for row in room.segments.tolist()]
        self._distances = module.preprocess_scene(voxels, self._extent, scene, True)[0]

    def answers(self, y: Array) -> Array:
        """Poses (n, 3) that explain ranges (l,)."""
        module, both = self._module, None
        for angle, rho in zip(ANGLES, y.tolist(), strict=True):
            voxels = module.marching_voxels(self._distances, self._extent, 0.0, 0.0, angle, rho, True)
            voxels = module.conv3d(voxels, True)
            both = voxels if both is None else module.do_intersect(both, voxels, True)
        found = [(each.x, each.y, each.theta) for each in module.predict(both, self._extent)]
        return np.array(found).reshape(-1, 3)


def _near(poses: Array, x: Array) -> bool:
    off, turned = np.hypot(*(poses[:, :2] - x[:2]).T), np.abs(wrapped(poses[:, 2] - x[2]))
    return bool(((off <= NEAR) & (turned <= NEAR)).any())


def _measure(room: Polygon, trials: int, rival: Rival | None, rng: np.random.Generator) -> RoomFindings:
    mission = RangingMission(room, ANGLES, RangeQuality(absolute=NOISE))
    config = PoseCertificateConfig(readings=1, radius=NEAR, angle=NEAR)
    ours, theirs = [], []
    for _ in range(trials):
        x = room.draw(rng)
        y = room.ranges(x, np.array(ANGLES))[0] + NOISE * rng.standard_normal(len(ANGLES))
        certificate = PoseCertificate(config, mission)
        certificate.note(mission.period, y, np.zeros(2))
        begun = time.perf_counter()
        found = certificate.check(NOWHERE)
        ours.append((time.perf_counter() - begun, found.complete, len(found.others), _near(found.others, x)))
        if rival is not None:
            begun = time.perf_counter()
            answers = rival.answers(y)
            theirs.append((time.perf_counter() - begun, 0.0, len(answers), _near(answers, x)))
    return RoomFindings(_summary(ours), None if rival is None else _summary(theirs))


def _summary(trials: Sequence[tuple[float, ...]]) -> Answers:
    figures = np.array(trials, dtype=float)
    return Answers(figures[:, 0], *figures[:, 1:].mean(axis=0).tolist())


def run(arguments: Arguments, console: Console) -> PoseSetFindings:
    """Measure each room in turn, both methods over the same ranges."""
    rooms = {}
    try:
        module = importlib.import_module("vbfdml2")
    except ImportError:
        module = None
    with progress(console, "pose sets", len(ROOMS)) as report:
        for k, (name, rings) in enumerate(ROOMS.items()):
            room = Polygon(rings, name)
            rival = None if module is None else Rival(module, room, arguments.voxels)
            rooms[name] = _measure(room, arguments.trials, rival, np.random.default_rng(0))
            report(k + 1)
    return PoseSetFindings(rooms)


def main(arguments: Arguments) -> None:
    alone("pose_sets", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
