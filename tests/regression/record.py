"""A fixed set of runs, recorded with one installation and compared with the same set recorded with another.

A change that is to leave behaviour as it is records the set before and after::

    python -m tests.regression.record BEFORE --mathnavi OLD/.venv/bin/mathnavi
    python -m tests.regression.record AFTER
    python -m tests.regression.compare BEFORE AFTER

The set: each scenario with two seeds and two configurations that are not the default, a refused run of each, pictures,
three studies, a sweep, an estimator over a recorded run, and a comparison of two runs.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

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
STUDIES = ("consensus", "ocp-problems", "sphere")
SWEEP = (
    "sweep safe-flight --trials 4 --terrain jacksboro --drawn-separation 0.2 0.3 --workers 2 "
    "--vary faults.solver-failure-rate=0,0.5"
)


def commands(folder: Path) -> dict[str, list[str]]:
    """The command lines of the set, each under its name; they write below ``folder``."""
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
    for name, command in commands(folder).items():
        if arguments.only not in name:
            continue
        began = time.perf_counter()
        ended = subprocess.run(
            [str(arguments.mathnavi.absolute()), *command],
            cwd=folder,  # where nothing else can be imported from
            capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        said = f"{ended.stdout}\n--- standard error\n{ended.stderr}".replace(str(folder), "FOLDER")
        (folder / f"{name}.txt").write_text(f"exit {ended.returncode}\n{said}", encoding="utf-8")
        print(f"{name:32} exit {ended.returncode}  {time.perf_counter() - began:5.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
