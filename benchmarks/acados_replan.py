"""The flight planner's replan stated for acados, and its solutions; acados runs in a separate process.

benchmarks/README.md explains how this statement differs from the planner's.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.controllers.flight.kernels import problem_data
from mathnavi.controllers.flight.problem import POINTS_ON_MANOEUVRE, POINTS_PER_ARC, PlanSolution, Problem
from mathnavi.controllers.flight.reference import windows
from mathnavi.controllers.flight.spline import TARGET_LENGTH
from mathnavi.interfaces.signals import Array

SCRIPT = Path(__file__).with_name("acados_flight.py")
WITHIN = 1e-3
"""largest relative excess over a limit that a plan may have; beyond it the solve counts as failed"""
NAMES = {"SQP": "acados, SQP", "SQP_RTI": "acados, RTI"}

Answers = tuple[Array, list[PlanSolution | None]]
"""ms (R, n), and the solution of each problem, None where it failed"""


def solved(folder: Path, problems: Sequence[tuple[Problem, Array]], repetitions: int) -> dict[str, Answers]:
    """Return the answers by name of the solver; RuntimeError with the end of its output if the process fails."""
    arrays: dict[str, Any] = {key: np.asarray(value, float) for key, value in _stated(problems).items()}
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "problems.npz"
        np.savez(path, **arrays)
        command = [sys.executable, str(SCRIPT), str(folder), str(path), str(repetitions)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"acados: exit code {done.returncode}\n{done.stderr[-2000:]}")
    found = json.loads(done.stdout.splitlines()[-1])
    return {NAMES[kind]: _answers(answer, problems) for kind, answer in found.items()}


def _stated(problems: Sequence[tuple[Problem, Array]]) -> dict[str, Any]:
    """Return the numbers that all problems share, and the start, guess and splines around the start of each."""
    problem = problems[0][0]
    environment, p, packed = problem.environment, problem.parameters, problem.packed
    around = [windows(each) for each, _ in problems]
    return {
        "arcs": problem.arcs,
        "h": p.h,
        "manoeuvre": p.manoeuvre_duration,
        "speed_max": p.speed_max,
        "acceleration_max": p.acceleration_max,
        "beta": p.beta,
        "epsilon": p.epsilon,
        "clearance": p.clearance,
        "psi": p.psi_per_metre,
        "terrain_weight": problem.terrain_weight,
        "approach_weight": packed[problem_data.APPROACH_WEIGHT],
        "climb_weight": packed[problem_data.CLIMB_WEIGHT],
        "points_per_arc": POINTS_PER_ARC,
        "points_on_manoeuvre": POINTS_ON_MANOEUVRE,
        "border": problem_data.BORDER,
        "width": environment.terrain.width,
        "depth": environment.terrain.depth,
        "spacing": environment.terrain.spacing,
        "heights": [heights.coefficients for heights, _, _ in around],
        "ground": [ground.coefficients for _, ground, _ in around],
        "ratio": [ratio.coefficients for _, _, ratio in around],
        "heights_frame": [heights.frame for heights, _, _ in around],
        "ground_frame": [ground.frame for _, ground, _ in around],
        "scales": environment.cost.scales,
        "target_length": TARGET_LENGTH,
        "starts": [each.start for each, _ in problems],
        "guesses": [guess for _, guess in problems],
    }


def _answers(answer: dict[str, Any], problems: Sequence[tuple[Problem, Array]]) -> Answers:
    found = zip(answer["found"], problems, strict=True)
    return np.array(answer["ms"]), [_solution(each, problem) for each, (problem, _) in found]


def _solution(found: dict[str, Any], problem: Problem) -> PlanSolution | None:
    if found["unknowns"] is None:
        return None
    unknowns = np.array(found["unknowns"])
    accelerations, climb = unknowns[:-1].reshape(-1, 3), max(0.0, float(unknowns[-1]))
    if excess(problem, accelerations, climb) > WITHIN:
        return None
    return PlanSolution(accelerations, climb, np.nan, True, found["iterations"])


def excess(problem: Problem, accelerations: Array, climb: float) -> float:
    """Return the largest relative excess of a plan and its manoeuvre over the limits of speed and acceleration."""
    p = problem.parameters
    v = problem.start[3:] + np.cumsum(np.array(p.lengths)[:, None] * accelerations, axis=0)
    braking = (np.array([0.0, 0.0, climb]) - v[-1]) / p.manoeuvre_duration
    speeds, forces = np.linalg.norm(v, axis=1), np.linalg.norm(np.vstack([accelerations, braking]), axis=1)
    return float(max(speeds.max() / p.speed_max, forces.max() / p.acceleration_max)) - 1.0
