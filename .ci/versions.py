"""Run mathnavi with every Python and MuJoCo that can be had here, and print what passed as a table in Markdown.

    .venv/bin/python .ci/versions.py [--python 3.12 ...] [--minors] [--parts flight osmesa egl contracts] [--wheels]

Pythons: those that pyproject.toml names and that are on PATH or among pyenv's. MuJoCo: the lowest and the highest
version served in the range of pyproject.toml, with --minors also the last of each minor version between them; and the
newest above the range, as a trial that may fail. Each pair has its own environment in .versions/, made by uv,
with the newest versions of everything else that pyproject.toml allows. A part that fails is a cell of the table. The
exit code is 1 if one failed within the ranges, 2 for bad input or without uv or a package index.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import sysconfig
import textwrap
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from ctypes.util import find_library
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".versions"
FLIGHT = ("safe-flight", "--terrain", "jacksboro", "--seed", "3")
BACKENDS = {"osmesa": ("OSMesa",), "egl": ("EGL", "OpenGL")}  # with the libraries that each needs
PARTS = {
    "flight": f"`mathnavi run {' '.join(FLIGHT)}`",
    "osmesa": "a video of it, `mathnavi render`, by OSMesa",
    "egl": "the same by EGL",
    "contracts": "`pytest tests/contracts`: every plug-in keeps the contract of its kind",
}
TOOLS = ("pytest", "pytest-xdist", "hypothesis")  # that the contracts need, in the ranges of the extra dev
PLATFORM = "aarch64-manylinux_2_28"
PATIENCE = 3600.0  # [s] for one part
PASSED = "passed"
LONGEST = 160  # characters of a reason


@dataclass(frozen=True)
class Row:
    """Result of every part with one Python and one MuJoCo."""

    python: str
    mujoco: str
    trial: bool  # this MuJoCo is above the range of pyproject.toml
    cells: Mapping[str, str]  # by the names of PARTS

    @property
    def failed(self) -> bool:
        """True if a part failed, and none may."""
        return not self.trial and any(cell.startswith("failed") for cell in self.cells.values())


class NothingServedError(Exception):
    """The package index has no version of a package that can be run, or does not answer; the message has the reason."""


def supported_pythons(project: Mapping[str, list[str]]) -> list[str]:
    """Return the Pythons that the classifiers of pyproject.toml name, "3.11" and so on."""
    found = (re.fullmatch(r"Programming Language :: Python :: (3\.\d+)", each) for each in project["classifiers"])
    return [match[1] for match in found if match]


def interpreter(python: str) -> str | None:
    """Return a program of this version of Python, from PATH or else from pyenv; None if absent."""
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv", "versions")
    # pyenv's command of a version that is not the chosen one only says so.
    for candidate in (f"python{python}", *map(str, sorted(pyenv.glob(f"{python}.*/bin/python")))):
        with_version = [candidate, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
        try:
            done = subprocess.run(with_version, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        except FileNotFoundError:
            continue
        if done.returncode == 0 and done.stdout.strip() == python:
            return candidate
    return None


def requirement(listed: Sequence[str], name: str) -> Requirement:
    """Return the requirement of one package among those of pyproject.toml."""
    (found,) = [each for each in map(Requirement, listed) if each.name == name]
    return found


def versions_to_try(served: Sequence[str], wanted: Requirement, minors: bool) -> tuple[list[str], list[str]]:
    """Return the versions to run, lowest first: those within the range, and the newest one if it is above the range.

    Args:
        served: versions that the package index has
        wanted: the requirement with its range
        minors: whether to run the last version of each minor one, too

    Raises NothingServedError without a version in the range.
    """
    every = sorted(version for version in map(Version, served) if not version.is_prerelease)
    within = [version for version in every if version in wanted.specifier]
    if not within:
        raise NothingServedError(f"no version of {wanted} is served; those that are: {', '.join(map(str, every))}")
    last = {version.release[:2]: version for version in within}  # the last of each minor version
    chosen = {*within[:1], *within[-1:], *(last.values() if minors else ())}
    above = every[-1:] if every[-1] > within[-1] else []
    return [str(version) for version in sorted(chosen)], [str(version) for version in above]


def served_versions(name: str) -> list[str]:
    """Return the versions of a package that pip's package index has for this Python.

    Raises NothingServedError without any.
    """
    command = [sys.executable, "-m", "pip", "index", "versions", name]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    found = re.search(r"^Available versions: (.+)$", done.stdout, re.MULTILINE)
    if found is None:
        raise NothingServedError(f"no version of {name} is served: {last_line(done.stderr)}")
    return found[1].split(", ")


def last_line(said: str) -> str:
    """Return the last line of an output, of no more than LONGEST characters, that may stand in a table."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return textwrap.shorten(lines[-1] if lines else "nothing was said", LONGEST, placeholder=" ...").replace("|", "\\|")


