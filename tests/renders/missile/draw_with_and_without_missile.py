"""Run by test_pictures.py in a process of its own: RUN_DIR OUT.npz."""

from __future__ import annotations

import sys

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.missile.run_data import load_run  # noqa: E402
from mathnavi.renders.missile.scene import Scene  # noqa: E402
from mathnavi.renders.missile.storyboard import CAMERAS  # noqa: E402


def main(run_dir: str, out: str) -> None:
    run = load_run(run_dir)
    moments = {"chase": 0.55, "side": 0.6, "target": 0.96}
    arrays = {}
    with Scene(run, 320, 180) as scene:
        for camera in CAMERAS:
            t = moments[camera] * run.duration
            arrays[f"{camera}.with"] = scene.draw(t, camera)
            arrays[f"{camera}.pixel"] = scene.stage.pixels(run.path[[run.index(t)]])[0]
            arrays[f"{camera}.labels"] = np.array([label.text for label in scene.labels(t, camera)])
        body = scene.model.body("missile/body").id
        scene.model.geom_group[scene.model.geom_bodyid == body] = 5  # is not drawn
        for camera in CAMERAS:
            arrays[f"{camera}.without"] = scene.draw(moments[camera] * run.duration, camera)
            arrays[f"{camera}.before"] = scene.draw(0.3 * run.duration, camera)
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
