"""Switching surfaces: where the functions of a problem jump or have a kink, found from their expression graph.

A comparison, as in ``if_else``, ``fmin``, ``fmax``, ``fabs``, ``sign`` or ``copysign`` changes its branch where a level
g(x, u, t; p) changes its sign; ``floor``, ``ceil``, ``fmod`` and ``remainder`` do where a level passes a step, an
integer or half of one; a linear table has a kink where an argument passes a knot. With the branch of every surface
given, and so the cell of every table, the functions are smooth.

Functions that are called are looked into where CasADi can write them as expressions; others, tables of splines among
them, are taken to be smooth.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.linear_tables import called, inner_knots, table_piece
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array

_COMPARISONS = {ca.OP_LT, ca.OP_LE, ca.OP_FMIN, ca.OP_FMAX}
_SIGNS = {ca.OP_FABS, ca.OP_SIGN}
_STEPS = {ca.OP_FLOOR, ca.OP_CEIL}
_REMAINDERS = {ca.OP_FMOD, ca.OP_REMAINDER}
_BRANCHING = _COMPARISONS | _SIGNS | _STEPS | _REMAINDERS | {ca.OP_COPYSIGN}
_BRANCHING_OR_CALL = _BRANCHING | {ca.OP_CALL}
_INLINED = {"SXFunction", "MXFunction"}
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
    knots: tuple[float, ...] = ()  # steps that are not evenly spaced: knots of a table, increasing
    given: bool = False  # True for a break time that a person gave: nothing is seen to branch there

    def nearest_step(self, levels: Array) -> Array:
        """The steps (n,) that are nearest to levels (n,)."""
        if self.knots:
            middles = 0.5 * (np.array(self.knots[1:]) + self.knots[:-1])
            return np.array(self.knots)[np.searchsorted(middles, levels)]
        if self.step == 0.0:
            return np.zeros_like(levels)
        nearest: Array = self.step * (np.round(levels / self.step + self.offset) - self.offset)
        return nearest

    def named(self, level: float) -> str:
        """The surface in words, with the knot that is nearest to a level."""
        return f"{self.text} = {float(self.nearest_step(np.array([level]))[0]):g}" if self.knots else self.text


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
    """True if dynamics, running cost or path constraints have an operation that branches, or call a function.

    And where break times of a free duration are given.
    """
    return bool(problem.break_times) or any(
        function.instruction_id(k) in _BRANCHING_OR_CALL
        for function in (problem.dynamics, problem.running_cost, problem.path)
        for k in range(function.n_instructions())
    )


@lru_cache(maxsize=64)
def surfaces_of(problem: ProblemFunctions) -> Surfaces | None:
    """The surfaces of a problem; None if it has none."""
    if not has_switching_surfaces(problem):
        return None
    arguments = _symbols(problem)
    function = _rows(problem, arguments)
    found: list[SwitchingSurface] = []
    branched(function, arguments, found, ())
    t = arguments[2]
    for time in problem.break_times:
        level, text = t - time, f"t = {time:g}"
        found.append(SwitchingSurface(text, level, 0.0, 0.0, by_state=False, by_control=False, given=True))
    if not found:
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
) -> ca.SX:
    """The result (n, 1) of a function of SX columns with branches that are given.

    Args:
        function: of columns, with one dense column as its result.
        arguments: its symbols, or expressions in their place.
        found: surfaces, in the order of the operations; those that are missing are added.
        branches: for each surface the value, below or above its step, on which its branch is taken; NaN or none for a
            branch that is left open.
    """
    return _Branches(arguments, found, branches).of(function, arguments)


class _Branches:
    """Functions of the arguments of a problem, evaluated operation by operation with the branches that are given."""

    def __init__(self, arguments: Sequence[ca.SX], found: list[SwitchingSurface], branches: Sequence[float]) -> None:
        self._arguments, self._found, self._branches = arguments, found, branches

    def of(self, function: ca.Function, arguments: Sequence[ca.SX]) -> ca.SX:
        """Result (n, 1) of a function of dense columns."""
        work: dict[int, ca.SX] = {}
        results: dict[int, ca.SX] = {}
        calls: list[ca.SX] = []
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
                calls = calls or ca.vertsplit(function.instructions_sx())
                made = self._call(calls[k].which_function(), [work[i] for i in given])
                work |= {i: each for i, each in zip(own, made, strict=True) if i >= 0}
            else:
                work[own[0]] = self._operation(code, [work[i] for i in given])
        return ca.vertcat(ca.SX(0, 1), *(results[k] for k in range(function.numel_out(0))))

    def _operation(self, code: int, parts: list[ca.SX]) -> ca.SX:
        made = ca.SX.unary(code, *parts) if len(parts) == 1 else ca.SX.binary(code, *parts)
        if code not in _BRANCHING or made.is_constant():
            return made
        side = self._side(_place(*_level(code, parts), made, self._arguments, self._found))
        return made if np.isnan(side) else _taken(code, parts, side)

    def _call(self, function: ca.Function, parts: list[ca.SX]) -> list[ca.SX]:
        """Results of a function that is called, each ()."""
        if (knots := inner_knots(function)) is not None:
            return self._table(function, parts, knots)
        if function.class_name() not in _INLINED:
            return called(function, parts)
        column = ca.SX.sym("column", len(parts))
        try:
            results = called(function, ca.vertsplit(column), inline=True)
        except RuntimeError:  # it may not be inlined, or solves equations
            return called(function, parts)
        inner = ca.Function("inner", [column], [ca.vertcat(ca.SX(0, 1), *results)])
        return ca.vertsplit(self.of(inner, [ca.vertcat(ca.SX(0, 1), *parts)]))

    def _table(self, table: ca.Function, parts: list[ca.SX], knots: list[Array]) -> list[ca.SX]:
        inside = np.full(len(knots), np.nan)
        for j, own in enumerate(knots):
            if len(own) and not parts[j].is_constant():
                inside[j] = self._side(
                    _place(parts[j], 0.0, 0.0, None, self._arguments, self._found, table.name(), own.tolist())
                )
        return table_piece(table, parts, inside.tolist())

    def _side(self, place: int) -> float:
        return self._branches[place] if place < len(self._branches) else np.nan


def _place(
    level: ca.SX,
    step: float,
    offset: float,
    made: ca.SX | None,
    arguments: Sequence[ca.SX],
    found: list[SwitchingSurface],
    table: str = "",
    knots: Sequence[float] = (),
) -> int:
    """Place among the surfaces of the one on which an operation, or a table, branches; it is added if it is new."""
    for place, other in enumerate(found):
        same = other.step == step and other.offset == offset and other.knots == tuple(knots)
        if same and ca.is_equal(other.level, level, 20):
            return place
    text = _text(level if made is None else made)
    text = text if len(text) <= _TEXT else f"{text[: _TEXT - 3]}..."
    text = f"{table} at {text}" if table else text
    by_state, by_control = (ca.depends_on(level, each) for each in arguments[:2])
    found.append(SwitchingSurface(text, level, step, offset, by_state, by_control, tuple(knots)))
    return len(found) - 1


def _text(made: ca.SX) -> str:
    """An expression as written, without CasADi's "@1=0.5, " for what occurs twice."""
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
    if surface.knots:
        return np.searchsorted(surface.knots, levels, side="right").astype(float)
    if surface.step == 0.0:
        return np.where(levels < 0.0, -1.0, 1.0)
    passed: Array = np.floor(levels / surface.step + surface.offset)
    return passed
