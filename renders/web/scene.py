"""The scene in the browser of the run in a folder, by its drawing, and the charts of its log."""

from __future__ import annotations

import pkgutil
from dataclasses import replace
from pathlib import Path

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.generic.run_data import load_run
from mathnavi.renders.generic.scene import generic_scene
from mathnavi.renders.scene.charts import (
    error_charts,
    estimate_charts,
    events_of,
    facts_of,
    figure_charts,
    input_charts,
    reading_charts,
    state_charts,
)
from mathnavi.renders.scene.elements import Scene


def read_scene(folder: Path) -> Scene:
    """Return the scene of a run.

    Raises:
        FileNotFoundError: something is missing.
        RunFolderError: something is broken.
        NothingToDrawError: the run ended at its first sample.
        UntrustedError: the folder names code that is not installed.
    """
    drawing = drawing_of(folder)
    run = load_run(folder)
    own = generic_scene(run) if drawing.web is None else pkgutil.resolve_name(drawing.web)(drawing.load_run(folder))
    charts = [*own.charts, *error_charts(run)]
    if not own.charts:
        first, last = [*estimate_charts(run), *state_charts(run)], [*input_charts(run), *reading_charts(run)]
        charts = [*first, *charts, *figure_charts(run), *last]
    return replace(own, charts=charts, events=events_of(run), facts=facts_of(run))
