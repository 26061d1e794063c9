"""CasADi functions that read and write arrays in place: a call costs microseconds, with CasADi's matrices a hundred."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np

from mathnavi.interfaces.signals import Array


class BufferedFunction:
    """A function that reads and writes given arrays; calling it evaluates it.

    ``arguments`` and ``results`` are those of the function, in their order: contiguous float64 arrays with an entry for
    each structural nonzero, column by column, or None for a result that is not needed.
    """

    def __init__(self, function: casadi.Function, arguments: Sequence[Array], results: Sequence[Array | None]) -> None:
        self._arrays = tuple(arguments), tuple(results)  # kept: the function knows their addresses only
        self._buffer: Any  # its stubs know only one of the overloads
        self._buffer, self._evaluate = function.buffer()  # the memory of the call is the buffer's
        for k, argument in enumerate(arguments):
            self._buffer.set_arg(k, argument.data)
        for k, result in enumerate(results):
            if result is not None:
                self._buffer.set_res(k, result.data)

    def __call__(self) -> None:
        self._evaluate()

    def stats(self) -> dict[str, Any]:
        """Return a solver's statistics of its last call."""
        statistics: dict[str, Any] = self._buffer.stats()
        return statistics


class NumericFunction:
    """A function of vectors, called with arrays; each result is an array of its own."""

    def __init__(self, function: casadi.Function) -> None:
        self._function = function
        given = [casadi.SX.sym(f"x_{k}", function.sparsity_in(k)) for k in range(function.n_in())]
        # transposed: CasADi stores columns, numpy rows
        rows = [casadi.densify(each.T) for each in function.call(given)]
        self._given = tuple(np.zeros(each.numel()) for each in given)
        self._found = tuple(np.zeros(each.numel()) for each in rows)
        self._shapes = tuple(function.size_out(k) for k in range(function.n_out()))
        self._evaluate = BufferedFunction(casadi.Function("rows", given, rows), self._given, self._found)

    def __reduce__(self) -> Any:
        return NumericFunction, (self._function,)

    def __call__(self, *arguments: Array | float) -> tuple[Array, ...]:
        """Return the results, (m, n) each, at vectors (n,); a number stands for one of alike entries.

        Raises ValueError for another number of arguments, or a vector of another length.
        """
        for given, argument in zip(self._given, arguments, strict=True):
            given[:] = argument
        self._evaluate()
        return tuple(found.reshape(shape).copy() for found, shape in zip(self._found, self._shapes, strict=True))
