"""Switching surfaces: where the functions of a problem jump or have a kink, found from their expression graph.

A comparison, as in ``if_else``, ``fmin``, ``fmax``, ``fabs``, ``sign`` or ``copysign`` changes its branch where a level
g(x, u, t; p) changes its sign; ``floor``, ``ceil``, ``fmod`` and ``remainder`` do where a level passes a step, an
integer or half of one. With the branch of every surface given, the functions are smooth.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array

_COMPARISONS = {ca.OP_LT, ca.OP_LE, ca.OP_FMIN, ca.OP_FMAX}
_SIGNS = {ca.OP_FABS, ca.OP_SIGN}
_STEPS = {ca.OP_FLOOR, ca.OP_CEIL}
_REMAINDERS = {ca.OP_FMOD, ca.OP_REMAINDER}
_BRANCHING = _COMPARISONS | _SIGNS | _STEPS | _REMAINDERS | {ca.OP_COPYSIGN}
_TEXT = 60  # characters of an expression in a message


@dataclass(frozen=True, eq=False)
class SwitchingSurface:
    """A surface on which a function of a problem changes its branch; several instructions may share it."""

    text: str  # the expression, "(x<1)"
    level: ca.SX  # g () that passes a step there
    step: float  # distance of its steps; 0 for one at zero
    offset: float  # of the steps: 0.5 where halves are
    by_state: bool  # True if g depends on x
    by_control: bool  # True if g depends on u


@dataclass(frozen=True, eq=False)
class Surfaces:
    """All surfaces of a problem, and its functions with the branches left open."""

    every: tuple[SwitchingSurface, ...]
    levels: ca.Function  # (x, u, t, p) -> (g (m,), Σ |∂g/∂z| scale (m,)), z = (x, u)
    rows: ca.Function  # (x, u, t, p) -> f, L and d below each other
    slopes: ca.Function  # (x, u, t, p) -> their derivatives by (x, u, t)
    normals: ca.Function  # (x, u, t, p) -> ∂g/∂(x, u, t) (m, nx + nu + 1)


@lru_cache(maxsize=256)
def has_switching_surfaces(problem: ProblemFunctions) -> bool:
    """True if dynamics, running cost or path constraints have an operation that branches."""
    return any(
        function.instruction_id(k) in _BRANCHING
        for function in (problem.dynamics, problem.running_cost, problem.path)
        for k in range(function.n_instructions())
    )


@lru_cache(maxsize=64)
def surfaces_of(problem: ProblemFunctions) -> Surfaces | None:
    """The surfaces of a problem; None if it has none, or calls functions whose operations are not known."""
    if not has_switching_surfaces(problem):
        return None
    arguments = _symbols(problem)
    function = _rows(problem, arguments)
    found: list[SwitchingSurface] = []
    if branched(function, arguments, found, ()) is None:
        return None
    g, z = ca.vertcat(*(each.level for each in found)), ca.vertcat(*arguments[:3])
    scale = ca.DM([*problem.state_scale, *problem.control_scale, problem.guess_duration])
    normals = ca.densify(ca.jacobian(g, z))
    rows = function(*arguments)
    return Surfaces(
        every=tuple(found),
        levels=ca.Function("levels", arguments, [ca.densify(g), ca.fabs(normals) @ scale]),
        rows=function,
        slopes=ca.Function("slopes", arguments, [ca.densify(ca.jacobian(rows, z))]),
        normals=ca.Function("normals", arguments, [normals]),
    )


def _symbols(problem: ProblemFunctions) -> list[ca.SX]:
    """Symbols x, u, t and p of the problem's own names."""
    x, u, p = (
        ca.vertcat(ca.SX(0, 1), *(ca.SX.sym(name) for name in names))
        for names in (problem.states, problem.controls, problem.parameters)
    )
    return [x, u, ca.SX.sym("t"), p]


def _rows(problem: ProblemFunctions, arguments: list[ca.SX]) -> ca.Function:
    made = [function(*arguments) for function in (problem.dynamics, problem.running_cost, problem.path)]
    return ca.Function("rows", arguments, [ca.densify(ca.vertcat(*made))])


