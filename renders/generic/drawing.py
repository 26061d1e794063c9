"""Drawing of runs whose scenario defines none (``mathnavi.renders.drawing``).

A run with a scene is seen by three cameras, by those of its model, and on the board of its charts; one without has the
board alone.
"""

from __future__ import annotations

from pathlib import Path

from mathnavi.interfaces.checks import is_plain_name
from mathnavi.renders.drawing import Drawing
from mathnavi.renders.generic.board import painting
from mathnavi.renders.generic.run_data import GenericRun, load_run
from mathnavi.renders.generic.shot_list import (
    BOARD,
    SCENE_CAMERAS,
    TURN,
    annotations_of,
    camera_name,
    highlight,
    shot_list,
)
from mathnavi.sim.records.run_folder import read_scene_cameras


def drawing_for(folder: Path) -> Drawing[GenericRun]:
    """The drawing of the run in a folder."""
    own = read_scene_cameras(folder)
    named = () if own is None else tuple(name for name in map(camera_name, own) if is_plain_name(name))
    return Drawing(
        cameras=(BOARD,) if own is None else tuple(dict.fromkeys((*SCENE_CAMERAS, *named, BOARD))),
        still_camera=BOARD if own is None else SCENE_CAMERAS[0],
        load_run=load_run,
        shot_list=shot_list,
        highlight=highlight,
        annotations=annotations_of,
        painter=painting,
        report="mathnavi.renders.generic.report:report",
        figure="mathnavi.renders.generic.report:at_a_glance",
        turn=TURN,
    )
