"""Location of acados' wheel, and whether its solvers can be built on this machine.

The wheel ``comma-deps-acados`` brings its own CasADi, which conflicts with the one of this environment: it is installed
into a separate folder, and every solver runs in a separate process.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

FOLDER = Path(sys.prefix) / "acados"
"""folder into which the Makefile installs the wheel"""


def missing(folder: Path) -> str:
    """Return in one line why acados cannot be compared on this machine; empty if it can."""
    if not (folder / "acados" / "acados_template").is_dir():
        return f"it is not installed (pip install --no-deps --target {folder} comma-deps-acados)"
    return "" if shutil.which("gcc") else "there is no gcc, which compiles its solvers"
