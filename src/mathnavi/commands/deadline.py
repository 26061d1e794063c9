"""``--wall-deadline``: a command in a child process, which is ended when its time is up, or crashes alone.

A plug-in that never returns, in Python or in machine code, cannot be stopped from within its process. Therefore the
command runs in a child process, and this one waits for it:

    child -> parent, by a file     the stack where the child was when its time was up, or when it crashed
                                   (faulthandler writes it), or ENDED: the command has come to its end
"""

from __future__ import annotations

import faulthandler
import importlib
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Annotated

from annotated_types import Gt

from mathnavi.commands.arguments import value_of, without
from mathnavi.commands.errors import OUT_OF_TIME, print_error
from mathnavi.interfaces.bounds import FINITE, Within

FLAG = "--wall-deadline"
PACKAGE = Path(__file__).parents[1]  # mathnavi
START = (
    "import json, sys; request = json.loads(sys.argv[1]); sys.path[:] = request['path']; "
    "from mathnavi.commands.deadline import run; run(**request)"
)
ENDED = "mathnavi: the command has ended\n"
WallDeadline = Annotated[float, Within(Gt(0.0), FINITE, allowed="a finite number of seconds > 0")]
_GRACE = 10.0  # [s] for the child to end itself when its time is up
_FRAME = re.compile(r'^  File "(.*)", line (\d+) in (.*)$', re.MULTILINE)


def watched(command: str, argv: Sequence[str]) -> int | None:
    """Run a command with ``--wall-deadline`` in a child process and return its exit code; None without the flag.

    Also None for a value that is not a time: the command itself refuses it.
    """
    argv = [word.replace("_", "-") if word.startswith("--wall_deadline") else word for word in argv]
    try:
        seconds = float(value_of(FLAG, argv) or "nan")
    except ValueError:
        return None
    if not (math.isfinite(seconds) and seconds > 0.0):
        return None
    words = [command, *without(FLAG, argv)]
    return watch("mathnavi.commands.cli:main", words, seconds)


def watch(place: str, argv: Sequence[str], seconds: float) -> int:
    """Run ``package.module:function`` with ``argv`` in a child process for at most ``seconds``; return its exit code.

    The code is ``OUT_OF_TIME`` when its time was up and 128 + N if signal N killed it: one line on standard error
    reports either, with the code that was running. Ctrl-C and SIGTERM are passed on.
    """
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as report:
        request = {"path": sys.path, "place": place, "argv": list(argv), "seconds": seconds, "report": report.fileno()}
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", START, json.dumps(request)], pass_fds=(report.fileno(),), process_group=0
        )
        before = signal.signal(signal.SIGTERM, lambda *_: _end(child, signal.SIGTERM))
        try:
            code = _awaited(child, seconds + _GRACE)
        finally:
            signal.signal(signal.SIGTERM, before)
            _end(child, signal.SIGKILL)  # what it has started, and what is left
        return _exit_code(code, report, shlex.join(["mathnavi", *argv]), seconds)


def run(path: Sequence[str], place: str, argv: Sequence[str], seconds: float, report: int) -> None:
    """Run the function in the child process, and end with its exit code."""
    module, _, name = place.partition(":")
    os.set_inheritable(report, False)
    faulthandler.enable(report)
    faulthandler.dump_traceback_later(seconds, exit=True, file=report)
    code = getattr(importlib.import_module(module), name)(list(argv))
    faulthandler.cancel_dump_traceback_later()
    os.write(report, ENDED.encode())
    sys.exit(code)


def _awaited(child: subprocess.Popen[bytes], seconds: float) -> int | None:
    """Wait for the child and return its exit code; None if it has not ended by itself. Ctrl-C is passed on once."""
    try:
        return child.wait(seconds)
    except subprocess.TimeoutExpired:
        return None
    except KeyboardInterrupt:
        _end(child, signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            return child.wait(_GRACE)
        return -signal.SIGINT


def _end(child: subprocess.Popen[bytes], number: signal.Signals) -> None:
    """Send a signal to the child and to the processes that it has started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, number)
    if number == signal.SIGKILL:
        child.wait()


def _exit_code(code: int | None, report: IO[str], command: str, seconds: float) -> int:
    """Return the exit code of this process; print a line on standard error if the command has not come to its end."""
    report.seek(0)
    text = report.read()
    if code is not None and text.endswith(ENDED):
        return code
    where = being_run(text)
    if code is None or text.startswith("Timeout"):
        print_error(f"{FLAG} = {seconds:g}: no end of `{command}` within {seconds:g} s{where}")
        return OUT_OF_TIME
    if code < 0:
        if code not in (-signal.SIGINT, -signal.SIGTERM):
            name = signal.Signals(-code).name
            print_error(f"the process of `{command}` was killed by {name}{where}")
        return 128 - code
    print_error(f"the process of `{command}` ended itself with exit code {code}{where}")
    return 2


def being_run(report: str) -> str:
    """Return ", in FILE:LINE FUNCTION" of the code that mathnavi had called last; "" if no stack was written."""
    stacks = re.split(r"^(?:Current t|T)hread 0x.*$", report, flags=re.MULTILINE)[1:]
    current = 0 if "Current thread" in report else -1  # the main thread is the last one
    frames: list[str] = []
    for file, line, function in _FRAME.findall(stacks[current]) if stacks else ():
        if file.startswith("<frozen") or file.startswith(os.path.dirname(importlib.__file__)):
            continue
        own = Path(file).is_relative_to(PACKAGE)
        if own and frames:
            break
        frames.append(f", in {file}:{line} {function}")
        if own:
            break
    return frames[-1] if frames else ""
