"""Every module has one name, though the repository's root on sys.path makes ``import models`` possible."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("controllers", "estimators", "models", "renders", "sim")
SCRIPT = """
import json, sys

sys.path.insert(0, sys.argv[1])
import mathnavi as mn
from mathnavi.sim.commands.cli import main

short = {
    "arm-velocity": {"duration": 1.1},
    "attitude-tracking": {"duration": 5.1},
    "missile-guidance": {},
    "quadrotor-canyon": {"terrain": "canyon:3", "planner.flight.nodes": 5},
    "range-localisation": {"duration": 1.0},
    "safe-flight": {"terrain": "jacksboro", "drawn_separation": (0.2, 0.3)},
    "simultaneous-arrival": {"terrain": "jacksboro", "vehicles": 2},
    "sphere-observer": {"duration": 2.1},
    "textbook-observer": {"duration": 1.0},
}
assert set(short) == set(mn.available("scenarios"))
for scenario, fields in short.items():
    run = mn.run(scenario, seed=1, **fields)
    run.plot()
run.report("report.html")
run.save("run")
assert main(["list"]) == 0
assert main(["estimate", "textbook_ekf", "run"]) in (0, 1)
assert main(["compare", "run", "run-textbook_ekf"]) == 0
assert main(["study", "introduction-examples", "--quick", "--out", "study"]) in (0, 1)
print(json.dumps(sorted(sys.modules)))
"""


def test_no_module_is_loaded_under_two_names(tmp_path: Path) -> None:
    """After the command line, every scenario with its figure, and a study, none of the folders has its bare name."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(ROOT)], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    modules = json.loads(done.stdout.splitlines()[-1])
    assert "mathnavi.sim.scenarios.safe_flight" in modules
    assert not [name for name in modules if name.partition(".")[0] in FOLDERS]
