"""Tracks over a terrain that a reader of the page of a sweep or of a study can turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.colors import to_rgb

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models import opengl
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.figures import thinned
from mathnavi.renders.page import Markup
from mathnavi.renders.palette import COLOURS, Colour, SceneElement
from mathnavi.renders.relief import EXAGGERATION

Radar = tuple[float, float, float, float]  # x, y, z of the antenna and radius [m], map frame
PLACE: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Track:
    """A line in the map frame."""

    name: str
    points: Array = field(repr=False)  # (n, 3) [m] map frame
    colour: str  # #rrggbb
    dashed: bool = False


def terrain_view(
    terrain: HeightField,
    tracks: Sequence[Track],
    places: Mapping[str, Array] | None = None,
    radars: Sequence[Radar] = (),
) -> Markup:
    """Return the view: ``places`` are (3,) [m] by name, map frame.

    Tracks of one name share an entry of the legend. Raises ArgumentError for a track that is not (n, 3) or not finite.
    """
    for track in tracks:
        if track.points.ndim != 2 or track.points.shape[1] != 3 or not track.points.size:
            raise ArgumentError(f"track {track.name!r} has points {track.points.shape}; allowed: (n, 3), n >= 1")
        if not np.isfinite(track.points).all():
            raise ArgumentError(f"track {track.name!r} has points that are not finite; allowed: finite numbers [m]")
    opengl.import_mujoco()
    from mathnavi.renders.scene.elements import Layer, Mark, Scene
    from mathnavi.renders.scene.landscape import dome, map_cameras, path, scale_marks
    from mathnavi.renders.web.document import scene_block  # these import mujoco, and most pages have no terrain

    colours = {part.value: COLOURS[part] for part in (SceneElement.START, SceneElement.TARGET)}
    course = tracks[0].points[-1] - tracks[0].points[0] if tracks else np.ones(3)
    names = list(dict.fromkeys(track.name for track in tracks))
    scene = Scene(
        terrain.name,
        0.0,
        map_cameras(terrain, course),
        surfaces=[dome(radius, centre=np.array(place)) for *place, radius in radars],
        lines=[
            path(Layer(track.name, to_rgb(track.colour), track.dashed), track.points[thinned(len(track.points), 0)])
            for track in tracks
        ],
        marks=[
            *(
                Mark(name, colours.get(name, PLACE), place, foot=float(terrain.height(*place[:2])))
                for name, place in (places or {}).items()
            ),
            *scale_marks(terrain),
        ],
        ground=terrain,
    )
    label = f"The terrain {terrain.name} in three dimensions with {', '.join(names) or 'no track'}"
    tall = f"heights{', those of the radars too,' if radars else ''} {EXAGGERATION} times as tall as they are"
    return scene_block(scene, label, f"{terrain.name}, {tall}.")
