"""How the runs of a scenario are drawn: a module that config.json names, with the parts of ``Drawing``.

A run that names none is a flight. A stranger's scenario names a module of its own, "drawing": "my_package.pictures".
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mathnavi.renders.film import Frame
from mathnavi.renders.palette import Picture
from mathnavi.sim.records.former_names import present_name
from mathnavi.sim.records.run_log import existing_folder, read_json

if TYPE_CHECKING:  # what makes pages takes a while to import, and the processes that draw make none
    from mathnavi.renders.page import Markup

FLIGHT = "mathnavi.renders.flight.drawing"
TOUR = "tour"  # the direction that cuts between the cameras
PARTS = ("cameras", "still_camera", "load_run", "storyboard", "highlight", "notices", "painter", "report")


class Painter(Protocol):
    """Draws frames of one run in one size."""

    def paint(self, frame: Frame) -> Picture:
        """The picture of a frame."""
        ...


class Drawing(Protocol):
    """A module that draws; ``run`` is what its own ``load_run`` returns."""

    cameras: Sequence[str]
    still_camera: str  # of a still, unless another is asked for

    def load_run(self, directory: Path) -> Any:
        """The run; FileNotFoundError where something is missing, ValueError where something is broken."""
        ...

    def storyboard(self, run: Any, direction: str, fps: int) -> list[Frame]:
        """The frames of a video by one of the cameras, or of the tour; ValueError for another word."""
        ...

    def highlight(self, run: Any) -> tuple[float, float]:
        """Between which times [s] there is most to see."""
        ...

    def notices(self, run: Any) -> list[tuple[float, str]]:
        """(time [s], text) of what a viewer should be told, in order of time."""
        ...

    def painter(self, run: Any, width: int, height: int, samples: int) -> AbstractContextManager[Painter]:
        """What draws; made in a process of its own, where OpenGL has been chosen."""
        ...

    def report(self, run: Any) -> Markup:
        """The run on one page."""
        ...


def drawing_of(directory: str | Path) -> Drawing:
    """What draws the run in a folder; errors as of ``load_run``."""
    path = existing_folder(directory) / "config.json"
    name = read_json(path).get("drawing", FLIGHT)
    try:
        drawing: Any = importlib.import_module(present_name(name))
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{str(path)!r}: drawing = {name!r} cannot be imported: {error}") from None
    if missing := [part for part in PARTS if not hasattr(drawing, part)]:
        raise ValueError(f"{str(path)!r}: drawing = {name!r} lacks {', '.join(missing)}; allowed: {', '.join(PARTS)}")
    found: Drawing = drawing
    return found


def checked_camera(camera: str, cameras: Sequence[str]) -> str:
    """The camera, if it is one of these; ValueError names them."""
    if camera not in cameras:
        raise ValueError(f"camera = {camera!r}; allowed: {', '.join(cameras)}")
    return camera