def why_not_installed(said: str) -> str:
    """Return uv's reason for an environment that could not be made: a package without a wheel by its name."""
    without = re.findall(r"versions? of (\S+) ha(?:s|ve) no usable wheels|(\S+) has no usable wheels", said)
    names = dict.fromkeys(name for pair in without for name in pair if name)
    return f"no wheel of {', '.join(names)}" if names else last_line(said.partition("\nhint:")[0])


def result(code: int, said: str) -> str:
    """Return the cell for a part that has run: "passed", with the numbers of tests, or "failed" with the reason."""
    counted = re.findall(r"^(?:=+ )?(\d+ \w+(?:, \d+ \w+)*) in [\d.]+s", said, re.MULTILINE)
    if code == 0:
        return f"{PASSED} ({counted[-1]})" if counted else PASSED
    tests = re.findall(r"^(?:FAILED|ERROR) (?:tests/contracts/)?(\S+)", said, re.MULTILINE)
    return f"failed: {f'{counted[-1]}: {last_line(tests[0])}' if counted and tests else last_line(said)}"


class Environment:
    """An environment with one Python and one MuJoCo, and mathnavi as it stands in the tree."""

    def __init__(self, python: str, mujoco: str, uv: Path) -> None:
        self.folder = FOLDER / f"python{python}-mujoco{mujoco}"
        self._python, self._mujoco, self._uv = python, mujoco, uv

    def make(self, program: str, tools: Sequence[str]) -> str:
        """Make the environment again with a program of Python; return why it could not be made, empty if it was."""
        override = FOLDER / f"mujoco{self._mujoco}.txt"  # also of a range that does not have it
        override.parent.mkdir(exist_ok=True)
        override.write_text(f"mujoco=={self._mujoco}\n", encoding="utf-8")
        chosen = ["--python", str(self.folder), "--only-binary", ":all:", "--no-binary", "mathnavi"]
        for words in (
            ["venv", "--clear", "--python", program, str(self.folder)],
            ["pip", "install", *chosen, "--override", str(override), "--editable", ".", *tools],
        ):
            done = executed([str(self._uv), "--quiet", *words], {})
            if done.returncode:
                return why_not_installed(done.stdout)
        return ""

    def run(self, part: str, workers: int) -> str:
        """Run a part and return its cell."""
        missing = [name for name in BACKENDS.get(part, ()) if find_library(name) is None]
        if missing:
            return f"missing: {', '.join(f'lib{name}' for name in missing)}"
        flown, programs = str(self.folder / "flight"), self.folder / "bin"
        backend = {"MUJOCO_GL": part if part in BACKENDS else "disable"}
        if part == "contracts":
            command = ["python", "-m", "pytest", "-q", "-n", str(workers), "-p", "no:cacheprovider", "tests/contracts"]
        elif part == "flight":
            command = ["mathnavi", "run", *FLIGHT, "--out", flown]
        else:
            command = ["mathnavi", "render", flown]
        done = executed([str(programs / command[0]), *command[1:]], backend)
        if part in BACKENDS and not done.returncode:
            (self.folder / "flight" / "video.mp4").rename(self.folder / f"{part}.mp4")
        return result(done.returncode, done.stdout)


