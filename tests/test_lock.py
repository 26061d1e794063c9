"""The lock of continuous integration: complete, in the ranges of pyproject.toml, hash by hash, without an address."""

from __future__ import annotations

import re
import subprocess
import tomllib
from importlib.metadata import PackageNotFoundError, requires
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / ".ci" / "requirements.txt").read_text(encoding="utf-8")
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PYPROJECT["project"]["optional-dependencies"]
HASH = r"    --hash=sha256:[0-9a-f]{64}"
ENTRY = re.compile(rf"^([\w.-]+)==([\w.]+)(?: ; ([^\\\n]+))? \\\n{HASH}(?: \\\n{HASH})*$", re.MULTILINE)
LOCKED = {found[1]: found for found in ENTRY.finditer(TEXT)}


def asked(*extras: str) -> list[Requirement]:
    lists = (PYPROJECT["project"]["dependencies"], PYPROJECT["build-system"]["requires"], *(EXTRAS[e] for e in extras))
    return [Requirement(text) for texts in lists for text in texts]


def test_every_line_is_a_version_with_hashes_and_none_an_address() -> None:
    lines = [line for line in TEXT.splitlines() if line and not line.startswith(("#", " "))]
    assert len(lines) == len(LOCKED) > 100
    assert "://" not in TEXT
    assert "--index-url" not in TEXT


@pytest.mark.parametrize("extra", sorted(set(EXTRAS) - {"bench", "learn", "logs", "mcap", "record", "rerun"}))
def test_what_pyproject_asks_for_is_locked_in_its_range(extra: str) -> None:
    for requirement in asked(extra):
        assert LOCKED[canonicalize_name(requirement.name)][2] in requirement.specifier, "make lock"


def test_what_these_need_is_locked_too() -> None:
    for name, found in LOCKED.items():
        if found[3] and not Marker(found[3]).evaluate():
            continue
        try:
            needed = [Requirement(text) for text in requires(name) or []]
        except PackageNotFoundError:
            continue
        for requirement in needed:
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                assert canonicalize_name(requirement.name) in LOCKED, f"{name} needs {requirement}; make lock"


def test_it_has_one_version_for_every_python() -> None:
    assert len(re.findall(r"^[\w.-]+==", TEXT, re.MULTILINE)) == len(LOCKED)


@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13", "3.14"])
def test_labmaze_is_locked_for_the_pythons_that_it_has_wheels_for_and_dm_control_for_all(version: str) -> None:
    assert LOCKED["dm-control"][3] is None
    environment = {"python_full_version": f"{version}.0", "python_version": version}
    assert Marker(LOCKED["labmaze"][3]).evaluate(environment) is (version in ("3.11", "3.12"))


def commands(*words: str) -> str:
    """Commands by which make would install for the tests."""
    command = ["make", "--dry-run", "--always-make", ".venv/.developed", *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout


def test_make_installs_from_the_lock_unless_it_is_taken_away() -> None:
    locked = commands("LOCK=.ci/requirements.txt")
    assert ".ci/install.py --lock .ci/requirements.txt;" in locked
    newest = commands("LOCK=")
    assert ".ci/install.py --extras dev,docs;" in newest
    assert "requirements.txt" not in newest


@pytest.mark.parametrize("script", ["lock", "newest", "opengl", "run", "weekly"])
def test_the_scripts_of_continuous_integration_are_whole(script: str) -> None:
    subprocess.run(["bash", "-n", str(ROOT / ".ci" / script)], check=True, timeout=60)
