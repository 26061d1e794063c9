"""Install mathnavi into the environment of this Python, with a line of progress every few seconds.

    .venv/bin/python .ci/install.py [--extras NAME,NAME] [--lock FILE]

With a lock: exactly its versions, hash by hash. Without: the newest versions that pyproject.toml allows, while the
kernels of a flight are compiled; should that fail, the first flight compiles for itself. Then the byte code is written
of what a flight, its video and its report import, or every start would translate a thousand modules where the
environment of a user writes none. uv is used if it is available, for it takes a fifth of the time, and pip otherwise:
both install the same packages. Their output is kept in install.log in the environment.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
import textwrap
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KERNELS = ("mathnavi.models.terrain.kernels", "mathnavi.controllers.flight.ahead")
NEEDED = ("annotated-types", "numba", "numpy", "scipy")
"""packages that the module of the kernels imports"""
IMPORTED = (
    "mathnavi.commands.run", "mathnavi.sim.scenarios.safe_flight", "mathnavi.estimators.full_state",
    "mathnavi.renders.worker", "mathnavi.renders.flight.report", "mathnavi.renders.flight.scene",
    "matplotlib.backends.backend_agg", "numba.np.arraymath", "numba.typed", "rich._emoji_codes", "scipy.linalg",
)  # fmt: skip
"""modules whose byte code, and that of what they import, is written"""
UV = "uv>=0.13.9,<0.14"
MOST_REASONS = 6  # lines
PAUSE = 4.0  # [s] between two lines of progress
WITHOUT_REQUIREMENTS = "dm-control"
"""package installed without its requirements: one has no wheel for some Pythons, mathnavi requires the others"""


class InstallationError(Exception):
    """Nothing could be installed; the message says what went wrong."""


@dataclass(frozen=True)
class Installer:
    """A program that installs packages into the environment of this Python."""

    command: tuple[str, ...]
    environment: Mapping[str, str]
    follows_overrides: bool  # those of pyproject.toml, by which no requirement without a wheel is asked for

    def install(self, arguments: Sequence[str], log: Path, progress: Callable[[], str]) -> None:
        """Install the packages; InstallationError with the reasons that the program printed."""
        with log.open("w+", encoding="utf-8", errors="replace") as output:
            process = subprocess.Popen(
                [*self.command, *arguments],
                cwd=ROOT, env=self.environment, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            )  # fmt: skip
            with ended(process):
                reported(process, progress)
            output.seek(0)
            if process.returncode:
                raise InstallationError(reasons(output.read()))


def with_pip() -> Installer:
    """Return pip, which every environment has."""
    command = (sys.executable, "-m", "pip", "install", "--no-input", "--disable-pip-version-check")
    return Installer(command, os.environ, follows_overrides=False)


def with_uv() -> Installer | None:
    """Return uv with pip's package index and certificates; None if uv is not available."""

    def pip(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *words]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)

    if pip("install", "--retries", "0", "--only-binary", ":all:", UV).returncode:
        return None
    program = Path(sysconfig.get_path("scripts"), "uv")
    settings = configured(pip("config", "list").stdout)
    command = (str(program), "pip", "install", "--python", sys.executable)
    return Installer(command, {**settings, **os.environ}, follows_overrides=True)


def configured(listed: str) -> dict[str, str]:
    """uv's variables for what ``pip config list`` lists; the environment comes last there, and counts most."""
    names = {"index-url": "UV_DEFAULT_INDEX", "cert": "SSL_CERT_FILE"}
    found = re.findall(r"^(?:global|install|:env:)\.([\w-]+)=(.*)$", listed, re.MULTILINE)
    return {names[name]: str(ast.literal_eval(value)) for name, value in found if name in names}


def steps(
    installer: Installer,
    pyproject: Path,
    extras: str = "",
    lock: str = "",
    version: tuple[int, int] = sys.version_info[:2],
) -> list[list[str]]:
    """Arguments of an installer, one list after the other. What the kernels need comes first where there is no lock."""
    if lock:
        # Only wheels: what a source is built with would not be locked. The lock is whole, and has what builds mathnavi.
        locked = ["--no-deps", "--only-binary", ":all:", "--require-hashes", "--requirement", lock]
        return [locked, ["--no-deps", "--no-build-isolation", "--editable", "."]]
    requirements = {re.split(r"[^\w-]", each, maxsplit=1)[0]: each for each in requirements_of(pyproject)}
    listed = [[requirements[name] for name in NEEDED], ["--editable", f".[{extras}]" if extras else "."]]
    if version >= (3, 13) and not installer.follows_overrides:
        listed.append(["--no-deps", requirements[WITHOUT_REQUIREMENTS].partition(";")[0].strip()])
    return listed


