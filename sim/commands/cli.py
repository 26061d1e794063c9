"""The command line ``mathnavi``.

Exit codes: 0 the mission did what it should, 1 it ran and did not, or its results could not be written, 2 bad input:
one line on standard error that names the field, its value and what is allowed, or the usage where there is no command
at all; 130 and 143 a signal asked it to end. A command's module is imported when it is called, so that help is quick.
"""

from __future__ import annotations

import errno
import importlib
import os
import sys
from collections.abc import Callable, Sequence

from mathnavi.sim.commands.errors import PIPE_CLOSED, BadInputError, worded
from mathnavi.sim.commands.interruption import end, exit_code, interrupted_line, interruptible
from mathnavi.sim.commands.known import COMMANDS
from mathnavi.sim.interfaces.checks import allowed_for

USAGE = "usage: mathnavi COMMAND ...\n       mathnavi --version\n\n{}\n\nmathnavi COMMAND --help explains a command."

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # errors of writing


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the result is the exit code."""
    # Small matrices only: on a busy machine the threads of a linear-algebra library wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments or arguments[0] in ("-h", "--help"):
        usage = USAGE.format("\n".join(f"  {name:12}{purpose}" for name, (_, purpose) in COMMANDS.items()))
        print(usage, file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    if arguments[0] == "--version":
        from importlib.metadata import version  # takes as long to import as all else here

        print(f"mathnavi {version('mathnavi')}")
        return 0
    try:
        with interruptible(arguments, whole_process=argv is None):
            code = _command(arguments[0])(arguments[1:])
            sys.stdout.flush()  # so that a reader that has gone is noticed here
        return code
    except BadInputError as error:
        print(f"mathnavi: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read the output has seen enough
        _discard_output()
        return PIPE_CLOSED
    except SystemExit as error:  # of a plug-in: no command of ours ends so
        from mathnavi.sim.interfaces.failures import explained

        print(f"mathnavi: a plug-in ended the command by {' '.join(explained(error).split())}", file=sys.stderr)
        return 2
    except OSError as error:  # a full disk, say
        if error.filename is None:
            if error.errno not in NO_ROOM:
                raise
            _discard_output()  # every writer of files names its file
        print(f"mathnavi: {worded(error) if error.filename else f'standard output: {error.strerror}'}", file=sys.stderr)
        return 1
    except KeyboardInterrupt as error:
        if argv is None:  # this process is the command, and has nothing more to do
            end(exit_code(error), arguments)
        print(interrupted_line(arguments), file=sys.stderr)
        return exit_code(error)


def _discard_output() -> None:
    """Write nothing more to standard output, not even when the interpreter ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _command(name: str) -> Callable[[Sequence[str]], int]:
    if name not in COMMANDS:
        raise BadInputError(f"COMMAND = {name!r} is not known; {allowed_for(name, list(COMMANDS))}")
    command: Callable[[Sequence[str]], int] = importlib.import_module(COMMANDS[name][0]).main
    return command
