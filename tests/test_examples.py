"""The stranger's package in examples/ridgeline is installed as one would, found by name, flown, and keeps contracts."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mathnavi.commands.cli import main

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "examples" / "ridgeline"

# The contract suites collect what is installed; built-in plug-ins have been through them elsewhere. The package's own
# tests run with everything.
ALONE = """
from importlib import metadata

everything = metadata.entry_points


def entry_points(**wanted):
    points = everything(**wanted)
    if wanted.get("group") not in ("mathnavi.controllers", "mathnavi.estimators"):
        return points
    return metadata.EntryPoints(point for point in points if point.dist.name == "ridgeline")


def pytest_collection_finish(session):
    metadata.entry_points = everything


metadata.entry_points = entry_points
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder into which pip has installed the package, built from a copy and without a network."""
    source = shutil.copytree(PACKAGE, tmp_path_factory.mktemp("stranger") / "ridgeline")
    target = tmp_path_factory.mktemp("installed")
    alone = ["--no-deps", "--no-build-isolation", "--no-index", "--target", str(target)]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *alone, str(source)]
    done = subprocess.run(pip, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return target


@pytest.fixture
def at_hand(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The installed package is imported in this process, and gone from it afterwards."""
    monkeypatch.syspath_prepend(installed)
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if name.partition(".")[0] == "ridgeline":
            del sys.modules[name]


def test_it_is_listed_by_its_names(at_hand: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "controllers", "--verbose"]) == 0
    assert "ridgeline 0.1.0, ridgeline.controller:Roadmap" in capsys.readouterr().out
    assert main(["list", "estimators", "--verbose"]) == 0
    assert "ridgeline.estimator:AlphaBetaGamma" in capsys.readouterr().out


def test_it_flies_from_the_command_line(at_hand: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ends = ["--start", "3000", "4000", "900", "--target", "9000", "10000", "1100"]
    names = ["--controller", "roadmap", "--estimator", "alpha_beta_gamma", "--planner.margin", "30"]
    noise = ["--noise.position", "5", "--estimator.memory", "2.5"]
    command = ["run", "safe-flight", "--terrain", "jacksboro", *ends, *names, *noise, "--out", str(tmp_path / "run")]
    assert main(command) == 0, capsys.readouterr().err
    assert "mission succeeded" in capsys.readouterr().out
    assert '"ridgeline.controller:Roadmap"' in (tmp_path / "run" / "config.json").read_text(encoding="utf-8")


def test_it_keeps_the_contracts_and_its_own_tests_pass_against_the_installed_copy(
    installed: Path, tmp_path: Path
) -> None:
    (tmp_path / "ridgeline_alone.py").write_text(ALONE, encoding="utf-8")
    own = shutil.copytree(PACKAGE / "tests", tmp_path / "tests")
    modules = [path.name for path in own.glob("test_*.py")]
    suites = [f"tests/contracts/test_{kind}.py" for kind in ("planners", "estimators")]
    chosen = " or ".join(["roadmap", "alpha_beta_gamma", *modules])
    options = ["-q", "-rA", "-p", "no:cacheprovider", "-p", "ridgeline_alone", "--noconftest", "-n", "0", "-k", chosen]
    path = os.pathsep.join(map(str, [installed, tmp_path]))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *suites, str(own)],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:]
    for module in (*modules, *suites):
        assert re.search(rf"^PASSED .*{re.escape(module)}::", done.stdout, re.MULTILINE), module
