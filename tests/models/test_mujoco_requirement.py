"""A MuJoCo that computes wrongly, is broken or cannot run on the processor is refused in one line before it is used."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import mathnavi.models.mujoco_requirement as requirement
from mathnavi.commands.cli import main

ROOT = Path(__file__).resolve().parents[2]
FLAGS = "processor\t: 0\nflags\t\t: fpu sse4_2 popcnt {}\nbugs\t\t:\n"
ALONE = 'raise ImportError("its core\\n  is missing")'  # MuJoCo 4 installed without what it requires
IMPORTS = {
    "a script": "import mathnavi as mn; mn.run",
    "a script that has imported it itself": "import mujoco, mathnavi as mn; mn.run",
    "environments": "import mathnavi.sim.environments",
    "a model": "import mathnavi.models.composer_and_mjcf",
}


def allowed() -> Requirement:
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (found,) = [each for each in map(Requirement, listed) if each.name == "mujoco"]
    return found


def fake(folder: Path, source: str, version: str) -> Path:
    """A folder with a MuJoCo of this version and source."""
    (folder / "mujoco").mkdir()
    (folder / "mujoco" / "__init__.py").write_text(source)
    (folder / f"mujoco-{version}.dist-info").mkdir()
    (folder / f"mujoco-{version}.dist-info" / "METADATA").write_text(f"Name: mujoco\nVersion: {version}\n")
    return folder


def last_line(folder: Path, script: str) -> str:
    """The last line that Python prints for a script, where a MuJoCo of a folder stands before the installed one."""
    told = f"import sys; sys.path.insert(0, {str(folder)!r}); {script}"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    return done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize("use", IMPORTS)
def test_python_refuses_a_version_that_computes_wrongly(use: str, tmp_path: Path) -> None:
    said = last_line(fake(tmp_path, '__version__ = "4.0.0"', "4.0.0"), IMPORTS[use])
    assert "UnusableMujocoError: MuJoCo 4.0.0 is installed: its Newton solver" in said
    assert Requirement(said.partition("allowed: ")[2]) == allowed()


@pytest.mark.parametrize(
    ("version", "begins"), [("4.0.0", "MuJoCo 4.0.0 is installed"), ("4.0.1", "MuJoCo cannot be imported: its core is")]
)
def test_one_that_is_installed_without_its_parts_is_refused_too(version: str, begins: str, tmp_path: Path) -> None:
    said = last_line(fake(tmp_path, ALONE, version), IMPORTS["a script"])
    assert said.startswith(f"mathnavi.models.mujoco_requirement.UnusableMujocoError: {begins}")
    assert Requirement(said.partition("allowed: ")[2]) == allowed()


@pytest.mark.parametrize("words", [["run", "safe-flight"], ["view", "."], ["study", "cost-to-go", "--quick"]])
def test_commands_refuse_it_in_one_line(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(requirement.REFUSED, sys.modules["mujoco"].__version__, "it is wrong")
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "is installed: it is wrong; allowed: mujoco" in line


def test_a_processor_without_what_the_library_needs_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(requirement, "PROCESSORS", str(tmp_path / "cpuinfo"))
    for listed in (FLAGS.format("avx"), FLAGS.format("avx2 avx"), "Features\t: fp asimd\n"):
        (tmp_path / "cpuinfo").write_text(listed)
        requirement.require_processor()
    (tmp_path / "cpuinfo").write_text(FLAGS.format("avx512f"))
    with pytest.raises(requirement.UnusableMujocoError, match="has no AVX"):
        requirement.require_processor()
    (tmp_path / "cpuinfo").unlink()  # not Linux
    requirement.require_processor()