def branched(
    function: ca.Function, arguments: Sequence[ca.SX], found: list[SwitchingSurface], branches: Sequence[float]
) -> ca.SX | None:
    """The result (n, 1) of a function of SX columns with branches that are given; None if it calls other functions.

    Args:
        function: of columns, with one column as its result.
        arguments: its symbols.
        found: surfaces, in the order of the operations; those that are missing are added.
        branches: for each surface the value, below or above its step, on which its branch is taken; NaN or none for a
            branch that is left open.
    """
    work: dict[int, ca.SX] = {}
    results: dict[int, ca.SX] = {}
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        given, own = function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            work[own[0]] = ca.SX(function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            work[own[0]] = arguments[given[0]][given[1]]
        elif code == ca.OP_OUTPUT:
            results[own[1]] = work[given[0]]
        elif code == ca.OP_CALL:
            return None
        else:
            parts = [work[i] for i in given]
            made = ca.SX.unary(code, *parts) if len(parts) == 1 else ca.SX.binary(code, *parts)
            if code in _BRANCHING and not made.is_constant():
                place = _place(code, parts, made, arguments, found)
                side = branches[place] if place < len(branches) else np.nan
                made = made if np.isnan(side) else _taken(code, parts, side)
            work[own[0]] = made
    return ca.vertcat(ca.SX(0, 1), *(results[k] for k in range(function.numel_out(0))))


def _place(
    code: int, parts: list[ca.SX], made: ca.SX, arguments: Sequence[ca.SX], found: list[SwitchingSurface]
) -> int:
    """Place among the surfaces of the one that an operation branches on; it is added if it is new."""
    level, step, offset = _level(code, parts)
    for place, other in enumerate(found):
        if other.step == step and other.offset == offset and ca.is_equal(other.level, level, 20):
            return place
    text = _text(made)
    text = text if len(text) <= _TEXT else f"{text[: _TEXT - 3]}..."
    by_state, by_control = (ca.depends_on(level, each) for each in arguments[:2])
    found.append(SwitchingSurface(text, level, step, offset, by_state, by_control))
    return len(found) - 1


def _text(made: ca.SX) -> str:
    """An expression as it is written, without CasADi's "@1=0.5, " for what occurs twice."""
    text = str(made)
    while text.startswith("@"):
        head, _, text = text.partition(", ")
        name, _, value = head.partition("=")
        text = value.join(re.split(rf"{name}(?!\d)", text))
    return text


def _level(code: int, parts: list[ca.SX]) -> tuple[ca.SX, float, float]:
    if code in _COMPARISONS:
        return parts[0] - parts[1], 0.0, 0.0
    if code in _SIGNS:
        return parts[0], 0.0, 0.0
    if code == ca.OP_COPYSIGN:
        return parts[1], 0.0, 0.0
    if code in _STEPS:
        return parts[0], 1.0, 0.0
    return parts[0] / parts[1], 1.0, 0.5 if code == ca.OP_REMAINDER else 0.0


def _taken(code: int, parts: list[ca.SX], side: float) -> ca.SX:
    """The branch of an operation where its level is ``side``."""
    if code in (ca.OP_LT, ca.OP_LE):
        return ca.SX(float(side < 0.0))
    if code == ca.OP_FMIN:
        return parts[0] if side < 0.0 else parts[1]
    if code == ca.OP_FMAX:
        return parts[1] if side < 0.0 else parts[0]
    if code == ca.OP_SIGN:
        return ca.SX(float(np.sign(side)))
    if code == ca.OP_FABS:
        return parts[0] * float(np.sign(side))
    if code == ca.OP_COPYSIGN:
        return ca.fabs(parts[0]) * float(np.sign(side))
    if code in _STEPS:
        return ca.SX(float(np.floor(side) if code == ca.OP_FLOOR else np.ceil(side)))
    whole = np.trunc(side) if code == ca.OP_FMOD else np.round(side)
    return parts[0] - parts[1] * float(whole)


def steps_passed(surface: SwitchingSurface, levels: Array) -> Array:
    """Number (n,) of the step that levels (n,) are above: another one on the other side of the surface."""
    if surface.step == 0.0:
        return np.where(levels < 0.0, -1.0, 1.0)
    passed: Array = np.floor(levels / surface.step + surface.offset)
    return passed