def executed(command: Sequence[str], more: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a command in the tree; what it printed on either stream is in its ``stdout``."""
    inherited = {name: value for name, value in os.environ.items() if name not in ("VIRTUAL_ENV", "PYTHONPATH")}
    try:
        return subprocess.run(
            command, cwd=ROOT, env={**inherited, **more}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, errors="replace", check=False, timeout=PATIENCE,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, f"it took more than {PATIENCE:g} s")


def cells_of(
    made: Environment, program: str, tools: Sequence[str], parts: Sequence[str], workers: int
) -> dict[str, str]:
    """Make an environment, run the parts in it, and return their cells. Nothing is drawn where the flight failed."""
    if reason := made.make(program, tools):
        return dict.fromkeys(parts, f"failed: {reason}")
    cells: dict[str, str] = {}
    for part in parts:
        began = time.monotonic()
        drawn = part not in BACKENDS or (made.folder / "flight" / "summary.json").exists()
        cells[part] = made.run(part, workers) if drawn else "no flight"
        seconds = time.monotonic() - began
        print(f"{made.folder.name}, {part}: {cells[part]}, {seconds:.0f} s", file=sys.stderr, flush=True)
    return cells


def table(rows: Sequence[Row], parts: Sequence[str]) -> str:
    """Return the rows as a table in Markdown."""
    lines = [f"| Python | MuJoCo | {' | '.join(parts)} |", "|---" * (len(parts) + 2) + "|"]
    for row in rows:
        mujoco = f"{row.mujoco} (trial)" if row.trial else row.mujoco
        lines.append(f"| {row.python} | {mujoco} | {' | '.join(row.cells[part] for part in parts)} |")
    return "\n".join(lines)


def wheels(pythons: Sequence[str], uv: Path) -> dict[str, str]:
    """Return for each Python how many packages have a wheel on PLATFORM, "all 60", or "failed" with those without."""
    found = {}
    for python in pythons:
        chosen = ["--python-version", python, "--python-platform", PLATFORM, "--only-binary", ":all:"]
        done = executed([str(uv), "pip", "compile", "--quiet", "--no-annotate", *chosen, "pyproject.toml"], {})
        count = len(re.findall(r"^[\w.-]+==", done.stdout, re.MULTILINE))
        found[python] = f"failed: {why_not_installed(done.stdout)}" if done.returncode else f"all {count}"
    return found


def rows(chosen: argparse.Namespace, wanted: Requirement, tools: Sequence[str], uv: Path) -> Iterator[Row]:
    """Run every pair of a Python and a MuJoCo, and yield its row."""
    within, above = versions_to_try(served_versions("mujoco"), wanted, chosen.minors)
    for python in chosen.python:
        program = interpreter(python)
        if program is None:
            yield Row(python, "", False, dict.fromkeys(chosen.parts, "not here"))
            continue
        for mujoco in (*within, *above):
            made = Environment(python, mujoco, uv)
            yield Row(python, mujoco, mujoco in above, cells_of(made, program, tools, chosen.parts, chosen.workers))


def main(argv: Sequence[str]) -> int:
    """The exit code."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    supported = supported_pythons(pyproject)
    parser = argparse.ArgumentParser(allow_abbrev=False, description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--python", nargs="+", choices=supported, default=supported, help="versions of Python")
    parser.add_argument("--minors", action="store_true", help="the last MuJoCo of each minor version in the range, too")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="columns of the table")
    parser.add_argument("--workers", type=int, default=2, help="processes that run the contracts")
    parser.add_argument("--wheels", action="store_true", help=f"only a table of missing wheels for {PLATFORM}")
    chosen = parser.parse_args(argv)
    uv = Path(sysconfig.get_path("scripts"), "uv")
    if not uv.exists():
        print(f"versions: {uv} is not there, and it makes the environments; type: pip install uv", file=sys.stderr)
        return 2
    if chosen.wheels:
        found = wheels(chosen.python, uv)
        print(f"| Python | wheels for {PLATFORM} |\n|---|---|")
        print("\n".join(f"| {python} | {cell} |" for python, cell in found.items()))
        return int(any(cell.startswith("failed") for cell in found.values()))
    tools = [str(requirement(pyproject["optional-dependencies"]["dev"], name)) for name in TOOLS]
    try:
        ran = list(rows(chosen, requirement(pyproject["dependencies"], "mujoco"), tools, uv))
    except NothingServedError as error:
        print(f"versions: {error}", file=sys.stderr)
        return 2
    print("\n".join(f"- {part}: {PARTS[part]}" for part in chosen.parts), end="\n\n")
    print(table(ran, chosen.parts))
    return int(any(row.failed for row in ran))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
