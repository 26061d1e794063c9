"""Drawing of missiles (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.missile.overlay import overlay
from mathnavi.renders.missile.run_data import load_run
from mathnavi.renders.missile.shot_list import CAMERAS, TURN, annotations_of, highlight, shot_list
from mathnavi.renders.painter import SceneDrawing

drawing = Drawing(
    cameras=CAMERAS,
    still_camera="side",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.missile.scene:MissileScene", overlay, annotations_of),
    report="mathnavi.renders.missile.report:report",
    web="mathnavi.renders.missile.web:web_scene",
    figure="mathnavi.renders.missile.figures:path_figure",
    turn=TURN,
)
