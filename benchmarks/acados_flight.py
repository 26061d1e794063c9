"""The flight planner's replan by acados, in a process of its own; only NumPy and the wheel's folder are needed.

    python benchmarks/acados_flight.py FOLDER PROBLEMS.npz REPETITIONS

FOLDER is the wheel's (see ``acados_cart_pole``), PROBLEMS.npz what ``flight_solvers`` has recorded. One line of JSON:
for full sequential quadratic programming and for a real-time iteration the thread CPU time of each solve, the
accelerations and the climb rate found, the number of iterations and what failed.

States are position, velocity and the climb rate w, which stays constant and is free at the start; the dynamics of a
held acceleration are exact. Clearance and approach are soft with quadratic penalties, acados' own slacks. The Hessian
is exact in the cost, projected to be positive, without the curvature of the constraints; HPIPM solves the quadratic
programmes. In one run over the problems every solve starts from the planner's guess and, but for the first, from the
multipliers of the problem before.
"""

from __future__ import annotations

import contextlib
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this runs as a script
from benchmarks.acados_cart_pole import load

MOST_ITERATIONS = 200
NONE = 1e9  # stands for no limit
KINDS = ("SQP", "SQP_RTI")


def splines(ca: Any, known: dict[str, Any]) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Clearance that a point (3,) lacks [m] and the terminal cost there, with CasADi's own splines."""

    def spline(coordinates: list[Any], coefficients: Any) -> Any:
        shape = coefficients.shape
        knots = [(np.arange(count + 4) - 3.0).tolist() for count in reversed(shape)]
        at = [ca.fmin(ca.fmax(u, 0), count - 3) for u, count in zip(coordinates, shape, strict=True)]
        return ca.bspline(ca.vertcat(*reversed(at)), ca.DM(coefficients.ravel()), knots, [3] * len(shape), 1, {})

    x_0, y_0, cell, level_0, layer_spacing, *target = known["scales"]

    def lowness(p: Any) -> Any:
        height = spline([p[1] / known["spacing"], p[0] / known["spacing"]], known["heights"])
        return height + known["clearance"] - p[2]

    def psi(p: Any) -> Any:
        row, column = (p[1] - y_0) / cell, (p[0] - x_0) / cell
        layer = (p[2] - spline([row, column], known["ground"]) - level_0) / layer_spacing
        distance = ca.sqrt(ca.sumsqr(p - ca.DM(target)) + known["target_length"] ** 2)
        return known["psi"] * (distance * spline([layer, row, column], known["ratio"]) - known["target_length"])

    return lowness, psi


def solver(acados: Any, known: dict[str, Any], scratch: Path, kind: str) -> Any:
    """The compiled solver of one environment, ``kind`` SQP or SQP_RTI."""
    import casadi as ca

    ocp, n, h, M = acados.AcadosOcp(), int(known["arcs"]), known["h"], known["manoeuvre"]
    lowness, psi = splines(ca, known)
    x, a = ca.MX.sym("x", 7), ca.MX.sym("a", 3)
    p, v, w = x[:3], x[3:6], x[6]
    v_next, limit = v + h * a, known["acceleration_max"]
    ocp.model.name = f"replan_{kind.lower()}"
    ocp.model.x, ocp.model.u = x, a
    ocp.model.disc_dyn_expr = ca.vertcat(p + h * v + h**2 / 2 * a, v_next, w)
    ocp.cost.cost_type, ocp.cost.cost_type_e = "EXTERNAL", "EXTERNAL"
    ocp.model.cost_expr_ext_cost = h * ca.sumsqr(a)
    ocp.model.cost_expr_ext_cost_e = psi(p) + known["climb_weight"] / 2 * w**2
    count = int(known["points_per_arc"])
    low = [lowness(p + t * v + t**2 / 2 * a) for t in h * np.arange(1, count + 1) / count]
    ocp.model.con_h_expr = ca.vertcat(*low, ca.sumsqr(v_next) / known["speed_max"] ** 2, ca.sumsqr(a) / limit**2)
    braking = (ca.vertcat(0, 0, w) - v) / M
    times = M * np.arange(1, int(known["points_on_manoeuvre"]) + 1) / int(known["points_on_manoeuvre"])
    manoeuvre = [p + t * v + t**2 / 2 * braking for t in times]
    far = (psi(p + h * v) - psi(p)) / (h * known["beta"]) + 1 + known["epsilon"]
    sides = np.array([known["width"], known["depth"]])
    middle, half = sides / 2, sides / 2 - known["border"]
    ends = [(q[:2] - middle) / half for q in (p, manoeuvre[-1])]
    last = [*(lowness(q) for q in manoeuvre), far, ca.sumsqr(braking) / limit**2, *ends]
    ocp.model.con_h_expr_e = ca.vertcat(*last)
    ocp.dims.N = n
    c = ocp.constraints
    c.lh, c.uh = np.full(count + 2, -NONE), np.array([0.0] * count + [1.0, 1.0])
    c.idxsh = np.arange(count)
    c.lh_e = np.array([-NONE] * (len(times) + 2) + [-1.0] * 4)
    c.uh_e = np.array([0.0] * (len(times) + 1) + [1.0] * 5)
    c.idxsh_e = np.arange(len(times) + 1)
    c.idxbx_0, c.lbx_0 = np.arange(7), np.zeros(7)
    c.ubx_0 = np.array([0.0] * 6 + [known["speed_max"]])
    c.idxbxe_0 = np.arange(6)
    kappa = np.full(count, known["terrain_weight"])
    kappa_e = np.append(np.full(len(times), known["terrain_weight"]), known["approach_weight"])
    for side in ("l", "u"):
        setattr(ocp.cost, f"Z{side}", kappa)
        setattr(ocp.cost, f"z{side}", np.zeros(count))
        setattr(ocp.cost, f"Z{side}_e", kappa_e)
        setattr(ocp.cost, f"z{side}_e", np.zeros(len(kappa_e)))
    options = ocp.solver_options
    options.tf, options.time_steps = float(n), np.ones(n)  # the cost of a stage is multiplied by its step
    options.integrator_type, options.nlp_solver_type = "DISCRETE", kind
    options.hessian_approx, options.regularize_method = "GAUSS_NEWTON", "PROJECT"
    options.qp_solver, options.hpipm_mode = "PARTIAL_CONDENSING_HPIPM", "BALANCE"
    options.qp_solver_iter_max, options.nlp_solver_max_iter = 200, MOST_ITERATIONS
    options.nlp_solver_tol_stat, options.nlp_solver_tol_eq = 1e-3, 1e-6
    options.nlp_solver_tol_ineq, options.nlp_solver_tol_comp = 1e-6, 1e-3
    options.globalization = "MERIT_BACKTRACKING" if kind == "SQP" else "FIXED_STEP"
    ocp.code_export_directory = str(scratch / kind)
    return acados.AcadosOcpSolver(ocp, json_file=str(scratch / f"{kind}.json"), verbose=False)


