"""Separate process for solvers that may not return: the kernel ends it when a solve has used up its time.

No iteration limit stops FATROP 1.1 while it raises the regularisation of one iteration without end, and C++ code cannot
be stopped from within its process. So its solves run in a child process, one for all of a process's solvers, which
sets an interval timer of its own CPU time (ITIMER_PROF) before each: where that runs out, SIGPROF ends it. CPU time,
so that a machine that is busy with something else ends no solve. The next solve starts another child.
"""

from __future__ import annotations

import atexit
import contextlib
import itertools
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Protocol

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction

_LOAD, _SOLVE = 0, 1
_HEADER = struct.Struct("<BQd")  # request, number of the solver, limit of CPU time [s]
_REPLY = struct.Struct("<?qdQ")  # success, iterations (-1 for an exception), CPU time [s], length of the message
_POLLING = 0.05  # [s] between two looks at whether the solve has to end
_NUMBERS = itertools.count(1)
# -P and a path that the process sets by itself: no casadi.py of the current folder is taken for the library.
_START = "import sys; sys.path[:] = sys.argv[2:]; from mathnavi.models.solver_process import main; main()"


@dataclass(frozen=True)
class ProcessReport:
    """Report on a solve in the child process."""

    success: bool
    message: str
    iterations: int | None  # None where the solver raised an exception, or its process ended
    timed_out: bool = False
    stopped: bool = False


class Stop(Protocol):
    """Request that a solve ends."""

    @property
    def stopped(self) -> bool:
        """True if the solve has to end."""
        ...


class SolverProcess:
    """The child process of this process; it starts with the first solve, and again after it was ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owner = 0  # process that started the child: one that is forked from it starts its own
        self._child: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._loaded: set[int] = set()
        self.cpu_seconds = 0.0  # [s] CPU time of all solves so far

    def solve(self, solver: RemoteSolver, seconds: float, stop: Stop | None = None) -> ProcessReport:
        """Solve with a solver's arguments within ``seconds`` of CPU time; its results are in its arrays afterwards.

        ``stop`` is called meanwhile; where it returns True the child is ended, and there is no result.
        """
        with self._lock:
            if self._child is None or self._owner != os.getpid():
                self._start()
            try:
                return self._asked(solver, seconds, stop)
            except (EOFError, ConnectionError):
                code = self._ended()
                timed_out = code == -signal.SIGPROF
                self.cpu_seconds += seconds if timed_out else 0.0
                reason = f"did not return within {seconds:g} s of CPU time"
                return ProcessReport(False, reason if timed_out else f"its process ended with {code}", None, timed_out)
            except BaseException:  # interrupted: the child's answer has no receiver
                self._ended()
                raise

    def close(self) -> None:
        """End the child process, if there is one."""
        with self._lock:
            if self._child is not None and self._owner == os.getpid():
                self._ended()

    def _asked(self, solver: RemoteSolver, seconds: float, stop: Stop | None) -> ProcessReport:
        connection = self._connection
        assert connection is not None
        if solver.number not in self._loaded:
            connection.send_bytes(_HEADER.pack(_LOAD, solver.number, 0.0) + solver.function.serialize().encode())
            self._loaded.add(solver.number)
        arguments = b"".join(array.tobytes() for array in solver.arguments)
        connection.send_bytes(_HEADER.pack(_SOLVE, solver.number, seconds) + arguments)
        began = time.perf_counter()
        while stop is not None and not connection.poll(_POLLING):
            if stop.stopped:
                self._ended()
                self.cpu_seconds += min(time.perf_counter() - began, seconds)
                return ProcessReport(False, "was stopped", None, stopped=True)
        reply = connection.recv_bytes()
        success, iterations, spent, length = _REPLY.unpack_from(reply)
        self.cpu_seconds += spent
        start = _REPLY.size + length
        message = reply[_REPLY.size : start].decode()
        if iterations < 0:
            return ProcessReport(False, message, None)
        values = np.frombuffer(reply, offset=start)
        for array in solver.results:
            array[:], values = values[: len(array)], values[len(array) :]
        return ProcessReport(success, message, iterations)

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._child = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, str(theirs.fileno()), *filter(None, sys.path)],
                pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                start_new_session=True,
            )  # fmt: skip
        self._connection = Connection(ours.detach())
        self._loaded, self._owner = set(), os.getpid()

    def _ended(self) -> int:
        """End the child if it still runs; returns its exit code."""
        assert self._child is not None
        assert self._connection is not None
        self._connection.close()
        if self._child.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._child.wait(0.2)
        self._child.kill()
        code = self._child.wait()
        self._child = self._connection = None
        return code


PROCESS = SolverProcess()
atexit.register(PROCESS.close)


def cpu_time() -> float:
    """CPU time [s] of this process and of the solves in its child process, since any fixed instant."""
    return time.process_time() + PROCESS.cpu_seconds


class RemoteSolver:
    """An NLP solver of CasADi that runs in the child process, with its arguments and results as arrays.

    ``arguments`` and ``results`` are those of the function, in their order: contiguous float64 arrays.
    """

    def __init__(self, function: ca.Function, arguments: Sequence[Array], results: Sequence[Array]) -> None:
        self.function, self.arguments, self.results = function, tuple(arguments), tuple(results)
        self.number = next(_NUMBERS)

    def solve(self, seconds: float, stop: Stop | None = None) -> ProcessReport:
        """Solve within ``seconds`` of CPU time, or until it has to ``stop``."""
        return PROCESS.solve(self, seconds, stop)


class _LoadedSolver:
    """A solver in the child process."""

    def __init__(self, serialised: bytes) -> None:
        function = ca.Function.deserialize(serialised.decode())
        self._arguments = [np.zeros(function.nnz_in(k)) for k in range(function.n_in())]
        self._results = [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
        self._evaluate = BufferedFunction(function, self._arguments, self._results)

    def answer(self, arguments: bytes, seconds: float) -> bytes:
        values = np.frombuffer(arguments)
        for array in self._arguments:
            array[:], values = values[: len(array)], values[len(array) :]
        began = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, seconds)
        try:
            self._evaluate()
        except RuntimeError as error:  # FATROP's way to give up
            message = str(error).strip().splitlines()[-1].encode()
            return _REPLY.pack(False, -1, time.process_time() - began, len(message)) + message
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        statistics = self._evaluate.stats()
        message = str(statistics["return_status"]).encode()
        spent = time.process_time() - began
        head = _REPLY.pack(bool(statistics["success"]), int(statistics["iter_count"]), spent, len(message)) + message
        return head + b"".join(array.tobytes() for array in self._results)


def serve(connection: Connection) -> None:
    """Load solvers and solve on request, until the other end is closed."""
    solvers: dict[int, _LoadedSolver] = {}
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            message = connection.recv_bytes()
            asked, number, seconds = _HEADER.unpack_from(message)
            if asked == _LOAD:
                solvers[number] = _LoadedSolver(message[_HEADER.size :])
            else:
                connection.send_bytes(solvers[number].answer(message[_HEADER.size :], seconds))


def main() -> None:
    """Serve the process at the other end of the socket whose number is the first argument."""
    serve(Connection(int(sys.argv[1])))
