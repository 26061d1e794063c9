"""Texts on a picture are beside what they name, and a legend shows what is drawn."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.film import Frame
from mathnavi.renders.flight.drawing import overlay
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.overlay import RING_COLOURS, Label, Overlay, OverlayWriter
from mathnavi.renders.palette import SceneElement

GREY = np.full((360, 640, 3), 128, np.uint8)


def written(*labels: Label, legend: tuple[SceneElement, ...] = (SceneElement.FLOWN,)) -> np.ndarray:
    overlay = Overlay(["title"], [("TIME", "1 s", "")], "", legend)
    return OverlayWriter(640, 360).write(GREY, overlay, labels=labels).astype(int)


def changed(label: Label) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that a label makes another colour."""
    return np.nonzero(np.abs(written(label) - written()).max(axis=-1) > 0)


def test_a_label_beside_its_place_leaves_free_what_is_above_it() -> None:
    rows, columns = changed(Label("target", 400.0, 180.0, beside=True))
    assert columns.min() > 400
    assert abs(rows.mean() - 180.0) < 4.0
    rows, _ = changed(Label("target", 400.0, 180.0))
    assert rows.max() < 180


def test_a_label_stays_in_the_picture() -> None:
    for beside in (False, True):
        _, columns = changed(Label("target", 639.0, 180.0, beside=beside))
        assert columns.max() < 639
        assert len(columns) == len(changed(Label("target", 320.0, 180.0, beside=beside))[0])


def test_a_target_has_its_rings_in_the_legend() -> None:
    shown = written(legend=(SceneElement.TARGET,))
    for colour in RING_COLOURS:
        assert (np.abs(shown - colour).max(axis=-1) < 12).sum() >= 10


def test_a_flight_among_radars_says_what_they_bind(run: FlightRun) -> None:
    assert run.mission.radars
    for camera in ("chase", "overview"):
        said = overlay(run, Frame(0.5 * run.duration, camera, 0.0, 1.0))
        assert any("radars" in line and "not on the completion path" in line for line in said.title)


def test_at_its_end_a_flight_has_arrived(run: FlightRun) -> None:
    assert overlay(run, Frame(run.duration, "overview", 0.0, 0.0)).state == "arrived"


def test_what_is_being_done_stays_in_its_panel() -> None:
    def widest(state: str) -> int:
        overlay = Overlay(["title"], [("TIME", "1 s", "")], state, (SceneElement.FLOWN,))
        changed = (
            np.abs(OverlayWriter(640, 360).write(GREY, overlay)[-180:-15, :320].astype(int) - 128).max(axis=-1) > 100
        )
        return int(np.nonzero(changed)[1].max())  # of the letters, which are white

    assert widest("mission failed, for a reason that takes a whole line") < 138


def test_no_name_covers_what_is_written() -> None:
    """A name moves off the annotation, off other names and off panels; one deep within a panel is left out."""
    overlay = Overlay(["title"], [("TIME", "1 s", "")], "arrived", (SceneElement.FLOWN,))

    def shown(*labels: Label) -> np.ndarray:
        return OverlayWriter(640, 360).write(GREY, overlay, "arrived", labels=labels).astype(int)

    places = [(320.0, 53.0), (320.0, 46.0), (318.0, 200.0), (326.0, 204.0), (60.0, 335.0), (600.0, 335.0)]
    labels = [Label("radar", column, row) for column, row in places]
    added = [np.abs(shown(each) - shown()).max(axis=-1) > 0 for each in labels]
    assert [bool(each.any()) for each in added] == [True, True, True, True, False, True]
    covered = np.abs(shown() - GREY).max(axis=-1) > 0
    for own, (_, row) in zip(added, places, strict=True):
        assert not (own & covered).any()
        assert not own.any() or abs(np.nonzero(own)[0].mean() + 10.0 - row) <= 30.0  # near its place
    both = np.abs(shown(labels[2], labels[3]) - shown()).max(axis=-1) > 0
    assert both.sum() > 1.9 * added[2].sum()  # each whole, beside the other
