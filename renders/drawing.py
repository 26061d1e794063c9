"""Drawing of the runs of a scenario: a module that config.json names, with a ``Drawing`` called ``drawing``.

A run that names none is a flight if it has a terrain; any other is drawn by its scene and its log alone
(``mathnavi.renders.generic``). A scenario names an entry point of the group ``mathnavi.drawings``, by its name or
its module, "drawing": "my_package.pictures". A module that is not installed in this way is imported for a folder only
if the folder is trusted (``mathnavi.sim.plugin.trust``), or if the run was flown by this process.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from mathnavi.interfaces.checks import plain_name
from mathnavi.interfaces.entry_points import named as named_point
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.failures import failures_named
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, checked_camera, frames_of
from mathnavi.renders.palette import Picture
from mathnavi.sim.plugin.groups import installed
from mathnavi.sim.plugin.trust import check_place
from mathnavi.sim.records.run_folder import CONFIG, existing_folder, read_run_document

if TYPE_CHECKING:  # the modules of pages take a while to import, and drawing processes do not need them
    from mathnavi.renders.page import Markup

FLIGHT = "mathnavi.renders.flight.drawing"
GENERIC = "mathnavi.renders.generic.drawing:drawing_for"  # which makes the drawing of a folder
CALLS = ("load_run", "shot_list", "highlight", "annotations")  # the functions of a drawing that this process calls

R = TypeVar("R")


class Painter(Protocol):
    """Painter of frames of one run in one size."""

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture of a frame."""
        ...


@dataclass(frozen=True)
class Drawing(Generic[R]):
    """Drawing of the runs of a scenario: all that videos, stills, clips and reports need.

    ``R`` is the type of a run for drawing; it has a ``duration`` [s].
    """

    cameras: Sequence[str]
    still_camera: str  # of a still, unless another is asked for
    load_run: Callable[[Path], R]  # FileNotFoundError where something is missing, RunFolderError where it is broken
    shot_list: Callable[[R, str], Sequence[Shot]]  # of a run and one of the cameras, or TOUR
    highlight: Callable[[R], tuple[float, float]]  # between which times [s] there is most to see
    annotations: Callable[[R], Sequence[Annotation]]  # in order of time
    painter: Callable[[R, int, int, int], AbstractContextManager[Painter]]  # run, width, height [pixels], samples
    report: str | Callable[[R], Markup]  # makes a page; "package.module:function" where its libraries import slowly
    turn: float = 0.0  # [degrees/s of video] at which the cameras that turn do
    figure: str | None = None  # "package.module:function" that makes one Figure of a run; its signals without
    web: str | None = None  # the same for the scene of a run in the browser; its recorded scene and its log without

    def __post_init__(self) -> None:
        for camera in (*self.cameras, self.still_camera):  # each is the name of a file
            plain_name(camera, "camera")

    def frames(self, run: R, direction: str = TOUR, fps: float = 24.0) -> list[Frame]:
        """Return the frames of a video by one of the cameras or of the tour; ValueError for another direction."""
        if direction != TOUR:
            checked_camera(direction, self.cameras)
        return frames_of(self.shot_list(run, direction), self.annotations(run), fps, self.turn)

    def page(self, run: R) -> Markup:
        """Return the page of the run."""
        return _report_at(self.report)(run)


def drawing_of(directory: str | Path) -> Drawing[Any]:
    """Return drawing of the run in a folder; errors as of ``Drawing.load_run``, UntrustedError for untrusted code."""
    folder = existing_folder(directory)
    document, _ = read_run_document(folder)
    if document.drawing is None and document.terrain is None and "terrain" not in document.fields:
        made: Drawing[Any] = pkgutil.resolve_name(GENERIC)(folder)
        return made
    return _drawing_at(FLIGHT if document.drawing is None else document.drawing, str(folder / CONFIG))


def _drawing_at(name: str, where: str) -> Drawing[Any]:
    """Return the drawing with a name, or in a module; RunFolderError if none exists."""
    subject = f"{where!r}: drawing = {name!r}"
    point = named_point(installed("drawings"), "drawings", name)
    place = name if point is None else point.value
    check_place(place, f"{where!r}: drawing")
    with failures_named(f"{subject} cannot be imported:", RunFolderError):
        drawing = getattr(importlib.import_module(place), "drawing", None)
    if not isinstance(drawing, Drawing):
        raise RunFolderError(
            f"{subject} lacks `drawing`; allowed: a module in which that is a {Drawing.__module__}.{Drawing.__name__}"
        )
    return drawing if place.startswith("mathnavi.") else _naming_failures(drawing, subject)


def _naming_failures(drawing: Drawing[Any], subject: str) -> Drawing[Any]:
    """Wrap a third-party drawing: exceptions except ValueError and OSError become a RunFolderError that names it."""

    def named(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def call_named(*arguments: Any) -> Any:
            with failures_named(f"{subject}: {name}() failed:", RunFolderError, (ValueError, OSError)):
                return call(*arguments)

        return call_named

    checked: dict[str, Any] = {name: named(name, getattr(drawing, name)) for name in CALLS}
    return replace(drawing, **checked, report=named("report", lambda run: _report_at(drawing.report)(run)))


def _report_at(place: str | Callable[[R], Markup]) -> Callable[[R], Markup]:
    report: Callable[[R], Markup] = pkgutil.resolve_name(place) if isinstance(place, str) else place
    return report
