"""``mathnavi identify``."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mathnavi.commands.cli import main
from tests.sim.logs.test_identification import recorded

FLAGS = ("--mechanism", "two-link", "--position", "q0,q1", "--inputs", "i0,i1")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, log in (("arm.csv", recorded(0)), ("other.csv", recorded(100, 5.0))):
        table = log.channels["table"]
        rows = np.column_stack([table.t, table.values])
        np.savetxt(tmp_path / name, rows, delimiter=",", header="t,q0 [rad],q1 [rad],i0 [A],i1 [A]", comments="")
    return tmp_path


def test_it_prints_and_writes_what_the_log_says_of_the_arm(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", "arm.csv", *FLAGS, "--test", "other.csv", "--out", "found"]) == 0
    printed = capsys.readouterr().out
    assert "other.csv" in printed
    document = json.loads((folder / "found/identified.json").read_text())
    shoulder = document["joints"]["shoulder"]["parameters"]
    assert shoulder["gain"]["value"] == pytest.approx(11.0, rel=0.02)
    assert document["tested"][0]["explained"]["elbow"] > 0.99
    model = mujoco.MjModel.from_xml_path(str(folder / "found/identified.xml"))
    assert model.actuator_gainprm[:, 0] == pytest.approx([11.0, -6.0], rel=0.02)
    assert model.dof_armature == pytest.approx([0.8, 0.3], rel=0.02)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "LOG is missing; allowed: a log, before the flags"),
        (["--mechanism", "two-link"], "LOG is missing; allowed: a log, before the flags"),
        (["nothing.csv", *FLAGS], "nothing.csv does not exist"),
        (["arm.csv", *FLAGS[:-1], "i0,i2"], "it has no signal 'i2'"),
        (["arm.csv", *FLAGS[:-1], "i0"], "has 1 inputs; allowed: 2, of the joints"),
        (["arm.csv", *FLAGS, "--gains", "0"], "--gains"),
        (["arm.csv", "--mechanism", "quadruped", *FLAGS[2:]], "hinges and slides only"),
        (["arm.csv", *FLAGS, "--half-window", "0.001"], "have enough others within 0.001 s"),
    ],
)
def test_what_cannot_be_identified_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    assert main(["identify", *words]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
    assert not (folder / "arm-identified").exists()
