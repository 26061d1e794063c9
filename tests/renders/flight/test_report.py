"""The report stands alone, shows everything the summary says, and lets no text of a run become markup."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.renders import figures, report
from mathnavi.renders.child import DrawingFailedError
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.page import inline_svg, quantity
from mathnavi.renders.report import write_report
from mathnavi.sim.records.figure_names import label
from mathnavi.sim.records.run_folder import described
from tests.renders.reading import Page, check_identifiers, checked_report, lines_named
from tests.renders.synthetic import ridges


@pytest.fixture(scope="module")
def source(run_dir: Path) -> str:
    return checked_report(run_dir)[0]


def test_report_shows_every_key_of_the_summary_and_every_event(source: str, run: FlightRun) -> None:
    words = Page(source).words
    for key in run.summary:
        assert any(label(key)[0] in word for word in words)
    for event in run.events:
        assert described(event)[0] in words


def test_report_shows_the_flight_the_first_plan_and_the_radars_over_the_terrain(source: str, run: FlightRun) -> None:
    (scene,) = Page(source).scenes
    for name, end in (("flown", run.x[-1, :3]), ("first plan, to rest", run.log.plans[0].x[-1, :3])):
        (path,) = lines_named(scene, name)
        np.testing.assert_allclose(path["points"][-1], end, atol=0.1)
    radar = next(k for k, layer in enumerate(scene["layers"]) if layer["name"] == "radar")
    assert sum(surface["layer"] == radar for surface in scene["surfaces"]) == len(run.mission.radars)
    assert [mark["text"] for mark in scene["marks"]][:2] == ["start", "target"]
    assert "Radars weigh on the optimised part of a plan only" in Page(source).text


def test_a_radar_warning_is_given_in_words() -> None:
    assert described(Event(1.0, "vehicle", "message", "radar from radar warning")) == ("radar on", "")
    assert described(Event(1.0, "vehicle", "plan-rejected", "why")) == ("plan rejected", "why")


def test_text_of_a_run_is_escaped(source: str) -> None:
    assert "radar 1 &lt;on&gt; &amp; seen" in source
    assert "<on>" not in source


def test_every_picture_is_described_and_identifiers_are_unique(source: str) -> None:
    page = Page(source)
    assert all(attributes.get("alt") for tag, attributes in page.attributes if tag == "img")
    pictures = [a for tag, a in page.attributes if tag == "svg" or a.get("role") in ("img", "group")]
    assert all(attributes.get("aria-label") for attributes in pictures)
    check_identifiers(source)


def test_with_drawing_switched_off_the_report_of_a_vehicle_that_did_not_arrive_says_both(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Figures have sensible digits, and unknown ones a dash."""
    monkeypatch.setenv("MUJOCO_GL", "disable")
    copy = shutil.copytree(run_dir, tmp_path / "run")
    summary = json.loads((copy / "summary.json").read_text())
    summary |= {
        "arrived": False, "arrival_time_s": None, "min_clearance_m": -3.0, "ground_contacts": 1,
        "tracking_error_max_m": 3e-10, "solve_ms_mean": None, "solve_ms_p50": 0.28123,
        "path_length_m": 76211.3, "deadline_s": 276.43333,
    }  # fmt: skip
    (copy / "summary.json").write_text(json.dumps(summary))
    text = write_report(copy).read_text(encoding="utf-8")
    assert "MUJOCO_GL = disable switches drawing off" in text
    assert "apt-get" not in text
    assert "did not arrive, and came too close to the ground" in text
    title = re.search("<h1>(.*?)</h1>", text)
    assert title is not None
    assert re.search(r": not arrived in [0-9.]+ s; least clearance -3.00 m at [0-9]+ s$", title[1])
    shown = dict(re.findall(r"<tr><th[^>]*>(?:<details[^>]*><summary>)?([^<]*)<.*?<td[^>]*>([^<]*)</td>", text))
    assert shown["deadline"] == "276.4 s"
    assert shown["tracking error max"] == "&lt; 0.001 m"
    assert shown["solve time mean"] == shown["arrival time"] == "–"
    assert shown["solve time p50"] == "0.28 ms"
    assert shown["path length"] == "76,211 m"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"straight_line_m": 1e6, "arrived": True}, True),
        ({"straight_line_m": 1e6, "arrived": False}, False),
        ({"straight_line_m": 1.0, "arrived": True}, False),
    ],
)
def test_a_path_that_is_shorter_than_the_straight_line_is_explained(
    changes: dict[str, object], said: bool, run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    copy = shutil.copytree(run_dir, tmp_path / "run")
    summary = json.loads((copy / "summary.json").read_text()) | changes
    (copy / "summary.json").write_text(json.dumps(summary))
    text = write_report(copy).read_text(encoding="utf-8")
    assert ("which counts as arrival, so its path is shorter than the straight line to the target" in text) is said


def test_a_report_is_written_where_the_process_that_draws_ends(run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*_: object, **__: object) -> Path:
        raise DrawingFailedError("the process that draws ended: no glGetError")

    monkeypatch.setattr(report, "write_still", ended)
    text = write_report(run_dir).read_text(encoding="utf-8")
    assert "No picture of the scene: the process that draws ended: no glGetError." in text


def test_a_figure_that_is_no_number_has_a_dash() -> None:
    assert quantity("solve_ms_mean", math.nan) == "–"


def test_report_of_a_missing_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_report(tmp_path / "nowhere")


def test_terrain_figure_names_the_terrain_and_its_heights() -> None:
    terrain = ridges()
    svg = inline_svg(figures.terrain_figure(terrain), "terrain", "a map")
    assert terrain.name in svg
    assert f"{terrain.z.max():.0f} m" in svg


def test_the_solve_times_that_are_known_get_a_bar_each() -> None:
    assert len(figures.solve_figure({"solve_ms_mean": 0.3, "solve_ms_max": 1.0}).axes[0].patches) == 2
    assert len(figures.solve_figure({}).axes[0].patches) == 0
