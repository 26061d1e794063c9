"""A run in the browser: the page opens in Chromium, its scene is drawn, play moves it, and it asks nobody."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from mathnavi.renders.page import document as report_page
from mathnavi.renders.page import figure_block
from mathnavi.renders.palette import COLOURS, SceneElement
from mathnavi.renders.report import write_report
from mathnavi.renders.web.document import document
from mathnavi.renders.web.scene import read_scene
from tests.renders.web.browser import chromium, watched


@pytest.fixture(scope="module")
def page(run_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a flight, as a file."""
    path = tmp_path_factory.mktemp("web") / "page.html"
    path.write_text(document(read_scene(run_dir)))
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


def near(picture: Any, element: SceneElement, within: float = 60.0) -> int:
    """Number of pixels that have about the colour of an element."""
    apart = np.abs(picture.astype(float) - 255.0 * np.array(COLOURS[element])).sum(axis=2)
    return int((apart < within).sum())


def test_a_flight_is_drawn_and_played_without_any_request(page: Path, browser: Any) -> None:
    with watched(browser) as seen:
        seen.open(page.as_uri())
        seen.drawn("player.seek(0.5 * player.scene.duration)")
        seen.until("player.stage && !player.changed")
        picture = seen.picture("#canvas")
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500  # ground, sky, lines: not one colour
        for element in (SceneElement.FLOWN, SceneElement.COMPLETION):
            assert near(picture, element) > 5
        t = float(seen.page.evaluate("player.t"))
        seen.page.click("#play")
        seen.until(f"player.t > {t}")
        seen.page.click("#play")
        assert not seen.page.evaluate("player.playing")
        moved = seen.picture("#canvas")
        assert (moved != picture).any()
        assert seen.requests == [page.as_uri()]
        assert seen.complaints == []


