"""A run as a recording of Rerun (.rrd), with the views that its viewer opens at first.

| entities | content |
|---|---|
| ``world/...`` | the scene: a transform for each motion, below it meshes and points; lines |
| ``[VEHICLE/]truth``, ``input``, ``readings/NAME``, ``estimate``, ``plan`` | the log, a scalar series for each number |
| ``charts/TITLE/CURVE`` | the curves of the run's page |
| ``events/AGENT``, ``run`` | events as a text log; title, figures and the texts of the run's folder |

The timeline ``t`` is the time of the run, in whole nanoseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mathnavi.interfaces.extras import extra
from mathnavi.interfaces.signals import Array
from mathnavi.renders.export.contents import (
    ExportedRun,
    chart_names,
    marks_of,
    mesh_of,
    moments_of,
    stretches,
    surfaces_of,
)
from mathnavi.renders.palette import Colour
from mathnavi.renders.scene.elements import Camera, Chart, Layer
from mathnavi.sim.records.log_channels import Channel, Field
from mathnavi.sim.records.run_folder import described

TIMELINE, WORLD, CHARTS, EVENTS, RUN = "t", "world", "charts", "events", "run"
DOT = 5.0  # [pixels] of points
LINE = 0.6  # of the width of a line on the page: of its radius here


def writer() -> Callable[[Path, ExportedRun], None]:
    """Return what writes a run to a file, or raises OSError; FieldError if rerun-sdk is not installed."""
    rerun, blueprint = extra("rerun", "--rerun"), extra("rerun.blueprint", "--rerun")
    return lambda path, run: _Writer(rerun, blueprint, run).write(path)


class _Writer:
    """One recording."""

    def __init__(self, rerun: Any, blueprint: Any, run: ExportedRun) -> None:
        self._rr, self._rrb, self._run = rerun, blueprint, run
        self._scene = run.scene
        self._hidden: set[str] = set()  # entities of layers that are not shown at first
        self._names: set[str] = set()
        self._out = rerun.RecordingStream("mathnavi")  # a viewer joins recordings of one id: each has a new one
        self._out.set_log_time_enabled(False)
        self._out.set_log_tick_enabled(False)

    def write(self, path: Path) -> None:
        memory = self._out.memory_recording()  # its own writer to a file waits for ever once the disk is full
        self._out.send_recording_name(self._scene.title)
        self._write_scene()
        for channel in self._run.channels:
            self._write_channel(channel)
        for name, chart in zip(chart_names(self._scene.charts), self._scene.charts, strict=True):
            self._write_chart(name, chart)
        self._write_texts()
        self._out.send_blueprint(self._views())
        path.write_bytes(memory.drain_as_bytes())

    # ---- scene

    def _write_scene(self) -> None:
        rr, scene = self._rr, self._scene
        self._out.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for name, motion in scene.motions.items():
            columns = {"translation": motion.pos}
            if motion.quat is not None:
                columns["quaternion"] = motion.quat[:, [1, 2, 3, 0]]  # the scalar comes last
            self._send(self._moving(name), motion.t, rr.Transform3D.columns(**columns))
        for surface in surfaces_of(scene):
            mesh = mesh_of(surface)
            self._show(
                self._name(surface.layer, "shape", surface.motion),
                surface.motion,
                rr.Mesh3D(
                    vertex_positions=mesh.vertices.astype(np.float32),
                    triangle_indices=mesh.faces.astype(np.uint32),
                    vertex_normals=mesh.normals.astype(np.float32),
                    vertex_colors=mesh.colours,
                    albedo_factor=None if mesh.colours is not None else _rgba(surface.colour, surface.opacity),
                ),
            )
        for mark in marks_of(scene):
            point = rr.Points3D(
                [[0.0, 0.0, 0.0] if mark.place is None else mark.place],
                radii=rr.Radius.ui_points(DOT if mark.dot else 0.5),
                colors=_rgba(mark.colour),
                labels=[mark.text] if mark.text else None,
            )
            self._show(self._name(mark.layer, mark.text or "mark", mark.motion), mark.motion, point)
        for lines in scene.lines:
            name = self._name(lines.layer, "lines", None)
            for moment in moments_of(lines, scene.duration):
                self._out.set_time(TIMELINE, duration=moment.t)
                colours = [_rgba(lines.colour, opacity) for opacity in moment.opacities]
                strips = [each.astype(np.float32) for each in moment.polylines]
                radius = rr.Radius.ui_points(LINE * lines.width)
                self._out.log(name, rr.LineStrips3D(strips, colors=colours, radii=radius))
        self._out.reset_time()

    def _show(self, name: str, motion: str | None, drawn: Any) -> None:
        """Draw something while its motion is shown."""
        for begin, end in stretches(self._scene.motions.get(motion or ""), self._scene.duration):
            if begin <= 0.0 and math.isinf(end):
                self._out.log(name, drawn, static=True)
                continue
            self._out.set_time(TIMELINE, duration=begin)
            self._out.log(name, drawn)
            if math.isfinite(end):
                self._out.set_time(TIMELINE, duration=end)
                self._out.log(name, self._rr.Clear(recursive=False))
            self._out.reset_time()

    def _moving(self, motion: str) -> str:
        return self._path(WORLD, motion)

    def _name(self, layer: Layer | None, kind: str, motion: str | None) -> str:
        """Return a new entity for a part of a layer, below that of its motion."""
        parts = [WORLD, *([motion] if motion is not None else []), layer.name if layer and layer.name else kind]
        found, number = self._path(*parts), 1
        while found in self._names:
            number += 1
            found = self._path(*parts[:-1], f"{parts[-1]} {number}")
        self._names.add(found)
        if layer is not None and not layer.shown:
            self._hidden.add(found)
        return found

    # ---- log

    def _write_channel(self, channel: Channel) -> None:
        if not len(channel.t):
            return
        for field in channel.fields:
            for path, names, rows in _series(channel, field):
                lengths = [row.size for row in rows]
                flat = np.concatenate([row.ravel() for row in rows]).astype(np.float64)
                entity = self._path(*channel.path, *path)
                self._send(entity, channel.t, self._rr.Scalars.columns(scalars=flat).partition(lengths))
                self._out.log(entity, self._rr.SeriesLines(names=names), static=True)

    def _write_chart(self, name: str, chart: Chart) -> None:
        rr = self._rr
        for series in chart.series:
            entity = self._path(CHARTS, name, series.name or chart.title)
            self._send(entity, series.t, rr.Scalars.columns(scalars=series.y))
            self._out.log(
                entity, rr.SeriesLines(colors=_rgba(series.colour), names=series.name or chart.title), static=True
            )
        t = np.array([0.0, self._scene.duration])
        for number, bound in enumerate(chart.bounds, start=1):
            entity = self._path(CHARTS, name, f"bound {number}")
            self._send(entity, t, rr.Scalars.columns(scalars=np.array([bound, bound])))
            self._out.log(entity, rr.SeriesLines(colors=[160, 160, 160, 255], names=f"bound {bound:g}"), static=True)

    def _write_texts(self) -> None:
        rr = self._rr
        for event in self._run.events:
            kind, details = described(event)
            self._out.set_time(TIMELINE, duration=event.t)
            self._out.log(self._path(EVENTS, event.agent or RUN), rr.TextLog(f"{kind}: {details}", level="INFO"))
        self._out.reset_time()
        facts = "".join(f"| {name} | {value} |\n" for name, value in self._scene.facts)
        head = f"# {self._scene.title}\n\n| figure | value |\n|---|---|\n{facts}"
        self._out.log(RUN, rr.TextDocument(head, media_type="text/markdown"), static=True)
        for name, text in self._run.documents.items():
            self._out.log(self._path(RUN, name), rr.TextDocument(text), static=True)

    # ---- what both need

    def _path(self, *parts: str) -> str:
        found: str = self._rr.new_entity_path(list(parts))
        return found

    def _send(self, entity: str, t: Array, columns: Any) -> None:
        nanoseconds = np.round(t * 1e9).astype("timedelta64[ns]")
        self._out.send_columns(entity, indexes=[self._rr.TimeColumn(TIMELINE, duration=nanoseconds)], columns=columns)

    def _views(self) -> Any:
        """The scene with its events on the left, the charts on the right."""
        rrb, scene = self._rrb, self._scene
        charts = [
            rrb.TimeSeriesView(origin=self._path(CHARTS, name), name=_heading(each))
            for name, each in zip(chart_names(scene.charts), scene.charts, strict=True)
        ]
        texts = rrb.Tabs(
            rrb.TextLogView(origin=EVENTS, name="events"), rrb.TextDocumentView(origin=RUN, name="run"), active_tab=0
        )
        left = [texts]
        if scene.cameras:
            overrides = {name: rrb.EntityBehavior(visible=False) for name in sorted(self._hidden)}
            eye = _eye(scene.cameras[0])
            controls = rrb.EyeControls3D(position=eye, look_target=scene.cameras[0].target, eye_up=[0.0, 0.0, 1.0])
            view = rrb.Spatial3DView(origin=WORLD, name=scene.title, overrides=overrides, eye_controls=controls)
            left = [rrb.Vertical(view, texts, row_shares=[4, 1])]
        right = [rrb.Vertical(*charts)] if charts else []
        time = rrb.TimePanel(timeline=TIMELINE, state="collapsed")
        return rrb.Blueprint(rrb.Horizontal(*left, *right), time, auto_views=False, auto_layout=False)


def _series(channel: Channel, field: Field) -> Iterator[tuple[list[str], list[str], Sequence[Array]]]:
    """Yield the entities of a field below that of its channel, with the names of their numbers, and their rows.

    A number with a name has its own entity; others are the components of one.
    """
    rows = [np.atleast_1d(np.asarray(row)) for row in field.rows]
    if field.columns:
        for k, name in enumerate(field.columns):
            yield [field.name, name], [name], [row[k : k + 1] for row in rows]
        return
    names = [field.name]
    if field.shape is not None and rows[0].size > 1:
        names = [f"{field.name}{list(place)}" for place in np.ndindex(rows[0].shape)]
    yield [field.name], names, rows


def _heading(chart: Chart) -> str:
    return f"{chart.title} [{chart.unit}]" if chart.unit else chart.title


def _eye(camera: Camera) -> list[float]:
    """(3,) [m] where a camera is."""
    azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
    sight = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    eye: list[float] = (np.array(camera.target) - camera.distance * sight).tolist()
    return eye


def _rgba(colour: Colour, opacity: float = 1.0) -> list[int]:
    return [round(255 * channel) for channel in (*colour, opacity)]
