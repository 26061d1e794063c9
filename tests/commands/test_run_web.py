"""``mathnavi run --web``: a page follows the run, its sliders change the fields, and the run can be flown again."""

from __future__ import annotations

import json
import threading
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.command_line import read_command_line
from mathnavi.commands.errors import BadInputError
from mathnavi.commands.run import RunOptions, fly
from mathnavi.commands.run_web import FollowedRun, changed_config, followed
from mathnavi.sim.engine.loop import Loop
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunData
from mathnavi.sim.scenarios.flight_fields import SafeFlightConfig
from tests.renders.web.browser import chromium, watched

ROBOT = ("range-localisation", "--duration", "1.0", "--sensors", "0", "90")
MISSION = {"start": [1000.0, 2000.0, 500.0], "target": [9000.0, 8000.0, 600.0]}
VALUES = {
    "radar_east": 5.0, "radar_north": 4.0, "radar_radius": 1.5,
    "target_east": 7.0, "target_north": 3.0, "gust_rms": 0.5,
}  # fmt: skip


def spec_of(*words: str) -> RunSpec:
    return read_command_line("run", words, RunOptions).spec


def asked(url: str, posted: object = None) -> Any:
    """Answer of a server."""
    data = None if posted is None else json.dumps(posted).encode()
    headers = {"Content-Type": "application/json"}
    with urllib.request.urlopen(urllib.request.Request(url, data, headers), timeout=60.0) as answer:
        text = answer.read().decode()
    return text if text.startswith("<!doctype") else json.loads(text)


def flown(run: FollowedRun, wanted: RunSpec) -> RunData:
    return run.fly(wanted.build(), lambda loop, watch: fly(loop, lambda t, duration: None, watch=watch))


def test_a_page_that_follows_a_run_gets_all_of_it_and_changes_nothing() -> None:
    wanted = spec_of(*ROBOT)
    with followed(wanted, "127.0.0.1", 0) as run:
        assert "being prepared" in asked(run.url)
        results: list[RunData] = []
        thread = threading.Thread(target=lambda: results.append(flown(run, wanted)))
        thread.start()
        t: list[float] = []
        pos: list[float] = []
        seen = 0
        while True:
            alive = thread.is_alive()
            news = asked(f"{run.url}news?since={seen}")
            seen = news["next"] or seen
            t += news["t"]
            if news["t"]:
                pos += next(iter(news["motions"].values()))[0]
            if not alive:
                break
        page = asked(run.url)
        assert "connect-src 'self'" in page
    recording = results[0].recording
    assert np.array_equal(t, recording.t[np.searchsorted(recording.t, t)])
    assert np.diff(t).max() < 0.1
    places = np.array(pos).reshape(-1, 3)[:, :2]
    truth = recording.truths["robot"][np.searchsorted(recording.t, t), :2]
    assert np.abs(places - truth).max() < 1e-3
    alone = wanted.build().run().recording
    assert np.array_equal(alone.truths["robot"], recording.truths["robot"])


def test_the_page_that_follows_a_run_is_drawn_in_a_browser() -> None:
    wanted = spec_of(*ROBOT)
    with chromium() as browser, followed(wanted, "127.0.0.1", 0) as run, watched(browser) as seen:
        flown(run, wanted)
        seen.open(run.url)
        seen.until("player.live.next > 10 && !player.changed")
        assert len(np.unique(seen.picture("#canvas").reshape(-1, 3), axis=0)) > 100
        assert seen.page.locator("#controls input").count() == 1  # the pace
        assert all(url.startswith(run.url) for url in seen.requests)
        assert seen.complaints == []


def test_sliders_change_fields_from_now_on() -> None:
    before = SafeFlightConfig()
    radar = changed_config(before, MISSION, VALUES, {"radar_east"}, 12.0)
    assert (radar.radar, radar.radar_time) == (((5000.0, 4000.0, 1500.0, 5.0),), 12.0)
    assert (radar.start, radar.target) == ((1000.0, 2000.0, 500.0), (9000.0, 8000.0, 600.0))
    gone = changed_config(radar, MISSION, VALUES | {"radar_radius": 0.0}, {"radar_radius"}, 20.0)
    assert (gone.radar, gone.radar_time) == ((), 0.0)
    moved = changed_config(before, MISSION, VALUES, {"target_north"}, 10.0)
    assert moved.target_path == ((10.0, 9000.0, 8000.0, 600.0), (40.0, 7000.0, 3000.0, 600.0))
    again = changed_config(moved, MISSION, VALUES | {"target_east": 6.0}, {"target_east"}, 25.0)
    assert again.target_path[:2] == ((10.0, 9000.0, 8000.0, 600.0), (25.0, 8000.0, 5500.0, 600.0))
    assert again.target_path[2] == (55.0, 6000.0, 3000.0, 600.0)
    windy = changed_config(before, MISSION, VALUES, {"gust_rms"}, 3.0)
    assert windy.faults == replace(before.faults, gust_rms=0.5)


def test_a_run_in_which_sliders_were_moved_is_flown_again_from_its_folder(tmp_path: Path) -> None:
    words = ("--drawn-separation", "0.25", "0.3", "--drawn-heights", "1", "15", "--planner.grid-nodes", "17")
    wanted = spec_of("safe-flight", "--terrain", "canyon:3", "--seed", "3", *words)
    run, moved = FollowedRun(wanted), iter(({"radar_radius": 0.05}, {"target_east": 0.35}))

    def simulate(closed_loop: ClosedLoop, watch: Callable[[Loop], None]) -> RunData:
        run.change({"pace": 20.0})

        def moving(loop: Loop) -> None:
            if loop.t > 1.0 and (change := next(moved, None)):
                run.change(change)
            watch(loop)

        return fly(closed_loop, lambda t, duration: None, watch=moving)

    first, again = tmp_path / "first", tmp_path / "again"
    run.fly(wanted.build(), simulate).write(first)
    fields = json.loads((first / "config.json").read_text())["fields"]
    assert fields["radar"][0][2] == 50.0
    assert fields["target_path"][-1][1] == 350.0
    assert main(["run", "--from", str(first), "--out", str(again)]) in (0, 1)
    for name in ("log.npz", "events.jsonl"):
        assert (first / name).read_bytes() == (again / name).read_bytes()


@pytest.mark.parametrize("posted", [[1], {"pace": 1e9}, {"pace": True}, {"pace": "1"}, {"no_such": 1.0}, {"paused": 1}])
def test_what_is_no_value_of_a_slider_is_refused(posted: object) -> None:
    run = FollowedRun(spec_of(*ROBOT))
    with pytest.raises(ValueError, match="allowed"):
        run.change(posted)


def test_an_address_needs_web_and_the_port_must_be_free(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", *ROBOT, "--port", "0", "--out", str(tmp_path / "run")]) == 2
    assert "--port = 0; allowed: only together with --web" in capsys.readouterr().err
    with followed(spec_of(*ROBOT), "127.0.0.1", 0) as run:
        port = run.url.rpartition(":")[2].rstrip("/")
        with pytest.raises(BadInputError, match=f"--port = {port}"), followed(spec_of(*ROBOT), "127.0.0.1", int(port)):
            pass
