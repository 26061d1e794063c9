"""Where acados' wheel lies, and whether its solvers can be built here.

The wheel ``comma-deps-acados`` brings a CasADi of its own, which must not meet the one of this environment: it is
installed into a folder of its own, and every solver runs in a process of its own.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

FOLDER = Path(sys.prefix) / "acados"
"""folder into which the Makefile installs the wheel"""


def missing(folder: Path) -> str:
    """Reason why acados cannot be compared here, in a line; empty where it can."""
    if not (folder / "acados" / "acados_template").is_dir():
        return f"it is not installed (pip install --no-deps --target {folder} comma-deps-acados)"
    return "" if shutil.which("gcc") else "there is no gcc, which compiles its solvers"
