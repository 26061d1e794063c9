"""Linear tables, ``casadi.interpolant(..., "linear", ...)``: their knots, and their multilinear piece in a given cell.

A table of y_1 ... y_d is continuous, and multilinear in each cell between neighbouring knots,

    F(y) = Σ_c Π_j w_jc(y_j) F(k_c),        w_jc = (y_j - k_j) / (k_(j+1) - k_j)  or  1 - that,

over the 2^d corners c of the cell; its first and last cells go on beyond the knots. Its derivative by y_j is constant
in y_j in a cell, and linear in the others.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array

MOST_KNOTS = 100
"""number of knots, or of times, beyond which a table is as good as smooth: one with a value each minute, for example"""

_TABLE, _DERIVATIVE = "LinearInterpolant", "LinearInterpolantJac"  # CasADi's classes


def inner_knots(function: ca.Function) -> list[Array] | None:
    """Knots at which a linear table, or the derivative of one, may have a kink or a jump, along each argument.

    All but the first and the last. None for any other function, and for a table whose knots are inputs; none along an
    argument with more than ``MOST_KNOTS`` of them.
    """
    kind = function.class_name()
    if kind not in (_TABLE, _DERIVATIVE) or (kind == _DERIVATIVE and function.n_out() > 1):
        return None
    every = table_knots(function)
    if len(every) != function.numel_in(0):
        return None
    return [knots[1:-1] if len(knots) <= MOST_KNOTS else np.empty(0) for knots in every]


def table_knots(table: ca.Function) -> list[Array]:
    """Knots of a linear table along each of its arguments, which CasADi hands out in its serialised form only."""
    letters = np.frombuffer(table.serialize({"debug": True}).encode(), np.uint8).reshape(-1, 2) - ord("a")
    written = (letters[:, 0] + 16 * letters[:, 1]).astype(np.uint8).tobytes()
    grid = _vector(written, b"Interpolant::grid", b"d", "<f8")
    offset = _vector(written, b"Interpolant::offset", b"J", "<i8").astype(np.int64)
    return [grid[first:last] for first, last in pairwise(offset.tolist())]


def _vector(written: bytes, name: bytes, letter: bytes, kind: str) -> Array:
    """A vector in the serialised form: its name, its length, and each number behind a letter."""
    start = re.search(re.escape(name) + b"VJ", written)
    assert start is not None, f"{name!r} in the serialised table"
    count = int(np.frombuffer(written, "<i8", 1, start.end())[0])
    numbers = np.frombuffer(written, np.dtype([("letter", "S1"), ("value", kind)]), count, start.end() + 8)
    assert (numbers["letter"] == letter).all(), f"the numbers of {name!r} in the serialised table"
    return np.array(numbers["value"], float)


def table_piece(table: ca.Function, arguments: list[ca.SX], inside: Sequence[float]) -> list[ca.SX]:
    """Results of a linear table, or of its derivative, each () in a cell that is given.

    Args:
        table: the function.
        arguments: all nonzeros of its inputs, each (), those of the table first.
        inside: (d,) a value of each argument inside the cell; NaN along an argument whose cell is left open.
    """
    along = zip(table_knots(table), inside, strict=True)
    cells = [None if np.isnan(value) else _cell(knots, value) for knots, value in along]
    if table.class_name() == _TABLE:
        return _corners(table, arguments, cells, 0)
    count = table.numel_out(0) // len(cells)
    results = list[ca.SX]()
    for j, cell in enumerate(cells):
        middle, others = list(arguments), list(cells)
        if cell is not None:
            middle[j], others[j] = ca.SX(0.5 * sum(cell)), None
        results += _corners(table, middle, others, 0)[j * count : (j + 1) * count]
    return results


def _cell(knots: Array, inside: float) -> tuple[float, float]:
    first = int(np.clip(np.searchsorted(knots, inside) - 1, 0, len(knots) - 2))
    return float(knots[first]), float(knots[first + 1])


def _corners(
    table: ca.Function, arguments: list[ca.SX], cells: Sequence[tuple[float, float] | None], first: int
) -> list[ca.SX]:
    """The sum over the corners of a cell along the arguments from ``first`` on; those of an open cell stay."""
    j = next((j for j in range(first, len(cells)) if cells[j] is not None), None)
    if j is None:
        return called(table, arguments)
    low, high = cells[j] or (0.0, 1.0)
    weight = (arguments[j] - low) / (high - low)
    lower, upper = (
        _corners(table, [*arguments[:j], ca.SX(knot), *arguments[j + 1 :]], cells, j + 1) for knot in (low, high)
    )
    return [below + weight * (above - below) for below, above in zip(lower, upper, strict=True)]


def called(function: ca.Function, arguments: Sequence[ca.SX], *, inline: bool = False) -> list[ca.SX]:
    """Nonzeros of all results, each (), of a function that is called with all nonzeros of its inputs, each ()."""
    given, start = list[ca.SX](), 0
    for k in range(function.n_in()):
        count = function.nnz_in(k)
        own = ca.vertcat(ca.SX(0, 1), *arguments[start : start + count])
        given.append(ca.SX(function.sparsity_in(k), own) if count else ca.SX(*function.size_in(k)))
        start += count
    if all(each.is_constant() for each in arguments):
        made = [ca.SX(each) for each in function.call([ca.DM(each) for each in given])]
    else:
        made = function.call(given, inline, False)
    nonzeros = [ca.vec(ca.SX(each.nz[:])) for each in made]
    return [part for each in nonzeros if each.numel() for part in ca.vertsplit(each)]
