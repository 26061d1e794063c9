"""View of a terrain that a reader can turn, with the paths flown over it: a block of a report
(``mathnavi.renders.page``).

The ground is drawn on its own triangles, in the colours of ``mathnavi.renders.relief``, heights exaggerated as in
every picture. The nodes travel packed (16 bits a height, 24 a colour) and are unfolded by ``terrain_view.js``; plotly
draws.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading.files import read_text
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.figures import thinned
from mathnavi.renders.page import Markup, text
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.relief import EXAGGERATION, relief, resampled

MOST_NODES = 257  # along the longer side of the ground
HEIGHT_UNIT = 0.1  # [m]
SIDE = 0.05  # of the longer side of the map: how far the block goes down below the lowest ground
EARTH = "#5d5145"  # of the block's sides
LEVELS, SECTORS = 25, 73  # of a radar's dome
ELEVATION = math.radians(40.0)  # of the camera over its point of aim
TANGENT, ASPECT = math.tan(math.pi / 8.0), 16.0 / 9.0  # of half of plotly's field of view; of the view (page.css)
FILL = 0.93  # share of the view that is filled
MARGIN = 0.06  # around the map for the numbers along its edges, in lengths of the map's longer side
LABELS = 5  # about as many along the map's longer side
FLAT_LIGHT = {"ambient": 1.0, "diffuse": 0.0, "specular": 0.0, "fresnel": 0.0}  # the shade is in the colours
POSITION = "%{x:.1f} km east, %{y:.1f} km north, %{z:,.0f} m high"


Radar = tuple[float, float, float, float]  # x, y, z of the antenna and radius [m], map frame


@dataclass(frozen=True, eq=False)
class Track:
    """A line in the map frame."""

    name: str
    points: Array = field(repr=False)  # (n, 3) [m] map frame
    colour: str  # #rrggbb
    dashed: bool = False


def script() -> str:
    """JavaScript of a page with at least one view; about 5 MB, of plotly."""
    from plotly.offline import get_plotlyjs  # not needed for anything but this

    own = read_text(Path(__file__).with_name("terrain_view.js"), ValueError)
    return f"{get_plotlyjs()}\n{own}"


def terrain_view(
    terrain: HeightField,
    tracks: Sequence[Track],
    places: Mapping[str, Array] | None = None,
    radars: Sequence[Radar] = (),
    note: str = "",
) -> Markup:
    """The view: ``places`` are (3,) [m] by name; ``radars`` antennas (x, y, z) and radius [m], all in the map frame.

    ``note`` ends the caption. Tracks of one name share an entry of the legend. Raises ArgumentError for a track that is
    not (n, 3) or not finite.
    """
    places = places or {}
    names = [track.name for track in tracks]
    for track in tracks:
        if track.points.ndim != 2 or track.points.shape[1] != 3 or not track.points.size:
            raise ArgumentError(f"track {track.name!r} has points {track.points.shape}; allowed: (n, 3), n >= 1")
        if not np.isfinite(track.points).all():
            raise ArgumentError(f"track {track.name!r} has points that are not finite; allowed: finite numbers [m]")
    extent = _Extent.around(terrain, [track.points for track in tracks], radars)
    view = {
        "ground": _ground(terrain),
        "ground_style": {"lighting": FLAT_LIGHT, "hovertemplate": f"{POSITION}<extra></extra>"},
        "traces": [
            _sides(terrain, extent.low),
            *(_dome(radar, terrain, first=k == 0) for k, radar in enumerate(radars)),
            *(_line(track, first=names.index(track.name) == k) for k, track in enumerate(tracks)),
            _marks(places),
        ],
        "layout": _layout(terrain, extent, places, [track.points for track in tracks], radars),
    }
    data = json.dumps(view, separators=(",", ":"), allow_nan=False)
    data = data.replace("<", "\\u003c")  # so that nothing in it ends the script
    tall = f"heights{', those of the radars too,' if radars else ''} {EXAGGERATION} times as tall as they are"
    label = f"The terrain {terrain.name} in three dimensions with {', '.join(dict.fromkeys(names)) or 'no track'}"
    return Markup(
        f'<figure class="card"><div class="view" role="img" aria-label="{text(label)}"></div>'
        f'<script type="application/json">{data}</script>'
        "<noscript>The terrain that can be turned needs JavaScript, which this browser does not run.</noscript>"
        f"<figcaption>{text(terrain.name)}, {tall}. Drag to turn; click, then scroll to zoom; drag with the right "
        f"button to move.{f' {text(note)}' if note else ''}</figcaption></figure>\n"
    )


@dataclass(frozen=True)
class _Extent:
    """The box that is drawn: the whole map from ``low`` to ``high`` [m]; what lies outside of it is cut off."""

    low: float
    high: float

    @staticmethod
    def around(terrain: HeightField, points: Sequence[Array], radars: Sequence[Radar]) -> _Extent:
        tops = [
            float(terrain.z.max()),
            *(float(p[:, 2].max()) for p in points),
            *(z + r for *_, z, r in radars),
        ]
        side = SIDE * max(terrain.width, terrain.depth) / EXAGGERATION
        return _Extent(float(terrain.z.min()) - side, max(tops) + 0.02 * side)


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _ground(terrain: HeightField) -> dict[str, Any]:
    """The nodes, row 0 south: their own where there are few enough, else as many, evenly spread between them."""
    size = min(max(terrain.z.shape), MOST_NODES)
    z = resampled(terrain, size, order=1)
    low = float(z.min())
    unit = max(HEIGHT_UNIT, (float(z.max()) - low) / 65535.0)
    return {
        "rows": z.shape[0],
        "columns": z.shape[1],
        "east_km": terrain.width / 1e3,
        "north_km": terrain.depth / 1e3,
        "low_m": low,
        "unit_m": unit,
        "heights": _packed(np.rint((z - low) / unit), "<u2"),
        "colours": _packed(relief(terrain, size)[::-1], "u1"),
    }


def _points(points: Array) -> dict[str, Any]:
    """Points (n, 3) [m] as plotly takes them: km, km and m."""
    x, y, z = points.T
    return {"type": "scatter3d", "x": _numbers(x / 1e3, 4), "y": _numbers(y / 1e3, 4), "z": _numbers(z, 1)}


def _numbers(values: Array, digits: int) -> list[float]:
    rounded: list[float] = np.round(values, digits).tolist()
    return rounded


def _mesh(vertices: Array, rows: int, columns: int) -> dict[str, Any]:
    """A grid of ``rows`` x ``columns`` vertices (n, 3) [m] as plotly's triangles."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    first, second, third = (
        np.concatenate(pair)
        for pair in ((corner, corner), (corner + 1, corner + columns + 1), (corner + columns + 1, corner + columns))
    )
    return _points(vertices) | {
        "type": "mesh3d",
        "i": first.tolist(),
        "j": second.tolist(),
        "k": third.tolist(),
        "hoverinfo": "skip",
    }


