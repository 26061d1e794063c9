"""Drawing of textbook systems (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.textbook.painter import painting
from mathnavi.renders.textbook.run_data import load_run
from mathnavi.renders.textbook.shot_list import CAMERAS, annotations_of, highlight, shot_list

drawing = Drawing(
    cameras=CAMERAS,
    still_camera=CAMERAS[0],
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=painting,
    report="mathnavi.renders.textbook.report:report",
    figure="mathnavi.renders.textbook.report:panel_figure",
)
