"""Good files of every kind, made once: tiny runs, a store, studies, maps, a mechanism, plug-ins."""

from __future__ import annotations

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.records.claims import Claim
from tests.hostile.brakes import brakes

MISSION = "safe-flight --terrain hills.npz --start 1500 1500 800 --target 3000 1500 800 --planner.grid-nodes 17"
RUNS = {
    "flight": MISSION,
    "arm": "arm-velocity --duration 0.2 --settled 0.1 --mechanism arm.xml",
    "robot": "range-localisation --duration 0.5",
    "textbook": "textbook-observer --duration 0.5",
    "fleet": "simultaneous-arrival --terrain hills.npz --vehicles 2 --start 1000 1500 900 --start 1000 4500 900 "
    "--target 4500 3000 900 --deadline-factor 2 --planner.grid-nodes 17",
}
SWEEP = "sweep textbook-observer --duration 0.05 --trials 3 --store trials.db --workers 1 --vary noise=0,0.1"
ARM = """<mujoco model="arm">
  <option timestep="0.001" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" type="hinge" axis="0 1 0"/>
      <geom name="upper" type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="1"/>
      <body name="lower" pos="0 0 -1">
        <joint name="elbow" type="hinge" axis="0 1 0"/>
        <geom name="lower" type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="shoulder"/>
    <motor joint="elbow"/>
  </actuator>
</mujoco>
"""


@cache
def originals(folder: Path) -> Path:
    """The folder with all originals, made if it is not."""
    import mujoco  # noqa: F401 - with what draws, before a command imports it without
    from dm_control import mujoco as _  # noqa: F401

    from mathnavi.commands.cli import main

    folder.mkdir(parents=True, exist_ok=True)
    maps(folder)
    (folder / "arm.xml").write_text(ARM)
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as error:
        patch.chdir(folder)
        _here(patch)
        codes = {"sweep": main(SWEEP.split())}
        brakes(patch)
        for name, words in RUNS.items():
            codes[name] = main(("run", *words.split(), "--out", name))
        codes["csv"] = main(("store", "export", "trials.db", "--out", "trials.csv"))
    if wrong := {name: code for name, code in codes.items() if code not in (0, 1)}:
        raise RuntimeError(f"originals that cannot be made: {wrong}: {error.getvalue()}")
    shutil.rmtree(folder / "renders", ignore_errors=True)
    study(folder / "study")
    return folder


def _here(patch: pytest.MonkeyPatch) -> None:
    from mathnavi.sim.sweep import execution
    from tests.sim.here import Here

    patch.setattr(execution, "Worker", lambda path: Here())


def maps(folder: Path) -> None:
    """A small map, and elevation models of every kind that is read."""
    x, y = np.meshgrid(np.arange(61) * 100.0, np.arange(61) * 100.0)
    heights = 500.0 + 200.0 * np.sin(x / 1500.0) * np.cos(y / 1700.0)
    write_npz(HeightField(heights, 100.0, "hills"), folder / "hills.npz")
    Image.fromarray(heights.astype(np.uint16)).save(folder / "dem.png")
    tile = np.zeros((1201, 1201), ">i2")
    tile[:61, :61] = heights
    tile.tofile(folder / "N42E080.hgt")
    import rasterio
    from rasterio.transform import from_origin

    profile = {
        "driver": "GTiff",
        "height": 61,
        "width": 61,
        "count": 1,
        "dtype": "float32",
        "transform": from_origin(500000.0, 4600000.0, 100.0, 100.0),
    }
    with rasterio.open(folder / "dem.tif", "w", crs="EPSG:32644", **profile) as file:
        file.write(heights.astype(np.float32), 1)


def study(folder: Path) -> None:
    """A study's document as a study writes it."""
    folder.mkdir(exist_ok=True)
    claim = Claim("noise-1", "target", "it holds", "A.1", "1", "1.0", True)
    document = {
        "study": "noise",
        "title": "Noise",
        "terrain": {"name": "hills", "digest": "abc"},
        "summary": [["runs", "1"]],
        "rows": [{"a": 1}],
        "claims": [asdict(claim), asdict(replace(claim, id="noise-2", holds=None))],
        "command": "mathnavi study noise",
        "first_look": "",
    }
    (folder / "noise.json").write_text(json.dumps(document))
    (folder / "noise.csv").write_text("a\n1\n")
