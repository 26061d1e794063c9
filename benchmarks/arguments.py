"""Arguments of a benchmark: the fields of a dataclass as flags, as mathnavi's commands read them."""

from __future__ import annotations

import inspect
import sys
from typing import TypeVar

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.errors import BadInputError, HelpPrinted, one_line

Arguments = TypeVar("Arguments")


def read_arguments(kind: type[Arguments]) -> Arguments:
    """Return the arguments of this process; the help and a mistake, reported in one line, end the process."""
    spec = sys.modules["__main__"].__spec__
    prog = f"python -m {spec.name.removesuffix('.__main__')}" if spec else sys.argv[0]
    try:
        arguments: Arguments = parse(sys.argv[1:], prog, inspect.cleandoc(kind.__doc__ or ""), FlagGroup(kind))[0]
    except HelpPrinted:
        sys.exit(0)
    except BadInputError as error:
        print(f"{prog}: {one_line(str(error))}", file=sys.stderr)
        sys.exit(2)
    return arguments
