"""Two or more scenes as one: all runs begin at time 0, each in a colour of its own.

What all runs have in common, such as ground, walls and radars, is shown once. Charts are merged where runs have one of
the same name and unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.renders.palette import Colour, SceneElement, vehicle_colour
from mathnavi.renders.scene.cameras import ASPECT, framing_camera
from mathnavi.renders.scene.elements import PATTERNS, Camera, Chart, Layer, Lines, Mark, Motion, Scene, Series, Surface

SEEN_THROUGH = 0.5  # opacity of the bodies of the second run and of later ones, beside those of the first
ESTIMATED = {part.value for part in (SceneElement.ESTIMATE, SceneElement.BELIEVED, SceneElement.FOUND_VELOCITY)}
REFERENCE = SceneElement.REFERENCE.value  # what another system found: the same of all runs over one log
EQUAL = 1e-6  # [m] of places that are the same


def side_by_side(scenes: Mapping[str, Scene]) -> Scene:
    """Return the scene of several runs by their names; ArgumentError if they are over different grounds."""
    names, each = list(scenes), list(scenes.values())
    grounds = {None if scene.ground is None else scene.ground.digest for scene in each if scene.cameras}
    if len(grounds) > 1:
        raise ArgumentError(f"{', '.join(names)} are over different grounds; allowed: runs over the same one")
    parts = [_Part(name, number, each) for number, name in enumerate(names)]
    first = each[0]
    return Scene(
        title="; ".join(f"{name}: {scene.title}" for name, scene in scenes.items()),
        duration=max(scene.duration for scene in each),
        cameras=_cameras(parts),
        motions={name: motion for part in parts for name, motion in part.motions.items()},
        surfaces=[surface for part in parts for surface in part.surfaces()],
        lines=[lines for part in parts for lines in part.lines()],
        marks=[mark for part in parts for mark in part.marks()],
        charts=_charts(scenes),
        events=sorted(
            (t, f"{name}: {words}", alarm) for name, scene in scenes.items() for t, words, alarm in scene.events
        ),
        facts=_facts(each),
        ground=next((scene.ground for scene in each if scene.ground is not None), None),
        floor=next((scene.floor for scene in each if scene.floor is not None), None),
        note=first.note,
        speed=first.speed,
    )


class _Part:
    """The elements of one of the scenes, under names that no other one has."""

    def __init__(self, name: str, number: int, scenes: Sequence[Scene]) -> None:
        self.name, self.scene, self.colour = name, scenes[number], vehicle_colour(number)
        self._first = number == 0
        self._before, self._others = scenes[:number], [scene for k, scene in enumerate(scenes) if k != number]
        shared = {
            key for key, motion in self.scene.motions.items() if all(_moves_as(motion, o, key) for o in self._others)
        }
        self._shared = shared
        self._references = {
            lines.layer.name
            for lines in self.scene.lines
            if lines.layer.name == REFERENCE
            and all(any(_same(lines, other, ("points",)) for other in scene.lines) for scene in self._others)
        }
        self.motions = {
            self.motion(key): motion
            for key, motion in self.scene.motions.items()
            if self._first or key not in shared
        }  # fmt: skip

    def motion(self, key: str) -> str:
        """The name of a motion of the scene; a motion that is the same in all runs keeps its own."""
        return key if key in self._shared else f"{self.name}/{key}"

    def surfaces(self) -> list[Surface]:
        """The surfaces, without those that an earlier scene has."""
        found = []
        for surface in self.scene.surfaces:
            if self._common(surface.motion):
                before = [other for scene in self._before for other in scene.surfaces]
                if not any(_same(surface, other, ("vertices", "faces", "motion")) for other in before):
                    found.append(surface)
                continue
            assert surface.motion is not None
            layer = surface.layer and self._layer(surface.layer)
            own = replace(surface, motion=self.motion(surface.motion), layer=layer)
            if surface.span > 0.0:  # a sign for a vehicle
                own = replace(own, colour=self.colour)
            elif not self._first and surface.opacity >= 1.0:
                own = replace(own, colour=self.colour, opacity=SEEN_THROUGH, shadow=False, picture=b"")
            found.append(own)
        return found

    def lines(self) -> list[Lines]:
        """The lines: paths in the colour of the run, others in their own and hidden at first."""
        found = []
        for lines in self.scene.lines:
            if lines.layer.name in self._references:
                found += [lines] * self._first
                continue
            if lines.motion is None and not lines.cut and lines.frames is None:
                if not any(_same(lines, other, ("points",)) for s in self._before for other in s.lines):
                    found.append(lines)
                continue
            motion = None if lines.motion is None else self.motion(lines.motion)
            layer = self._layer(lines.layer)
            colour = layer.colour if lines.cut == "past" else lines.colour
            found.append(replace(lines, layer=layer, colour=colour, motion=motion))
        return found

    def marks(self) -> list[Mark]:
        """The marks, without those that an earlier scene has, and the name of the run at its first vehicle."""
        found = []
        for mark in self.scene.marks:
            if self._common(mark.motion):
                fields = ("text", "place", "motion")
                before, after = (
                    [any(_same(mark, other, fields) for other in scene.marks) for scene in scenes]
                    for scenes in (self._before, self._others[len(self._before) :])
                )
                if not any(before) and not any(after):
                    found.append(replace(mark, text=f"{self.name}: {mark.text}" if mark.text else ""))
                elif not any(before):  # of several runs, it is shown once
                    found.append(mark)
            else:
                assert mark.motion is not None
                layer = mark.layer and self._layer(mark.layer)
                text = f"{self.name}: {mark.text}" if mark.text else ""
                found.append(replace(mark, text=text, motion=self.motion(mark.motion), layer=layer))
        if (leader := self.leader) is not None:
            found.insert(0, Mark(self.name, self.colour, motion=self.motion(leader), dot=False))
        return found

    @property
    def leader(self) -> str | None:
        """The motion that the first camera follows."""
        return next((camera.follow for camera in self.scene.cameras if camera.follow is not None), None)

    def _common(self, motion: str | None) -> bool:
        """True for what stands in the world, or moves in all runs alike."""
        return motion is None or motion in self._shared

    def _layer(self, layer: Layer) -> Layer:
        """A layer of this run alone: of paths in the run's colour, of plans and rays hidden at first."""
        paths = list(dict.fromkeys(lines.layer.name for lines in self.scene.lines if lines.cut == "past"))
        paths = [name for name in paths if name not in self._references]
        true = [name for name in paths if name not in ESTIMATED] or paths
        name = self.name if [layer.name] == true else f"{self.name}: {layer.name}"
        if layer.name not in paths:
            drawn = any(lines.layer.name == layer.name for lines in self.scene.lines)
            return replace(layer, name=name, shown=layer.shown and not drawn)
        return replace(layer, name=name, colour=self.colour if layer.name in true else _paler(self.colour))


