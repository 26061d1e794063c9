"""Picture of a problem whose optimum is known: its solution by hp refinement, drawn by ``Solution.plot``.

    python -m mathnavi.renders.optimum NAME FILE

FILE ends in .png, .svg or .pdf. Exit code 0: it was written; 1: there is no solution within the tolerance; 2: there is
no such problem, or FILE cannot be written.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.interfaces.checks import allowed_for


def main(arguments: Sequence[str]) -> int:
    """Draw one problem and return the exit code."""
    if len(arguments) != 2 or arguments[0] not in PROBLEMS:
        name = arguments[0] if arguments else ""
        print(f"optimum: NAME = {name!r}, then FILE; {allowed_for(name, list(PROBLEMS))}", file=sys.stderr)
        return 2
    name, path = arguments
    solution = hp(PROBLEMS[name].problem())
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        solution.plot(path=path)
    except (OSError, ValueError) as error:
        print(f"optimum: {error}", file=sys.stderr)
        return 2
    print(path)
    return 0 if solution.ok else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
