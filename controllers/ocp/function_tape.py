"""Conversion of compiled functions to arrays and back: a list of elementary operations, which is data, not code.

    row k of the tape:  operation, result, first argument, second argument

Operations are numbers into a list of names, so that a tape does not depend on CasADi's version. Results and arguments
are places in a work vector; of an input the arguments are its number and its element, of an output the result is the
element. What is read back is checked row by row and built of the operations in ``OF_ONE`` and ``OF_TWO``, no others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array

OF_ONE = (
    "ASSIGN", "NEG", "EXP", "LOG", "SQRT", "SQ", "TWICE", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "NOT", "FLOOR",
    "CEIL", "FABS", "SIGN", "ERF", "INV", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ERFINV", "LOG1P", "EXPM1",
)  # fmt: skip
OF_TWO = (
    "ADD", "SUB", "MUL", "DIV", "POW", "CONSTPOW", "LT", "LE", "EQ", "NE", "AND", "OR", "FMOD", "COPYSIGN",
    "IF_ELSE_ZERO", "FMIN", "FMAX", "ATAN2", "HYPOT", "REMAINDER",
)  # fmt: skip
OPERATIONS = ("CONST", "INPUT", "OUTPUT", *OF_ONE, *OF_TWO)
_CODES = {getattr(ca, f"OP_{name}"): k for k, name in enumerate(OPERATIONS)}
_MOST_ROWS = 1_000_000


def taped(function: ca.Function) -> dict[str, Array] | None:
    """Convert a function of columns with a column as its result to arrays; None if it calls others, as a table.

    "tape" (n, 4) whole numbers, "constants" (n,), "inputs" their sizes, "size" () that of the result.
    """
    arguments = function.sx_in()
    dense = ca.Function(function.name(), arguments, [ca.densify(function(*arguments))])
    rows, constants = [], []
    for k in range(dense.n_instructions()):
        code = _CODES.get(dense.instruction_id(k))
        if code is None:
            return None
        results, given = dense.instruction_output(k), dense.instruction_input(k)
        own = results[-1:] if OPERATIONS[code] == "OUTPUT" else results
        rows.append([code, *own, *given, 0, 0][:4])
        constants.append(dense.instruction_constant(k) if OPERATIONS[code] == "CONST" else 0.0)
    return {
        "tape": np.array(rows, np.int64).reshape(-1, 4),
        "constants": np.array(constants, float),
        "inputs": np.array([symbol.numel() for symbol in arguments], np.int64),
        "size": np.array(dense.numel_out(0), np.int64),
    }


def function_of(name: str, arrays: Mapping[str, Array], inputs: Sequence[int], size: int) -> ca.Function:
    """The function of these input sizes and result size; ValueError for arrays that are not such a function."""
    tape, constants = np.asarray(arrays["tape"]), np.asarray(arrays["constants"], float)
    if (
        tape.dtype.kind != "i"
        or tape.ndim != 2
        or tape.shape[1] != 4
        or constants.shape != tape.shape[:1]
        or len(tape) > _MOST_ROWS
    ):
        raise ValueError(
            f"tape of {tape.dtype} {tape.shape} with {constants.size} constants; allowed: int64 (n, 4) with n"
        )
    if arrays["inputs"].tolist() != list(inputs) or int(arrays["size"]) != size:
        raise ValueError(
            f"inputs {arrays['inputs'].tolist()} and result {arrays['size']}; allowed: {list(inputs)} and {size}"
        )
    arguments = [ca.SX.sym(f"v{k}", count) for k, count in enumerate(inputs)]
    work: dict[int, ca.SX] = {}
    results: dict[int, ca.SX] = {}
    for k, row in enumerate(np.asarray(tape, np.int64).tolist()):
        _run(k, row, float(constants[k]), arguments, work, results)
    if sorted(results) != list(range(size)):
        raise ValueError(f"tape gives the elements {sorted(results)[:9]}; allowed: each of {size}, once")
    return ca.Function(name, arguments, [ca.vertcat(ca.SX(0, 1), *(results[k] for k in range(size)))])


def _run(
    k: int, row: list[int], constant: float, arguments: list[ca.SX], work: dict[int, ca.SX], results: dict[int, ca.SX]
) -> None:
    """Execute a row of a tape symbolically."""
    code, result, first, second = row
    name = OPERATIONS[code] if 0 <= code < len(OPERATIONS) else ""
    if name == "CONST":
        work[result] = ca.SX(constant)
    elif name == "INPUT" and 0 <= first < len(arguments) and 0 <= second < arguments[first].numel():
        work[result] = arguments[first][second]
    elif name == "OUTPUT" and first in work and result not in results:
        results[result] = work[first]
    elif name in OF_ONE and first in work:
        work[result] = ca.SX.unary(getattr(ca, f"OP_{name}"), work[first])
    elif name in OF_TWO and first in work and second in work:
        work[result] = ca.SX.binary(getattr(ca, f"OP_{name}"), work[first], work[second])
    else:
        raise ValueError(f"tape row {k} = {row}; allowed: a known operation on what is there")
