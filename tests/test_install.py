"""``make`` installs by one program that says how far it is, and what went wrong in the words of neither installer."""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import packages_distributions, requires
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.programs import program

ROOT = Path(__file__).resolve().parents[1]
install = program(".ci/install.py")
PYPROJECT = ROOT / "pyproject.toml"


def test_the_kernels_import_nothing_but_what_is_installed_first() -> None:
    present = {*install.NEEDED, "llvmlite"}  # which numba needs
    missing = [name for name, owners in packages_distributions().items() if not {*owners} & {*present, "mathnavi"}]
    assert {"mujoco", "casadi", "rich"} <= set(missing)
    script = f"import sys; sys.modules.update(dict.fromkeys({missing!r})); import {', '.join(install.KERNELS)}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def installer(*, follows_overrides: bool) -> Any:
    return install.Installer(("true",), {}, follows_overrides)


def test_what_the_kernels_need_comes_first_in_its_versions(tmp_path: Path) -> None:
    listed = [
        "mujoco>=3", "numba>=0.68,<0.69", "numpy-extra", "numpy", "annotated-types",
        "scipy[all]>=1; os_name == 'posix'",
    ]  # fmt: skip
    (tmp_path / "pyproject.toml").write_text(f"[project]\ndependencies = {listed}\n", encoding="utf-8")
    first, *rest = install.steps(installer(follows_overrides=True), tmp_path / "pyproject.toml", "dev,docs")
    assert sorted(first) == ["annotated-types", "numba>=0.68,<0.69", "numpy", "scipy[all]>=1; os_name == 'posix'"]
    assert rest == [["--editable", ".[dev,docs]"]]


@pytest.mark.parametrize("version", [(3, 11), (3, 12), (3, 13), (3, 14)])
def test_dm_control_is_installed_without_its_requirements_where_one_has_no_wheel(version: tuple[int, int]) -> None:
    named = install.steps(installer(follows_overrides=False), PYPROJECT, version=version)
    overridden = install.steps(installer(follows_overrides=True), PYPROJECT, version=version)
    apart = [["--no-deps", "dm-control>=1.0.50,<1.1"]] if version >= (3, 13) else []
    assert named == [*overridden, *apart]


def test_what_dm_control_requires_is_required_by_name_but_for_labmaze() -> None:
    own = [Requirement(text) for text in install.requirements_of(PYPROJECT)]
    for wanted in map(Requirement, requires("dm-control") or []):
        if wanted.marker is not None or wanted.name == "labmaze":
            continue
        (found,) = [each for each in own if canonicalize_name(each.name) == canonicalize_name(wanted.name)]
        assert found.marker is None
        if len(found.specifier) <= len(wanted.specifier):  # else ours is narrower
            assert found.specifier == wanted.specifier


def test_a_lock_is_installed_as_it_stands() -> None:
    locked, own = install.steps(installer(follows_overrides=False), PYPROJECT, lock="some.txt", version=(3, 13))
    assert locked == ["--no-deps", "--only-binary", ":all:", "--require-hashes", "--requirement", "some.txt"]
    assert own == ["--no-deps", "--no-build-isolation", "--editable", "."]


def test_uv_asks_the_index_that_pip_is_configured_with() -> None:
    listed = "global.index-url='https://one/simple'\nglobal.timeout='9'\n:env:.index-url='https://two/simple'\n"
    assert install.configured(listed) == {"UV_DEFAULT_INDEX": "https://two/simple"}
    assert install.configured("install.cert='/etc/own.pem'\nfreeze.cert='other'\n") == {"SSL_CERT_FILE": "/etc/own.pem"}
    assert install.configured("") == {}


REFUSED = """WARNING: Retrying (Retry(total=0, connect=None, read=None, redirect=None, status=None)) after connection \
broken by 'NewConnectionError('<pip._vendor.urllib3.connection.HTTPConnection object at 0x7f>: Failed to establish a \
new connection: [Errno 111] Connection refused')': /simple/numba/
ERROR: Ignored the following versions that require a different python version: 1.21.2 Requires-Python >=3.7,<3.11
ERROR: Could not find a version that satisfies the requirement numba<0.69 (from versions: none)
ERROR: No matching distribution found for numba<0.69
"""
UNKNOWN = """error: Request failed after 3 retries in 7.7s
  cause: Failed to fetch: http://nowhere.invalid/simple/numpy/
  cause: failed to lookup address information: Name or service not known
"""
FULL = "ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device\n"


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (REFUSED, "Failed to establish a new connection: [Errno 111] Connection refused"),
        (REFUSED, "No matching distribution found for numba<0.69"),
        (UNKNOWN, "failed to lookup address information: Name or service not known"),
        (FULL, "[Errno 28] No space left on device"),
        ("", "no reason was given"),
    ],
)
def test_what_went_wrong_is_told_without_the_name_of_an_installer(said: str, expected: str) -> None:
    told = install.reasons(said)
    assert expected in told
    assert not re.search(r"\b(uv|pip)\b|Retrying|Ignored", told)
    assert len(told.splitlines()) <= install.MOST_REASONS


