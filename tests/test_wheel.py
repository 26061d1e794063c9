"""The published archives are complete: every file once; the wheel alone flies beside a user's folders of our names."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from mathnavi.models import opengl

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("controllers", "estimators", "interfaces", "models", "renders", "sim", "studies")
FRONT_DOOR = ("commands", "learning", "scripting")
SOURCES = ROOT / "src" / "mathnavi"
DATA = (".xml", ".css", ".html", ".js", ".json", ".png", ".md", ".typed", ".template")
FLIGHT = ["safe-flight", "--terrain", "jacksboro", "--start", "3000", "4000", "900", "--target", "6000", "7000", "1000"]

SCRIPT = """
import json
import sys

import mathnavi as mn
import mathnavi.models
from mathnavi.renders.video import write_still

run = mn.run("textbook-observer", duration=1.0)
run.save("out")
if sys.argv[1] == "True":
    write_still("run", "overview", "overview.png", width=320, height=180)
swept = mn.sweep("textbook-observer", 1, store="trials.db", workers=2)
same = mn.load("out").success == run.success
print(json.dumps({"place": mathnavi.models.__file__, "again": same, "trials": len(swept.records),
                  "succeeded": swept.failures.trials - swept.failures.events}))
"""


def installed_files() -> Iterator[str]:
    """The package's files as the repository has them, but for what is drawn: pictures of the gallery, and outputs."""
    yield from ("__init__.py", "__main__.py", "py.typed")
    for folder in (*FOLDERS, *FRONT_DOOR):
        for path in (SOURCES / folder).rglob("*"):
            name = path.relative_to(SOURCES).as_posix()
            drawn = name.startswith(("renders/out/", "renders/gallery/")) and path.suffix != ".py"
            if path.is_file() and path.suffix in (".py", *DATA) and (not drawn or path.name == "README.md"):
                yield name


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with sdist and wheel, built as ``make wheel`` does, without a network."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    (path,) = built.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An interpreter of an environment in which the wheel is installed, and everything that it needs but mathnavi.

    What it needs is seen through a .pth file: a folder so named adds itself and none of its own .pth files, so the
    repository, which is installed as editable here, is out of sight.
    """
    home = tmp_path_factory.mktemp("environment") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home)], check=True, timeout=120)
    python = home / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    alone = ["install", "--quiet", "--no-deps", "--no-index", "--no-compile", str(wheel)]
    done = subprocess.run([*pip, *alone], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    (site,) = home.glob("lib/python*/site-packages")
    needed = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site / "needed.pth").write_text("".join(f"{path}\n" for path in sorted(needed)), encoding="utf-8")
    return python


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A user's folder, with packages that are called as our folders are, and that nobody may import in our place."""
    for name in FOLDERS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise RuntimeError('a stranger: {name}')\n", encoding="utf-8")
    return tmp_path


def said(python: Path, folder: Path, *command: str, **more: str) -> str:
    """Output of a command of the environment in the user's folder; it has to succeed."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")} | more
    done = subprocess.run(
        [str(python.with_name(command[0])), *command[1:]],
        cwd=folder, env=variables, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-4000:]}"
    return done.stdout


def test_the_wheel_holds_each_file_once_and_all_of_them(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert len(names) == len(set(names))
    package = {name.removeprefix("mathnavi/") for name in names if name.startswith("mathnavi/")}
    assert package == set(installed_files())
    others = {name.partition("/")[0] for name in names} - {"mathnavi"}
    assert len(others) == 1
    assert others.pop().endswith(".dist-info")


def test_the_sdist_holds_each_file_once_and_all_of_them(built: Path) -> None:
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        members = archive.getmembers()
    assert all(member.isfile() for member in members), "links would not survive on every system"
    names = [member.name.partition("/")[2] for member in members]
    assert len(names) == len(set(names))
    inside = {name.removeprefix("src/mathnavi/") for name in names if name.startswith("src/mathnavi/")}
    assert inside == set(installed_files())
    beside = {name for name in names if not name.startswith("src/")}
    assert beside >= {"CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "pyproject.toml"}


def test_a_wheel_built_from_the_sdist_is_the_same(built: Path, wheel: Path, tmp_path: Path) -> None:
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(tmp_path / wheel.name) as again, zipfile.ZipFile(wheel) as archive:
        assert {name: again.read(name) for name in again.namelist()} == {
            name: archive.read(name) for name in archive.namelist()
        }


def test_it_lists_flies_draws_and_sweeps_beside_a_strangers_folders(python: Path, folder: Path) -> None:
    """The command line, a script, and from it the processes that draw and those that run trials."""
    listing = said(python, folder, "python", "-m", "mathnavi", "list")
    assert "safe-flight" in listing
    assert "jacksboro" in listing
    assert "mission succeeded" in said(python, folder, "mathnavi", "run", *FLIGHT, "--out", "run")
    used = json.loads(said(python, folder, "python", "-c", SCRIPT, str(opengl.available() is not None)))
    assert Path(used.pop("place")).is_relative_to(python.parents[1])
    assert used == {"again": True, "trials": 1, "succeeded": 1}
    assert (folder / "overview.png").is_file() == (opengl.available() is not None)