def requirements_of(pyproject: Path) -> list[str]:
    """The requirements of the project, with their versions and markers."""
    listed: list[str] = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]["dependencies"]
    return listed


def reasons(said: str) -> str:
    """Return the reasons of a failure from an installer's output, one a line: first why nothing could be fetched."""
    fetching = re.findall(r"after connection broken by '(?:.*>: )?(.*?)'*\)?': /", said)
    errors = re.findall(r"^ *(?:ERROR:|error:|cause:|WARNING:(?= The repository)) *(.+)$", said, re.MULTILINE)
    told = dict.fromkeys([*fetching[:1], *(line for line in errors if not line.startswith("Ignored the following"))])
    lines = [textwrap.shorten(line, 200) for line in list(told)[:MOST_REASONS]] or ["no reason was given"]
    return "\n".join(f"    {line}" for line in lines)


@contextmanager
def ended(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """End a process when the block ends, also by an exception."""
    try:
        yield
    finally:
        process.kill()
        process.wait()


def reported(process: subprocess.Popen[bytes], progress: Callable[[], str]) -> None:
    """Wait for a process, and print a line of progress now and then."""
    while True:
        with suppress(subprocess.TimeoutExpired):
            process.wait(PAUSE)
            return
        print(progress(), flush=True)


def compiling(claims: str, *options: str) -> subprocess.Popen[bytes]:
    """A process that compiles those kernels of a flight that no other process has claimed."""
    return _python("-m", "mathnavi.sim.engine.compilation", claims, *KERNELS, *options)


def importing() -> subprocess.Popen[bytes]:
    """A process that writes the byte code of ``IMPORTED``."""
    return _python("-c", f"import {', '.join(IMPORTED)}")


def _python(*words: str) -> subprocess.Popen[bytes]:
    """A quiet process of this Python, which imports mathnavi from its sources and keeps the byte code."""
    return subprocess.Popen(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONDONTWRITEBYTECODE": ""},
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def name_sources_in_ascii(site: Path, sources: Path = ROOT / "src") -> None:
    """Name the folder of the sources from the site's own folder, if its absolute path is not ASCII.

    At every start, Python 3.11 and 3.12 read the file that names it in the encoding of the locale, and do not start if
    that cannot decode it, as that of LC_ALL=C cannot decode an umlaut.
    """
    file, named = site / "_mathnavi.pth", os.path.relpath(sources, site)
    if named.isascii() and not file.read_bytes().isascii():
        file.write_text(named, encoding="ascii")


def install(extras: str, lock: str) -> None:
    """Install, by pip if uv fails; InstallationError if that fails too."""
    began = time.monotonic()
    site, log = Path(sysconfig.get_path("purelib")), Path(sys.prefix, "install.log")

    def in_place() -> str:
        packages = sum(1 for _ in site.glob("*.dist-info"))
        return f"Installing: {time.monotonic() - began:.0f} s, {packages} packages in place"

    with ExitStack() as running:
        claims = running.enter_context(tempfile.TemporaryDirectory())
        compilers: list[subprocess.Popen[bytes]] = []

        def meanwhile(process: subprocess.Popen[bytes]) -> subprocess.Popen[bytes]:
            running.enter_context(ended(process))
            return process

        def run(installer: Installer) -> None:
            for arguments in steps(installer, ROOT / "pyproject.toml", extras, lock):
                installer.install(arguments, log, in_place)
                if not lock and not compilers:
                    compilers.append(meanwhile(compiling(claims)))
            name_sources_in_ascii(site)

        uv = with_uv()
        try:
            run(uv or with_pip())
        except InstallationError:
            if uv is None:
                raise
            print("That did not work; trying again another way", flush=True)
            run(with_pip())
        print(in_place(), flush=True)
        importer = meanwhile(importing())
        if not lock:
            compilers.append(meanwhile(compiling(claims, "--first")))  # the processors have nothing else to do now
        for compiler in compilers:
            reported(compiler, lambda: f"Compiling the kernels of a flight: {len(os.listdir(claims))} begun")
        reported(importer, lambda: "Writing byte code")


def main(argv: Sequence[str]) -> int:
    """The exit code."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("--extras", default="", help="extras of mathnavi, with commas between them")
    parser.add_argument("--lock", default="", help="file with the version and the hashes of every package")
    chosen = parser.parse_args(argv)
    try:
        install(chosen.extras, chosen.lock)
    except InstallationError as error:
        log = Path(sys.prefix, "install.log")
        print(f"mathnavi could not be installed (everything that was said: {log}):\n{error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
