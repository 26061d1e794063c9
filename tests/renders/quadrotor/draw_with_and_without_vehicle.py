"""Run by test_pictures.py in a process of its own: RUN_DIR OUT.npz."""

from __future__ import annotations

import sys

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.quadrotor.run_data import load_run  # noqa: E402
from mathnavi.renders.quadrotor.scene import NEAR_GROUP, Scene  # noqa: E402
from mathnavi.renders.quadrotor.storyboard import CAMERAS  # noqa: E402


def main(run_dir: str, out: str) -> None:
    run = load_run(run_dir)
    t = 0.5 * run.duration
    arrays = {}
    with Scene(run, 320, 180) as scene:
        shown = {camera: scene.draw(t, camera) for camera in CAMERAS}
        for camera in CAMERAS:
            arrays[f"{camera}.with"] = scene.draw(t, camera)
            arrays[f"{camera}.pixels"] = scene.pixels(run.pose(t)[0][None], camera)[0]
            arrays[f"{camera}.labels"] = np.array([text for text, _, _ in scene.labels(t, camera)])
            assert np.array_equal(arrays[f"{camera}.with"], shown[camera])  # whatever was drawn in between
        vehicles = (scene.model.geom_group == NEAR_GROUP) | (scene.model.geom_bodyid == scene.model.body("afar").id)
        scene.model.geom_group[vehicles] = 5  # is not drawn
        for camera in CAMERAS:
            arrays[f"{camera}.without"] = scene.draw(t, camera)
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
