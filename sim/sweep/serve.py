"""Child process of a sweep: it runs task after task, trials or jobs, for its parent, and ends with it.

It communicates on a separate connection, so nothing that a plug-in prints can be taken for an answer:

    parent -> child     the pickled pair (task, content)
    child -> parent     ("refused", why)                 its code or its files are not those in the hash
                        ("began", None)                  from here on time counts
                        ("compiling", True or False)     numba has begun, or ended; this does not count
                        ("ended", record)
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import random
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import nullcontext, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from mathnavi.models.opengl import import_mujoco
from mathnavi.sim.engine.compilation import compilation_reported
from mathnavi.sim.sweep.task import Ended, SweepTask

Send = Callable[[str, Any], None]

MOST_CHARACTERS = 10_000  # of an error
# Its many lines would leave no room for what the task printed last.
WITHOUT_C_STACK: dict[str, Any] = {"c_stack": False} if sys.version_info >= (3, 14) else {}
_OOM_SCORE = "1000"  # the most that Linux takes: where memory runs out, this process goes and not the sweep
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")
_LOADED = re.compile(r"^Extension modules:.*\n?", re.MULTILINE)


def main(descriptor: int) -> None:
    """Serve until the other end of the connection is closed."""
    os.set_inheritable(descriptor, False)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    faulthandler.enable(all_threads=False, **WITHOUT_C_STACK)
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE)
    import_mujoco()
    connection: Connection[Any, Any] = Connection(descriptor)
    requests: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_hear, args=(connection, requests), daemon=True).start()

    def send(what: str, value: Any) -> None:
        connection.send((what, value))

    while True:
        _answer(requests.get(), send)


def comparable(text: str) -> str:
    """Return the message of an error without the parts that differ from process to process."""
    message = _LOADED.sub("", _ADDRESS.sub("0x...", text)).strip()
    return message[-MOST_CHARACTERS:].encode("utf-8", "backslashreplace").decode()


def _hear(connection: Connection[Any, Any], requests: SimpleQueue[bytes]) -> None:
    """Pass requests on; when the parent is gone, end this process and the processes that its plug-ins have started."""
    with suppress(EOFError, OSError):
        while True:
            requests.put(connection.recv_bytes())
    os.killpg(os.getpgrp(), signal.SIGKILL)


def _answer(request: bytes, send: Send) -> None:
    try:
        task: SweepTask
        task, content = pickle.loads(request)
        same = task.content == content
    except Exception as error:
        send("refused", f"a worker cannot read the task: {type(error).__name__}: {error}")
        return
    if not same:
        send("refused", f"a worker has other sources or files than the sweep began with: its code is {task.code}")
        return
    # A plug-in draws from the generator that is passed to it; one that does not is repeatable all the same.
    random.seed(task.seed)
    np.random.seed(task.seed % 2**32)
    loaded = "numba" in sys.modules
    with compilation_reported(lambda compiling: send("compiling", compiling)) if loaded else nullcontext():
        send("began", None)
        record = _run(task, content)
    for stream in (sys.stdout, sys.stderr):  # so that what this task printed is not taken for the next one's
        with suppress(Exception):
            stream.flush()
    send("ended", record)


def _run(task: SweepTask, content: str) -> Ended:
    began = time.perf_counter()
    timings: dict[str, float | None] = {}
    try:
        performed = task.perform()
        timings = performed.pop("timings")
        ended: dict[str, Any] = {"status": "ok", **performed}
    except BaseException:  # of a plug-in, whatever it is: it ends the task and not this process
        ended = {"status": "raised", "error": comparable(traceback.format_exc())}
    record: Ended = task.record(content, timings={**timings, task.WALL_TIME: time.perf_counter() - began}, **ended)
    return record
