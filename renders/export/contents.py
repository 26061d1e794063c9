"""Contents of an exported run: the scene of its page, and its log as channels, whatever the format of the file.

Other viewers draw meshes, polylines and points, and keep each until it is replaced. So a surface is a
mesh with normals; a line that grows, shrinks or changes is a sequence of moments at each of which it is drawn again.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.reading.files import read_text
from mathnavi.interfaces.signals import Array, Event
from mathnavi.renders.generic.run_data import load_run
from mathnavi.renders.scene.bodies import grid_faces
from mathnavi.renders.scene.elements import INK_COLOUR, Chart, Lines, Mark, Motion, Scene, Surface
from mathnavi.renders.scene.ground import ground_surfaces
from mathnavi.renders.web.scene import read_scene
from mathnavi.sim.records.log_channels import Channel, channels_of
from mathnavi.sim.records.run_folder import ARRAY_INDEX, CONFIG, SUMMARY, read_activation_names

MOST_MOMENTS = 200  # of a line that grows or shrinks with time
PAINTED = 129  # nodes along a side of a picture that lies on a flat surface
DOCUMENTS = (CONFIG, SUMMARY, ARRAY_INDEX)  # texts of the folder that go along


@dataclass(frozen=True, eq=False)
class ExportedRun:
    """A run with all that is written of it."""

    scene: Scene  # its ground is among its surfaces
    channels: Sequence[Channel]
    events: Sequence[Event]  # in order of time
    config: Mapping[str, Any]
    documents: Mapping[str, str]  # texts by the names of their files


def read_run(folder: Path) -> ExportedRun:
    """Read the run in a folder; errors as of ``mathnavi.renders.web.scene.read_scene``."""
    scene, run = read_scene(folder), load_run(folder)
    channels = channels_of(run.vehicles, run.signals, read_activation_names(folder))
    documents = {name: read_text(folder / name, RunFolderError) for name in DOCUMENTS}
    return ExportedRun(scene, channels, run.events, run.config, documents)


# ---- charts


def chart_names(charts: Sequence[Chart]) -> list[str]:
    """Return a name of each chart that no other one has: its title, with the unit where titles are the same."""
    titles = Counter(chart.title for chart in charts)
    named = [
        f"{chart.title} ({chart.unit.replace('/', ' per ')})" if titles[chart.title] > 1 and chart.unit else chart.title
        for chart in charts
    ]
    seen: Counter[str] = Counter()
    found = []
    for name in named:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} {seen[name]}")
    return found


# ---- surfaces


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles as a viewer takes them."""

    vertices: Array  # (m, 3) [m]
    normals: Array  # (m, 3)
    faces: NDArray[np.int64]  # (f, 3)
    colours: NDArray[np.uint8] | None  # (m, 3) red, green, blue of the vertices; None: all are of one colour


def surfaces_of(scene: Scene) -> list[Surface]:
    """All surfaces of a scene, the ground first."""
    return [*([] if scene.ground is None else ground_surfaces(scene.ground)), *scene.surfaces]


def mesh_of(surface: Surface) -> Mesh:
    """Return a surface as a mesh; a picture on it becomes the colours of its vertices."""
    vertices, faces = surface.vertices, surface.faces
    pictured = bool(surface.picture) and not surface.tiled  # of a small picture that repeats, vertices show nothing
    if pictured and len(vertices) == 4:  # a flat floor, whose corners alone would show nothing of the picture
        vertices, faces = _grid(surface)
    colours = None if not pictured else _painted(vertices, surface)
    if not surface.smooth:
        colours = None if colours is None else colours[faces].reshape(-1, 3)
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    return Mesh(vertices, _normals(vertices, faces), faces, colours)


def _grid(surface: Surface) -> tuple[Array, NDArray[np.int64]]:
    west, south, east, north = surface.picture_box
    x, y = np.meshgrid(np.linspace(west, east, PAINTED), np.linspace(south, north, PAINTED))
    level = np.full(x.size, float(surface.vertices[:, 2].mean()))
    return np.column_stack([x.ravel(), y.ravel(), level]), grid_faces(PAINTED, PAINTED)


def _painted(vertices: Array, surface: Surface) -> NDArray[np.uint8]:
    """Colours (m, 3) of the picture at the vertices; its row 0 is in the north."""
    picture = np.asarray(Image.open(io.BytesIO(surface.picture)).convert("RGB"))
    west, south, east, north = surface.picture_box
    height, width = picture.shape[:2]
    column = (vertices[:, 0] - west) / (east - west) * (width - 1)
    row = (north - vertices[:, 1]) / (north - south) * (height - 1)
    found: NDArray[np.uint8] = picture[
        np.clip(row.round(), 0, height - 1).astype(np.int64), np.clip(column.round(), 0, width - 1).astype(np.int64)
    ]
    return found


def _normals(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """Normals (m, 3) of the vertices: of the triangles that meet there, each weighted by its area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across, found = np.cross(b - a, c - a), np.zeros_like(vertices)
    for k in range(3):
        np.add.at(found, faces[:, k], across)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(length > 0.0, found / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


# ---- names


def marks_of(scene: Scene) -> list[Mark]:
    """All marks of a scene.

    Those of motions of what the page draws at a size in the picture are among them: in a world of true sizes it is seen
    from nearby only.
    """
    small = {each.motion: each.layer for each in scene.surfaces if each.span and each.motion is not None}
    marked = {each.motion for each in scene.marks if each.dot}
    own = [
        Mark("", layer.colour if layer else INK_COLOUR, motion=motion, layer=layer)
        for motion, layer in small.items()
        if motion not in marked
    ]
    return [*scene.marks, *own]


# ---- times


def stretches(motion: Motion | None, duration: float) -> list[tuple[float, float]]:
    """Times [s] from and until which what is on a motion is shown, within the run; the whole run without a motion.

    A stretch that lasts to the end of the run ends at infinity.
    """
    if motion is None:
        return [(0.0, math.inf)]
    found = [(max(begin, 0.0), end) for begin, end in motion.shown if end >= 0.0 and begin <= duration]
    return [(begin, math.inf if end >= duration else end) for begin, end in found]


@dataclass(frozen=True, eq=False)
class Moment:
    """Polylines that are drawn from a time on."""

    t: float  # [s]
    polylines: Sequence[Array]  # (m, 3) [m] each
    opacities: Sequence[float]


def moments_of(lines: Lines, duration: float) -> Iterator[Moment]:
    """Yield the moments at which lines change, from the start of the run on."""
    times = [np.zeros(1)]
    if lines.starts is not None:
        times.append(lines.starts[lines.starts <= duration])
        if lines.end < duration:
            times.append(np.array([lines.end + 1e-3]))
    if lines.cut:
        times.append(np.linspace(0.0, duration, MOST_MOMENTS))
    before: tuple[int, ...] | None = None
    for t in np.unique(np.concatenate(times)).tolist():
        polylines = lines.at(t)
        shape = tuple(len(each) for each in polylines)
        if not lines.cut or shape != before or any(shape):  # of nothing that stays nothing one moment is enough
            yield Moment(t, polylines, lines.opacities_at(t))
        before = shape
