"""Replans of the flight planner by acados: a script that needs only NumPy and the folder of acados' wheel.

    python benchmarks/acados_flight.py FOLDER PROBLEMS.npz REPETITIONS

FOLDER is that of the wheel (see ``acados_cart_pole``), PROBLEMS.npz is recorded by ``flight_solvers``. The output is
one line of JSON: for full sequential quadratic programming and for a real-time iteration the thread CPU time of each
solve, the accelerations and the climb rate found, the number of iterations and the failures.

States are position, velocity and the climb rate w, which stays constant and is free at the start; the dynamics of a
held acceleration are exact. Clearance and approach are soft with quadratic penalties, acados' own slacks. The Hessian
is exact in the cost, projected to be positive, without the curvature of the constraints; HPIPM solves the quadratic
programmes. In one run over the problems every solve starts from the planner's guess and, but for the first, from the
multipliers of the problem before. Setting them, and the problem's parameters, is not timed.
"""

from __future__ import annotations

import contextlib
import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this runs as a script
from benchmarks.acados_cart_pole import load

MOST_ITERATIONS = 100
FAR = 1e5  # [m] stands for no limit
KINDS = ("SQP", "SQP_RTI")


def spline(ca: Any, c: Any, axes: list[tuple[int, Any, Any]], coordinates: list[Any]) -> Any:
    """Return a cubic B-spline at a point, from the coefficients c (n,) of a window in row-major order.

    Each axis is (size of the window, its corner, size of the whole array); coordinates are in cells of the whole array.
    """
    index, weight = ca.MX.zeros(1), ca.MX.ones(1)
    for (size, corner, whole), coordinate in zip(axes, coordinates, strict=True):
        clipped = ca.fmin(ca.fmax(coordinate, 0), whole - 3)
        cell = ca.fmin(ca.floor(clipped), whole - 4)
        f = clipped - cell
        g = 1 - f
        basis = ca.vertcat(g**3, 4 - 6 * f**2 + 3 * f**3, 4 - 6 * g**2 + 3 * g**3, f**3) / 6
        first = ca.fmin(ca.fmax(cell - corner, 0), size - 4)
        # Every place so far times every place of this axis, the last one fastest.
        index = ca.vec(ca.repmat(first + ca.DM(range(4)), 1, index.numel()) + size * ca.repmat(index.T, 4, 1))
        weight = ca.vec(ca.mtimes(basis, weight.T))
    return ca.dot(c[index], weight)


class Ground:
    """Clearance and terminal cost as splines whose windows are parameters of a problem."""

    def __init__(self, ca: Any, known: dict[str, Any]) -> None:
        self._ca, self._known = ca, known
        names = "heights", "ground", "ratio"
        self._shapes = {name: known[name].shape[1:] for name in names}
        self._frames = {name: ca.MX.sym(f"{name}_frame", 4) for name in names[:2]}
        self._windows = {name: ca.MX.sym(name, math.prod(self._shapes[name])) for name in names}

    @property
    def parameters(self) -> Any:
        """Parameters (np,) of the solver."""
        return self._ca.vertcat(*self._frames.values(), *self._windows.values())

    def _axes(self, frame: str, shape: tuple[int, ...]) -> list[tuple[int, Any, Any]]:
        corner = self._frames[frame]
        return [(shape[-2], corner[0], corner[2]), (shape[-1], corner[1], corner[3])]

    def lowness(self, p: Any) -> Any:
        """Return the missing clearance [m] of a point (3,) [m]."""
        known, axes = self._known, self._axes("heights", self._shapes["heights"])
        at = [p[1] / known["spacing"], p[0] / known["spacing"]]
        return spline(self._ca, self._windows["heights"], axes, at) + known["clearance"] - p[2]

    def psi(self, p: Any) -> Any:
        """Return the terminal cost at a point (3,) [m]."""
        known, ca = self._known, self._ca
        x_0, y_0, cell, level_0, layer_spacing, *target = known["scales"]
        row, column = (p[1] - y_0) / cell, (p[0] - x_0) / cell
        axes, layers = self._axes("ground", self._shapes["ground"]), self._shapes["ratio"][0]
        ground = spline(ca, self._windows["ground"], axes, [row, column])
        layer = (p[2] - ground - level_0) / layer_spacing
        axes = [(layers, ca.MX(0), ca.MX(layers)), *self._axes("ground", self._shapes["ratio"])]
        distance = ca.sqrt(ca.sumsqr(p - ca.DM(target)) + known["target_length"] ** 2)
        ratio = spline(ca, self._windows["ratio"], axes, [layer, row, column])
        return known["psi"] * (distance * ratio - known["target_length"])


