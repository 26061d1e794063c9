"""Swing-up of the cart-pole by acados: a script that needs only NumPy and the folder of acados' wheel.

    python benchmarks/acados_cart_pole.py FOLDER INTERVALS REPETITIONS

FOLDER is where ``pip install --target`` has put the wheel ``comma-deps-acados``. Its ``casadi`` conflicts with the one
of this environment, so the script runs in a separate process. The wheel brings the libraries, the template renderer and
the headers; gcc compiles the solver. The output is one line of JSON: CPU time [s] of each solve from the coarse guess,
the trajectory, and the CPU times [s] of real-time iterations from starts close to it. The control is held on each
interval; the integrator is the classical Runge-Kutta method of order 4, the solver sequential quadratic programming
with the Gauss-Newton Hessian (the cost is F^2) and HPIPM.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import math
import os
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

CART, POLE, LENGTH, GRAVITY, FORCE, DURATION = 1.0, 0.3, 0.5, 9.81, 20.0, 2.0  # as in problems/cart_pole.py
END = np.array([1.0, math.pi, 0.0, 0.0])


def load(folder: Path, scratch: Path) -> Any:
    """Load the wheel's libraries, link its templates into the folder ``scratch``, and import its Python package."""
    install = folder / "acados" / "install"
    source = scratch / "source"
    (source / "interfaces" / "acados_template").mkdir(parents=True)
    (source / "interfaces" / "acados_template" / "acados_template").symlink_to(folder / "acados" / "acados_template")
    for part in install.iterdir():
        (source / part.name).symlink_to(part)
    os.environ |= {"ACADOS_SOURCE_DIR": str(source), "TERA_PATH": str(install / "bin" / "t_renderer")}
    for name in ("blasfeo", "hpipm", "qpOASES_e"):  # the solver's library finds them by name once they are loaded
        ctypes.CDLL(str(install / "lib" / f"lib{name}.so"), mode=ctypes.RTLD_GLOBAL)
    sys.path.insert(0, str(folder))
    return import_module("acados.acados_template")


def solver(acados: Any, scratch: Path, intervals: int, kind: str) -> Any:
    """Return the compiled solver; ``kind`` is "SQP" or "SQP_RTI"."""
    import casadi as ca

    ocp = acados.AcadosOcp()
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u")
    sin, cos, dphi = ca.sin(x[1]), ca.cos(x[1]), x[3]
    inertia = CART + POLE * sin**2
    total = CART + POLE
    ocp.model.name = f"cart_pole_{kind.lower()}"
    ocp.model.x, ocp.model.u = x, u
    ocp.model.f_expl_expr = ca.vertcat(
        x[2],
        dphi,
        (u + POLE * sin * (LENGTH * dphi**2 + GRAVITY * cos)) / inertia,
        -(u * cos + POLE * LENGTH * dphi**2 * sin * cos + total * GRAVITY * sin) / (LENGTH * inertia),
    )
    ocp.cost.cost_type = "LINEAR_LS"
    ocp.cost.Vx, ocp.cost.Vu = np.zeros((1, 4)), np.ones((1, 1))
    ocp.cost.W, ocp.cost.yref = np.array([[2.0]]), np.zeros(1)  # half of it times u^2
    ocp.constraints.x0 = np.zeros(4)
    ocp.constraints.idxbx_e, ocp.constraints.lbx_e, ocp.constraints.ubx_e = np.arange(4), END, END
    ocp.constraints.idxbu = np.array([0])
    ocp.constraints.lbu, ocp.constraints.ubu = np.array([-FORCE]), np.array([FORCE])
    ocp.dims.N = intervals
    options = ocp.solver_options
    options.tf, options.integrator_type, options.nlp_solver_type = DURATION, "ERK", kind
    options.hessian_approx, options.nlp_solver_max_iter = "GAUSS_NEWTON", 500
    options.qp_solver, options.qp_tol = "PARTIAL_CONDENSING_HPIPM", 1e-8
    options.hpipm_mode = "ROBUST"
    options.globalization = "MERIT_BACKTRACKING" if kind == "SQP" else "FIXED_STEP"
    ocp.code_export_directory = str(scratch / kind)
    return acados.AcadosOcpSolver(ocp, json_file=str(scratch / f"{kind}.json"), verbose=False)


def cold(own: Any, intervals: int) -> tuple[int, float]:
    """Return status and CPU time [s] of one solve from the straight line between the ends."""
    for i in range(intervals + 1):
        own.set(i, "x", END * i / intervals)
        own.set(i, "lam", 0.0 * own.get(i, "lam"))
    for i in range(intervals):
        own.set(i, "u", np.zeros(1))
        own.set(i, "pi", np.zeros(4))
    began = time.process_time()
    status = own.solve()
    return int(status), time.process_time() - began


def steps(own: Any, x: Any, u: Any, count: int) -> tuple[list[float], int]:
    """Return CPU times [s] of real-time iterations from ``count`` starts near the solution, and how many failed."""
    generator = np.random.default_rng(0)
    seconds, failed = [], 0
    for _ in range(count):
        for i, state in enumerate(x):
            own.set(i, "x", state)
        for i, control in enumerate(u):
            own.set(i, "u", control)
        start = x[0] + 1e-3 * generator.standard_normal(4)
        own.set(0, "lbx", start)
        own.set(0, "ubx", start)
        began = time.process_time()
        failed += own.solve() not in (0, 2)  # 2: one iteration was made, as many as there are
        seconds.append(time.process_time() - began)
    return seconds, failed


def main(folder: Path, intervals: int, repetitions: int) -> dict[str, Any]:
    """Return the results that are printed as one line of JSON."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        acados = load(folder, scratch)
        own = solver(acados, scratch, intervals, "SQP")
        solves = [cold(own, intervals) for _ in range(repetitions)]
        x = np.array([own.get(i, "x") for i in range(intervals + 1)])
        u = np.array([own.get(i, "u") for i in range(intervals)])
        iterating, failed = steps(solver(acados, scratch, intervals, "SQP_RTI"), x, u, 20 * repetitions)
        return {
            "solved": all(status == 0 for status, _ in solves),
            "seconds": [spent for _, spent in solves],
            "cost": float(own.get_cost()),
            "iteration_seconds": iterating,
            "iteration_failures": failed,
            "states": x.tolist(),
            "controls": u.tolist(),
        }


if __name__ == "__main__":
    result = sys.stdout
    with contextlib.redirect_stdout(sys.stderr):
        found = main(Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3]))
    print(json.dumps(found), file=result, flush=True)
