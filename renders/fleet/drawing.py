"""Drawing of fleets of aerial vehicles (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.fleet.overlay import overlay
from mathnavi.renders.fleet.run_data import load_run
from mathnavi.renders.fleet.shot_list import CAMERAS, TURN, annotations_of, highlight, shot_list
from mathnavi.renders.painter import SceneDrawing

drawing = Drawing(
    cameras=CAMERAS,
    still_camera="overview",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.fleet.scene:FleetScene", overlay, annotations_of),
    report="mathnavi.renders.fleet.report:report",
    web="mathnavi.renders.fleet.web:web_scene",
    figure="mathnavi.renders.fleet.figures:map_figure",
    turn=TURN,
)
