"""Drawing of robots that localise themselves by ranges (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.ranging.overlay import overlay
from mathnavi.renders.ranging.run_data import load_run
from mathnavi.renders.ranging.shot_list import CAMERAS, TURN, annotations_of, highlight, shot_list

drawing = Drawing(
    cameras=CAMERAS,
    still_camera="top",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.ranging.scene:RangingScene", overlay, annotations_of),
    report="mathnavi.renders.ranging.report:report",
    web="mathnavi.renders.ranging.web:web_scene",
    figure="mathnavi.renders.ranging.field_figure:field_figure",
    turn=TURN,
)