def _cameras(parts: Sequence[_Part]) -> list[Camera]:
    """Those that stand still, so that all runs are in the picture, and the following ones of each run."""
    found = []
    for camera in parts[0].scene.cameras:
        if camera.follow is not None:
            continue
        same = [c for part in parts for c in part.scene.cameras if c.name == camera.name and c.framed is not None]
        framed = camera.framed
        if framed is not None and any(not np.array_equal(framed.points, c.framed.points) for c in same if c.framed):
            points = np.vstack([c.framed.points for c in same if c.framed is not None])
            low = min(part.scene.low for part in parts)
            wide = framing_camera(
                camera.name, replace(framed, points=points, motions=()), (camera.azimuth, camera.elevation),
                camera.field_of_view, aspect=ASPECT, low=low, tall=camera.tall,
            )  # fmt: skip
            camera = replace(camera, target=wide.target, distance=wide.distance, framed=wide.framed)
        found.append(camera)
    for part in parts:
        found += [
            replace(camera, name=f"{part.name}: {camera.name}", follow=part.motion(camera.follow))
            for camera in part.scene.cameras
            if camera.follow is not None
        ]
    return found


def _charts(scenes: Mapping[str, Scene]) -> list[Chart]:
    """The charts by name and unit: first those of two runs or more."""
    by_name: dict[tuple[str, str], list[tuple[str, Colour, Chart]]] = {}
    for number, (name, scene) in enumerate(scenes.items()):
        for chart in scene.charts:
            by_name.setdefault((chart.title, chart.unit), []).append((name, vehicle_colour(number), chart))
    merged = [(len({name for name, *_ in each}), _merged(each)) for each in by_name.values()]
    return [chart for count, chart in merged if count > 1] + [chart for count, chart in merged if count == 1]


def _merged(each: Sequence[tuple[str, Colour, Chart]]) -> Chart:
    """One chart of several: each run has a colour, each of its curves a pattern of dashes."""
    series: list[Series] = []
    for name, colour, chart in each:
        series += [
            replace(
                own, name=f"{name}: {own.name}" if own.name else name, colour=colour, pattern=number % len(PATTERNS)
            )
            for number, own in enumerate(chart.series)
        ]
    first = each[0][2]
    bounds = list(dict.fromkeys(bound for *_, chart in each for bound in chart.bounds))
    return replace(first, series=series, bounds=bounds, logarithmic=all(chart.logarithmic for *_, chart in each))


def _facts(scenes: Sequence[Scene]) -> list[tuple[str, str]]:
    """The figures of all runs in their order, once where they are the same."""
    names = dict.fromkeys(name for scene in scenes for name, _ in scene.facts)
    found = []
    for name in names:
        values = [dict(scene.facts).get(name, "–") for scene in scenes]
        found.append((name, values[0] if len(set(values)) == 1 else " · ".join(values)))
    return found


def _moves_as(motion: Motion, other: Scene, key: str) -> bool:
    """True if another scene has the same motion under the same name."""
    return key in other.motions and _same(motion, other.motions[key], ("t", "pos", "quat"))


def _same(one: Any, other: Any, fields: Sequence[str]) -> bool:
    """True if some fields of two elements are equal, places to within ``EQUAL``."""
    for name in fields:
        a, b = getattr(one, name), getattr(other, name)
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
            if a.shape != b.shape or not np.allclose(a, b, rtol=0.0, atol=EQUAL, equal_nan=True):
                return False
        elif a is not b and a != b:
            return False
    return True


def _paler(colour: Colour) -> Colour:
    """A colour half way to white."""
    red, green, blue = (0.5 + 0.5 * channel for channel in colour)
    return red, green, blue
