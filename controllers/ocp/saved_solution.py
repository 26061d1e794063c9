"""Solutions from files: reads what ``Solution.save`` has written.

The file is an .npz archive of numbers and texts (see ``records``): every field of the solution, its problem's limits,
scales and guess, and the problem's functions as lists of elementary operations. Nothing in it is executed, and all of
it is checked. So a solution that is read back can do what it could before: be evaluated, drawn, replayed, checked and
used as a guess, and its problem can be solved again.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.function_tape import function_of
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.records import RecordReader
from mathnavi.controllers.ocp.solution import FORMAT, RECORD, Solution
from mathnavi.controllers.ocp.transcriptions.collocation import GaussLegendre, LegendreGaussLobatto, RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA, point_counts
from mathnavi.interfaces.errors import SolutionFileError
from mathnavi.interfaces.reading.arrays import NUMBERS_AND_TEXTS, read_npz
from mathnavi.interfaces.signals import Array

_KINDS = (
    Euler, GaussLegendre, HermiteSimpson, LegendreGaussLobatto, MultipleShooting, RadauIIA, Trapezoid, VariableRadauIIA,
)  # fmt: skip
SCHEMES: dict[str, Any] = {kind.__name__: kind for kind in _KINDS}
"""schemes that a file may contain, by name"""

_PROBLEM = f"{RECORD}.problem"


def load_solution(path: str | Path, problem: ProblemFunctions | None = None) -> Solution:
    """Load the solution that ``Solution.save`` has written to a file.

    Args:
        path: of the file.
        problem: the problem that was solved, ``OptimalControlProblem.functions()``; None takes it from the file, which
            contains it unless its functions call others, for instance tables.

    Raises:
        FileNotFoundError: if the file does not exist.
        SolutionFileError: for a file that is broken, not one of a solution, or of another problem than ``problem``.
    """
    arrays = read_npz(Path(path), SolutionFileError, kinds=NUMBERS_AND_TEXTS)
    try:
        return _solution(arrays, problem)
    except (ValueError, TypeError, OverflowError) as fault:
        raise SolutionFileError(f"{path} is not the file of a solution: {fault}") from None


def _solution(arrays: Mapping[str, Array], problem: ProblemFunctions | None) -> Solution:
    reader = RecordReader(arrays, {}, {Scheme: SCHEMES})
    if (version := reader.text("format")) != FORMAT:
        raise ValueError(f"format = {version!r:.60}; allowed: {FORMAT}")
    names = [reader.texts(f"{_PROBLEM}.{kind}") for kind in ("states", "controls", "parameters")]
    if problem is not None:
        if names != [problem.states, problem.controls, problem.parameters]:
            raise ValueError(f"it has {_listed(names)}, and {problem.name} other states, controls or parameters")
        known: dict[str, Any] = {_PROBLEM: problem}
    else:
        known = {f"{_PROBLEM}.{field}": function for field, function in _functions(reader).items()}
    solution: Solution = RecordReader(arrays, known, reader.kinds).record(Solution, RECORD)
    _check_shapes(solution)
    return solution


def _listed(names: list[tuple[str, ...]]) -> str:
    return "; ".join(", ".join(each) or "none" for each in names)


def _functions(reader: RecordReader) -> dict[str, ca.Function]:
    """Read the functions of the problem, by field."""
    nx, nu, parameters = (len(reader.texts(f"{_PROBLEM}.{kind}")) for kind in ("states", "controls", "parameters"))
    nd, ni, ns = (reader.numbers(f"{_PROBLEM}.{kind}_bounds.lower").size for kind in ("path", "initial", "final"))
    along, at_end = (nx, nu, 1, parameters), (nx, 1, parameters)
    wanted = {
        "dynamics": (along, nx),
        "running_cost": (along, 1),
        "terminal_cost": (at_end, 1),
        "path": (along, nd),
        "initial": ((nx, parameters), ni),
        "final": (at_end, ns),
    }
    instants = f"{_PROBLEM}.instants"
    if f"{instants}.fractions" in reader.arrays:
        states = nx * reader.numbers(f"{instants}.fractions").size
        wanted["instants.cost"] = (states, parameters), 1
        wanted["instants.rows"] = (states, parameters), len(reader.texts(f"{instants}.names"))
    made = {}
    for field, (inputs, size) in wanted.items():
        parts = {part: f"{_PROBLEM}.{field}.{part}" for part in ("tape", "constants", "inputs", "size")}
        if missing := [key for key in parts.values() if key not in reader.arrays]:
            raise ValueError(f"there is no array {missing[0]!r}; allowed: to give the problem, problem=ocp.functions()")
        try:
            made[field] = function_of(
                field.replace(".", "_"), {part: reader.arrays[key] for part, key in parts.items()}, inputs, size
            )
        except ValueError as fault:
            raise ValueError(f"{_PROBLEM}.{field}: {fault}") from None
    return made


def _check_shapes(solution: Solution) -> None:
    """Check that every array has the shape for the nodes, points, states and controls; ValueError names a wrong one."""
    problem, m = solution.problem, solution.multipliers
    n, k, nx, nu = len(solution.grid), len(solution.scheme.points), problem.nx, problem.nu
    nd, ni, ns = (len(limits.lower) for limits in (problem.path_bounds, problem.initial_bounds, problem.final_bounds))
    if len(point_counts(solution.scheme)) not in (1, n - 1):
        raise ValueError(f"scheme.counts: points of {len(point_counts(solution.scheme))} intervals; allowed: {n - 1}")
    parameters, guesses = len(problem.parameters), len(problem.guess_times)
    wanted = {
        "x": (solution.x, (n, nx)),
        "inner": (solution.inner, (n - 1, k, nx)),
        "u": (solution.u, (n - 1, k, nu)),
        "costates": (solution.costates, (n - 1, nx)),
        "parameters": (solution.parameters, (parameters,)),
        "sensitivities": (solution.sensitivities.values, (parameters,)),
        "multipliers.dynamics": (m.dynamics.values, (n - 1, k, nx)),
        "multipliers.path": (m.path.values, (n - 1, k, nd)),
        "multipliers.states": (m.states.values, (n - 1, k, nx)),
        "multipliers.controls": (m.controls.values, (n - 1, k, nu)),
        "multipliers.initial": (m.initial.values, (ni,)),
        "multipliers.final": (m.final.values, (ns,)),
        "problem.state_scale": (problem.state_scale, (nx,)),
        "problem.control_scale": (problem.control_scale, (nu,)),
        "problem.nominal": (problem.nominal, (parameters,)),
        "problem.guess_times": (problem.guess_times, (guesses,)),
        "problem.guess_states": (problem.guess_states, (guesses, nx)),
        "problem.guess_controls": (problem.guess_controls, (guesses, nu)),
    }
    bounds = {"state": nx, "control": nu, "path": nd, "initial": ni, "final": ns}
    for kind, size in bounds.items():
        for side, array in zip(("lower", "upper"), getattr(problem, f"{kind}_bounds"), strict=True):
            wanted[f"problem.{kind}_bounds.{side}"] = array, (size,)
    if (instants := problem.instants) is not None:
        wanted["problem.instants.fractions"] = instants.fractions, (instants.fractions.size,)
        for side, array in zip(("lower", "upper"), instants.bounds, strict=True):
            wanted[f"problem.instants.bounds.{side}"] = array, (len(instants.names),)
        if not ((instants.fractions >= 0.0) & (instants.fractions <= 1.0)).all():
            raise ValueError(f"problem.instants.fractions = {instants.fractions.tolist()!r:.80}; allowed: 0 to 1")
    for name, (array, shape) in wanted.items():
        if array.shape != shape:
            raise ValueError(f"array '{RECORD}.{name}' of shape {array.shape}; allowed: {shape}")
    named = {
        "dynamics": (m.dynamics, nx), "states": (m.states, nx), "controls": (m.controls, nu), "path": (m.path, nd),
        "initial": (m.initial, ni), "final": (m.final, ns), "sensitivities": (solution.sensitivities, parameters),
    }  # fmt: skip
    for name, (own, size) in named.items():
        if len(own.names) != size:
            raise ValueError(f"{name}: {len(own.names)} names; allowed: {size}")
    if solution.replay is not None and solution.replay.end.shape != (nx,):
        raise ValueError(f"replay.end of shape {solution.replay.end.shape}; allowed: {(nx,)}")
    if not (np.isfinite(solution.duration) and solution.duration > 0.0):
        raise ValueError(f"duration = {solution.duration}; allowed: a finite value > 0")