def _sides(terrain: HeightField, low: float) -> dict[str, Any]:
    """The block's four sides, from the edge of the ground down, and its bottom."""
    size = min(max(terrain.z.shape), MOST_NODES)
    z = resampled(terrain, size, order=1)
    rows, columns = z.shape
    j = np.concatenate([np.zeros(columns), np.arange(rows), np.full(columns, rows - 1), np.arange(rows)[::-1]])
    i = np.concatenate([np.arange(columns), np.full(rows, columns - 1), np.arange(columns)[::-1], np.zeros(rows)])
    edge = z[j.astype(int), i.astype(int)]
    x, y = i * terrain.width / (columns - 1), j * terrain.depth / (rows - 1)
    upper, lower = np.column_stack([x, y, edge]), np.column_stack([x, y, np.full_like(edge, low)])
    middle = np.broadcast_to([0.5 * terrain.width, 0.5 * terrain.depth, low], upper.shape)
    return _mesh(np.vstack([middle, lower, upper]), 3, len(edge)) | {"color": EARTH, "lighting": FLAT_LIGHT}


def _dome(radar: Radar, terrain: HeightField, *, first: bool) -> dict[str, Any]:
    """The sphere that a radar sees, down to where the ground hides it."""
    x, y, z, radius = radar
    lowest = max(-1.0, (float(terrain.z.min()) - z) / radius)
    elevation = np.linspace(math.asin(lowest), 0.5 * math.pi, LEVELS)
    azimuth = np.linspace(0.0, 2.0 * math.pi, SECTORS)
    up, around = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
    level = np.cos(up)
    vertices = np.array([x, y, z]) + radius * np.column_stack(
        [level * np.cos(around), level * np.sin(around), np.sin(up)]
    )
    style = {
        "name": SceneElement.RADAR.value,
        "legendgroup": SceneElement.RADAR.value,
        "showlegend": first,
        "color": hexadecimal(COLOURS[SceneElement.RADAR]),
        "opacity": 0.28,
        "lighting": {"ambient": 0.7, "diffuse": 0.4, "specular": 0.1, "fresnel": 0.0},
    }
    return _mesh(vertices, LEVELS, SECTORS) | style


