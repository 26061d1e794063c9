"""How the runs of a scenario are drawn: a module that config.json names, with a ``Drawing`` called ``drawing``.

A run that names none is a flight. A stranger's scenario names a module of its own, "drawing": "my_package.pictures".
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, checked_camera, frames_of
from mathnavi.renders.palette import Picture
from mathnavi.sim.interfaces.errors import RunFolderError
from mathnavi.sim.records.former_names import present_name
from mathnavi.sim.records.run_folder import CONFIG, existing_folder, read_run_document

if TYPE_CHECKING:  # what makes pages takes a while to import, and the processes that draw make none
    from mathnavi.renders.page import Markup

FLIGHT = "mathnavi.renders.flight.drawing"

R = TypeVar("R")


class Painter(Protocol):
    """Draws frames of one run in one size."""

    def paint(self, frame: Frame) -> Picture:
        """The picture of a frame."""
        ...


@dataclass(frozen=True)
class Drawing(Generic[R]):
    """Everything that videos, stills, clips and reports need to know of the runs of a scenario.

    ``R`` is the type of a run as it is drawn; it has a ``duration`` [s].
    """

    cameras: Sequence[str]
    still_camera: str  # of a still, unless another is asked for
    load_run: Callable[[Path], R]  # FileNotFoundError where something is missing, RunFolderError where it is broken
    shot_list: Callable[[R, str], Sequence[Shot]]  # of a run and one of the cameras, or TOUR
    highlight: Callable[[R], tuple[float, float]]  # between which times [s] there is most to see
    annotations: Callable[[R], Sequence[Annotation]]  # in order of time
    painter: Callable[[R, int, int, int], AbstractContextManager[Painter]]  # run, width, height [pixels], samples
    report: str  # "package.module:function" that makes a page of a run; its libraries take a while to import
    turn: float = 0.0  # [degrees/s of video] at which the cameras that turn do

    def frames(self, run: R, direction: str = TOUR, fps: int = 24) -> list[Frame]:
        """The frames of a video by one of the cameras or of the tour; ValueError for another direction."""
        if direction != TOUR:
            checked_camera(direction, self.cameras)
        return frames_of(self.shot_list(run, direction), self.annotations(run), fps, self.turn)

    def page(self, run: R) -> Markup:
        """The run on one page."""
        report: Callable[[R], Markup] = pkgutil.resolve_name(self.report)
        return report(run)


def drawing_of(directory: str | Path) -> Drawing[Any]:
    """The drawing of the run in a folder; errors as of ``Drawing.load_run``."""
    path = existing_folder(directory) / CONFIG
    document, _ = read_run_document(existing_folder(directory))
    name = FLIGHT if document.drawing is None else document.drawing
    try:
        module = importlib.import_module(present_name(name))
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        raise RunFolderError(f"{str(path)!r}: drawing = {name!r} cannot be imported: {error}") from None
    drawing = getattr(module, "drawing", None)
    if not isinstance(drawing, Drawing):
        raise RunFolderError(
            f"{str(path)!r}: drawing = {name!r} lacks `drawing`; allowed: a module in which that is a "
            f"{Drawing.__module__}.{Drawing.__name__}"
        )
    return drawing
