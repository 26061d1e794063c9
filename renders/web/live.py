"""Live page of a run that is being simulated: the scene at first, then the news.

The loop's thread calls ``observe``; the server's threads call ``news``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signal_names import name_and_unit
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.flight.run_data import mission_of_record, terrain_of
from mathnavi.renders.flight.scene import follow
from mathnavi.renders.framing import Box
from mathnavi.renders.generic.run_data import TRUTH_WORD
from mathnavi.renders.palette import COLOURS, Colour, SceneElement, vehicle_colour
from mathnavi.renders.scene.bodies import body_surfaces, model_shapes
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.charts import ESTIMATE, ESTIMATED_WORD, TRUTH, grouped
from mathnavi.renders.scene.elements import Camera, Chart, Framed, Layer, Lines, Mark, Motion, Scene, Series
from mathnavi.renders.scene.landscape import airframe, mission_cameras, plan_pieces, radar_domes
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.log import names_of
from mathnavi.sim.engine.loop import Loop
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.records.event_kinds import is_alarm
from mathnavi.sim.records.missions import ChangingFlightRecord, FleetRecord, read_mission
from mathnavi.sim.records.run_folder import described
from mathnavi.sim.scenarios.declared_signals import Estimands, true_values

RATE = 20.0  # [1/s] of samples, in simulated time
GROUPS = (0, 1, 2)  # of geoms that are shown
MOST_STATES = 6  # that have a chart
FIELD_OF_VIEW, FREE = 36.0, Box(0.2, 0.8, 0.2, 0.8)
FOLLOW_DISTANCE = 8.0  # sizes of a vehicle
PARTS = (SceneElement.OPTIMISED, SceneElement.MANOEUVRE, SceneElement.COMPLETION)
Nowhere = np.zeros(0)


class LiveScene:
    """Scene of one loop on a page."""

    def __init__(
        self,
        title: str,
        plant: Plant,
        config: Mapping[str, Any],
        duration: float,
        estimands: Estimands | None = None,
    ) -> None:
        """Build the scene from ``config``, that of config.json, and the largest ``duration`` [s] of the run;
        ``estimands`` is what there is to estimate, if the scenario declares it.
        """
        body = plant.plant if isinstance(plant, Disturbed) else plant
        self._title, self._config, self._duration, self._plant = title, config, duration, plant
        self._estimands = estimands
        self._body = body if isinstance(body, MujocoPlant) else None
        self._terrain: HeightField | None = terrain_of(config["terrain"]) if config.get("terrain") else None
        self._lock = threading.Lock()
        self._samples: list[dict[str, Any]] = []
        self._plans: dict[str, tuple[int, Any]] = {}  # by vehicle: version, lines
        self._followed: dict[str, Plan] = {}
        self._events = 0
        self._next = 0.0  # [s]
        self._charts, self._values = self._chart_functions()

    # ---- the page at first

    def scene(self) -> Scene:
        """The scene before the first sample."""
        flying = self._terrain is not None and self._has_airframes()
        own = self._flight() if flying else self._mechanism() if self._body is not None else {"cameras": ()}
        return Scene(self._title, self._duration, charts=self._charts, speed=1.0, **own)

    def _has_airframes(self) -> bool:
        model = None if self._body is None else self._body.model
        names = {model.body(b).name for b in range(model.nbody)} if model is not None else set()
        return all(f"{name}/airframe" in names for name in self._plant.names)

    def _flight(self) -> dict[str, Any]:
        """Vehicles as airframes over the relief of the ground, with radars, starts and targets."""
        terrain, names = self._terrain, list(self._plant.names)
        assert terrain is not None
        several, mission = len(names) > 1, self._config["mission"]
        if several:
            fleet = read_mission(FleetRecord, mission)
            each = {name: {**mission, **mission["vehicles"][name]} for name in fleet.vehicles}
        else:
            each = {names[0]: mission}
        flown = {name: mission_of_record(read_mission(ChangingFlightRecord, own), ()) for name, own in each.items()}
        first = next(iter(flown.values()))
        motions, surfaces = radar_domes(first.radars, terrain, self._duration)
        lines, marks, cameras = [], [], []
        for number, (name, own) in enumerate(flown.items()):
            layer = Layer(name, vehicle_colour(number)) if several else Layer.for_element(SceneElement.FLOWN)
            motions[name] = Motion(np.zeros(1), own.start[None], np.array([[1.0, 0.0, 0.0, 0.0]]))
            surfaces += airframe(name, layer, layer.colour if several else None)
            lines.append(_path(name, layer))
            for part in PARTS:
                in_part = layer if several else Layer.for_element(part, dashed=part is SceneElement.COMPLETION)
                lines.append(
                    _ahead(in_part, layer.colour if several else COLOURS[part], part, f"{name}:{PARTS.index(part)}")
                )
            cameras.append(follow(name))
            foot = float(terrain.height(*own.target[:2]))
            marks.append(Mark("slot" if several else "target", COLOURS[SceneElement.TARGET], own.target, foot=foot))
        places = np.vstack([[own.start, own.target] for own in flown.values()])
        return {
            "cameras": [*mission_cameras(terrain, places, first.target - first.start), *cameras], "motions": motions,
            "surfaces": surfaces, "lines": lines, "marks": marks, "ground": terrain,
        }  # fmt: skip

    def _mechanism(self) -> dict[str, Any]:
        """Add the bodies of the model at their true size."""
        assert self._body is not None
        model, data = self._body.model, self._body.data
        mujoco.mj_kinematics(model, data)
        moving = self._moving()
        own = {b: f"body {b}" for b in moving}
        pos, quat = data.xpos.copy(), data.xquat.copy()
        motions = {name: Motion(np.zeros(1), pos[b][None], quat[b][None]) for b, name in own.items()}
        shapes = model_shapes(model, GROUPS)
        extent = float(model.stat.extent)
        surfaces = body_surfaces(shapes, own, (pos, quat), endless=20.0 * extent)
        floors = [each for each in surfaces if each.checker > 0.0]
        lines, cameras = [], []
        points = np.vstack([pos[moving] - 0.3 * extent, pos[moving] + 0.3 * extent])
        for name, sight in {"fixed": (50.0, -24.0), "top": (90.0, -89.0)}.items():
            cameras.append(framing_camera(name, Framed(points, FREE), sight, FIELD_OF_VIEW))
        for number, name in enumerate(self._plant.names):
            body = next((b for b in moving if model.body(b).name.startswith(f"{name}/")), moving[0])
            size = float(model.geom_rbound[model.geom_bodyid == body].max(initial=0.05 * extent))
            lines.append(_path(own[body], Layer(f"path of {name}", vehicle_colour(number))))
            cameras.append(Camera(f"follow {name}", (0.0, 0.0, 0.0), FOLLOW_DISTANCE * size, 40.0, -24.0, own[body]))
        level = float(floors[0].vertices[:, 2].max()) if floors else None
        return {"cameras": cameras, "motions": motions, "surfaces": surfaces, "lines": lines, "floor": level}

    def _moving(self) -> list[int]:
        assert self._body is not None
        found: list[int] = np.flatnonzero(self._body.model.body_weldid != 0).tolist()
        return found

    # ---- what is new

    def observe(self, loop: Loop) -> None:
        """Take a sample of the loop, if it is time."""
        if loop.t < self._next - 1e-9:
            return
        self._next = loop.t + 1.0 / RATE
        sample = {"t": loop.t, "motions": self._poses(loop), "charts": [each(loop) for each in self._values]}
        plans = self._new_plans(loop)
        with self._lock:
            self._samples.append(sample)
            for name, lines in plans.items():
                self._plans[name] = (len(self._samples), lines)
            self._events = len(loop.recording.events)
            self._recorded = loop.recording.events

    def news(self, since: int) -> dict[str, Any]:
        """News after the first ``since`` samples."""
        with self._lock:
            samples = self._samples[since:]
            plans = {name: lines for name, (version, lines) in self._plans.items() if version > since}
            following = len(self._samples)
            events = list(self._recorded[: self._events]) if samples else []
        names = list(samples[0]["motions"]) if samples else []
        worded = [(event.t, *described(event), is_alarm(event)) for event in events]
        return {
            "next": following,
            "t": [sample["t"] for sample in samples],
            "motions": {
                name: [
                    [x for sample in samples for x in sample["motions"][name][0]],
                    [x for sample in samples for x in sample["motions"][name][1]],
                ]
                for name in names
            },
            "charts": [sample["charts"] for sample in samples],
            "plans": plans,
            "events": [[t, f"{kind}: {details}" if details else kind, alarm] for t, kind, details, alarm in worded],
        }

    def _poses(self, loop: Loop) -> dict[str, tuple[list[float], list[float]]]:
        """Place and quaternion of everything that moves."""
        if self._body is None:
            return {}
        if self._terrain is not None and self._has_airframes():
            found: dict[str, tuple[list[float], list[float]]] = {}
            for name, x in loop.truths.items():
                place, quat = airframe_pose(x[:3], x[3:6], loop.runners[name].command)
                found[name] = (np.round(place, 2).tolist(), np.round(quat, 4).tolist())
            return found
        data = self._body.data
        return {
            f"body {b}": (np.round(data.xpos[b], 5).tolist(), np.round(data.xquat[b], 5).tolist())
            for b in self._moving()
        }

    def _new_plans(self, loop: Loop) -> dict[str, Any]:
        """The plans that have been adopted since the sample before, by vehicle."""
        if self._terrain is None:
            return {}
        found: dict[str, Any] = {}
        for name, runner in loop.runners.items():
            plan = runner.plan
            if plan is None or plan is self._followed.get(name) or plan.x.shape[1] < 6:
                continue
            self._followed[name] = plan
            parts: list[dict[str, Any]] = [{"points": [], "times": [], "offsets": [0]} for _ in PARTS]
            for part, (times, places) in plan_pieces(plan, loop.t):
                own = parts[PARTS.index(part)]
                own["points"] += np.round(places, 1).ravel().tolist()
                own["times"] += np.round(times, 2).tolist()
                own["offsets"].append(len(own["times"]))
            found |= {f"{name}:{k}": own for k, own in enumerate(parts)}
        return found

    # ---- charts

    def _chart_functions(self) -> tuple[list[Chart], list[Callable[[Loop], list[float | None]]]]:
        """Charts, and what to draw in each at a sample: a value for each of its curves."""
        names = list(self._plant.names)
        if self._terrain is not None and len(self._plant.state(names[0])) >= 6:
            return self._flight_charts(names)
        charts: list[Chart] = []
        values: list[Callable[[Loop], list[float | None]]] = []
        if len(names) > 1:
            curves = [(name, vehicle_colour(number)) for number, name in enumerate(names)]
            for k, words in enumerate(self._plant.state_names(names[0])[:MOST_STATES]):
                charts.append(_empty(*name_and_unit(words), curves))
                values.append(partial(_states, k))
            return charts, values
        estimands = self._estimands
        both = [(TRUTH_WORD, TRUTH), (ESTIMATED_WORD, ESTIMATE)]
        if estimands is not None:
            wanted = list(true_values(estimands, self._plant.state(names[0])[None]))
            for k, words in enumerate(wanted):
                charts.append(_empty(*name_and_unit(words), both))
                values.append(partial(_estimated, estimands, words, k, len(wanted)))
        signals = names_of(self._plant, names[0])
        for title, unit, columns in grouped(signals.states, signals.groups)[:MOST_STATES]:
            if len(columns) > 1:
                curves = [(called, vehicle_colour(number)) for number, (_, called) in enumerate(columns)]
            else:
                curves = both if estimands is None else [("", TRUTH)]
            charts.append(_empty(title, unit, curves))
            values.append(partial(_single, [k for k, _ in columns], len(curves)))
        return charts, values

    def _flight_charts(self, names: list[str]) -> tuple[list[Chart], list[Callable[[Loop], list[float | None]]]]:
        terrain = self._terrain
        assert terrain is not None
        several = len(names) > 1
        curves = [
            Series(name if several else "", vehicle_colour(number) if several else TRUTH, Nowhere, Nowhere)
            for number, name in enumerate(names)
        ]
        mission = self._config["mission"]
        bounds = [[float(mission[key])] if key in mission else [] for key in ("clearance_min", "speed_max")]

        def above(loop: Loop) -> list[float | None]:
            return [_number(x[2] - float(terrain.height(x[0], x[1]))) for x in loop.truths.values()]

        def speed(loop: Loop) -> list[float | None]:
            return [_number(np.linalg.norm(_velocity(x))) for x in loop.truths.values()]

        return [
            Chart("height above ground", "m", curves, bounds[0], logarithmic=True),
            Chart("speed", "m/s", curves, bounds[1]),
        ], [above, speed]


def _velocity(x: Array) -> Array:
    """(3,) [m/s] in a state of a point, or of a quadrotor."""
    velocity: Array = x[3:6] if len(x) == 6 else x[7:10]
    return velocity


def _empty(title: str, unit: str, curves: Sequence[tuple[str, Colour]]) -> Chart:
    """A chart before the first sample."""
    return Chart(title, unit, [Series(name, colour, Nowhere, Nowhere) for name, colour in curves])


def _states(k: int, loop: Loop) -> list[float | None]:
    """Return a state of every vehicle."""
    return [_number(x[k]) for x in loop.truths.values()]


def _single(columns: Sequence[int], curves: int, loop: Loop) -> list[float | None]:
    """Return some states of a single vehicle, and the estimate of a chart that has a curve for it."""
    (x,) = loop.truths.values()
    values = [_number(x[k]) for k in columns]
    return values if len(values) == curves else [*values, _estimate(loop, columns[0], len(x))]


def _estimated(estimands: Estimands, words: str, k: int, size: int, loop: Loop) -> list[float | None]:
    """Return the true value of one of the estimands of a single vehicle, and its estimate."""
    (x,) = loop.truths.values()
    return [_number(true_values(estimands, x[None])[words][0]), _estimate(loop, k, size)]


def _estimate(loop: Loop, k: int, size: int) -> float | None:
    """The k-th number of the estimate of a single vehicle; None if it has fewer numbers."""
    estimate = next(iter(loop.runners.values())).estimate
    return None if estimate is None or len(estimate.x) != size else _number(estimate.x[k])


def _number(value: Any) -> float | None:
    return float(f"{float(value):.6g}") if np.isfinite(value) else None


def _path(motion: str, layer: Layer) -> Lines:
    """The path of a motion so far."""
    return Lines(layer, np.zeros((0, 3)), np.array([0, 0]), layer.colour, 3.2, cut="past", motion=motion)


def _ahead(layer: Layer, colour: tuple[float, float, float], part: SceneElement, plan: str) -> Lines:
    """A part of the plan of the moment, which comes with the news."""
    return Lines(
        layer, np.zeros((0, 3)), np.array([0]), colour, 3.0, part is SceneElement.COMPLETION, times=np.zeros(0),
        cut="ahead", plan=plan,
    )  # fmt: skip
