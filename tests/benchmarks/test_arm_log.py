"""The benchmark of arms reads logs of one's own for the filters that the study of real logs compares."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import arm_log
from mathnavi.sim.logs.recorded_log import RecordedLog
from tests.sim.logs.test_identification import recorded


def test_two_files_are_read_for_the_comparison(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def compare(tune: RecordedLog, tests: list[RecordedLog], *given: Any) -> list[dict[str, Any]]:
        logs = [[float(each["table"].t[-1]) for each in (tune, *tests)]]
        return [{"logs": logs, "given": given}]

    monkeypatch.setattr(arm_log, "compare", compare)
    for name, log in (("a.csv", recorded(0, 2.0)), ("b.csv", recorded(100, 1.0))):
        table = log.channels["table"]
        rows = np.column_stack([table.t, table.values])
        np.savetxt(tmp_path / name, rows, delimiter=",", header="t,q0,q1,i0,i1", comments="")
    found: Any = arm_log.compared(
        arm_log.Arguments(tmp_path / "a.csv", tmp_path / "b.csv", "two-link", "q0,q1", "i0,i1")
    )
    assert found["logs"] == [pytest.approx([1.99, 0.99])]
    assert found["given"] == ("two-link", ["q0", "q1"], ["i0", "i1"], arm_log.Arguments.noise)
