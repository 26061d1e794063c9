"""Pictures show something, the vehicle among it, and a video has the size, length and rate asked for."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from pathlib import Path

import av
import numpy as np
import pytest

from mathnavi.renders import video
from mathnavi.renders.film import Frame
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.palette import Picture
from mathnavi.renders.relief import relief, resampled
from mathnavi.renders.video import VIDEO_SAMPLES, write_video
from tests.renders.drawn import differing, draw_apart, draw_here, drawn_apart, needs_opengl
from tests.renders.synthetic import ridges


def test_relief_has_north_on_top_and_light_on_the_north_western_slopes() -> None:
    terrain = ridges()
    picture = relief(terrain, 129).astype(float).mean(axis=-1)
    z = resampled(terrain, 129, order=1)
    assert picture.shape == z.shape
    north, east = np.gradient(z)
    faces_the_light = (east > 0) & (north < 0)  # uphill to the south-east: the slope faces north-west
    faces_away = (east < 0) & (north > 0)
    upright = picture[::-1]
    assert upright[faces_the_light].mean() > upright[faces_away].mean() + 10.0


def test_resampling_on_the_grids_own_nodes_changes_nothing() -> None:
    terrain = ridges(33)
    np.testing.assert_allclose(resampled(terrain, 33, order=1), terrain.z)


@needs_opengl
def test_vehicle_is_where_it_should_be_and_nothing_else_moves_with_it(run_dir: Path, tmp_path: Path) -> None:
    pictures = drawn_apart("flight", tmp_path, run_dir)
    for camera in ("chase", "overview", "top"):
        shown = pictures[f"{camera}.with"].astype(int)
        assert shown.std() > 15.0
        column, row, depth = pictures[f"{camera}.pixels"][0]
        assert depth > 0.0
        assert 0 < column < 320
        assert 0 < row < 180
        without = pictures[f"{camera}.without.vehicle"]
        rows, columns = differing(shown, without, 8)
        assert len(rows) > 20
        assert np.hypot(rows - row, columns - column).max() < 40  # all that changed is near the vehicle
        if camera != "chase":  # it sits on the tip of its path
            assert np.hypot(rows.mean() - row, columns.mean() - column) < 2.0
        assert (pictures[f"{camera}.earlier"] != without).mean() > 0.001


@needs_opengl
def test_video_has_the_size_rate_and_length_asked_for_and_the_same_pictures_whichever_process_draws_them(
    run_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shots: list[tuple[Frame, Picture]] = []

    def recorded(directory: Path, frames: Sequence[Frame], *size: int) -> Generator[Picture]:
        for shot in zip(frames, draw_apart(directory, frames, *size), strict=True):
            shots.append(shot)
            yield shot[1]

    monkeypatch.setattr(video, "draw", recorded)
    path = write_video(run_dir, path=tmp_path / "short.mp4", width=160, height=90, fps=1, progress=False)
    assert [file.name for file in tmp_path.iterdir()] == ["short.mp4"]
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert stream.codec_context.name == "h264"
        assert (stream.width, stream.height) == (160, 90)
        assert stream.average_rate == 1
    assert 15 <= len(pictures) <= 25
    assert min(picture.std() for picture in pictures) > 10.0
    here = draw_here(run_dir, [frame for frame, _ in shots[::4]], 160, 90, VIDEO_SAMPLES)
    np.testing.assert_array_equal(list(here), [picture for _, picture in shots[::4]])


def test_odd_sizes_and_missing_runs_are_refused_before_anything_is_written(run_dir: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="161 x 90"):
        write_video(run_dir, path=tmp_path / "video.mp4", width=161, height=90)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_video(tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == []


@needs_opengl
def test_failure_of_the_process_that_draws_is_reported_in_its_own_words(run: FlightRun, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="does not exist"):
        next(iter(draw_apart(tmp_path / "gone", [Frame(0.0, "top", 0.0, 0.0)], 64, 36, 0)))
