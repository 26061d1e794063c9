"""Every script of the examples gallery runs to its end and draws something."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest
from matplotlib import pyplot

SCRIPTS = sorted((Path(__file__).resolve().parents[1] / "examples" / "gallery").glob("plot_*.py"))


@pytest.mark.usefixtures("trials_here")  # tests/sim/sweep has sweeps in child processes
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_script_runs_and_draws(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with mpl.rc_context({"backend": "agg"}):
        pyplot.close("all")
        runpy.run_path(str(script), run_name="__main__")
        drawn = [axes for number in pyplot.get_fignums() for axes in pyplot.figure(number).axes if axes.has_data()]
        pyplot.close("all")
    assert drawn
