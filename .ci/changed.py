"""Print the tests of what has changed since a commit, uncommitted and new files too, one path a line.

    python .ci/changed.py [COMMIT]      HEAD unless another is named

The tests mirror the packages: for a module, the tests in the folder of its package that import it are run, or all tests
of that folder if none imports it by name. A changed test is run; for another changed file in ``tests/``, all tests in
its folder.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = ROOT / "tests"
PACKAGES = ("interfaces", "models", "controllers", "estimators", "sim", "renders", "studies", "commands", "scripting")
FRONT_DOOR = Path("src", "mathnavi")  # where the last two of them are


def changed(commit: str) -> list[Path]:
    """Files that differ from a commit, or are new, relative to the repository; CalledProcessError without a commit."""
    commands = ("diff", "--name-only", commit), ("ls-files", "--others", "--exclude-standard")
    named = [
        name
        for command in commands
        for name in subprocess.run(
            ["git", *command], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
        ).stdout.splitlines()
    ]
    return [Path(name) for name in named]


def tests_of(file: Path) -> Iterator[Path]:
    """Return the tests of a file of the repository."""
    if file.is_relative_to(FRONT_DOOR):
        file = file.relative_to(FRONT_DOOR)
    if file.suffix != ".py" or file.parts[0] not in ("tests", "benchmarks", *PACKAGES):
        return
    if file.name.startswith("test_"):
        if (ROOT / file).exists():
            yield ROOT / file
        return
    inside = Path(*file.parts[1:]) if file.parts[0] == "tests" else file
    folder = next(each for each in (TESTS / parent for parent in inside.parents) if each.is_dir())
    beside = sorted(folder.glob("test_*.py"))
    module = ".".join(file.with_suffix("").parts)
    yield from [test for test in beside if module in test.read_text(encoding="utf-8")] or beside


def main() -> None:
    """Print the tests of the changed files."""
    commit = sys.argv[1] if len(sys.argv) > 1 else "HEAD"
    found = {test for file in changed(commit) for test in tests_of(file)}
    print("\n".join(str(test.relative_to(ROOT)) for test in sorted(found)))


if __name__ == "__main__":
    main()
