"""Run by test_pictures.py in a process of its own: RUN_DIR OUT.npz."""

from __future__ import annotations

import sys

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.fleet.run_data import load_run  # noqa: E402
from mathnavi.renders.fleet.scene import Scene  # noqa: E402
from mathnavi.renders.fleet.storyboard import CAMERAS  # noqa: E402

MOMENTS = {"overview": 0.4, "top": 0.5, "arrival": 0.9}


def main(run_dir: str, out: str) -> None:
    run = load_run(run_dir)
    arrays = {}
    with Scene(run, 320, 180) as scene:
        for camera, share in MOMENTS.items():
            t = share * run.duration
            arrays[f"{camera}.with"] = scene.draw(t, camera)
            arrays[f"{camera}.pixels"] = scene.pixels(run.positions(t), camera)
            arrays[f"{camera}.slots"] = scene.pixels(run.slots, camera)
            arrays[f"{camera}.labels"] = np.array([label.text for label in scene.labels(t, camera)])
        arrays["end"] = scene.draw(run.duration, "arrival")
        arrays["end.slots"] = scene.pixels(run.slots, "arrival")
        for name in run.vehicles:
            body = scene.model.body(name).id
            scene.model.geom_group[scene.model.geom_bodyid == body] = 5  # is not drawn
            for camera in CAMERAS:
                arrays[f"{camera}.without.{name}"] = scene.draw(MOMENTS[camera] * run.duration, camera)
            scene.model.geom_group[scene.model.geom_bodyid == body] = 2
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
