"""Run by test_pictures.py in a process of its own: RUN_DIR OUT.npz."""

from __future__ import annotations

import sys

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.flight.run_data import load_run  # noqa: E402
from mathnavi.renders.flight.scene import Scene  # noqa: E402
from mathnavi.renders.flight.storyboard import CAMERAS  # noqa: E402


def main(run_dir: str, out: str) -> None:
    run = load_run(run_dir)
    t = 0.5 * run.duration
    arrays = {}
    with Scene(run, 320, 180) as scene:
        for camera in CAMERAS:
            arrays[f"{camera}.with"] = scene.draw(t, camera)
            arrays[f"{camera}.pixel"] = scene.pixels(run.state(t)[None, :3], camera)[0]
        body = scene.model.body("airframe").id
        # Group 5 is not drawn.
        scene.model.geom_group[scene.model.geom_bodyid == body] = 5
        for camera in CAMERAS:
            arrays[f"{camera}.without"] = scene.draw(t, camera)
            arrays[f"{camera}.before"] = scene.draw(0.0, camera)
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
