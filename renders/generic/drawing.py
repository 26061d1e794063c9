"""Drawing of runs whose scenario defines none (``mathnavi.renders.drawing``): shots, annotations, overlay.

A run with a scene is seen by three cameras, by those of its model, and on the board of its charts; one without has the
board alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

import matplotlib
import numpy as np

from mathnavi.interfaces.checks import is_plain_name
from mathnavi.interfaces.signal_names import name_and_unit
from mathnavi.renders.blitted import Blitted
from mathnavi.renders.drawing import Drawing
from mathnavi.renders.figures import BOUND, STYLE
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.generic.figures import board_figure
from mathnavi.renders.generic.run_data import GenericRun, camera_name, index, load_run
from mathnavi.renders.overlay import Key, Overlay, pace
from mathnavi.renders.painter import SceneDrawing, ScenePainter
from mathnavi.renders.palette import Picture, SceneElement, vehicle_colour
from mathnavi.sim.records.figure_names import SHORTFALL
from mathnavi.sim.records.run_folder import described, read_scene_cameras

BOARD = "board"
SCENE_CAMERAS = ("fixed", "track", "top")
LENGTHS = (6.0, 14.0)  # [s of video] least and most of the whole run
LAST_MOMENT = 2.0  # [s of video] for which its end stays
MOST_ANNOTATED = 8
STATUS_CHANGED = "estimator-status"  # kind of event, whose message begins with the status
TURN = 1.5  # [degrees/s] at which the tracking camera turns
_CUTS = ((0.0, "fixed"), (0.35, "track"), (0.75, "fixed"))  # shares of the run at which the tour changes the camera
MOST_VALUES = 2  # of the state, next to the time
INCHES_HIGH, BRIEF_INCHES = 6.4, 3.3  # of a picture, whatever its pixels, and of one whose letters are large
MOST_ROWS, BRIEF_ROWS = 6, 2


def highlight(run: GenericRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see."""
    return 0.4 * run.duration, 0.7 * run.duration