def solver(acados: Any, known: dict[str, Any], scratch: Path, kind: str) -> Any:
    """Return the compiled solver; ``kind`` is "SQP" or "SQP_RTI"."""
    import casadi as ca

    ocp, n, h, M = acados.AcadosOcp(), int(known["arcs"]), known["h"], known["manoeuvre"]
    ground = Ground(ca, known)
    lowness, psi = ground.lowness, ground.psi
    x, a = ca.MX.sym("x", 7), ca.MX.sym("a", 3)
    p, v, w = x[:3], x[3:6], x[6]
    v_next, limit = v + h * a, known["acceleration_max"]
    ocp.model.name = f"replan_{kind.lower()}"
    ocp.model.x, ocp.model.u, ocp.model.p = x, a, ground.parameters
    ocp.parameter_values = np.zeros(ground.parameters.numel())
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
    c.lh, c.uh = np.array([-FAR] * count + [-1.0, -1.0]), np.array([0.0] * count + [1.0, 1.0])
    c.idxsh = np.arange(count)
    c.lh_e = np.array([-FAR] * (len(times) + 1) + [-1.0] * 5)
    c.uh_e = np.array([0.0] * (len(times) + 1) + [1.0] * 5)
    c.idxsh_e = np.arange(len(times) + 1)
    c.idxbx_0, c.lbx_0 = np.arange(7), np.zeros(7)
    c.ubx_0 = np.array([0.0] * 6 + [known["speed_max"]])
    c.idxbxe_0 = np.array([], dtype=int)  # as bounds: HPIPM does not eliminate a part of the first state
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
    options.qp_solver, options.hpipm_mode = "PARTIAL_CONDENSING_HPIPM", "ROBUST"
    options.qp_solver_iter_max, options.nlp_solver_max_iter = 200, MOST_ITERATIONS
    options.nlp_solver_tol_stat, options.nlp_solver_tol_eq = 1e-3, 1e-6
    options.nlp_solver_tol_ineq, options.nlp_solver_tol_comp = 1e-6, 1e-3
    ocp.code_export_directory = str(scratch / kind)
    return acados.AcadosOcpSolver(ocp, json_file=str(scratch / f"{kind}.json"), verbose=False)


def prepare(own: Any, known: dict[str, Any], i: int) -> None:
    """Set the start, the parameters and the planner's guess of problem i; the multipliers remain."""
    start, guess, arcs, h = known["starts"][i], known["guesses"][i], int(known["arcs"]), known["h"]
    x = np.append(start, guess[-1])
    own.set(0, "lbx", np.append(start, 0.0))
    own.set(0, "ubx", np.append(start, known["speed_max"]))
    names = "heights_frame", "ground_frame", "heights", "ground", "ratio"
    parameters = np.concatenate([known[name][i].ravel() for name in names])
    for k in range(arcs + 1):
        own.set(k, "p", parameters)
        own.set(k, "x", x)
        if k < arcs:
            a = guess[3 * k : 3 * k + 3]
            own.set(k, "u", a)
            x = np.concatenate([x[:3] + h * x[3:6] + 0.5 * h * h * a, x[3:6] + h * a, x[6:]])


def run(acados: Any, known: dict[str, Any], scratch: Path, kind: str, repetitions: int) -> dict[str, Any]:
    """Solve all problems in order, ``repetitions`` times."""
    own, arcs = solver(acados, known, scratch, kind), int(known["arcs"])
    prepare(own, known, 0)
    own.solve()  # what is loaded once
    ms = np.empty((repetitions, len(known["starts"])))
    found: list[dict[str, Any]] = []
    for repetition in range(repetitions):
        own.reset()
        found = []
        for i in range(len(known["starts"])):
            prepare(own, known, i)
            began = time.thread_time()
            status = int(own.solve())
            ms[repetition, i] = 1e3 * (time.thread_time() - began)
            values = np.concatenate([*(own.get(k, "u") for k in range(arcs)), own.get(0, "x")[6:]])
            iterations = int(np.ravel(own.get_stats("sqp_iter"))[0]) if kind == "SQP" else 1
            failed = status not in ((0,) if kind == "SQP" else (0, 2)) or not np.isfinite(values).all()
            found.append({"unknowns": None if failed else values.tolist(), "iterations": iterations, "status": status})
            if failed:
                own.reset()
    return {"ms": ms.tolist(), "found": found}


def main(folder: Path, problems: Path, repetitions: int) -> dict[str, Any]:
    """Return the results that are printed as one line of JSON, by kind of solver."""
    with np.load(problems) as file:
        known = {name: file[name] if file[name].ndim else float(file[name]) for name in file.files}
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        acados = load(folder, scratch)
        return {kind: run(acados, known, scratch, kind, repetitions) for kind in KINDS}


if __name__ == "__main__":
    result = sys.stdout
    with contextlib.redirect_stdout(sys.stderr):
        answer = main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]), int(sys.argv[3]))
    print(json.dumps(answer), file=result, flush=True)
