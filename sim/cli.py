"""The command line ``mathnavi``.

Exit codes: 0 the mission did what it should, 1 it ran and did not, 2 bad input: one line on standard error that names the
field, its value and what is allowed. A command's module is imported when it is called, so that help and errors are quick.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from sim.commands.errors import BadInputError

COMMANDS = {
    "list": ("sim.commands.listing", "what is installed: controllers, estimators, scenarios, terrains"),
    "run": ("sim.commands.run", "fly a scenario and write its log, summary, video and report"),
    "render": ("sim.commands.render", "a video or a still of a run"),
    "terrain": ("sim.commands.terrain", "import an elevation model, show a map"),
}
USAGE = "usage: mathnavi COMMAND ...\n\n{}\n\n`mathnavi COMMAND --help` explains a command."
INTERRUPTED = 130  # what a shell calls a process that ended by SIGINT


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the result is the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments or arguments[0] in ("-h", "--help"):
        commands = "\n".join(f"  {name:9}{purpose}" for name, (_, purpose) in COMMANDS.items())
        print(USAGE.format(commands), file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    try:
        return _command(arguments[0])(arguments[1:])
    except BadInputError as error:
        print(f"mathnavi: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mathnavi: interrupted", file=sys.stderr)
        return INTERRUPTED


def _command(name: str):  # type: ignore
    if name not in COMMANDS:
        raise BadInputError(f"command {name!r} is not known; allowed: {', '.join(COMMANDS)}")
    return importlib.import_module(COMMANDS[name][0]).main
