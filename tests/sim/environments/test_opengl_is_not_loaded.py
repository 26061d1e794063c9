"""Whoever makes, flies and draws an environment may load another LLVM afterwards: no OpenGL is in the process.

Mesa's OSMesa and EGL bring an LLVM. With it in the process the import of Triton, which PyTorch's optimisers do, ends in
a segmentation fault.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

from mathnavi.models.opengl import available

LIBRARIES = ("OSMesa", "libLLVM", "libgallium", "libEGL", "libGL.", "libGLX")
FLOWN = """
import sys
import mathnavi as mn

assert mn.run("range-localisation", duration=0.5).t[-1] <= 0.5
environment = mn.make("safe-flight", terrain="jacksboro")
environment.reset()
environment.step(environment.action_spec().minimum)
"""
DRAWN = """
import gymnasium
import mathnavi.sim.environments

environment = gymnasium.make("mathnavi/SafeFlight-v1", terrain="jacksboro", render_mode="rgb_array")
environment.reset(seed=1)
assert environment.render().std() > 1.0
environment.reset(seed=2)
assert environment.render().std() > 1.0
environment.close()
"""
LOADED = f"""
with open("/proc/self/maps") as maps:
    loaded = [line for line in maps if any(name in line for name in {LIBRARIES})]
assert not loaded, loaded
"""
NEXT_LLVM = "import triton\n" if find_spec("triton") else ""


@pytest.mark.skipif(sys.platform != "linux", reason="what a process has loaded is read as Linux tells it")
@pytest.mark.parametrize("chosen", [None, "osmesa", "disable"])
def test_no_opengl_is_in_the_process_that_flies_and_has_its_pictures_drawn(chosen: str | None) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MUJOCO_GL", raising=False)
        if chosen is not None:
            patch.setenv("MUJOCO_GL", chosen)
        draws = available() is not None
    script = (FLOWN if chosen != "osmesa" or not draws else "") + (DRAWN if draws else "")
    environment = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    if chosen is not None:
        environment["MUJOCO_GL"] = chosen
    command = [sys.executable, "-c", script + LOADED + NEXT_LLVM]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
