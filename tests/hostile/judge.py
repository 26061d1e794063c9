"""A hostile input in a folder of its own, run and judged.

An input ends well if the command returns 0, 1 or 2 within ``LIMIT``, prints no traceback, says what is wrong in one
line that names the culprit where it returns 2, runs no code that was not asked for, and changes nothing but what it was
asked to write.
"""

from __future__ import annotations

import hashlib
import os
import resource
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import traceback
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from mathnavi.commands.errors import one_line
from tests.hostile.brakes import brakes

LIMIT = 20  # [s] of the processor from which on a command hangs
PATIENCE = 6 * LIMIT  # [s] on a machine that does other things too
MEMORY = 6 * 2**30  # [bytes] that a command may take beside what this process has
MARKER = "executed"  # file that a module writes which nobody asked to run
PRECIOUS = (
    "precious.png",
    "precious.html",
    "outside/precious.txt",
    "outside/precious.png",
    "work/precious.txt",
    "work/precious/letter.txt",
)
DEFAULT_OUT = "renders"  # where commands write without --out


@dataclass(frozen=True)
class Case:
    """A command with hostile input."""

    command: str  # "run", "store export"
    kind: str  # of the hostile part: "config.json", "words"
    words: tuple[str, ...]  # of the command line, with the command
    culprits: tuple[str, ...] = ()  # one of which the error names; empty: any
    writes: tuple[str, ...] = (DEFAULT_OUT,)  # paths in the working folder that may be written
    done: str = ""  # mutation, in words
    runs_code: bool = False  # plug-ins of the working folder are asked for by name
    apart: bool = False  # needs a process of its own
    gone: bool = False  # called in a folder that has been removed
    environment: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Outcome:
    """How a case ended."""

    code: str  # exit code, or "hang", "traceback"
    faults: tuple[str, ...]  # none: it ended well
    error: str  # what was printed on standard error
    trace: str = ""


def signature(outcome: Outcome) -> str:
    """Class of a failure: its faults, and where an exception was raised in this project."""
    frames = [
        line.strip() for line in outcome.trace.splitlines() if line.strip().startswith("File ") and "/mathnavi/" in line
    ]
    where = frames[-1].partition("/mathnavi/")[2].replace('", line ', ":").partition(",")[0] if frames else ""
    kind = outcome.trace.rstrip().splitlines()[-1].partition(":")[0] if outcome.trace else ""
    faults = [fault.partition(": ")[0] for fault in outcome.faults]
    return " ".join(filter(None, ("; ".join(faults), kind.rpartition(".")[2], where)))


class HangError(BaseException):
    """A command takes too long."""


def box(parent: Path) -> Path:
    """A new folder for one case: ``work`` is the working folder, ``outside`` beside it holds what nothing may touch."""
    folder = Path(tempfile.mkdtemp(dir=parent))
    work, outside = folder / "work", folder / "outside"
    for each in (work, outside, work / "precious"):
        each.mkdir()
    for name in PRECIOUS:
        path = folder / name
        path.write_text(f"{path.name}, which must not be lost")
    trap = f"open({str(work / MARKER)!r}, 'a').write(__name__)\n"
    for name in ("evil_module", "drawing", "numpy", "av", "PIL", "json"):
        (work / f"{name}.py").write_text(
            trap + ("raise ImportError('trap')\n" if name != "evil_module" else "class Evil: pass\n")
        )
    (work / "loop").symlink_to("loop")
    (work / "dangling").symlink_to("nowhere-at-all")
    (work / "link").symlink_to("../outside")
    os.mkfifo(work / "pipe")
    return folder


def digest(folder: Path) -> dict[str, str]:
    """Content of every file of a tree, its kind where it is none, by its path; but for Python's caches."""
    found = {}
    for top, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if name != "__pycache__"]
        for name in (*folders, *files):
            path = os.path.join(top, name)
            mode = os.lstat(path).st_mode
            if stat.S_ISREG(mode):
                with open(path, "rb") as file:
                    value = hashlib.blake2b(file.read(), digest_size=8).hexdigest()
            else:
                value = os.readlink(path) if stat.S_ISLNK(mode) else str(stat.S_IFMT(mode))
            found[os.path.relpath(path, folder)] = value
    return found


def judged(case: Case, folder: Path, *, draws: bool = False) -> Outcome:
    """Run a case in its box; unless it ``draws``, pictures and figures stay empty."""
    before = digest(folder)
    work = folder / "work"
    code, error, trace = _apart(case, work, folder) if case.apart else _here(case, work, folder, draws)
    return Outcome(code, tuple(_faults(case, code, error, trace, before, digest(folder))), error, trace)


