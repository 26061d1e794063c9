"""A file that has changed since a run was recorded is named with both digests, and a run says what it was made of."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from mathnavi.commands.cli import main
from mathnavi.models.mechanism.entity import mechanism_digest
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.records.computing_environment import machine, versions

ARM = """<mujoco>
  <include file="options.xml"/>
  <worldbody><body><joint name="shoulder" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 1" size=".05"/></body>
  </worldbody>
  <actuator><motor joint="shoulder"/></actuator>
</mujoco>"""


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a run of an arm in a file that includes another one, which lies in the current folder."""
    monkeypatch.chdir(tmp_path)
    Path("arm.xml").write_text(ARM)
    Path("options.xml").write_text('<mujoco><option gravity="0 0 -9.81"/></mujoco>')
    assert main(
        ["run", "arm-velocity", "--mechanism", "arm.xml", "--duration", "0.2", "--settled", "0.1", "--out", "run"]
    ) in (0, 1)
    return tmp_path / "run"


def test_it_is_recorded_and_what_changed_is_said_with_both_digests(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = mechanism_digest("arm.xml")
    config = json.loads((run / "config.json").read_text())
    assert config["inputs"] == {"mechanism": before}
    assert config["code"] == code_version()
    assert config["versions"] == {"mathnavi": config["versions"]["mathnavi"], **versions()}
    assert config["machine"] == machine()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert main(["run", "--from", str(run), "--out", "again"]) in (0, 1)  # it is found from any folder
    (tmp_path / "options.xml").write_text('<mujoco><option gravity="0 0 -1"/></mujoco>')
    now = mechanism_digest(str(tmp_path / "arm.xml"))
    capsys.readouterr()
    for words in (
        ["run", "--from", str(run), "--out", "again"],
        ["estimate", "riemannian_observer", str(run), "--out", "estimated"],
        ["render", str(run), "--still"],
        ["report", str(run), "--out", "page.html"],
    ):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert before in said, words
        assert now in said, words
    given = ["--mechanism", str(tmp_path / "arm.xml")]
    assert main(["run", "--from", str(run), *given, "--out", "again"]) in (0, 1)
    assert json.loads(Path("again/config.json").read_text())["inputs"] == {"mechanism": now}


def test_another_environment_is_named(
    run: Path, capsys: pytest.CaptureFixture[str], elsewhere: Callable[[str], None]
) -> None:
    capsys.readouterr()
    elsewhere("9.9")
    assert main(["run", "--from", str(run), "--out", "again"]) in (0, 1)
    assert "was recorded in another environment: numpy" in capsys.readouterr().err
    path = run / "config.json"
    config = json.loads(path.read_text())
    path.write_text(json.dumps(config | {"code": "0.0+f00d"}))
    assert main(["run", "--from", str(run), "--out", "again"]) in (0, 1)
    assert f"recorded by other code, 0.0+f00d; it is now {config['code']}" in capsys.readouterr().err
    for name in ("inputs", "code", "machine"):  # as an earlier version wrote it
        del config[name]
    path.write_text(json.dumps(config))
    assert main(["run", "--from", str(run), "--out", "again"]) in (0, 1)
    assert "without a note of its environment" in capsys.readouterr().err
