"""Run by test_pictures.py in a process of its own: BANK_DIR OBSERVER_DIR OUT.npz."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.ranging.run_data import RangingRun, load_run  # noqa: E402
from mathnavi.renders.ranging.scene import ABOVE, ROBOT_GROUP, Scene  # noqa: E402
from mathnavi.renders.ranging.storyboard import CAMERAS  # noqa: E402
from mathnavi.sim.interfaces.signals import Array  # noqa: E402
from tests.renders.ranging.believers import ELSEWHERE  # noqa: E402

EARLY = 0.2  # [s] the estimate is well off
MOMENTS = (0.2, 0.5, 1.9)  # [s] the hypotheses fade, and one after the other is dropped


def raised(pose: Array) -> Array:
    """(1, 3) the place of a pose, above the robot's lid."""
    return np.array([[*pose[:2], ABOVE]])


def blind(run: RangingRun) -> RangingRun:
    """The run of a robot whose estimator says nothing."""
    beliefs = replace(
        run.beliefs, t=np.empty(0), x=np.empty((0, 3)), covariance=None, hypotheses=None, scores=None, z=None
    )
    return replace(run, beliefs=beliefs)


def draw_bank(run: RangingRun) -> dict[str, Array]:
    arrays = {}
    with Scene(run, 480, 270) as scene:
        for camera in CAMERAS:
            arrays[f"{camera}.with"] = scene.draw(EARLY, camera)
            arrays[f"{camera}.robot"] = scene.stage.pixels(raised(run.joints(EARLY)))[0]
            arrays[f"{camera}.estimate"] = scene.stage.pixels(raised(run.beliefs.x[run.belief(EARLY)]))[0]
            arrays[f"{camera}.labels"] = np.array([label.text for label in scene.labels(EARLY, camera)])
        for moment in MOMENTS:
            arrays[f"hypotheses.{moment}"] = scene.draw(moment, "top")
        arrays["hypotheses.at"] = np.array([scene.stage.pixels(raised(pose))[0] for pose in ELSEWHERE])
        arrays["image.at"] = scene.stage.pixels(raised(run.curve.images(run.joints(1.9)[:3])[1]))[0]
        scene.run = blind(run)
        for camera in CAMERAS:
            arrays[f"{camera}.no estimate"] = scene.draw(EARLY, camera)
        scene.model.geom_group[scene.model.geom_group == ROBOT_GROUP] = 5  # is not drawn
        for camera in CAMERAS:
            arrays[f"{camera}.neither"] = scene.draw(EARLY, camera)
    return arrays


def draw_observer(run: RangingRun) -> dict[str, Array]:
    with Scene(run, 480, 270) as scene:
        arrays = {"observer.chase": scene.draw(0.4, "chase")}
        arrays["observer.ends"] = scene.draw(0.4, "top")
        assert run.beliefs.z is not None
        ends = run.curve.points(run.beliefs.z[run.belief(0.4), :-1])
        arrays["ends.at"] = np.vstack([scene.stage.pixels(raised(end)) for end in ends])
        scene.run = replace(run, beliefs=replace(run.beliefs, z=None))
        return arrays | {"observer.no ends": scene.draw(0.4, "top")}


def main(bank: str, observer: str, out: str) -> None:
    np.savez(out, allow_pickle=False, **draw_bank(load_run(bank)), **draw_observer(load_run(observer)))


if __name__ == "__main__":
    main(*sys.argv[1:])