def _faults(
    case: Case, code: str, error: str, trace: str, before: dict[str, str], after: dict[str, str]
) -> Iterator[str]:
    if code in ("hang", "traceback"):
        yield code
    elif code not in ("0", "1", "2") and not (code == "130" and "KeyboardInterrupt" in case.done):
        yield f"exit {code}"
    if code != "traceback" and "Traceback (most recent call last)" in error:
        yield "traceback printed"
    lines = error.splitlines()
    if code == "2":
        if len(error.rstrip("\n").split("\n")) != 1 or not error.endswith("\n"):
            yield f"{len(lines)} lines on standard error"
        elif not error.startswith("mathnavi: "):
            yield "error without the command's name"
        elif case.culprits and not any(culprit and one_line(culprit) in error for culprit in case.culprits):
            yield "culprit not named"
        if len(error) > 3000:
            yield "error of more than 3,000 characters"
    if odd := {char for char in error if unicodedata.category(char) in ("Cc", "Cs") and char not in "\n\t"}:
        yield f"control characters on standard error: {sorted(odd)!r}"
    named = any(word.startswith("evil_module:") for word in case.words)
    if "work/" + MARKER in after and not (case.runs_code or named):
        yield "code was run"
    changed = sorted({path for path in {*before, *after} if before.get(path) != after.get(path)} - {"work/" + MARKER})
    if code == "0" and not changed and _makes(case.words):
        yield "exit 0 without a result"
    if code == "2":
        begun = case.writes if case.command == "study" and case.runs_code else ()  # its store keeps what had ended
        lost = [path for path in changed if path in before]
        new = [path for path in changed if path not in before and not _within(path, begun)]
        if lost:
            yield f"lost or changed: {', '.join(lost[:4])}"
        if new:
            yield f"left behind: {', '.join(new[:4])}"
    else:
        if beside := [path for path in changed if not _within(path, case.writes)]:
            yield f"written outside: {', '.join(beside[:4])}"
    if partial := [
        path for path in changed if path in after and (".partial" in path or path.endswith((".tmp", "-journal")))
    ]:
        yield f"left half-written: {', '.join(partial[:4])}"


def _makes(words: Sequence[str]) -> bool:
    """True for a command that writes something when it ends well."""
    makers = ("run", "estimate", "compare", "sweep", "report", "export", "new")
    makes = words[:1] in [(each,) for each in makers] or words[:2] in (
        ("terrain", "import"),
        ("store", "export"),
    )
    return makes and not {"-h", "--help"} & set(words)


def _within(path: str, writes: Sequence[str]) -> bool:
    places = [os.path.normpath(os.path.join("work", place)) for place in writes]
    return any(path == place or path.startswith(f"{place}/") or place.startswith(f"{path}/") for place in places)


# ---- in this process


def _here(case: Case, work: Path, folder: Path, draws: bool) -> tuple[str, str, str]:
    from mathnavi.commands.cli import main

    modules, paths, trace, code = set(sys.modules), list(sys.path), "", ""
    scratch = Path(tempfile.mkdtemp(dir=folder.parent))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(work)
        if case.gone:
            (work / "gone").mkdir()
            os.chdir("gone")
            Path("../gone").rmdir()
        patch.setenv("TMPDIR", str(scratch))
        patch.setattr(tempfile, "tempdir", str(scratch))
        for name, value in case.environment:
            patch.setenv(name, value)
        brakes(patch, draws=draws)
        with _captured(scratch / "error") as read, _limits():
            try:
                code = str(main(case.words))
            except HangError:
                code, trace = "hang", traceback.format_exc()
            except BaseException:  # whatever leaves main is a defect
                code, trace = "traceback", traceback.format_exc()
        error = read()
    if code == "70":
        trace = "".join(path.read_text() for path in scratch.glob("mathnavi-error-*"))
    sys.path[:] = paths
    for name in set(sys.modules) - modules:
        if str(folder) in (getattr(sys.modules[name], "__file__", None) or ""):
            del sys.modules[name]
    shutil.rmtree(scratch, ignore_errors=True)
    return code, error, trace


@contextmanager
def _limits() -> Iterator[None]:
    """Alarms, and less memory than the machine has."""

    def ring(number: int, frame: FrameType | None) -> None:
        raise HangError

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    former = [(number, signal.signal(number, ring)) for number in (signal.SIGALRM, signal.SIGPROF)]
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        for number, handler in former:
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@contextmanager
def _captured(path: Path) -> Iterator[Callable[[], str]]:
    """Standard output and error as a terminal would get them, with warnings and what libraries write themselves."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [os.dup(1), os.dup(2)]
    streams: list[Any] = [sys.stdout, sys.stderr]
    with path.open("wb") as error, path.with_name("output").open("wb") as output, warnings.catch_warnings():
        warnings.simplefilter("default", RuntimeWarning)
        warnings.simplefilter("default", UserWarning)
        warnings.showwarning = lambda message, category, filename, line, file=None, text=None: print(
            f"{filename}:{line}: {category.__name__}: {message}", file=sys.stderr
        )
        os.dup2(output.fileno(), 1)
        os.dup2(error.fileno(), 2)
        sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
        sys.stderr = os.fdopen(os.dup(2), "w", encoding="utf-8", errors="backslashreplace", buffering=1)
        try:
            yield lambda: path.read_bytes().decode("utf-8", "backslashreplace")
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.close()
            sys.stdout, sys.stderr = streams
            for number, copy in enumerate(saved, start=1):
                os.dup2(copy, number)
                os.close(copy)


# ---- in a process of its own


def _apart(case: Case, work: Path, folder: Path) -> tuple[str, str, str]:
    scratch = Path(tempfile.mkdtemp(dir=folder.parent))
    environment = {**os.environ, "TMPDIR": str(scratch), **dict(case.environment)}
    command = [str(Path(sys.executable).with_name("mathnavi")), *case.words]
    try:
        done = subprocess.run(
            command,
            cwd=work,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "hang", "", ""
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    error = done.stderr.decode("utf-8", "backslashreplace")
    return ("traceback" if "Traceback (most recent call last)" in error else str(done.returncode)), error, error