def annotations_of(run: GenericRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time: the first event of each kind, of a log the first time of
    each status of the estimate, and how the run ended.
    """
    first: dict[str, float] = {}
    for event in run.events:
        kind, message = described(event)
        if run.is_log and event.kind == STATUS_CHANGED:
            kind = f"estimate {message.partition(':')[0]}"
        first.setdefault(kind, event.t)
    shown = [(min(t, run.duration), kind) for kind, t in first.items()][:MOST_ANNOTATED]
    return sorted([*shown, (run.duration, verdict(run))])


def verdict(run: GenericRun) -> str:
    """Return the outcome of the run in a few words; of a log, in which no mission was flown, that of the estimate."""
    if run.is_log:
        status = run.final_status
        return "no estimator has run over this log" if status is None else f"estimate {status.name.lower()} at the end"
    return "mission succeeded" if SHORTFALL not in run.summary else "mission failed"


def short_verdict(run: GenericRun) -> str:
    """Outcome of the run in a word or two, for the panel of numbers."""
    return "succeeded" if SHORTFALL not in run.summary else "failed"


def shot_list(run: GenericRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole run."""
    end, length = run.duration, float(np.clip(run.duration, *LENGTHS))
    if direction != TOUR or run.scene is None:
        camera = BOARD if direction == TOUR else direction
        return consecutive((0.0, end, end), ((camera, length), (camera, LAST_MOMENT)))
    begins = [share * end for share, _ in _CUTS]
    lengths = np.diff([*(share for share, _ in _CUTS), 1.0]) * length
    shots = [(camera, float(part)) for (_, camera), part in zip(_CUTS, lengths, strict=True)]
    return consecutive((*begins, end, end), (*shots, ("fixed", LAST_MOMENT)))


def overlay(run: GenericRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    assert run.scene is not None
    parts = f"{_plain(run.config, 'controller')}, {_plain(run.config, 'estimator')}"
    name, log = next(iter(run.vehicles.items()))
    state = log.x[index(log.t, frame.t)]
    several = len(run.vehicles) > 1
    values = [] if several else [_value(label, value) for label, value in zip(run.states[name], state, strict=True)]
    flown: list[SceneElement | Key] = [SceneElement.PATH]
    if several:
        flown = [Key(each, vehicle_colour(k)) for k, each in enumerate(run.vehicles)]
    return Overlay(
        title=(f"mathnavi · {run.config['scenario']} · seed {run.config['seed']}", parts),
        numbers=(("TIME", f"{frame.t:.2f} s", pace(frame, run.duration)), *values[:MOST_VALUES]),
        state=short_verdict(run) if frame.t >= run.duration else run.status(frame.t),
        legend=[
            *flown,
            *([SceneElement.PLAN] if run.scene.plans else []),
            *([SceneElement.ESTIMATE] if run.scene.has_ghost() else []),
        ],
    )


def _plain(config: object, part: str) -> str:
    """Return the name of a plug-in, only the class for a third-party one."""
    record = config.get(part) if isinstance(config, dict) else None
    name = str(record.get("name", "")) if isinstance(record, dict) else ""
    return name.rpartition(":")[2].rpartition(".")[2]


def _value(label: str, value: float) -> tuple[str, str, str]:
    """A state's name, value and unit: "heading [rad]" is 0.41 rad."""
    name, unit = name_and_unit(label)
    return name, f"{value:.3g}{f' {unit}' if unit else ''}", ""


class Board:
    """The charts of one size, with a line at the time of the picture, beside the plan of a log."""

    def __init__(self, run: GenericRun, width: int, height: int, *, brief: bool) -> None:
        inches = BRIEF_INCHES if brief else INCHES_HIGH
        dpi = height / inches
        figure, plan = board_figure(run, BRIEF_ROWS if brief else MOST_ROWS, brief=brief)
        figure.set_size_inches(width / dpi, inches)
        figure.set_layout_engine("constrained", rect=(0.01, 0.01, 0.98, 0.92))
        figure.set_facecolor("white")
        places = None if plan is None else plan.axes
        self._cursors = [axes.axvline(0.0, color=BOUND, lw=1.2) for axes in figure.axes if axes is not places]
        self._plan = plan
        self._heading = figure.text(0.02, 0.975, "", va="top", size=10.5)
        self._annotation = figure.text(0.98, 0.975, "", va="top", ha="right", size=11.5, weight="bold", color=BOUND)
        moving = () if plan is None else plan.markers
        self._blitted = Blitted(figure, (*self._cursors, *moving, self._heading, self._annotation), dpi)

    def picture(self, t: float, heading: str, annotation: str) -> Picture:
        """Draw the picture (height, width, 3)."""
        for cursor in self._cursors:
            cursor.set_xdata([t, t])
        if self._plan is not None:
            self._plan.show(t)
        self._heading.set_text(heading)
        self._annotation.set_text(annotation)
        return self._blitted.picture()


class GenericPainter:
    """Draws frames of the board, and of the scene where there is one."""

    def __init__(self, run: GenericRun, scene: ScenePainter | None, width: int, height: int) -> None:
        self._run, self._scene, self._size = run, scene, (width, height)

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture (height, width, 3)."""
        if frame.camera != BOARD and self._scene is not None:
            return self._scene.paint(frame)
        if frame.brief:
            return self._brief.picture(frame.t, f"{frame.t:.1f} s", frame.annotation)
        heading = f"mathnavi · {self._run.title} · {frame.t:.2f} s, {pace(frame, self._run.duration)}"
        return self._whole.picture(frame.t, heading, frame.annotation)

    @cached_property
    def _whole(self) -> Board:
        return Board(self._run, *self._size, brief=False)

    @cached_property
    def _brief(self) -> Board:
        return Board(self._run, *self._size, brief=True)


SCENE = SceneDrawing("mathnavi.renders.generic.scene:generic_scene", overlay, annotations_of)


@contextmanager
def painting(run: GenericRun, width: int, height: int, samples: int) -> Iterator[GenericPainter]:
    """Return a painter of pictures of a size in pixels."""
    with matplotlib.rc_context(STYLE):
        if run.scene is None:
            yield GenericPainter(run, None, width, height)
            return
        with SCENE(run, width, height, samples) as scene:
            yield GenericPainter(run, scene, width, height)


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
