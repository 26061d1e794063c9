"""Build hook of hatchling: with MATHNAVI_KERNELS=all the wheel carries compiled kernels, and is one for this platform.

Instead of all, modules with lists of kernels may be named, with commas between them. The environment that builds the
wheel needs mathnavi and its dependencies. Without that variable nothing happens here.
"""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FOLDER = "mathnavi/sim/interfaces/shipped_kernels"


class CompiledKernels(BuildHookInterface[Any]):
    """Adds compiled kernels to a wheel, whose tags are those of the installed numba, which they need."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        chosen = os.environ.get("MATHNAVI_KERNELS", "")
        if version != "standard" or not chosen:
            return
        self.scratch = tempfile.TemporaryDirectory()
        modules = [] if chosen == "all" else chosen.split(",")
        command = [sys.executable, "-P", "-m", "mathnavi.sim.plugin.ship_kernels", self.scratch.name, *modules]
        subprocess.run(command, check=True)
        for file in sorted(Path(self.scratch.name).iterdir()):
            build_data["force_include"][str(file)] = f"{FOLDER}/{file.name}"
        build_data["pure_python"] = False
        build_data["tag"] = numba_tag()

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if hasattr(self, "scratch"):
            self.scratch.cleanup()


def numba_tag() -> str:
    """Tag of the numba that is installed, cp311-cp311-manylinux_2_27_x86_64 for one, platforms joined by dots."""
    lines = (importlib.metadata.distribution("numba").read_text("WHEEL") or "").splitlines()
    tags = [line.partition(": ")[2].strip().split("-") for line in lines if line.startswith("Tag: ")]
    return "-".join(".".join(dict.fromkeys(parts)) for parts in zip(*tags, strict=True))
