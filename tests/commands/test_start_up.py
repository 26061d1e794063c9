"""A flight begins without importing what it does not use, and a process that flies prints nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

# Numba imports scipy.linalg when it loads a kernel. Each of these takes as long to import as a minute of flight to
# simulate.
HEAVY = (
    *("casadi", "matplotlib", "PIL.ImageFont", "scipy.ndimage", "scipy.optimize", "scipy.sparse", "scipy.special"),
    *("scipy.stats", "mathnavi.sim.sweep.cluster"),
)
CALL = f"""
import sys
from mathnavi.commands.cli import main
code = main(sys.argv[1:])
loaded = [name for name in {HEAVY} if name in sys.modules]
assert not loaded, loaded
sys.exit(code)
"""


def test_a_nominal_flight_imports_no_heavy_library_and_prints_its_own_words_alone(tmp_path: Path) -> None:
    """No warning of a library, no bar without a terminal, no announcement where the caches are warm."""
    flight = ("--terrain", "jacksboro", "--start", "3000", "4000", "1000", "--target", "3600", "4600", "1000")
    words = ("run", "safe-flight", *flight, "--out", str(tmp_path / "run"))
    done = subprocess.run([sys.executable, "-c", CALL, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    assert done.stdout.rstrip().endswith(str(tmp_path / "run"))
    assert "\x1b" not in done.stdout