def warm(own: Any, start: Any, guess: Any, arcs: int, h: float) -> None:
    """Set the start and the planner's guess (3 arcs + 1,); multipliers stay."""
    x = np.append(start, guess[-1])
    bounds = own.acados_ocp.constraints
    own.set(0, "lbx", np.append(start, 0.0))
    own.set(0, "ubx", np.append(start, bounds.ubx_0[6]))
    for i in range(arcs):
        a = guess[3 * i : 3 * i + 3]
        own.set(i, "x", x)
        own.set(i, "u", a)
        x = np.concatenate([x[:3] + h * x[3:6] + 0.5 * h * h * a, x[3:6] + h * a, x[6:]])
    own.set(arcs, "x", x)


def run(acados: Any, known: dict[str, Any], scratch: Path, kind: str, repetitions: int) -> dict[str, Any]:
    """Solve the problems of one environment in their order, ``repetitions`` times over."""
    own, arcs = solver(acados, known, scratch, kind), int(known["arcs"])
    own.solve()  # what is loaded once
    ms, found = np.empty((repetitions, len(known["starts"]))), []
    for repetition in range(repetitions):
        own.reset()
        found = []
        for i, (start, guess) in enumerate(zip(known["starts"], known["guesses"], strict=True)):
            warm(own, start, guess, arcs, known["h"])
            began = time.thread_time()
            status = int(own.solve())
            ms[repetition, i] = 1e3 * (time.thread_time() - began)
            unknowns = [*(own.get(k, "u") for k in range(arcs)), own.get(0, "x")[6:]]
            iterations = int(np.ravel(own.get_stats("sqp_iter"))[0]) if kind == "SQP" else 1
            values = np.concatenate(unknowns)
            failed = status not in ((0,) if kind == "SQP" else (0, 2)) or not np.isfinite(values).all()
            found.append({"unknowns": None if failed else values.tolist(), "iterations": iterations, "status": status})
            if failed:
                own.reset()
    return {"ms": ms.tolist(), "found": found}


def main(folder: Path, problems: Path, repetitions: int) -> dict[str, Any]:
    """What the line of JSON holds: by kind, a list with an entry for each environment."""
    with np.load(problems) as file:
        count = int(file["environments"])
        every = [
            {name.removeprefix(f"{k}/"): file[name] for name in file.files if name.startswith(f"{k}/")}
            for k in range(count)
        ]
    environments = [{name: value if value.ndim else float(value) for name, value in each.items()} for each in every]
    results: dict[str, Any] = {kind: [] for kind in KINDS}
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        acados = load(folder, scratch)
        for k, known in enumerate(environments):
            for kind in KINDS:
                place = scratch / f"{k}"
                place.mkdir(exist_ok=True)
                results[kind].append(run(acados, known, place, kind, repetitions))
    return results


if __name__ == "__main__":
    result = sys.stdout
    with contextlib.redirect_stdout(sys.stderr):
        answer = main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]), int(sys.argv[3]))
    assert math.isfinite(sum(sum(map(sum, part["ms"])) for parts in answer.values() for part in parts))
    print(json.dumps(answer), file=result, flush=True)
