"""Drawing of mechanisms and points on curved spaces, with their velocity observers (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.lagrangian.painter import painting
from mathnavi.renders.lagrangian.run_data import load_run
from mathnavi.renders.lagrangian.shot_list import CAMERAS, annotations_of, highlight, shot_list

drawing = Drawing(
    cameras=CAMERAS,
    still_camera=CAMERAS[0],
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=painting,
    report="mathnavi.renders.lagrangian.report:report",
    web="mathnavi.renders.lagrangian.web:web_scene",
    figure="mathnavi.renders.lagrangian.figures:velocity_figure",
)
