"""A release is refused, a line for each reason, until version, changelog, citation, tree and tag fit."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.programs import program

ROOT = Path(__file__).resolve().parents[1]
release = program(".ci/release.py")


def git(root: Path, *words: str) -> None:
    identity = ["-c", "user.name=Somebody", "-c", "user.email=somebody@example.org"]
    subprocess.run(["git", *identity, *words], cwd=root, check=True, capture_output=True)


@pytest.fixture
def ready(tmp_path: Path) -> Path:
    """A repository whose version 1.2.0 can be released."""
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "mathnavi"\nversion = "1.2.0"\n')
    (tmp_path / "CITATION.cff").write_text("title: mathnavi\nversion: 1.2.0\n")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## [1.2.0] - 2026-01-31\n")
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "All")
    return tmp_path


def test_what_is_ready_has_no_fault(ready: Path) -> None:
    assert list(release.faults("1.2.0", ready)) == []


@pytest.mark.parametrize("version", ["", "1.2", "v1.2.0", "1.2.0; rm -rf", "1.2.0\n"])
def test_what_is_no_version_is_refused(version: str, ready: Path) -> None:
    (line,) = release.faults(version, ready)
    assert "allowed: X.Y.Z" in line


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        ("pyproject.toml", '[project]\nversion = "1.1.0"\n', "pyproject.toml: version = '1.1.0'"),
        ("CITATION.cff", "version: 1.2.01\n", "CITATION.cff"),
        ("CHANGELOG.md", "## [Unreleased] 1.2.0\n", "no section"),
        ("CHANGELOG.md", "## [1.2.0] - 9999-01-01\n", "is not past"),
    ],
)
def test_each_file_has_to_have_the_version(file: str, content: str, reason: str, ready: Path) -> None:
    (ready / file).write_text(content)
    git(ready, "commit", "-qam", "Changed")
    (line,) = release.faults("1.2.0", ready)
    assert reason in line


def test_a_changed_tree_and_a_tag_that_is_there_are_refused(ready: Path) -> None:
    git(ready, "tag", "v1.2.0")
    (ready / "new").write_text("new")
    changed, tagged = release.faults("1.2.0", ready)
    assert "not committed" in changed
    assert "v1.2.0 is there" in tagged
