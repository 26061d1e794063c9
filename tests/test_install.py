"""``make fly`` compiles the kernels of a flight while pip installs the rest."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
SPEC = importlib.util.spec_from_file_location("install", ROOT / ".ci" / "install.py")
assert SPEC is not None
assert SPEC.loader is not None
install = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(install)


def test_the_kernels_import_nothing_but_what_is_installed_first() -> None:
    present = {*install.NEEDED, "llvmlite"}  # which numba needs
    missing = [name for name, owners in packages_distributions().items() if not {*owners} & {*present, "mathnavi"}]
    assert {"mujoco", "casadi", "tyro"} <= set(missing)
    script = f"import sys; sys.modules.update(dict.fromkeys({missing!r})); import {install.KERNELS}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_requirements_keep_their_versions(tmp_path: Path) -> None:
    listed = '"mujoco>=3", "numba>=0.68,<0.69", "numpy-extra", "scipy[all]>=1; os_name == \'posix\'"'
    (tmp_path / "pyproject.toml").write_text(f"[project]\ndependencies = [{listed}]\n", encoding="utf-8")
    found = install.needed_first(tmp_path / "pyproject.toml")
    assert found == ["numba>=0.68,<0.69", "scipy[all]>=1; os_name == 'posix'"]
    assert len(install.needed_first(ROOT / "pyproject.toml")) == len(install.NEEDED)


@pytest.mark.parametrize("failing", [None, 0, 2])
def test_what_the_kernels_need_comes_first_and_a_failure_of_pip_is_the_exit_code(
    failing: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    def run(command: list[str], check: bool) -> SimpleNamespace:
        done.append(command[-1])
        return SimpleNamespace(returncode=7 if failing == len(done) - 1 else 0)

    class Compiling:
        polls = iter([None, 0])

        def __init__(self, command: list[str], **options: Any) -> None:
            assert command[2] == "mathnavi.sim.engine.compilation"
            assert Path(options["env"]["PYTHONPATH"], "mathnavi", "sim", "engine", "compilation.py").is_file()
            done.append("compiling")

        def poll(self) -> int | None:
            return next(self.polls)

        def kill(self) -> None:
            done.append("ended")

        def wait(self) -> None:
            pass

    fake = SimpleNamespace(run=run, Popen=Compiling, DEVNULL=None)
    monkeypatch.setattr(install, "subprocess", fake)
    monkeypatch.setattr(install.time, "sleep", lambda seconds: done.append("waited"))
    assert install.main([]) == (7 if failing is not None else 0)
    libraries, *rest = done
    assert libraries.startswith("scipy")
    expected: dict[int | None, list[str]] = {
        None: ["compiling", str(ROOT), "waited", "ended"],
        0: [],
        2: ["compiling", str(ROOT), "ended"],
    }
    assert rest == expected[failing]
