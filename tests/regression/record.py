"""A fixed set of runs, recorded with one installation and compared with the same set recorded with another.

A change that is to leave behaviour as it is records the set before and after::

    python -m tests.regression.record BEFORE --mathnavi OLD/.venv/bin/mathnavi
    python -m tests.regression.record AFTER
    python -m tests.regression.compare BEFORE AFTER

The set: each scenario with two seeds and two configurations that are not the default, a refused run of each, pictures,
a study of each paper and of the introduction, a sweep, a search, an estimator over a recorded run, a comparison of two
runs, a script that flies, an episode of an environment, and the import of an elevation model.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from PIL import Image

RUNS: dict[str, tuple[str, str, str]] = {  # a scenario: two configurations and one that is refused
    "safe-flight": (
        "--terrain jacksboro --drawn-separation 0.2 0.3 --estimator kalman --noise.position 2 --faults.gust-rms 0.5",
        "--terrain jacksboro --drawn-separation 0.2 0.3 --faults.solver-failure-rate 0.5 --faults.late-plan-rate 0.2 "
        "--planner.nodes 8 --faults.corrupted-plan-rate 0.1",
        "--clearance-min nan",
    ),
    "simultaneous-arrival": (
        "--terrain jacksboro --vehicles 3 --consensus maximum",
        "--terrain jacksboro --vehicles 3 --faults.solver-failure-rate 0.2 --radio.loss 0.2",
        "--vehicles 0",
    ),
    "quadrotor-canyon": (
        "--terrain canyon:3 --faults.gust-rms 0.3 --mismatch.mass 1.05",
        "--terrain canyon:5 --planner.flight.nodes 9 --noise.position 0.01",
        "--terrain nowhere",
    ),
    "missile-guidance": (
        "--planner.autopilot tvlqr --estimator.rate 50",
        "--planner.spatial joint --planner.nodes 21",
        "--planner.grid zigzag",
    ),
    "range-localisation": (
        "--estimator range_ekf --drive differential --duration 6",
        "--planner.mode circle --field.shape egg --noise.outliers 0.1 --duration 6",
        "--sensors",
    ),
    "textbook-observer": (
        "--system krener-isidori --duration 4",
        "--system kazantzis-kravaris --noise 0.01 --duration 4",
        "--rate -1",
    ),
    "arm-velocity": (
        "--mechanism two-link --load 1.5 --duration 4",
        "--mechanism seven-joint --estimator lagrangian_ekf --duration 4 --reading.noise 0.001",
        "--mechanism missing.xml",
    ),
    "attitude-tracking": (
        "--planner.rate 0 --duration 6",
        "--estimator filtered_differences --duration 6 --reading.noise 0.001",
        "--inertia 0",
    ),
    "sphere-observer": (
        "--space sphere --duration 4",
        "--space hyperbolic-plane --estimator high_gain --duration 4",
        "--space torus",
    ),
}
SEEDS = (1, 2)
STUDIES = ("consensus", "ocp-problems", "mismatch", "sphere", "introduction-examples")
SWEEP = (
    "sweep safe-flight --trials 4 --terrain jacksboro --drawn-separation 0.2 0.3 --workers 2 "
    "--vary faults.solver-failure-rate=0,0.5"
)
SEARCH = (
    "search safe-flight --terrain canyon:3 --drawn-separation 0.2 0.3 --drawn-heights 0 30 --missions 8 --batch 4 "
    "--workers 2 --minimise clearance_margin_m --over faults.gust-rms=0..2 --over seed=0..9 --worst 1"
)
SCRIPT = """
import json
import sys
import numpy as np
import mathnavi as mn

run = mn.run(
    "safe-flight", seed=3, terrain="jacksboro", drawn_separation=(0.2, 0.3), noise={"position": 2.0},
    controller=mn.plugin("flight", nodes=9), estimator="kalman",
)
np.savez(sys.argv[1] + ".npz", **{name: run[name] for name in ("t", "truth.x", "estimate.x", "command.u")})
sweep = mn.sweep("textbook-observer", 2, vary={"noise": [0.0, 0.01]}, workers=1, duration=2.0)
with open(sys.argv[1] + ".json", "w") as file:
    json.dump({"run": dict(run.summary), "events": len(run.events), "sweep": sweep.rows}, file, default=str)
"""
EPISODE = """
import sys
import numpy as np
import mathnavi as mn

