"""The command line ``mathnavi``.

Exit codes: 0 the mission succeeded; 1 it ran and failed, or its results could not be written; 2 bad input,
with one line on standard error that names the field, its value and what is allowed, or with the usage if no command is
given; 70 an unforeseen error, with one line that names a file with the traceback; 130 and 143 interrupted by a signal.
A command's module is imported when it is called, so that help is quick.
"""

from __future__ import annotations

import gc
import importlib
import io
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial

from mathnavi.commands.errors import PIPE_CLOSED, UNFORESEEN, BadInputError, HelpPrinted, print_error
from mathnavi.commands.interruption import end, exit_code, interrupted_line, interruptible
from mathnavi.commands.known import COMMANDS, FLOWN
from mathnavi.commands.library_folders import place_libraries
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.checks import allowed_for
from mathnavi.models.dm_control_requirement import MissingPackageError, require_dm_control
from mathnavi.models.mujoco_requirement import UnusableMujocoError

USAGE = "usage: mathnavi COMMAND ...\n       mathnavi --version\n\n{}\n\nmathnavi COMMAND --help explains a command."
_ALLOCATIONS = 200_000  # less deallocations, between two searches for garbage


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    # Small matrices only: on a busy machine the threads of a linear-algebra library wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    place_libraries()
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        with interruptible(arguments, whole_process=argv is None), _few_collections(whole_process=argv is None):
            code = _called(arguments, whole_process=argv is None)
            if sys.stdout is not None:  # it may have been closed from the start
                sys.stdout.flush()  # so that a reader that has gone, or a full disk, is noticed here
        return code
    except (BadInputError, MissingPackageError, UnusableMujocoError) as error:
        print_error(str(error))
        return 2
    except SystemExit as error:  # of a plug-in, or of rich, whose reader has gone: no command of ours ends so
        if isinstance(error.__context__, BrokenPipeError):
            return PIPE_CLOSED
        from mathnavi.interfaces.failures import explained

        print_error(f"a plug-in ended the command by {explained(error)}")
        return 2
    except KeyboardInterrupt as error:
        if argv is None:  # this process is the command, and has nothing more to do
            end(exit_code(error), arguments)
        print(interrupted_line(arguments), file=sys.stderr)
        return exit_code(error)
    except Exception as error:
        from mathnavi.commands import unforeseen  # not needed as a rule

        if isinstance(error, BrokenPipeError) and unforeseen.reader_has_gone():  # it has seen enough
            _discard_output()
            return PIPE_CLOSED
        if (reason := unforeseen.not_written(error)) is not None:
            _discard_output()
            print_error(reason)
            return 1
        if unforeseen.traceback_is_shown():
            raise
        print(f"mathnavi: {unforeseen.report(error, arguments)}", file=sys.stderr)
        return UNFORESEEN


@contextmanager
def _few_collections(whole_process: bool) -> Iterator[None]:
    """Collect garbage rarely within the block, and exclude its objects afterwards, if this process is one command.

    Imports make many objects, none of which is garbage; the end of the process frees them all, and would first look
    through each of them.
    """
    if not whole_process:
        yield
        return
    threshold = gc.get_threshold()
    gc.set_threshold(_ALLOCATIONS)
    try:
        yield
    finally:
        gc.set_threshold(*threshold)
        gc.freeze()


def _called(arguments: Sequence[str], whole_process: bool) -> int:
    """Run a command, or print the help or the version; return the exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name of a file may be no text
    if not arguments or arguments[0] in ("-h", "--help"):
        usage = USAGE.format("\n".join(f"  {name:12}{purpose}" for name, (_, purpose) in COMMANDS.items()))
        print(wrapped(usage), file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    if arguments[0] == "--version":
        from importlib.metadata import version  # takes as long to import as all else here

        print(f"mathnavi {version('mathnavi')}")
        return 0
    name, *words = arguments
    _check_command(name)
    try:
        if name in FLOWN:
            from mathnavi.commands import flown  # no other command needs it

            return flown.main(name, words, partial(_imported, name), whole_process=whole_process)
        return _imported(name)(words)
    except HelpPrinted:
        return 0


def _discard_output() -> None:
    """Discard what is still to be printed, so that it does not fail again when the process ends."""
    with suppress(AttributeError, io.UnsupportedOperation):  # it is closed, or no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _check_command(name: str) -> None:
    if name not in COMMANDS:
        raise BadInputError(f"COMMAND = {name!r} is not known; {allowed_for(name, list(COMMANDS))}")
    require_dm_control()


def _imported(name: str) -> Callable[[Sequence[str]], int]:
    command: Callable[[Sequence[str]], int] = importlib.import_module(COMMANDS[name][0]).main
    return command