def _line(track: Track, *, first: bool) -> dict[str, Any]:
    """A track; of those with one name the legend has the ``first``."""
    return _points(track.points[thinned(len(track.points), 0)]) | {
        "mode": "lines",
        "name": text(track.name),
        "legendgroup": track.name,
        "showlegend": first,
        "line": {"color": track.colour, "width": 6, "dash": "dash" if track.dashed else "solid"},
        "hovertemplate": f"{POSITION}<extra>{text(track.name)}</extra>",
    }


def _marks(places: Mapping[str, Array]) -> dict[str, Any]:
    """A dot for each place; its name is an annotation, which no mountain hides."""
    colours = {part.value: hexadecimal(COLOURS[part]) for part in (SceneElement.START, SceneElement.TARGET)}
    return _points(np.array(list(places.values())).reshape(-1, 3)) | {
        "mode": "markers",
        "marker": {
            "size": 6,
            "color": [colours.get(name, "#ffffff") for name in places],
            "line": {"color": "#101824", "width": 2},
        },
        "showlegend": False,
        "text": [text(name) for name in places],
        "hovertemplate": f"{POSITION}<extra>%{{text}}</extra>",
    }


def _layout(
    terrain: HeightField,
    extent: _Extent,
    places: Mapping[str, Array],
    paths: Sequence[Array],
    radars: Sequence[Radar],
) -> dict[str, Any]:
    longest = max(terrain.width, terrain.depth)
    tall = EXAGGERATION * (extent.high - extent.low) / longest
    hidden = {"visible": False, "showspikes": False}
    margin = MARGIN * longest / 1e3
    sides = {"x": terrain.width, "y": terrain.depth}
    axes = {f"{axis}axis": hidden | {"range": [-margin, side / 1e3 + margin]} for axis, side in sides.items()}
    return {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "modebar": {"bgcolor": "rgba(0,0,0,0)"},
        "font": {"family": 'system-ui, "DejaVu Sans", sans-serif', "size": 13},
        "hoverlabel": {"bgcolor": "#101824", "font": {"color": "#ffffff"}},
        "legend": {"x": 0.0, "y": 1.0, "bgcolor": "rgba(0,0,0,0)", "itemsizing": "constant"},
        "scene": axes | {
            "zaxis": hidden | {"range": [extent.low, extent.high]},
            "aspectmode": "manual",
            "aspectratio": {axis: side / longest + 2.0 * MARGIN for axis, side in sides.items()} | {"z": tall},
            "camera": _camera(terrain, extent, paths, radars),
            "dragmode": "turntable",
            "annotations": [*map(_named, places, places.values()), *_scale(terrain, extent.low)],
        },
    }  # fmt: skip


