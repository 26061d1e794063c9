"""Write the compiled kernels that a wheel carries.

    python -m mathnavi.sim.plugin.ship_kernels FOLDER [MODULE ...]

Kernels of the lists that mathnavi's plug-ins name as their ``kernels``, or of these modules, are compiled for a common
level of the processor and written to FOLDER, under names by which ``mathnavi.sim.interfaces.compiled`` finds them.
"""

from __future__ import annotations

import importlib
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from mathnavi.sim.plugin.groups import installed

KINDS = "controllers", "estimators", "consensus", "scenarios"


def kernel_lists() -> list[str]:
    """The modules with lists of kernels that mathnavi's own plug-ins name."""
    points = (point for kind in KINDS for point in installed(kind) if point.dist and point.dist.name == "mathnavi")
    found = (getattr(point.load().Config, "kernels", None) for point in points)
    return list(dict.fromkeys(module for module in found if module is not None))


def ship(folder: Path, modules: Sequence[str]) -> None:
    """Compile the kernels of modules and copy them into a folder; ValueError if no level of the processor is known.

    Numba reads the processor that it compiles for when it is imported: a process of its own does it.
    """
    from mathnavi.sim.interfaces.compiled import LEVELS

    machine = platform.machine()
    if machine not in LEVELS:
        raise ValueError(f"architecture {machine} has no common level; allowed: {', '.join(LEVELS)}")
    level = LEVELS[machine]
    environment = {**os.environ, "NUMBA_CPU_NAME": level.name, "NUMBA_CPU_FEATURES": level.features}
    script = f"from mathnavi.sim.plugin.ship_kernels import copy; copy(*{(str(folder), list(modules))!r})"
    subprocess.run([sys.executable, "-P", "-c", script], env=environment, check=True)


def copy(folder: str, modules: Sequence[str]) -> None:
    """Copy compiled kernels of modules from the folder of kernels, compiled now if they are not there."""
    for module in modules:
        for kernel, arguments in importlib.import_module(module).KERNELS:
            kernel.compile(arguments)
            file = kernel._cache.files(arguments, kernel.targetctx.codegen())[0]
            shutil.copyfile(file, Path(folder) / file.name)


if __name__ == "__main__":
    ship(Path(sys.argv[1]), sys.argv[2:] or kernel_lists())
