"""Drawing of flights of quadrotors (``mathnavi.renders.drawing``)."""

from __future__ import annotations

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.quadrotor.overlay import overlay
from mathnavi.renders.quadrotor.run_data import load_run
from mathnavi.renders.quadrotor.shot_list import CAMERAS, TURN, annotations_of, highlight, shot_list

drawing = Drawing(
    cameras=CAMERAS,
    still_camera="chase",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.quadrotor.scene:QuadrotorScene", overlay, annotations_of),
    report="mathnavi.renders.quadrotor.report:report",
    web="mathnavi.renders.quadrotor.web:web_scene",
    figure="mathnavi.renders.quadrotor.figures:clearance_figure",
    turn=TURN,
)