def test_the_scene_of_a_report_is_turned_and_played_from_the_disk_and_leaves_the_wheel_to_the_page(
    run_dir: Path, tmp_path: Path, browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    path = write_report(run_dir).rename(tmp_path / "report.html")
    with watched(browser, 1000, 900) as seen:
        seen.open(path.as_uri())
        seen.until("player.stage && !player.changed")
        seen.page.wait_for_timeout(500.0)  # for the picture of the ground
        picture = seen.picture("#canvas")
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
        for element in (SceneElement.FLOWN, SceneElement.COMPLETION, SceneElement.RADAR):
            assert near(picture, element, 120.0) > 5
        assert seen.page.evaluate("player.t === player.scene.duration")
        distance = seen.page.evaluate("player.orbit.distance")
        seen.page.hover("#canvas")
        seen.page.mouse.wheel(0.0, 100.0)
        seen.until("scrollY > 0")
        assert seen.page.evaluate("player.orbit.distance") == distance
        seen.page.locator("#canvas").click()
        seen.page.mouse.wheel(0.0, 100.0)
        seen.until(f"player.orbit.distance > {distance}")
        seen.page.click("#play")
        seen.until("player.playing && player.t < 0.9 * player.scene.duration")
        assert seen.requests == [path.as_uri()]
        assert seen.complaints == []


def test_cameras_layers_and_charts_answer(page: Path, browser: Any) -> None:
    with watched(browser) as seen:
        seen.open(page.as_uri())
        middle = "player.seek(0.5 * player.scene.duration)"
        seen.drawn(middle)
        with_path = near(seen.picture("#canvas"), SceneElement.FLOWN)
        box = seen.page.locator("#legend label", has_text=SceneElement.FLOWN.value).locator("input")
        box.evaluate("box => box.click()")
        seen.until("!player.changed")
        assert near(seen.picture("#canvas"), SceneElement.FLOWN) < with_path
        before = seen.page.evaluate("player.view.eye")
        seen.drawn("player.choose(player.scene.cameras.find(camera => camera.follow))")
        assert seen.page.evaluate("player.view.eye") != before
        chart = seen.page.locator("#charts canvas").first
        chart.scroll_into_view_if_needed()
        chart.click(position={"x": chart.bounding_box()["width"] - 9.0, "y": 40.0})
        assert seen.page.evaluate("player.t") > 0.9 * seen.page.evaluate("player.scene.duration")
        assert seen.complaints == []


def test_the_page_forbids_every_request_and_hides_no_markup(run_dir: Path) -> None:
    from dataclasses import replace

    scene = replace(read_scene(run_dir), title="</script><img src=x onerror=alert(1)>")
    found = document(scene)
    assert "default-src 'none'" in found
    assert "connect-src" not in found
    assert "<img" not in found
    assert found.count("</script>") == 2


@pytest.mark.usefixtures("laid_out")
def test_a_report_on_a_telephone_keeps_its_letters_and_moves_no_further_than_its_figures(
    tmp_path: Path, browser: Any
) -> None:
    figure = Figure((9.4, 2.6))
    figure.subplots().set_xlabel("time [s]")
    path = tmp_path / "report.html"
    path.write_text(report_page("a report", figure_block(figure, "one", "a figure")))
    with watched(browser, 390, 800) as seen:
        seen.page.goto(path.as_uri())
        assert seen.page.evaluate("document.documentElement.scrollWidth") == 390
        assert seen.page.evaluate("document.querySelector('figure svg').getBoundingClientRect().width") == 640
        seen.page.set_viewport_size({"width": 1280, "height": 800})
        assert seen.page.evaluate("document.querySelector('figure svg').getBoundingClientRect().width") > 900


def test_a_chart_says_its_value_at_the_pointer_and_zooms_to_a_stretch_of_time(page: Path, browser: Any) -> None:
    with watched(browser, 1200, 700) as seen:
        seen.open(page.as_uri())
        seen.until("player.charts[1].range && !player.changed")
        box = seen.page.locator("#charts canvas").nth(1).bounding_box()
        y = box["y"] + 40.0
        places = [
            box["x"] + float(seen.page.evaluate(f"player.charts[1].x({share} * player.scene.duration)"))
            for share in (0.25, 0.5)
        ]
        seen.page.mouse.move(places[1], y)
        wanted = "Number(document.querySelectorAll('#charts figure')[1].querySelector('output').textContent)"
        own, middle = "player.charts[1].chart.series[0]", "0.5 * player.scene.duration"
        seen.until(f"Math.abs({wanted} / {own}.y[{own}.t.findIndex((t) => t > {middle})] - 1) < 0.02")
        seen.page.keyboard.down("Shift")
        seen.page.mouse.move(places[0], y)
        seen.page.mouse.down()
        seen.page.mouse.move(places[1], y)
        seen.page.mouse.up()
        seen.page.keyboard.up("Shift")
        seen.until("player.charts.every((chart) => Math.abs(chart.begin / player.scene.duration - 0.25) < 0.01)")
        seen.until("player.charts.every((chart) => Math.abs(chart.end / player.scene.duration - 0.5) < 0.01)")
        assert seen.page.evaluate("player.t") == 0.0  # it has not gone there
        seen.page.click("#whole")
        seen.until("player.charts.every((chart) => chart.begin === 0 && chart.end === player.scene.duration)")
        assert not seen.page.is_visible("#whole")
        assert seen.complaints == []


def test_the_charts_that_are_chosen_stay_in_the_address(page: Path, browser: Any) -> None:
    visible = (
        "[...document.querySelectorAll('#charts figure:not([hidden]) figcaption')].map((each) => each.firstChild.data)"
    )
    with watched(browser) as seen:
        seen.open(page.as_uri())
        every = seen.page.evaluate(visible)
        assert len(every) > 2
        seen.page.evaluate("document.querySelector('#chosen').open = true")
        seen.drawn("document.querySelector('#chosen input').click()")
        assert seen.page.evaluate(visible) == every[1:]
        address = seen.page.url
        assert "#chart=" in address
        seen.page.goto("about:blank")
        seen.open(address)
        assert seen.page.evaluate(visible) == every[1:]
        seen.page.goto("about:blank")
        seen.open(f"{page.as_uri()}#chart=of+another+run")
        assert seen.page.evaluate(visible) == every
        assert seen.complaints == []


def test_a_camera_of_the_model_looks_along_its_own_axis_from_where_it_is_mounted(page: Path, browser: Any) -> None:
    h = 0.5**0.5
    # In a frame that is turned a quarter to the left, it looks along y of the frame, with z upwards.
    look = f"""player.scene.motions.probe =
            {{ t: [0], pos: [10, 0, 0], quat: [{h}, 0, 0, {h}], shown: [[-1e30, 1e30]] }};
        player.choose({{ target: [0, 0, 0], distance: 1, azimuth: 0, elevation: 0, field_of_view: 90, follow: "probe",
                         behind: 0, tall: 1, span: 0.06, mounted: {{ pos: [1, 0, 0], quat: [{h}, {h}, 0, 0] }} }})"""
    point = """{ const matrix = player.view.matrix, place = [6, 1, 2, 1];
        [0, 1, 3].map((i) => place.reduce((sum, each, k) => sum + matrix[4 * k + i] * each, 0)) }"""
    with watched(browser) as seen:
        seen.open(page.as_uri())
        seen.drawn(look)
        across, up, ahead = seen.page.evaluate(point)
        eye = seen.page.evaluate("player.view.eye")
    np.testing.assert_allclose(eye, [10.0, 1.0, 0.0], atol=1e-5)
    # It looks westwards: a point 4 m ahead and 2 m above is half way up the picture, whose half is 45 degrees.
    np.testing.assert_allclose([ahead, across / ahead, up / ahead], [4.0, 0.0, 0.5], atol=1e-5)


def test_the_bar_of_lengths_is_as_long_as_it_says_and_the_arrow_points_north(page: Path, browser: Any) -> None:
    place = """(x, y) => { const p = player.raised_centre, m = player.view.matrix, q = [p[0] + x, p[1] + y, p[2], 1];
        const c = [0, 1, 3].map((i) => q.reduce((sum, each, k) => sum + m[4 * k + i] * each, 0));
        const { clientWidth: w, clientHeight: h } = document.querySelector('#canvas');
        return [0.5 * w * c[0] / c[2], -0.5 * h * c[1] / c[2]]; }"""
    with watched(browser, 1200, 800) as seen:
        seen.open(page.as_uri())
        seen.drawn("player.choose(player.scene.cameras.find((camera) => camera.name === 'top'))")
        seen.page.evaluate("player.raised_centre = player.orbit.target")
        words = seen.page.locator("#scale em").inner_text()
        metres = float(words.split()[0]) * {"km": 1000.0, "m": 1.0}[words.split()[1]]
        width = float(seen.page.evaluate("parseFloat(document.querySelector('#scale i').style.width)"))
        origin, east = (seen.page.evaluate(f"({place})({x}, 0)") for x in (0, metres))
        assert np.hypot(*np.subtract(east, origin)) == pytest.approx(width, rel=0.02)
        assert "heights ×" in seen.page.locator("#scale b").inner_text()
        seen.drawn("player.orbit.turn(0.5, 0); player.change()")
        north = np.subtract(seen.page.evaluate(f"({place})(0, {metres})"), seen.page.evaluate(f"({place})(0, 0)"))
        angle = float(seen.page.evaluate("parseFloat(document.querySelector('#scale strong').style.rotate)"))
        assert np.arctan2(north[0], -north[1]) == pytest.approx(angle, abs=0.02)
        assert abs(angle) > 0.3


def test_the_open_layers_leave_the_list_of_views_free_on_a_telephone(page: Path, browser: Any) -> None:
    boxes = "['#views', '#legend'].map((each) => document.querySelector(each).getBoundingClientRect().toJSON())"
    with watched(browser, 390, 800) as seen:
        seen.open(page.as_uri())
        assert not seen.page.evaluate("document.querySelector('#legend').open")
        seen.page.evaluate("document.querySelector('#legend').open = true")
        views, legend = seen.page.evaluate(boxes)
        assert legend["top"] >= views["bottom"] or legend["left"] >= views["right"]
        assert seen.page.evaluate("document.documentElement.scrollWidth") == 390
