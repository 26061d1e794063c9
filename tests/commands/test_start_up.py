"""A flight begins without importing what it does not use."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

# Numba imports scipy.linalg when it loads a kernel.
HEAVY = ("casadi", "matplotlib", "scipy.ndimage", "scipy.sparse", "scipy.special", "scipy.optimize")
CALL = f"""
import json, sys
from mathnavi.commands.cli import main
code = main(sys.argv[1:])
sys.stderr.write(json.dumps([code, *(name for name in {HEAVY} if name in sys.modules)]))
"""


def test_a_nominal_flight_imports_no_heavy_library(tmp_path: Path) -> None:
    """Each of them takes as long to import as a minute of flight to simulate."""
    flight = ("--terrain", "jacksboro", "--start", "3000", "4000", "1000", "--target", "3600", "4600", "1000")
    words = ("run", "safe-flight", *flight, "--out", str(tmp_path / "run"))
    done = subprocess.run([sys.executable, "-c", CALL, *words], capture_output=True, text=True, check=True)
    assert json.loads(done.stderr.splitlines()[-1]) == [0]
