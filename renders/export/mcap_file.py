"""A run as an MCAP file, which Foxglove, PlotJuggler and every reader of MCAP take.

| topics | schema | content |
|---|---|---|
| ``/scene/...`` | ``foxglove.SceneUpdate`` | meshes, lines and names, a topic for each part |
| ``/tf`` | ``foxglove.FrameTransforms`` | where each frame is in ``world`` |
| ``/log`` | ``foxglove.Log`` | events |
| ``[/VEHICLE]/truth``, ``/input``, ``/readings/NAME``, ``/estimate``, ``/plan`` | JSON | the log |
| ``/charts/TITLE`` | JSON | the curves of the run's page; with the unit where two charts have one title |
| ``/events`` | JSON | events |

The stamps are whole nanoseconds from the start of the run. Each JSON message also has the time as recorded,
``t`` [s], and each number of the log as recorded: one that is missing is NaN, in a list null, and infinity is
1e999, which every parser of JSON reads as infinity. The metadata of a JSON channel names the arrays of log.npz that its
fields hold; config.json, summary.json and log.json of the run are attached.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.signals import Array, Event
from mathnavi.renders.export.contents import (
    ExportedRun,
    Mesh,
    chart_names,
    marks_of,
    mesh_of,
    moments_of,
    stretches,
    surfaces_of,
)
from mathnavi.renders.palette import Colour
from mathnavi.renders.scene.elements import Chart, Layer, Lines, Mark, Surface
from mathnavi.sim.records.log_channels import Channel, Field
from mathnavi.sim.records.run_folder import described

WORLD = "world"  # the frame that does not move
FONT = 14.0  # [pixels]
NAMED = {"protobuf": "protobuf", "json": "jsonschema"}  # encodings of messages, and of their schemas
Message = tuple[float, bytes]  # time [s] and content


def writer() -> Callable[[Path, ExportedRun], None]:
    """Return what writes a run to a file, or raises OSError; FieldError if a package is not installed."""
    writing, protobuf = extra("mcap.writer", "--mcap"), extra("mcap_protobuf.schema", "--mcap")
    extra("foxglove_schemas_protobuf", "--mcap")
    return lambda path, run: _write(path, run, writing, protobuf)


def _write(path: Path, run: ExportedRun, writing: Any, protobuf: Any) -> None:
    scenes = _SceneMessages(run)
    with open(path, "wb") as file:
        out = writing.Writer(file)
        out.start(profile="", library="mathnavi")
        schemas: dict[str, int] = {}
        messages: list[tuple[int, int, bytes]] = []

        def add(topic: str, encoding: str, schema: int, content: Iterable[Message], metadata: dict[str, str]) -> None:
            channel = out.register_channel(topic, encoding, schema, metadata)
            messages.extend((_nanoseconds(t), channel, data) for t, data in content)

        for topic, kind, content in scenes.topics():
            if kind not in schemas:
                schemas[kind] = protobuf.register_schema(out, scenes.kinds[kind])
            add(topic, "protobuf", schemas[kind], content, {})
        for topic, schema, content, metadata in _json_topics(run):
            number = out.register_schema(topic.removeprefix("/"), "jsonschema", json.dumps(schema).encode())
            add(topic, "json", number, content, metadata)
        for number, (time, channel, data) in enumerate(sorted(messages, key=lambda each: each[:2])):
            out.add_message(channel, time, data, time, number)
        for name, text in run.documents.items():
            out.add_attachment(0, 0, name, "application/json", text.encode())
        out.add_metadata("run", {"title": run.scene.title, **dict(run.scene.facts)})
        out.finish()


def _nanoseconds(t: float) -> int:
    """Stamp of a time [s]; none exists before the start of the run."""
    return max(round(t * 1e9), 0)


# ---- scene


class _SceneMessages:
    """Messages of Foxglove's own schemas.

    Who goes to another time gets the last message of each topic: so a topic is one part of the scene, and each of its
    messages the whole of that part.
    """

    def __init__(self, run: ExportedRun) -> None:
        def kind(name: str) -> Any:
            return getattr(extra(f"foxglove_schemas_protobuf.{name}_pb2", "--mcap"), name)

        self._run, self._scene, self._kind = run, run.scene, kind
        self.kinds = {name: kind(name) for name in ("SceneUpdate", "FrameTransforms", "Log")}
        self._entity, self._update = kind("SceneEntity"), self.kinds["SceneUpdate"]
        self._point, self._pose, self._colour = kind("Point3"), kind("Pose"), kind("Color")
        self._names: set[str] = set()

    def topics(self) -> Iterator[tuple[str, str, Iterable[Message]]]:
        """Yield name, schema and messages of each topic."""
        scene = self._scene
        yield "/tf", "FrameTransforms", self._transforms()
        yield "/log", "Log", self._events()
        for surface in surfaces_of(scene):
            name = self._name(surface.layer, surface.motion or "ground")
            yield name, "SceneUpdate", self._shown(name, surface.motion, self._mesh(surface))
        for mark in marks_of(scene):
            name = self._name(mark.layer, f"name {mark.text}")
            yield name, "SceneUpdate", self._shown(name, mark.motion, self._mark(mark))
        for lines in scene.lines:
            name = self._name(lines.layer, "lines")
            yield name, "SceneUpdate", self._lines(name, lines)

    def _name(self, layer: Layer | None, otherwise: str) -> str:
        name = f"/scene/{(layer.name if layer and layer.name else otherwise).strip()}"
        found, number = name, 1
        while found in self._names:
            number += 1
            found = f"{name} {number}"
        self._names.add(found)
        return found

    def _shown(self, name: str, motion: str | None, parts: dict[str, Any]) -> Iterator[Message]:
        """Yield a part when its motion is shown, and nothing in its place when it is not."""
        for begin, end in stretches(self._scene.motions.get(motion or ""), self._scene.duration):
            yield begin, self._scene_update(name, begin, motion, parts)
            if math.isfinite(end):
                yield end, self._scene_update(name, end, motion, {})

    def _lines(self, name: str, lines: Lines) -> Iterator[Message]:
        kind = self._kind("LinePrimitive")
        for moment in moments_of(lines, self._scene.duration):
            drawn = [
                kind(
                    type=kind.LINE_STRIP, thickness=lines.width, scale_invariant=True, points=self._points(points),
                    pose=self._pose(), color=self._rgba(lines.colour, opacity),
                )
                for points, opacity in zip(moment.polylines, moment.opacities, strict=True)
            ]  # fmt: skip
            yield moment.t, self._scene_update(name, moment.t, None, {"lines": drawn})

    def _scene_update(self, name: str, t: float, motion: str | None, parts: dict[str, Any]) -> bytes:
        entity = self._entity(
            timestamp=self._stamp(t), frame_id=motion or WORLD, id=name, frame_locked=True,
            metadata=[self._kind("KeyValuePair")(key="t", value=repr(t))], **parts,
        )  # fmt: skip
        return bytes(self._update(entities=[entity]).SerializeToString())

    def _mesh(self, surface: Surface) -> dict[str, Any]:
        mesh: Mesh = mesh_of(surface)
        colours = [] if mesh.colours is None else [self._rgba(each, surface.opacity) for each in mesh.colours / 255.0]
        triangles = self._kind("TriangleListPrimitive")(
            pose=self._pose(), points=self._points(mesh.vertices), indices=mesh.faces.ravel().tolist(), colors=colours,
            color=self._rgba(surface.colour, surface.opacity),
        )  # fmt: skip
        return {"triangles": [triangles]}

    def _mark(self, mark: Mark) -> dict[str, Any]:
        text = f"● {mark.text}".strip() if mark.dot else mark.text
        x, y, z = (0.0, 0.0, 0.0) if mark.place is None else mark.place.tolist()
        written = self._kind("TextPrimitive")(
            pose=self._pose(position={"x": x, "y": y, "z": z}), billboard=True, font_size=FONT, scale_invariant=True,
            text=text, color=self._rgba(mark.colour),
        )  # fmt: skip
        return {"texts": [written]}

    def _transforms(self) -> Iterator[Message]:
        """Yield the poses of all frames that have one at a time."""
        one, vector, quaternion = self._kind("FrameTransform"), self._kind("Vector3"), self._kind("Quaternion")
        poses: dict[float, list[Any]] = {}
        for name, motion in self._scene.motions.items():
            still = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(motion.t), 4))
            quat = still if motion.quat is None else motion.quat
            for t, (x, y, z), (w, a, b, c) in zip(motion.t.tolist(), motion.pos.tolist(), quat.tolist(), strict=True):
                pose = one(
                    timestamp=self._stamp(t), parent_frame_id=WORLD, child_frame_id=name,
                    translation=vector(x=x, y=y, z=z), rotation=quaternion(x=a, y=b, z=c, w=w),
                )  # fmt: skip
                poses.setdefault(t, []).append(pose)
        for t, transforms in poses.items():
            yield t, self.kinds["FrameTransforms"](transforms=transforms).SerializeToString()

    def _events(self) -> Iterator[Message]:
        kind = self.kinds["Log"]
        for event in self._run.events:
            words = ": ".join(filter(None, described(event)))
            made = kind(timestamp=self._stamp(event.t), level=kind.INFO, message=words, name=event.agent)
            yield event.t, made.SerializeToString()

    def _stamp(self, t: float) -> dict[str, int]:
        seconds, nanoseconds = divmod(_nanoseconds(t), 10**9)
        return {"seconds": seconds, "nanos": nanoseconds}

    def _points(self, points: Array) -> list[Any]:
        return [self._point(x=x, y=y, z=z) for x, y, z in points.tolist()]

    def _rgba(self, colour: Colour | Array, opacity: float = 1.0) -> Any:
        red, green, blue = (float(each) for each in colour)
        return self._colour(r=red, g=green, b=blue, a=opacity)


# ---- log


def _json_topics(run: ExportedRun) -> Iterator[tuple[str, dict[str, Any], Iterable[Message], dict[str, str]]]:
    """Yield name, schema, messages and metadata of each topic."""
    for channel in run.channels:
        arrays = {
            field.array: {
                "field": field.name, "columns": list(_columns(field)), "shape": field.shape, "dtype": field.dtype,
            }
            for field in channel.fields
        }  # fmt: skip
        metadata = {"arrays": json.dumps(arrays), "vehicle": channel.vehicle}
        yield f"/{'/'.join(channel.path)}", _schema(channel), _rows(channel), metadata
    for name, chart in zip(chart_names(run.scene.charts), run.scene.charts, strict=True):
        yield f"/charts/{name}", _chart_schema(chart), _chart_rows(chart), {"unit": chart.unit}
    words = {name: {"type": "string"} for name in ("agent", "kind", "message")}
    yield "/events", _described("events", words), _event_rows(run.events), {}


def _schema(channel: Channel) -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for field in channel.fields:
        if columns := _columns(field):
            own = {name: {"type": "number", "description": words} for name, words in columns.items()}
            properties[field.name] = {"type": "object", "properties": own}
        elif field.shape == ():
            properties[field.name] = {"type": "number"}
        else:
            words = f"{field.array} of log.npz, row by row"
            words += "" if field.shape is None or len(field.shape) < 2 else f", of the shape {list(field.shape)}"
            properties[field.name] = {"type": "array", "items": {"type": "number"}, "description": words}
    return _described(channel.name, properties)


def _described(title: str, properties: dict[str, Any]) -> dict[str, Any]:
    """Schema of messages with the time and other properties, as simple as readers of JSON schemas want it."""
    t = {"type": "number", "description": "time of the run as it was recorded [s]"}
    return {"title": title, "type": "object", "properties": {"t": t, **properties}, "required": ["t"]}


def _columns(field: Field) -> dict[str, str]:
    """Names of the numbers of a row, without their units where that leaves them different, and with them."""
    short = [words.partition(" [")[0] for words in field.columns]
    return dict(zip(short if len(set(short)) == len(short) else field.columns, field.columns, strict=True))


def _rows(channel: Channel) -> Iterator[Message]:
    """Yield the messages of a channel."""
    names = [list(_columns(field)) for field in channel.fields]
    for k, t in enumerate(channel.t.tolist()):
        found = {"t": repr(t)}
        for field, columns in zip(channel.fields, names, strict=True):
            numbers = [_number(value) for value in np.ravel(field.rows[k]).tolist()]
            if columns:
                found[field.name] = _object(
                    {name: word for name, word in zip(columns, numbers, strict=True) if word != "null"}
                ).decode()
            elif field.shape != ():
                found[field.name] = f"[{','.join(numbers)}]"
            elif numbers[0] != "null":
                found[field.name] = numbers[0]
        yield t, _object(found)


def _chart_schema(chart: Chart) -> dict[str, Any]:
    series = {_curve(chart, k): {"type": "number", "description": chart.unit} for k in range(len(chart.series))}
    return _described(chart.title, series)


def _chart_rows(chart: Chart) -> Iterator[Message]:
    """Yield the points of all curves in order of time."""
    points: dict[float, dict[str, str]] = {}
    for k, series in enumerate(chart.series):
        for t, y in zip(series.t.tolist(), series.y.tolist(), strict=True):
            if not math.isnan(y):
                points.setdefault(t, {})[_curve(chart, k)] = _number(y)
    for t in sorted(points):
        yield t, _object({"t": repr(t), **points[t]})


def _event_rows(events: Iterable[Event]) -> Iterator[Message]:
    for event in events:
        texts = {"agent": event.agent, "kind": event.kind, "message": event.message}
        yield event.t, _object({"t": repr(event.t)} | {name: json.dumps(text) for name, text in texts.items()})


def _curve(chart: Chart, k: int) -> str:
    return chart.series[k].name or "value"


def _number(value: float) -> str:
    """A number as JSON, from which the same is read."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if math.isnan(value):
        return "null"
    return repr(value) if math.isfinite(value) else f"{'-' if value < 0 else ''}1e999"


def _object(words: dict[str, str]) -> bytes:
    """An object whose values are JSON already."""
    return f"{{{','.join(f'{json.dumps(name)}:{word}' for name, word in words.items())}}}".encode()
