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
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.reading.files import read_text
from mathnavi.renders.page import Markup, text
from mathnavi.renders.scene.cameras import ASPECT
from mathnavi.renders.scene.elements import Framed, Layer, Scene
from mathnavi.renders.scene.ground import ground_surfaces
from mathnavi.renders.stage import HORIZON, ZENITH

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


def packed(scene: Scene) -> dict[str, Any]:
    """The scene as plain data; ``block`` holds its arrays."""
    block = DataBlock()
    layers: list[Layer] = []
    ground = [] if scene.ground is None else ground_surfaces(scene.ground)
    shown = replace(scene, ground=None, surfaces=[*ground, *scene.surfaces])
    found: dict[str, Any] = _packed(shown, layers, block)
    found |= {"low": scene.low, "embedded": False, "sky": [list(HORIZON), list(ZENITH)]}
    return found | {"layers": [vars(each) for each in layers], "block": block.packed()}


def _packed(value: Any, layers: list[Layer], block: DataBlock) -> Any:
    """A part of a scene as plain data: an array as a reference to the block, a layer as an index."""
    if isinstance(value, Layer):  # those of one name are one
        names = [each.name for each in layers]
        if value.name not in names:
            layers.append(value)
            return len(names)
        return names.index(value.name)
    if isinstance(value, np.ndarray):
        if np.issubdtype(value.dtype, np.integer) and value.min(initial=0) >= 0:
            return block.add(value, "u4", stride=value.shape[1] if value.ndim == 2 else 0)
        return block.add(value)
    if isinstance(value, Framed):  # the browser has target and distance of the camera, in a picture of this shape
        return ASPECT
    if isinstance(value, bytes):
        return block.add(np.frombuffer(value, np.uint8), "u1") if value else None
    if is_dataclass(value):
        return {each.name: _packed(getattr(value, each.name), layers, block) for each in fields(value)}
    if isinstance(value, Mapping):
        return {name: _packed(each, layers, block) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_packed(each, layers, block) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return math.copysign(FOREVER, value)
    return value.item() if isinstance(value, np.generic) else value


def document(scene: Scene, live: Mapping[str, Any] | None = None) -> Markup:
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


def scene_block(scene: Scene, label: str, caption: str) -> Markup:
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