def _place(point: Array) -> dict[str, float]:
    x, y, z = point.tolist()
    return {"x": x / 1e3, "y": y / 1e3, "z": z}


def _named(name: str, point: Array) -> dict[str, Any]:
    """An annotation on a place."""
    return _place(point) | {
        "text": text(name), "ax": 0, "ay": -30, "arrowhead": 0, "arrowwidth": 1, "arrowcolor": "#101824",
        "bgcolor": "rgba(16,24,36,0.76)", "font": {"color": "#ffffff", "size": 13}, "borderpad": 3,
    }  # fmt: skip


def _scale(terrain: HeightField, low: float) -> list[dict[str, Any]]:
    """Distances along the southern and the western edge, and north: annotations, which no mountain hides."""
    east, north = terrain.width, terrain.depth
    step = 1e3 * _round_step(max(east, north) / 1e3 / LABELS)
    beside = 0.9 * MARGIN * max(east, north)
    named = [(f"{along / 1e3:g} km", (along, -0.5 * beside, low)) for along in np.arange(step, east, step)]
    for up in np.arange(step, north, step):
        named.append((f"{up / 1e3:g} km", (-beside, up, float(terrain.height(0.0, up)))))
    named.append(("north", (0.5 * east, north + beside, float(terrain.z[-1].max()))))
    return [
        _place(np.array(point)) | {"text": name, "showarrow": False, "font": {"size": 12}, "opacity": 0.75}
        for name, point in named
    ]


def _camera(
    terrain: HeightField, extent: _Extent, paths: Sequence[Array], radars: Sequence[Radar]
) -> dict[str, dict[str, float]]:
    """Plotly's camera, from the south, from where all that is drawn fills the view.

    Its lengths are those of the map's longer side, its origin is the middle of the box that is drawn.
    """
    longest = max(terrain.width, terrain.depth)
    edges = [(x, y) for x in (-MARGIN * longest, terrain.width) for y in (-0.5 * MARGIN * longest, terrain.depth)]
    corners = [(x, y, z) for x, y in edges for z in (extent.low, float(terrain.z[-1 if y > 0.0 else 0].max()))]
    domes = [(x, y, z + radius) for x, y, z, radius in radars]
    points = np.vstack([np.array(corners + domes), *(path[thinned(len(path), 0)] for path in paths)])
    middle = np.array([0.5 * terrain.width, 0.5 * terrain.depth, 0.5 * (extent.low + extent.high)])
    points = (points - middle) * [1.0, 1.0, EXAGGERATION] / longest
    forward = np.array([0.0, math.cos(ELEVATION), -math.sin(ELEVATION)])
    upward = np.array([0.0, math.sin(ELEVATION), math.cos(ELEVATION)])
    centre, distance = np.zeros(3), 1.0
    for _ in range(12):  # centre, then fill; perspective couples the two only weakly
        ahead = points - (centre - distance * forward)
        depth = ahead @ forward
        across, along = ahead[:, 0] / depth, ahead @ upward / depth
        middle = 0.5 * np.array([across.min() + across.max(), along.min() + along.max()])
        centre = centre + distance * (middle[0] * np.array([1.0, 0.0, 0.0]) + middle[1] * upward)
        distance *= 0.5 * max(float(np.ptp(across)) / ASPECT, float(np.ptp(along))) / (FILL * TANGENT)
    named = {"center": centre, "eye": centre - distance * forward, "up": np.array([0.0, 0.0, 1.0])}
    return {name: dict(zip("xyz", vector.tolist(), strict=True)) for name, vector in named.items()}


def _round_step(step: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is no shorter."""
    power = 10.0 ** math.floor(math.log10(step))
    return power * min(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= step * (1.0 - 1e-9))
