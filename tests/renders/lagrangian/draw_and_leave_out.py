"""Run by test_pictures.py in a process of its own: BODY_DIR ARM_DIR TRACKING_DIR OUT.npz."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from mathnavi.renders.opengl import choose_backend

choose_backend()

from mathnavi.renders.lagrangian.run_data import LagrangianRun, load_run  # noqa: E402
from mathnavi.renders.lagrangian.scene import Scene  # noqa: E402
from mathnavi.sim.interfaces.signals import Array  # noqa: E402

MOMENT = 0.3  # [s] the estimate is still off


def seen(scene: Scene, position: Array) -> Array:
    """(m, 3) column, row and depth of the middles of what moves, at a position (nq,)."""
    places = scene.places(position)
    return scene.stage.pixels(places)


def draw(name: str, run: LagrangianRun) -> dict[str, Array]:
    with Scene(run, 480, 270) as scene:
        shown = scene.draw(MOMENT, "scene")
        arrays = {f"{name}.with": shown, f"{name}.truth": seen(scene, run.position(MOMENT))}
        arrays[f"{name}.estimate"] = seen(scene, run.drawn(run.belief(MOMENT)))
        if (reference := run.reference(MOMENT)) is not None:
            arrays[f"{name}.reference"] = seen(scene, reference)
            summary = {key: value for key, value in run.log.summary.items() if key != "attitude_rms_rad"}
            scene.run = replace(run, log=replace(run.log, summary=summary))
            arrays[f"{name}.no reference"] = scene.draw(MOMENT, "scene")
            scene.run = run
        run.errors.found[:] = 0.0
        arrays[f"{name}.no estimate"] = scene.draw(MOMENT, "scene")
        scene.model.geom_rgba[scene.model.body_weldid[scene.model.geom_bodyid] != 0, 3] = 0.0
        scene.model.geom_matid[scene.model.body_weldid[scene.model.geom_bodyid] != 0] = -1
        arrays[f"{name}.neither"] = scene.draw(MOMENT, "scene")
    return arrays


def main(body: str, arm: str, tracking: str, out: str) -> None:
    named = {"body": body, "arm": arm, "tracking": tracking}
    arrays: dict[str, Array] = {}
    for name, directory in named.items():
        arrays |= draw(name, load_run(directory))
    np.savez(out, allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