Installed = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Installed:
    """Runs the program with installers that are commands of the shell; its exit code and what was done, in order."""

    def run(uv: str | None, pip: str, *argv: str) -> tuple[int, list[str]]:
        done = tmp_path / "done"
        done.touch()

        def shell(name: str, script: str, follows_overrides: bool) -> Any:
            command = ("sh", "-c", f'echo {name} "$@" >> {done}; {script}', name)
            return install.Installer(command, {"PATH": "/usr/bin:/bin"}, follows_overrides)

        def compiling(claims: str, *options: str) -> Any:
            return subprocess.Popen(["sh", "-c", f'echo compiled "$@" >> {done}', "compiling", *options])

        monkeypatch.setattr(install, "with_uv", lambda: None if uv is None else shell("one", uv, True))
        monkeypatch.setattr(install, "with_pip", lambda: shell("other", pip, False))

        def importing() -> Any:
            return subprocess.Popen(["sh", "-c", f"echo imported >> {done}"])

        monkeypatch.setattr(install, "compiling", compiling)
        monkeypatch.setattr(install, "importing", importing)
        monkeypatch.setattr(install, "name_sources_in_ascii", lambda site: None)
        monkeypatch.setattr(install, "PAUSE", 0.05)
        monkeypatch.setattr(install.sys, "prefix", str(tmp_path))
        code = install.main(argv)
        return code, [" ".join(line.split()[:2]) for line in done.read_text().splitlines()]

    return run


def test_the_faster_installer_does_it_where_it_can_and_the_other_else(installed: Installed) -> None:
    code, done = installed("true", "false")
    assert code == 0
    first, second = "one annotated-types>=0.7,<0.8", "one --editable"
    assert sorted(done) == sorted([first, "compiled", second, "imported", "compiled --first"])


def test_without_the_faster_one_the_other_does_it(installed: Installed) -> None:
    code, done = installed(None, "true")
    assert code == 0
    assert [line for line in done if line.startswith("other")][:2] == [
        "other annotated-types>=0.7,<0.8",
        "other --editable",
    ]


def test_where_the_faster_one_fails_the_other_does_it_all(
    installed: Installed, capsys: pytest.CaptureFixture[str]
) -> None:
    code, done = installed("case $1 in --editable) exit 3;; esac", "true")
    assert code == 0
    apart = sys.version_info >= (3, 13)  # dm-control
    assert [line.split()[0] for line in done if line.startswith(("one", "other"))] == ["one"] * 2 + ["other"] * (
        2 + apart
    )
    assert done.count("compiled") == 1
    assert "trying again another way" in capsys.readouterr().out


def test_where_both_fail_the_reason_is_told_and_nothing_more_is_done(
    installed: Installed, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, done = installed("echo error: no such index; exit 1", "echo ERROR: nothing here; sleep 0.2; exit 1")
    assert code == 1
    assert [line.split()[0] for line in done] == ["one", "other"]
    captured = capsys.readouterr()
    assert "Installing: 0 s, " in captured.out
    assert captured.err.splitlines()[-1].strip() == "nothing here"
    assert str(tmp_path / "install.log") in captured.err


def test_a_lock_compiles_nothing(installed: Installed) -> None:
    code, done = installed("true", "false", "--lock", "some.txt")
    assert code == 0
    assert done == ["one --no-deps", "one --no-deps", "imported"]


def test_byte_code_is_written_whatever_the_environment_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setenv("PYTHONPYCACHEPREFIX", str(tmp_path))
    monkeypatch.setattr(install, "IMPORTED", ("mathnavi.interfaces.errors", "this"))
    assert install.importing().wait() == 0
    assert {file.name.partition(".")[0] for file in tmp_path.rglob("*.pyc")} >= {"errors", "this"}


@pytest.mark.parametrize("module", install.IMPORTED)
def test_what_byte_code_is_written_of_is_there(module: str) -> None:
    assert importlib.util.find_spec(module) is not None


@pytest.mark.parametrize("above", ["", "Übung/"])
def test_the_sources_are_found_whatever_the_encoding_of_the_locale(above: str, tmp_path: Path) -> None:
    """Python 3.11 and 3.12 did not start with LC_ALL=C in a folder with an umlaut."""
    site, sources = tmp_path / f"{above}environment/site", tmp_path / f"{above}src"
    site.mkdir(parents=True)
    sources.mkdir()
    (site / "_mathnavi.pth").write_text(str(sources), encoding="utf-8")
    install.name_sources_in_ascii(site, sources)
    named = (site / "_mathnavi.pth").read_text(encoding="ascii")
    assert named == ("../../src" if above else str(sources))
    script = f"import site, sys; site.addsitedir({str(site)!r}); print(ascii(sys.path[-1]))"
    environment = {**os.environ, "LC_ALL": "C"}
    done = subprocess.run([sys.executable, "-Sc", script], capture_output=True, text=True, check=True, env=environment)
    assert ast.literal_eval(done.stdout) == str(sources)
