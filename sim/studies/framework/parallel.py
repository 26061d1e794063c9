"""A computation for each of several arguments, spread over worker processes, and told as it goes."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

from mathnavi.sim.studies.framework.study import Setup
from mathnavi.sim.sweep.execution import Progress

Argument = TypeVar("Argument")
Result = TypeVar("Result")


def computed(setup: Setup, function: Callable[[Argument], Result], arguments: Sequence[Argument]) -> list[Result]:
    """``function`` of each argument, in their order, by ``setup.workers`` processes; by this one if that is one.

    Function, arguments and results have to be picklable where there are several processes. What a call raises is
    raised here, and the calls that have not begun are dropped.
    """
    total = len(arguments)
    if setup.workers == 1 or total < 2:
        results: list[Result] = []
        for argument in arguments:
            _tell(setup, total, len(results))
            results.append(function(argument))
        return results
    _tell(setup, total, 0)
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries half
    with ProcessPoolExecutor(min(setup.workers, total), context, _end_with_parent) as pool:
        futures = [pool.submit(function, argument) for argument in arguments]
        try:
            for done, _ in enumerate(as_completed(futures), 1):
                _tell(setup, total, done)
            return [future.result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _end_with_parent() -> None:
    """A worker is not to outlive the process that it works for, however that ends; by itself it would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(process: Any) -> None:
    process.join()
    os._exit(1)


def _tell(setup: Setup, total: int, done: int) -> None:
    if setup.progress is not None:
        setup.progress(Progress(total, 0, done, 0, 0, compiling=False))
