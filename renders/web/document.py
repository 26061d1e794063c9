"""Page of a scene: one self-contained HTML document, which needs no network.

The scene travels as JSON, its arrays as one compressed block of bytes to which the JSON refers by offset, length and
type. The page forbids the browser every request; served with controls it may ask its own server (``live``).
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.reading.files import read_text
from mathnavi.renders.page import Markup, text
from mathnavi.renders.palette import hexadecimal
from mathnavi.renders.stage import HORIZON, ZENITH
from mathnavi.renders.web.elements import Camera, Chart, Layer, Lines, Mark, Motion, Surface, WebScene

VIEWER = Path(__file__).with_name("viewer")
SCRIPTS = ("geometry.js", "stage.js", "charts.js", "labels.js", "player.js", "live.js")  # in this order
FOREVER = 1e30  # [s] stands for an infinite time


class DataBlock:
    """Bytes of arrays, one after the other, each at a multiple of 4."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._length = 0

    def add(self, values: Any, kind: str = "f4", *, stride: int = 0) -> dict[str, Any] | None:
        """Add an array of the numpy type ``kind``; return the reference to it in the JSON, None for None.

        With a ``stride``, rows of ``stride`` whole numbers are packed as differences, which are compressed a
        hundredfold.
        """
        if values is None:
            return None
        own = np.ascontiguousarray(values, dtype=f"<{kind}" if kind != "u1" else kind)
        if stride:
            own = np.diff(own.reshape(-1, stride), axis=0, prepend=np.zeros((1, stride), own.dtype))
        raw = own.tobytes()
        reference = {"at": self._length, "count": int(own.size), "kind": kind, "stride": stride}
        padding = -len(raw) % 4
        self._parts += [raw, bytes(padding)]
        self._length += len(raw) + padding
        return reference

    def packed(self) -> str:
        """The whole document, compressed (zlib), in base 64."""
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")


def packed(scene: WebScene) -> dict[str, Any]:
    """The scene as plain data; ``block`` holds its arrays."""
    block = DataBlock()
    layers: list[Layer] = []
    described = {
        "title": scene.title,
        "duration": scene.duration,
        "low": scene.low,
        "floor": scene.floor,
        "note": scene.note,
        "embedded": False,
        "speed": scene.speed,
        "sky": [list(HORIZON), list(ZENITH)],
        "motions": {name: _motion(motion, block) for name, motion in scene.motions.items()},
        "surfaces": [_surface(each, layers, block) for each in scene.surfaces],
        "lines": [_lines(each, layers, block) for each in scene.lines],
        "marks": [_mark(each, layers) for each in scene.marks],
        "cameras": [_camera(each) for each in scene.cameras],
        "charts": [_chart(each, block) for each in scene.charts],
        "events": [[t, words] for t, words in scene.events],
        "facts": [list(fact) for fact in scene.facts],
    }
    described["layers"] = [
        {"name": layer.name, "colour": hexadecimal(layer.colour), "dashed": layer.dashed, "shown": layer.shown}
        for layer in layers
    ]
    return described | {"block": block.packed()}


def document(scene: WebScene, live: Mapping[str, Any] | None = None) -> Markup:
    """The whole page; ``live`` is what a page that follows a run needs to know of its server."""
    style, script = _viewer("page.css", "viewer.css"), _viewer(*SCRIPTS)
    data = packed(scene) | ({"live": dict(live)} if live is not None else {})
    return Markup(
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(style, script, live is not None)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="referrer" content="no-referrer">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{text(scene.title)}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"{_viewer('viewer.html')}{_scripts(data, script)}</body>\n</html>\n"
    )


def scene_block(scene: WebScene, label: str, caption: str) -> Markup:
    """Return the scene as a block of a report (``mathnavi.renders.page``), of which a page can have one.

    It shows the end of the run at first, its time if it has a duration, and none of its charts. ``label`` describes the
    scene for screen readers; ``caption`` is printed below.
    """
    viewer = _viewer("viewer.html").replace('id="app"', 'id="app" class="embedded"', 1)
    data = packed(scene) | {"embedded": True}
    return Markup(
        f'<figure class="card" role="group" aria-label="{text(label)}"><style>{_viewer("viewer.css")}</style>\n{viewer}'
        "<noscript>The scene that can be turned needs JavaScript, which this browser does not run.</noscript>"
        f"<figcaption>{text(caption)} Drag to turn; click, then scroll to zoom; drag with the right button to move."
        f"</figcaption>{_scripts(data, _viewer(*SCRIPTS))}</figure>\n"
    )


