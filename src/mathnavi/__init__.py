"""mathnavi: planners and observers close the loop with MuJoCo's physics.

    import mathnavi as mn

    run = mn.run("safe-flight", seed=3, terrain="jacksboro", controller=mn.plugin("flight", nodes=7))
    run.summary["min_clearance_m"], run["truth.x"], run.plot(), run.report("flight.html"), run.save("out")

These names are the public interface; each is imported at its first use. Everything else, such as ``mathnavi.models``,
can be imported too, and may change from version to version.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mathnavi.controllers.ocp.backend import Options as SolverOptions
    from mathnavi.controllers.ocp.monitors import Monitor
    from mathnavi.controllers.ocp.phases import MultiPhaseProblem
    from mathnavi.controllers.ocp.pontryagin import check_pontryagin
    from mathnavi.controllers.ocp.problems.library import OptimalControlProblem
    from mathnavi.controllers.ocp.progress import SolveProgress
    from mathnavi.controllers.ocp.saved_solution import load_solution
    from mathnavi.interfaces.errors import (
        ArgumentError,
        FieldError,
        LogError,
        MissionError,
        PluginError,
        ProblemError,
        RunFolderError,
        SolutionFileError,
        StoreError,
        TerrainError,
    )
    from mathnavi.interfaces.signals import Estimate, Measurement, Message, Plan, PlanRequest, Status
    from mathnavi.models.aerial.beacons import FlightBeacons
    from mathnavi.models.aerial.mission import FlightMission
    from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
    from mathnavi.models.field.curve import Curve, ellipse
    from mathnavi.models.field.polygon import Polygon
    from mathnavi.models.inertial_mission import InertialMission
    from mathnavi.models.manifold.constant_curvature import flat_space as EuclideanSpace  # noqa: N812
    from mathnavi.models.manifold.constant_curvature import hyperbolic_space as HyperbolicSpace  # noqa: N812
    from mathnavi.models.manifold.constant_curvature import sphere as Sphere  # noqa: N812
    from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
    from mathnavi.models.manifold.systems import RigidBody
    from mathnavi.models.mechanism.system import MechanismSystem
    from mathnavi.models.quadrotor.mission import InertialQuality, QuadrotorMission
    from mathnavi.models.terrain.dem_import import import_dem as import_terrain
    from mathnavi.models.terrain.height_field import HeightField
    from mathnavi.models.terrain.library import load_terrain
    from mathnavi.models.terrain.visibility import Radar
    from mathnavi.models.unicycle.beacons import BeaconMission, BeaconQuality
    from mathnavi.models.unicycle.mission import RangingMission
    from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
    from mathnavi.scripting.flight import FlightPlan, Verdict, certify, plan_flight
    from mathnavi.scripting.loading import load
    from mathnavi.scripting.localisation import PoseObserver, wall_through
    from mathnavi.scripting.localisation import feasible_set_bank as FeasibleSetBank  # noqa: N812
    from mathnavi.scripting.observers import IntrinsicObserver, VelocityObserver
    from mathnavi.scripting.requests import plugin
    from mathnavi.scripting.run_result import RunResult
    from mathnavi.scripting.runs import available, make, run, study, sweep
    from mathnavi.scripting.safety_filter import SafetyFilter
    from mathnavi.sim.logs.formats import read_log
    from mathnavi.sim.logs.identification import identify
    from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
    from mathnavi.sim.plugin.registry import PluginSpec
    from mathnavi.sim.records.sensor_log import EstimateHistory, SensorLog, estimate, smoother

    __version__: str

# Each name with its module, and with its name there where that is another one.
_PLACES = {
    # runs of scenarios
    "run": "scripting.runs",
    "load": "scripting.loading",
    "sweep": "scripting.runs",
    "study": "scripting.runs",
    "make": "scripting.runs",
    "plugin": "scripting.requests",
    "available": "scripting.runs",
    "RunResult": "scripting.run_result",
    "PluginSpec": "sim.plugin.registry",
    # planner and certificate
    "plan_flight": "scripting.flight",
    "certify": "scripting.flight",
    "FlightPlan": "scripting.flight",
    "Verdict": "scripting.flight",
    "SafetyFilter": "scripting.safety_filter",
    # observers
    "IntrinsicObserver": "scripting.observers",
    "VelocityObserver": "scripting.observers",
    "Sphere": "models.manifold.constant_curvature:sphere",
    "HyperbolicSpace": "models.manifold.constant_curvature:hyperbolic_space",
    "EuclideanSpace": "models.manifold.constant_curvature:flat_space",
    "RigidBody": "models.manifold.systems",
    "FeasibleSetBank": "scripting.localisation:feasible_set_bank",
    "PoseObserver": "scripting.localisation",
    "Curve": "models.field.curve",
    "Polygon": "models.field.polygon",
    "ellipse": "models.field.curve",
    "wall_through": "scripting.localisation",
    # estimators over one's own log
    "estimate": "sim.records.sensor_log",
    "smoother": "sim.records.sensor_log",
    "SensorLog": "sim.records.sensor_log",
    "read_log": "sim.logs.formats",
    "identify": "sim.logs.identification",
    "RecordedLog": "sim.logs.recorded_log",
    "Channel": "sim.logs.recorded_log",
    "EstimateHistory": "sim.records.sensor_log",
    "RangingMission": "models.unicycle.mission",
    "BeaconMission": "models.unicycle.beacons",
    "BeaconQuality": "models.unicycle.beacons",
    "RangeQuality": "models.unicycle.quality",
    "OdometryQuality": "models.unicycle.quality",
    "KnownStart": "models.unicycle.quality",
    "LagrangianMission": "models.manifold.mission",
    "PositionQuality": "models.manifold.mission",
    "MechanismSystem": "models.mechanism.system",
    "FlightMission": "models.aerial.mission",
    "FlightBeacons": "models.aerial.beacons",
    "QuadrotorMission": "models.quadrotor.mission",
    "InertialQuality": "models.quadrotor.mission",
    "InertialMission": "models.inertial_mission",
    # optimal control
    "OptimalControlProblem": "controllers.ocp.problems.library",  # which enters the problems of the literature
    "MultiPhaseProblem": "controllers.ocp.phases",
    "Monitor": "controllers.ocp.monitors",
    "SolveProgress": "controllers.ocp.progress",
    "SolverOptions": "controllers.ocp.backend:Options",
    "load_solution": "controllers.ocp.saved_solution",
    "check_pontryagin": "controllers.ocp.pontryagin",
    # terrain
    "load_terrain": "models.terrain.library",
    "import_terrain": "models.terrain.dem_import:import_dem",
    "HeightField": "models.terrain.height_field",
    "Radar": "models.terrain.visibility",
    # signals, for plug-ins of one's own
    "Estimate": "interfaces.signals",
    "Measurement": "interfaces.signals",
    "Message": "interfaces.signals",
    "FlightPhase": "models.aerial.plan_status",
    "FlightStatus": "models.aerial.plan_status",
    "Plan": "interfaces.signals",
    "PlanRequest": "interfaces.signals",
    "Status": "interfaces.signals",
    # errors, all of them ValueErrors
    "ArgumentError": "interfaces.errors",
    "FieldError": "interfaces.errors",
    "LogError": "interfaces.errors",
    "MissionError": "interfaces.errors",
    "PluginError": "interfaces.errors",
    "ProblemError": "interfaces.errors",
    "RunFolderError": "interfaces.errors",
    "SolutionFileError": "interfaces.errors",
    "StoreError": "interfaces.errors",
    "TerrainError": "interfaces.errors",
}

__all__ = [  # noqa: RUF022 (in the order of the table above)
    "run",
    "load",
    "sweep",
    "study",
    "make",
    "plugin",
    "available",
    "RunResult",
    "PluginSpec",
    "plan_flight",
    "certify",
    "FlightPlan",
    "Verdict",
    "SafetyFilter",
    "IntrinsicObserver",
    "VelocityObserver",
    "Sphere",
    "HyperbolicSpace",
    "EuclideanSpace",
    "RigidBody",
    "FeasibleSetBank",
    "PoseObserver",
    "Curve",
    "Polygon",
    "ellipse",
    "wall_through",
    "estimate",
    "smoother",
    "SensorLog",
    "read_log",
    "identify",
    "RecordedLog",
    "Channel",
    "EstimateHistory",
    "RangingMission",
    "BeaconMission",
    "BeaconQuality",
    "RangeQuality",
    "OdometryQuality",
    "KnownStart",
    "LagrangianMission",
    "PositionQuality",
    "MechanismSystem",
    "FlightMission",
    "FlightBeacons",
    "QuadrotorMission",
    "InertialQuality",
    "InertialMission",
    "OptimalControlProblem",
    "MultiPhaseProblem",
    "Monitor",
    "SolveProgress",
    "SolverOptions",
    "load_solution",
    "check_pontryagin",
    "load_terrain",
    "import_terrain",
    "HeightField",
    "Radar",
    "Estimate",
    "Measurement",
    "Message",
    "FlightPhase",
    "FlightStatus",
    "Plan",
    "PlanRequest",
    "Status",
    "ArgumentError",
    "FieldError",
    "LogError",
    "MissionError",
    "PluginError",
    "ProblemError",
    "RunFolderError",
    "SolutionFileError",
    "StoreError",
    "TerrainError",
]


if not TYPE_CHECKING:  # else a name that is not there would be taken for one that is

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            from importlib.metadata import version

            return version(__name__)
        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from mathnavi.models.dm_control_requirement import require_dm_control
        from mathnavi.models.opengl import import_mujoco

        require_dm_control()
        import_mujoco()  # before a module imports it, which would load OpenGL
        module, _, inside = _PLACES[name].partition(":")
        value = getattr(importlib.import_module(f"{__name__}.{module}"), inside or name)
        globals()[name] = value  # asked for once
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
