"""Draw a run of every kind by OSMesa and by EGL, and compare the pictures: python .ci/pictures.py [BACKEND FOLDER]

Prints a line for each camera, and ends with exit code 1 where more than 0.1 % of the pixels differ by more than a grey
level. Where one of the two does not draw, the other one draws alone, and the line says what is missing. With a backend
and a folder, it is the process that draws the runs in the folder.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

BACKENDS = ("osmesa", "egl")
WIDTH, HEIGHT = 320, 180  # [pixels]
SAMPLES = (0, 4)  # for each pixel: of videos and of stills
MOST_DIFFERING = 1e-3  # share of the pixels
GREY_LEVEL = 1
BRIEF = {"duration": 0.6, "settled": 0.3}
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "flight": ("safe-flight", {"terrain": "jacksboro", "start": (3000, 4000, 900), "target": (6000, 7000, 1000)}),
    "fleet": ("simultaneous-arrival", {"terrain": "jacksboro", "vehicles": 2}),
    "quadrotor": ("quadrotor-canyon", {"start": (300.0, 275.0, 1232.0), "target": (246.0, 288.0, 1246.0)}),
    "missile": ("missile-guidance", {}),
    "ranging": ("range-localisation", {"duration": 1.0}),
    "lagrangian": ("attitude-tracking", BRIEF),
    "mechanism": ("arm-velocity", BRIEF),
    "textbook": ("textbook-observer", {"duration": 1.0}),
}  # by what draws them


def fly(folder: Path) -> None:
    """Write a short run of each kind, and one again that names no drawing, for the drawing of any scene."""
    import mathnavi as mn

    for name, (scenario, fields) in RUNS.items():
        mn.run(scenario, seed=1, **fields).save(folder / name)
    mn.load(folder / "ranging").save(folder / "generic")
    config = folder / "generic" / "config.json"
    document = json.loads(config.read_text(encoding="utf-8"))
    del document["drawing"]
    config.write_text(json.dumps(document), encoding="utf-8")


def draw(backend: str, folder: Path) -> None:
    """Write the pictures of the runs in a folder, by each camera in the middle of the highlight, into BACKEND.npz."""
    from mathnavi.renders import worker
    from mathnavi.renders.drawing import drawing_of

    pictures: dict[str, Any] = {}
    for run_folder in sorted(path for path in folder.iterdir() if path.is_dir()):
        drawing = drawing_of(run_folder)
        moment = sum(drawing.highlight(drawing.load_run(run_folder))) / 2.0
        for samples in SAMPLES:
            frames = [(moment, camera, 0.0, 0.0) for camera in drawing.cameras]
            job = {"directory": str(run_folder), "trusted": False, "width": WIDTH, "height": HEIGHT}
            drawn = io.BytesIO()
            worker.draw({**job, "samples": samples, "frames": frames}, drawn)
            shown = np.frombuffer(drawn.getbuffer(), np.uint8).reshape(-1, HEIGHT, WIDTH, 3)
            names = (f"{run_folder.name} {camera}, {samples} samples" for camera in drawing.cameras)
            pictures |= dict(zip(names, shown, strict=True))
    np.savez(folder / f"{backend}.npz", **pictures)


def drawn_by(backend: str, folder: Path) -> dict[str, Any] | None:
    """Return the pictures that a process draws with a backend; None, and a line that says why, where it cannot."""
    from mathnavi.models.opengl import NoOpenGLError, environment

    os.environ["MUJOCO_GL"] = backend
    try:
        variables = environment()
    except NoOpenGLError as error:
        print(f"no pictures by {backend}: {error}")
        return None
    subprocess.run([sys.executable, __file__, backend, str(folder)], env=variables, check=True)
    return dict(np.load(folder / f"{backend}.npz"))


def compare(one: dict[str, Any], other: dict[str, Any]) -> int:
    """Print by how much the pictures differ; return the exit code."""
    code = 0
    for name, picture in one.items():
        apart = np.abs(picture.astype(int) - other[name]).max(axis=-1)
        share = float((apart > GREY_LEVEL).mean())
        print(f"{name:40} {100.0 * share:6.3f} % of the pixels differ, at most by {apart.max()} grey levels")
        if share > MOST_DIFFERING or picture.std() < 5.0:
            code = 1
    return code


def main() -> int:
    if len(sys.argv) == 3:
        draw(sys.argv[1], Path(sys.argv[2]))
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        fly(folder)
        pictures = [found for backend in BACKENDS if (found := drawn_by(backend, folder)) is not None]
    return compare(*pictures) if len(pictures) == 2 else 0


if __name__ == "__main__":
    sys.exit(main())
