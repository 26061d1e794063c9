"""Install mathnavi into the environment of this Python, and compile the kernels of a flight while pip does the rest.

    .venv/bin/python .ci/install.py [PIP_OPTION ...]

The libraries that the kernels need come first. Should the compilation fail, the first flight compiles for itself.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KERNELS = "mathnavi.controllers.flight.ahead"
NEEDED = ("annotated-types", "numba", "numpy", "scipy")
"""what the module of the kernels imports"""


def needed_first(pyproject: Path) -> list[str]:
    """The requirements of the project that the kernels need, with their versions."""
    requirements = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]["dependencies"]
    return [each for each in requirements if re.split(r"[^\w-]", each, maxsplit=1)[0] in NEEDED]


def main(options: list[str]) -> int:
    """Install; the exit code of pip."""
    pip = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", *options]
    if code := subprocess.run([*pip, *needed_first(ROOT / "pyproject.toml")], check=False).returncode:
        return code
    with tempfile.TemporaryDirectory() as claims:
        compiling = subprocess.Popen(
            [sys.executable, "-m", "mathnavi.sim.engine.compilation", claims, KERNELS],
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            code = subprocess.run([*pip, "--editable", str(ROOT)], check=False).returncode
            while not code and compiling.poll() is None:
                print(f"Compiling the kernels of a flight: {len(os.listdir(claims))} begun", flush=True)
                time.sleep(2.0)
        finally:
            compiling.kill()
            compiling.wait()
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