def _viewer(*names: str) -> str:
    """Files of the viewer, one after the other."""
    return "\n".join(read_text(VIEWER / name, ValueError) for name in names)


def _scripts(data: Mapping[str, Any], script: str) -> str:
    """The scene, and the script that shows it."""
    return (
        f'<script type="application/json" id="scene">{_json(data)}</script>\n<script type="module">{script}</script>\n'
    )


def _policy(style: str, script: str, served: bool) -> str:
    """Content security policy: the browser runs this script, applies this style, and asks only its server, if any."""
    hashes = (base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() for part in (style, script))
    own_style, own_script = (f"'sha256-{each}'" for each in hashes)
    connect = "; connect-src 'self'" if served else ""
    return f"default-src 'none'; img-src blob: data:; style-src {own_style}; script-src {own_script}{connect}"


def _json(data: Mapping[str, Any]) -> str:
    """JSON in which nothing ends a script."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _time(t: float) -> float:
    return t if math.isfinite(t) else math.copysign(FOREVER, t)


def _layer(layer: Layer | None, layers: list[Layer]) -> int:
    """Index of a layer; -1 for none. Layers of one name are one."""
    if layer is None:
        return -1
    names = [each.name for each in layers]
    if layer.name not in names:
        layers.append(layer)
        return len(names)
    return names.index(layer.name)


def _motion(motion: Motion, block: DataBlock) -> dict[str, Any]:
    return {
        "t": block.add(motion.t),
        "pos": block.add(motion.pos),
        "quat": block.add(motion.quat),
        "ground": block.add(motion.ground),
        "shown": [[_time(begin), _time(end)] for begin, end in motion.shown],
    }


def _surface(surface: Surface, layers: list[Layer], block: DataBlock) -> dict[str, Any]:
    found = {
        "vertices": block.add(surface.vertices),
        "faces": block.add(surface.faces, "u4", stride=3),
        "colour": list(surface.colour),
        "opacity": surface.opacity,
        "motion": surface.motion,
        "layer": _layer(surface.layer, layers),
        "smooth": surface.smooth,
        "glow": surface.glow,
        "span": surface.span,
        "tall": surface.tall,
        "checker": float(surface.checker),
        "shadow": surface.shadow,
    }
    if surface.picture:
        found["picture"] = block.add(np.frombuffer(surface.picture, np.uint8), "u1")
        found["box"] = list(surface.picture_box)
    return found


def _lines(lines: Lines, layers: list[Layer], block: DataBlock) -> dict[str, Any]:
    several = lines.frames is not None
    return {
        "points": block.add(lines.points),
        "offsets": block.add(lines.offsets, "u4"),
        "times": block.add(lines.times),
        "frames": block.add(lines.frames if several else [0, len(lines.offsets) - 1], "u4"),
        "starts": block.add(lines.starts if several else [-FOREVER]),
        "end": _time(lines.end),
        "opacities": block.add(lines.opacities),
        "colour": list(lines.colour),
        "width": lines.width,
        "dashed": lines.dashed,
        "cut": lines.cut,
        "trail": _time(lines.trail),
        "motion": lines.motion,
        "plan": lines.plan,
        "layer": _layer(lines.layer, layers),
    }


def _mark(mark: Mark, layers: list[Layer]) -> dict[str, Any]:
    return {
        "text": mark.text,
        "colour": hexadecimal(mark.colour),
        "place": None if mark.place is None else mark.place.tolist(),
        "motion": mark.motion,
        "foot": mark.foot,
        "dot": mark.dot,
        "layer": _layer(mark.layer, layers),
    }


def _camera(camera: Camera) -> dict[str, Any]:
    return {
        "name": camera.name,
        "target": list(camera.target),
        "distance": camera.distance,
        "azimuth": camera.azimuth,
        "elevation": camera.elevation,
        "follow": camera.follow,
        "behind": camera.behind,
        "fieldOfView": camera.field_of_view,
        "tall": camera.tall,
        "span": camera.span,
    }


def _chart(chart: Chart, block: DataBlock) -> dict[str, Any]:
    return {
        "title": chart.title,
        "unit": chart.unit,
        "bounds": [float(bound) for bound in chart.bounds],
        "logarithmic": chart.logarithmic,
        "series": [
            {
                "name": each.name,
                "colour": hexadecimal(each.colour),
                "t": block.add(each.t),
                "y": block.add(each.y),
                "step": each.step,
                "dashed": each.dashed,
            }
            for each in chart.series
        ],
    }
