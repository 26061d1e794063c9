"""Drawing of flights of aerial vehicles (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.flight.overlay import overlay
from mathnavi.renders.flight.run_data import load_run
from mathnavi.renders.flight.shot_list import CAMERAS, TURN, annotations_of, highlight, shot_list
from mathnavi.renders.painter import SceneDrawing

drawing = Drawing(
    cameras=CAMERAS,
    still_camera="overview",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.flight.scene:FlightScene", overlay, annotations_of),
    report="mathnavi.renders.flight.report:report",
    figure="mathnavi.renders.flight.figures:map_figure",
    web="mathnavi.renders.flight.web:web_scene",
    turn=TURN,
)