kept = {}
for scenario, fields in {
    "safe-flight": {"terrain": "jacksboro", "faults.gust_rms": 0.5}, "range-localisation": {}, "sphere-observer": {},
}.items():
    environment = mn.make(scenario, seed=4, **fields)
    steps = [environment.reset()]
    generator, spec = np.random.default_rng(4), environment.action_spec()
    for _ in range(40):
        steps.append(environment.step(generator.uniform(-1.0, 1.0, spec.shape)))
    for name in steps[0].observation:
        kept[f"{scenario}.{name}"] = np.array([step.observation[name] for step in steps])
    kept[f"{scenario}.reward"] = np.array([float(step.reward or 0.0) for step in steps])
    kept[f"{scenario}.last"] = np.array([step.last() for step in steps])
np.savez(sys.argv[1] + ".npz", **kept)
"""
IMPORT = "terrain import heights.png --spacing 90 --scale 0.1 --resample 60 --crop 500 500 7500 6500 --out imported.npz"


def write_heights(path: Path) -> None:
    """A 16-bit PNG of hills that rise to 400 m."""
    south, west = np.mgrid[0:100, 0:120] / 20.0
    heights = 2000.0 * (1.0 + np.sin(west) * np.cos(1.3 * south))
    Image.fromarray(heights.astype(np.uint16)).save(path)


def commands(folder: Path) -> dict[str, list[str]]:
    """The command lines of the set, each under its name; they write below ``folder``.

    A first word "python" stands for the interpreter beside the command that is recorded.
    """
    every: dict[str, list[str]] = {}
    for scenario, (first, second, refused) in RUNS.items():
        for seed in SEEDS:
            name = f"{scenario}-seed{seed}"
            every[name] = ["run", scenario, "--seed", str(seed), "--out", str(folder / name)]
        for number, fields in enumerate((first, second)):
            name = f"{scenario}-fields{number}"
            every[name] = ["run", scenario, "--seed", "3", *fields.split(), "--out", str(folder / name)]
        every[f"{scenario}-refused"] = ["run", scenario, *refused.split(), "--out", str(folder / f"{scenario}-refused")]
        every[f"{scenario}-still"] = ["render", str(folder / f"{scenario}-seed1"), "--still"]
    for study in STUDIES:
        every[f"study-{study}"] = ["study", study, "--quick", "--out", str(folder / f"study-{study}")]
    store = folder / "sweep.db"
    every["sweep"] = [*SWEEP.split(), "--store", str(store)]
    every["sweep-export"] = ["store", "export", str(store), "--out", str(folder / "sweep.csv")]
    every["search"] = [*SEARCH.split(), "--store", str(folder / "search.db"), "--out", str(folder / "search")]
    every["search-export"] = ["store", "export", str(folder / "search.db"), "--out", str(folder / "search.csv")]
    every["script"] = ["python", "-c", SCRIPT, str(folder / "script")]
    every["episode"] = ["python", "-c", EPISODE, str(folder / "episode")]
    every["terrain-import"] = IMPORT.split()
    every["estimate"] = ["estimate", "range_ekf", str(folder / "range-localisation-seed1")]
    pair = [str(folder / f"safe-flight-seed{seed}") for seed in SEEDS]
    every["compare"] = ["compare", *pair, "--out", str(folder / "comparison.html")]
    return every


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="a new folder, which the set is written into")
    here = Path(sys.executable).with_name("mathnavi")
    parser.add_argument("--mathnavi", type=Path, default=here, help="the command to record with (default: %(default)s)")
    parser.add_argument("--only", default="", help="record the commands alone whose names contain this")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    write_heights(folder / "heights.png")
    programs = {"python": arguments.mathnavi.absolute().with_name("python")}
    for name, (first, *rest) in commands(folder).items():
        if arguments.only not in name:
            continue
        began = time.perf_counter()
        ended = subprocess.run(
            [programs[first], *rest] if first in programs else [arguments.mathnavi.absolute(), first, *rest],
            cwd=folder,  # where nothing else can be imported from
            capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        said = f"{ended.stdout}\n--- standard error\n{ended.stderr}".replace(str(folder), "FOLDER")
        (folder / f"{name}.txt").write_text(f"exit {ended.returncode}\n{said}", encoding="utf-8")
        print(f"{name:32} exit {ended.returncode}  {time.perf_counter() - began:5.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
