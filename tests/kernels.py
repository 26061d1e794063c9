"""Missions that compile the kernels of most tests, before the first of them, in two processes that share the work.

    python -m tests.kernels flight|others CLAIMS

Workers of pytest-xdist would each compile for themselves. What is compiled is kept (``interfaces.compiled``), so it
happens once for each change of a kernel.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from mathnavi.interfaces.compiled import compiler, kernel_folder
from mathnavi.sim.engine.compilation import compile_unclaimed, listed

ROOT = Path(__file__).parents[1]
FOLDERS = ("interfaces", "models", "controllers", "estimators", "sim", "renders", "studies")
_LISTED = re.compile(r'^    kernels: ClassVar\[str\] = "(.+)"', re.MULTILINE)


def compile_listed(claims: Path, first: bool) -> None:
    """Compile what commands compile before their first run, so that none of it is compiled in a test.

    Two processes claim the kernels in ``claims``, one from the first on, the other from the last.
    """
    sources = [file.read_text(encoding="utf-8") for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")]
    modules = sorted({name for source in sources for name in _LISTED.findall(source)})
    compile_unclaimed(list(enumerate(listed(modules)))[:: 1 if first else -1], claims)


def flight() -> None:
    """A flight over mountains past a radar: planner, certificate, terrain."""
    from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
    from mathnavi.sim.scenarios.safe_flight import SafeFlight
    from tests.flight import START, TARGET, above, mountains, save

    terrain = mountains()
    ends = above(terrain, START, 600.0), above(terrain, TARGET, 600.0)
    with tempfile.TemporaryDirectory() as folder:
        file = save(terrain, Path(folder) / "mountains.npz")
        SafeFlight.build(SafeFlightConfig(file, *ends, radar=((6000.0, 6000.0, 900.0, 2.0),)), 0).run()


def others() -> None:
    """A missile, robots that range in every mode of active sensing, and bodies on a manifold."""
    from mathnavi.sim.scenarios.attitude_tracking import AttitudeTrackingScenario
    from mathnavi.sim.scenarios.range_localisation import RangeLocalisation
    from mathnavi.studies.ranging.active_control import FAST, MODES, TRACKS, localisation, tracking
    from tests.missile import fly

    fly(target=(200.0, 0.0, 0.0))
    trials = [localisation(mode, FAST, 0, 1.0) for mode in MODES]
    for trial in (*trials, *(tracking(kind, 0, 1.0) for kind in TRACKS)):
        trial.build().run()
    RangeLocalisation.build(RangeLocalisation.Config(duration=0.5), 0).run()
    AttitudeTrackingScenario.build(AttitudeTrackingScenario.Config(duration=1.2, settled=0.8), 0).run()


GROUPS: dict[str, Callable[[], None]] = {"flight": flight, "others": others}


def compile_kernels() -> None:
    """Have every group flown in a process of its own, unless these kernels are compiled already.

    Raises:
        RuntimeError: a mission fails.
    """
    folder = kernel_folder()
    done = folder and folder / f"tests-{_sources()}"
    if not done or done.exists():
        return
    command = [sys.executable, "-m", "tests.kernels"]
    with tempfile.TemporaryDirectory() as claims:
        running = {
            group: subprocess.Popen(
                [*command, group, claims], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
            )
            for group in GROUPS
        }
        for group, process in running.items():
            said, _ = process.communicate()
            if process.returncode:
                raise RuntimeError(f"the missions {group} fail:\n{said.decode()}")
    done.touch()


def _sources() -> str:
    """Hash of the sources that kernels depend on, and of what compiles them."""
    digest = hashlib.sha256(repr(compiler()).encode())
    sources = {file: file.read_text(encoding="utf-8") for folder in FOLDERS for file in (ROOT / folder).rglob("*.py")}
    seen = {file for file, source in sources.items() if "njit(" in source}
    waiting = list(seen)
    while waiting:
        found = re.findall(r"^from mathnavi\.([\w.]+) import ([\w, ]+|\([^)]*\))", sources[waiting.pop()], re.MULTILINE)
        paths = {
            Path(*module.split("."), *name) for module, names in found for name in [(), *zip(re.findall(r"\w+", names))]
        }
        new = {ROOT / path.with_suffix(".py") for path in paths} & sources.keys() - seen
        waiting += new
        seen |= new
    for file in sorted(seen):
        digest.update(sources[file].encode())
    return digest.hexdigest()[:32]


if __name__ == "__main__":
    compile_listed(Path(sys.argv[2]), first=sys.argv[1] == "flight")
    GROUPS[sys.argv[1]]()
