"""The plug-in ``missile``: plans the flight to a target online, and flies it with one of three autopilots."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from mathnavi.controllers.missile.autopilot import Autopilot, DelayCompensation, FeedbackLinearisation, OpenLoop
from mathnavi.controllers.missile.optimiser import JointOptimiser, Optimiser, OptimiserWithFallback
from mathnavi.controllers.missile.pitch_and_yaw import PitchAndYaw
from mathnavi.controllers.missile.planes import Limits
from mathnavi.controllers.missile.planner import MissilePlanner
from mathnavi.controllers.missile.tvlqr import TimeVaryingLQR
from mathnavi.controllers.ocp.backend import Backend
from mathnavi.controllers.ocp.distribution import Equidistributed, Fixed, NodeDistribution
from mathnavi.interfaces.bounds import Positive, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.models.compilation import compiler
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.mission import MissileMission

AutopilotName = Literal["feedback-linearisation", "tvlqr", "open-loop"]
BackendName = Literal["auto", "fatrop", "fatrop-compiled", "ipopt", "ipopt-compiled"]
GridName = Literal["uniform", "arclength"]
SpatialName = Literal["pitch-and-yaw", "joint"]

_FASTEST = 0.2  # bandwidth times control period
_PER_DELAY = 0.5  # bandwidth times declared delay: faster, a delay 20 % off or a wrong mass makes it unstable
_MOST_NODES = 200
_HIGHEST = 100.0  # [m] of a clearance


@configuration
class MissileConfig:
    """Fields of ``--planner``."""

    kernels: ClassVar[str] = "mathnavi.controllers.missile.optimiser"  # compiled before the first run

    autopilot: AutopilotName = "feedback-linearisation"
    """autopilot that flies the plan"""
    bandwidth: Positive = 8.0
    """bandwidth omega of the feedback linearisation [rad/s]; at most 0.5 over the declared delay of the thrusters"""
    replan_period: Positive = 0.1
    """time between two plans [s], in whole control periods; if longer than the flight, only one plan is flown"""
    commit: Positive = 0.3
    """time to go below which the last plan is flown to its end [s]; replan_period if that is longer"""
    lead: bool = True
    """whether to aim at where the target will be, and not at where it is"""
    nodes: Annotated[int, Within(Interval(ge=4, le=_MOST_NODES), allowed=f"4 to {_MOST_NODES}")] = 25
    """number N of nodes of a plan"""
    grid: GridName = "uniform"
    """distribution of the nodes: at equal times, or equidistributed in scaled arclength by the optimisation"""
    spatial: SpatialName = "pitch-and-yaw"
    """method for a flight in space: a pitch planner and a yaw planner in turn, and one problem in all states where they
    fail; or always one problem"""
    reserve: Annotated[float, Within(Interval(ge=0.0, lt=1.0), allowed="0 <= reserve < 1")] = 0.1
    """share of the thrusters' limits that is left to the autopilot"""
    clearance: Annotated[float, Within(Interval(ge=0.0, le=_HIGHEST), allowed=f"0 to {_HIGHEST:g} m")] = 5.0
    """height that plans keep over the ground, except near the target [m]"""
    backend: BackendName = "auto"
    """solver of the optimisation problem; auto is FATROP, compiled where there is a C compiler named cc"""


class MissileController:
    """Optimal flight to a target that may move, planned again while it is flown."""

    Config = MissileConfig

    @staticmethod
    def build(config: MissileConfig, mission: MissileMission) -> tuple[Planner, Tracker]:
        autopilot = _autopilot(config, mission)
        if mission.input_delay > 0.0:
            autopilot = DelayCompensation(autopilot, mission)
        period = max(1, round(config.replan_period / mission.control_period)) * mission.control_period
        backend, remark = _backend(config)
        try:
            optimiser = _optimiser(config, mission, backend)
        except OSError as error:  # the compiler fails
            if config.backend != "auto":
                raise
            optimiser = _optimiser(config, mission, "fatrop")
            remark = f"{error}: the plans are optimised in CasADi's virtual machine"
        planner = MissilePlanner(
            mission,
            optimiser,
            autopilot,
            period,
            max(config.commit, period),
            lead=config.lead,
            remark=remark,
        )
        return planner, autopilot


def _autopilot(config: MissileConfig, mission: MissileMission) -> Autopilot:
    if config.autopilot == "open-loop":
        return OpenLoop(mission)
    if config.autopilot == "tvlqr":
        return TimeVaryingLQR(mission)
    fastest = _FASTEST / mission.control_period
    if config.bandwidth > fastest:
        raise FieldError(
            f"bandwidth = {config.bandwidth!r}; allowed: at most {fastest:g} rad/s at a control_rate of "
            f"{1.0 / mission.control_period:g} Hz"
        )
    delay = mission.input_delay
    bandwidth = min(config.bandwidth, _PER_DELAY / delay) if delay > 0.0 else config.bandwidth
    return FeedbackLinearisation(mission, bandwidth)


def _backend(config: MissileConfig) -> tuple[Backend, str]:
    """The solver, and a remark on its choice."""
    if config.backend != "auto":
        return config.backend, ""
    if compiler() is not None:
        return "fatrop-compiled", ""
    return "fatrop", "no C compiler named cc was found: the plans are optimised in CasADi's virtual machine"


def _optimiser(config: MissileConfig, mission: MissileMission, backend: Backend) -> Optimiser:
    share = 1.0 - config.reserve
    limits = tuple(share * limit for limit in mission.input_max)
    distribution: NodeDistribution = Fixed() if config.grid == "uniform" else Equidistributed()
    common = config.nodes, backend, distribution, config.clearance

    def joint() -> Optimiser:
        return JointOptimiser(mission.case, mission.body, mission.coordinates, limits, *common)

    if mission.coordinates is PLANAR or config.spatial == "joint":
        return joint()
    planned, most = _in_space(limits), _in_space(mission.input_max)
    return OptimiserWithFallback(PitchAndYaw(mission.case, mission.body, planned, most, *common), joint)


def _in_space(limits: tuple[float, ...]) -> Limits:
    """Limits of the five inputs that a missile has in space."""
    axial, lateral, normal, pitching, yawing = limits
    return axial, lateral, normal, pitching, yawing
