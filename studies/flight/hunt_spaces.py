"""Spaces of the study ``hunt``: for each search a scenario, the fields that it varies, and its trials.

All missions are short, in canyons of 640 m and over level ground. The spaces contain noise and gusts as declared to the
controller, faults, bounds, ends, heights, seeds and changes on the way; for the mutants also the planner's horizon,
period and nodes; and for third-party parts what they do instead of answering.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, get_args

from mathnavi.controllers.flight.certificate import TrackingBound, raised_ground
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.flight_parts import mission_but_ends
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.flight import guarantee_holes, hostile_fleet, hostile_parts, policy_flight

FLOWN = guarantee_holes.__name__  # where the measures and the mutants are
SEEDS = 100_000
ROUNDING = 1e-3  # [m]
CANYONS = ("canyon:3", "canyon:7")
GRID = {"planner.grid_nodes": 17}  # of the cost-to-go, so that a mission is built quickly
SHORT = {"deadline_factor": 1.5, **GRID}
LEAST = 4.0  # [m] that the ground rises across a hull, on the steepest walls
LOWEST, ABOVE = 20.0, 30.0  # [m] h_min of missions of mutants, and their ends above it
CONTROL_RATE = 20.0  # [Hz]


@dataclass(frozen=True)
class Hunt:
    """Scenario and the space that is searched."""

    name: str
    space: tuple[Dimension, ...]
    scenario: str = "safe-flight"
    fields: Mapping[str, Any] = field(default_factory=dict)  # at values of their own
    controller: str | None = None
    estimator: str | None = None
    derived: Callable[[Values], dict[str, Any]] = lambda values: dict(values)  # fields, of the values of the space
    measure: str = f"{FLOWN}:violations"

    def make(self, values: Values) -> Trial:
        """Return the trial at these values; FieldError if the configuration refuses them."""
        fields = {**self.fields, **self.derived(values)}
        seed = fields.pop("seed")
        return trial(self.scenario, seed, self.controller, self.estimator, fields, self.measure)


SEED = Range("seed", 0, SEEDS)
FAULTS = (
    Range("faults.solver_failure_rate", 0.0, 0.95),
    Range("faults.late_plan_rate", 0.0, 0.9),
    Range("faults.dropout_rate", 0.0, 0.9),
)
AIR = (
    Range("faults.gust_rms", 0.0, 1.0),
    Range("faults.gust_time_constant", 0.1, 10.0, log=True),
    Range("noise.position", 0.0, 2.0),
)


def _course(fixed: Mapping[str, Any], values: Values) -> dict[str, Any]:
    """Return fields with start and target on opposite sides of a middle, above the lowest certified height."""
    fields = {name: value for name, value in values.items() if name not in COURSE_NAMES}
    keep = _lowest({**fixed, **fields})
    heading, half = float(values["heading"]), 0.5 * float(values["distance"])
    for name, side in (("start", -half), ("target", half)):
        x = float(values["middle_x"]) + side * math.cos(heading)
        y = float(values["middle_y"]) + side * math.sin(heading)
        fields[name] = (x, y, keep(x, y) + float(values[f"{name}_height"]))
    return fields


def _lowest(fields: Mapping[str, Any]) -> Callable[[float, float], float]:
    """Return a function of (x, y) [m]: the least height z [m] of a certified plan of ``safe-flight`` with these fields.

    It is h_min above the ground, which is raised by the tracking bound and the hull.
    """
    mission, bound = _to_certify(fields)
    ground = raised_ground(mission.terrain, bound.horizontal + mission.reach, bound.vertical)
    return lambda x, y: float(ground.height(x, y)) + mission.clearance_min + ROUNDING


def _to_certify(fields: Mapping[str, Any]) -> tuple[FlightMission, TrackingBound]:
    """Return the mission of ``safe-flight`` with these fields, without its ends, and the product's tracking bound."""
    spec = RunSpec.of("safe-flight", fields={name: value for name, value in fields.items() if name != "seed"})
    mission = mission_but_ends(spec.config, load_terrain(spec.config.terrain), spec.estimator)
    return mission, tracking_bound(spec["planner.bandwidth"], mission)


COURSE = (
    Range("middle_x", 150.0, 490.0), Range("middle_y", 150.0, 490.0), Range("heading", 0.0, 2.0 * math.pi),
    Range("distance", 80.0, 220.0), Range("start_height", 0.0, 80.0), Range("target_height", 0.0, 80.0),
)  # fmt: skip
COURSE_NAMES = frozenset(each.name for each in COURSE)


PATIENT = {**SHORT, "estimator.timeout": 60.0}
SAFE_FLIGHT = Hunt(
    "safe-flight",
    (
        Choice("terrain", CANYONS), SEED, *COURSE, *FAULTS, *AIR,
        Choice("estimator.rate", (60.0, 20.0, 5.0, 1.0)), Range("planner.margin", 0.0, 25.0),
        Range("clearance_min", 2.0, 60.0), Range("speed_max", 20.0, 150.0), Range("acceleration_max", 8.0, 40.0),
    ),
    fields=PATIENT,
    derived=partial(_course, PATIENT),
)  # fmt: skip


def _low(values: Values) -> dict[str, Any]:
    """Return fields whose ends are drawn between ``LEAST`` and ``LEAST`` + ``height`` [m] above h_min."""
    fields = dict(values)
    fields["drawn_heights"] = (LEAST, LEAST + fields.pop("height"))
    return fields


def _fleet(values: Values) -> dict[str, Any]:
    fields = _low(values)
    fields["radio.delay"] = (0.0, fields.pop("delay"))
    fields["slot_spacing"] = 4.0 * fields["separation"] + 40.0
    return fields


FLEET = Hunt(
    "fleet separation",
    (
        Choice("terrain", CANYONS), SEED, *FAULTS, *AIR,
        Range("radio.loss", 0.0, 0.9), Range("radio.duplication", 0.0, 0.5), Range("delay", 0.0, 1.0),
        Range("separation", 2.0, 20.0), Range("height", 5.0, 60.0), Range("speed_max", 20.0, 100.0),
    ),
    scenario="simultaneous-arrival",
    fields={"vehicles": 3, "drawn_distance": (0.2, 0.4), "clearance_min": 20.0, "spread": 10.0, **GRID},
    derived=_fleet,
)  # fmt: skip

QUADROTOR = Hunt(
    "quadrotor",
    (
        Choice("terrain", CANYONS), SEED, *FAULTS,
        Range("faults.gust_rms", 0.0, 0.6), Range("faults.gust_time_constant", 0.5, 10.0, log=True),
        Range("noise.position", 0.0, 0.2),
        Range("mismatch.mass", 1.0, 1.1), Range("mismatch.drag", 0.75, 1.25), Range("clearance_min", 0.5, 6.0),
        Range("height", 1.0, 10.0), Range("speed_max", 6.0, 14.0),
    ),
    scenario="quadrotor-canyon",
    fields={"drawn_separation": (0.04, 0.08), "planner.flight.grid_nodes": 17},
    derived=_low,
)  # fmt: skip


def _changing(values: Values) -> dict[str, Any]:
    """Return fields with a hill that becomes known on the way, a radar that appears and moves, and a target that moves.

    Places are shares of the map; that of the target is a step [m] from the middle of the map.
    """
    given = {name: values[name] for name in CHANGES}
    fields = _course(CHARTED, {name: value for name, value in values.items() if name not in CHANGES})
    ground = load_terrain(fields["terrain"])
    hill = (given["hill_x"] * ground.width, given["hill_y"] * ground.depth, given["hill_radius"], given["hill_height"])
    x, y = given["radar_x"] * ground.width, given["radar_y"] * ground.depth
    there = (given["target_x"] * ground.width, given["target_y"] * ground.depth)
    z = float(ground.height(*there)) + float(values["target_height"]) + float(given["hill_height"]) + 60.0
    return {
        **fields,
        "uncharted": (hill,),
        "uncharted_time": given["hill_time"],
        "radar": ((x, y, 60.0, 10.0),),
        "radar_time": given["radar_time"],
        "radar_velocity": (given["radar_speed"], 0.0),
        "target_path": ((given["target_time"], *there, z),),
    }


CHANGES = {
    each.name: each
    for each in (
        Range("hill_x", 0.1, 0.9), Range("hill_y", 0.1, 0.9), Range("hill_radius", 15.0, 80.0),
        Range("hill_height", 10.0, 150.0), Range("hill_time", 0.0, 15.0),
        Range("radar_x", 0.1, 0.9), Range("radar_y", 0.1, 0.9), Range("radar_time", 0.0, 10.0),
        Range("radar_speed", -30.0, 30.0),
        Range("target_x", 0.1, 0.9), Range("target_y", 0.1, 0.9), Range("target_time", 1.0, 15.0),
    )
}  # fmt: skip
CHARTED = {**SHORT, "clearance_min": 10.0}
UPDATES = Hunt(
    "updates",
    (
        Choice("terrain", CANYONS), SEED, *COURSE, *CHANGES.values(), Range("faults.solver_failure_rate", 0.0, 0.9),
        Range("planner.margin", 0.0, 25.0), Range("speed_max", 20.0, 100.0),
    ),
    fields=CHARTED,
    derived=_changing,
)  # fmt: skip

HUNTS = (SAFE_FLIGHT, FLEET, QUADROTOR, UPDATES)


# ---- plug-ins of strangers that misbehave: behind certificate and filter, in a fleet, on a quadrotor, in an episode

LONGEST = 120  # calls running at which a part misbehaves: two seconds of an estimator
MISBEHAVING: tuple[Dimension, ...] = (
    *(Choice(name, misdeeds) for name, misdeeds in hostile_parts.MISDEEDS.items()),
    *(
        each
        for part in ("planner", "estimator")
        for each in (
            Range(f"{part}.share", 0.02, 1.0), Range(f"{part}.calls", 1, LONGEST, log=True),
            Range(f"{part}.draw", 0, SEEDS),
        )
    ),
)  # fmt: skip
STRANGE = f"{hostile_parts.__name__}:Hostile"


STRANGE_FLEET: tuple[Dimension, ...] = tuple(
    each
    for part, misdeeds in hostile_fleet.MISDEEDS.items()
    for each in (
        Choice(f"{part}.misdeed", misdeeds),
        Range(f"{part}.share", 0.02, 1.0),
        Range(f"{part}.draw", 0, SEEDS),
    )
)


def _strange_fleet(values: Values) -> dict[str, Any]:
    """Return the fields of a fleet whose consensus and coordinators are written by others."""
    of_consensus = {name: value for name, value in values.items() if name.startswith("consensus.")}
    fields = _fleet({name: value for name, value in values.items() if name not in of_consensus})
    given = tuple(f"{name.partition('.')[2]}={value}" for name, value in of_consensus.items())
    return {**fields, "consensus": f"{hostile_fleet.__name__}:HostileMaximum", "consensus_with": given}


def _hostile(hunt: Hunt, name: str, **fields: Any) -> Hunt:
    """Return a hunt in which every part of the vehicles misbehaves."""
    known, rotors = {each.name for each in hunt.space}, hunt.scenario == "quadrotor-canyon"
    more = tuple(each for each in MISBEHAVING if each.name not in known)
    return replace(
        hunt,
        name=name,
        space=(*hunt.space, *more),
        fields={**hunt.fields, **fields},
        derived=partial(_beside, hunt.derived, tuple(each.name for each in more)),
        controller=STRANGE + ("Quadrotor" if rotors else "Flight"),
        estimator=STRANGE + ("QuadrotorState" if rotors else "FullState"),
    )


def _beside(derived: Callable[[Values], dict[str, Any]], names: Sequence[str], values: Values) -> dict[str, Any]:
    """Return the fields that ``derived`` makes of all values but those named, and those."""
    return {**derived({name: values[name] for name in values if name not in names}), **{n: values[n] for n in names}}


# An episode of an environment is a run behind the filter, bit for bit, whose tracker proposes a policy's actions.
ACTING = (
    Choice("planner.policy", get_args(policy_flight.Policy)), Range("planner.strength", 0.0, 1.0),
    Range("planner.hold", 1, 120, log=True), Range("planner.draw", 0, SEEDS),
    *(each for each in MISBEHAVING if each.name.startswith("estimator.")),
)  # fmt: skip
EPISODE = {"deadline_factor": 1.5}
EPISODES = Hunt(
    "strangers in an environment",
    (
        Choice("terrain", CANYONS), SEED, *COURSE, *AIR[:2], Range("noise.position", 0.01, 30.0, log=True),
        Choice("estimator.rate", (60.0, 20.0, 5.0)),
        Range("clearance_min", 2.0, 60.0), Range("speed_max", 10.0, 60.0), Range("acceleration_max", 8.0, 40.0),
        *ACTING,
    ),
    fields={**EPISODE, "filter": True},
    controller=f"{policy_flight.__name__}:PolicyFlight",
    estimator=f"{STRANGE}FullState",
    derived=partial(_beside, partial(_course, EPISODE), tuple(each.name for each in ACTING)),
)  # fmt: skip

HOSTILE = (
    _hostile(SAFE_FLIGHT, "strangers, certified"),
    _hostile(SAFE_FLIGHT, "strangers, filtered", filter=True),
    _hostile(
        replace(
            FLEET,
            space=(*FLEET.space, *STRANGE_FLEET),
            scenario=f"{hostile_fleet.__name__}:HostileArrival",
            derived=_strange_fleet,
        ),
        "strangers in a fleet",
    ),
    _hostile(QUADROTOR, "strangers on a quadrotor"),
    EPISODES,
)


# ---- controllers with a hole


@dataclass(frozen=True)
class HoledHunt:
    """Missions of a mutant, and the same missions of the product's controller, which has no hole.

    The hole is found if a mission comes below h_min; a search for it minimises ``figure``.
    """

    mutant: Hunt
    product: Hunt
    figure: str = "clearance_margin_m"


def _hole(
    name: str,
    attribute: str,
    *space: Dimension,
    ends: tuple[Dimension, ...] | None = None,
    derived: Callable[[Values], dict[str, Any]] | None = None,
    product: Callable[[Values], dict[str, Any]] | None = None,
    measured: str = "",
    fields: Mapping[str, Any],
) -> HoledHunt:
    given = {"clearance_min": LOWEST, "deadline_factor": 1.5, "control_rate": CONTROL_RATE, **GRID, **fields}
    measure = f"{FLOWN}:{measured}" if measured else ""
    mutant = Hunt(
        name,
        (SEED, *(ends or RIM), *space),
        fields=given,
        controller=f"{FLOWN}:{attribute}",
        derived=derived or _to_the_plateau,
        measure=measure,
    )
    flown = replace(mutant, name=f"{name}: product", controller=None, derived=product or mutant.derived)
    return HoledHunt(mutant, flown, measured or "clearance_margin_m")


def _to_the_plateau(values: Values) -> dict[str, Any]:
    """Return fields of missions from the gorge to the plateau, both ends ``ABOVE`` h_min.

    ``period_share`` is the planner's period in horizons, ``reading`` the estimator's in control steps, and ``late`` the
    delay [s] of late plans.
    """
    fields = _ends(values, CANYONS[0], ABOVE)
    period = max(1, round(fields.pop("period_share") * fields["planner.horizon"] * CONTROL_RATE)) / CONTROL_RATE
    fields["planner.period"] = period
    if "reading" in fields:
        fields["estimator.rate"] = CONTROL_RATE / fields.pop("reading")
    if "late" in fields:
        fields["faults.late_plan_latency"] = period + fields.pop("late")
    return fields


def _level(bounds: float, values: Values) -> dict[str, Any]:
    """Return fields of missions over level ground, ``bounds`` + ``height`` vertical tracking bounds above h_min."""
    _, bound = _to_certify({**LEVEL, **{name: value for name, value in values.items() if name not in ENDS_NAMES}})
    return _ends(values, LEVEL["terrain"], (bounds + float(values["height"])) * bound.vertical + ROUNDING)


def _ends(values: Values, terrain: str, height: float) -> dict[str, Any]:
    """Return fields with start and target ``height`` [m] above h_min."""
    fields = {name: value for name, value in values.items() if name not in ENDS_NAMES} | {"terrain": terrain}
    ground = load_terrain(terrain)
    for name in ("start", "target"):
        x, y = float(values[f"{name}_x"]), float(values[f"{name}_y"])
        fields[name] = (x, y, float(ground.height(x, y)) + LOWEST + height)
    return fields


ENDS_NAMES = frozenset(("height", "start_x", "start_y", "target_x", "target_y"))
LEVEL: Mapping[str, Any] = {
    "terrain": "plain", "control_rate": CONTROL_RATE, "planner.margin": 0.0, "acceleration_max": 40.0,
    "faults.gust_limit": 20.0,
}  # fmt: skip
# Missions that are long, so that gusts have time: from the west to the east.
ACROSS = (
    Range("start_x", 80.0, 400.0), Range("start_y", 80.0, 880.0), Range("target_x", 560.0, 880.0),
    Range("target_y", 80.0, 880.0),
)  # fmt: skip
# Ends between which the highest ground is under the target: a flight that completes is far above all ground, so that
# what comes near to it are the plans themselves, around the rim.
RIM = (
    Range("start_x", 240.0, 390.0), Range("start_y", 270.0, 320.0), Range("target_x", 200.0, 345.0),
    Range("target_y", 50.0, 90.0),
)  # fmt: skip
PLANS = (Range("planner.horizon", 4.0, 20.0, log=True), Range("period_share", 0.05, 0.9))
# The monitor answers a plan that begins beside the vehicle by another at once, as long as it knows where that is. So
# readings are rare here, and the estimate is lost between them, although it stays right for want of gusts.
RARE = (Range("speed_max", 30.0, 80.0), Range("acceleration_max", 3.0, 20.0, log=True))
BLIND: Mapping[str, Any] = {"estimator.timeout": 0.05, "deadline_factor": 2.0}
HOLES = (
    # Between two points at which the optimiser asks for clearance: few nodes, unequal arcs, and plans that are flown
    # nearly to their end.
    _hole(
        "no clearance check", "NoClearanceCheck", *PLANS,
        Range("speed_max", 20.0, 120.0), Range("acceleration_max", 2.0, 30.0, log=True),
        Range("planner.nodes", 3, 13), Range("planner.stretch", 1.0, 1.4),
        fields={"planner.margin": 20.0, "deadline_factor": 2.0},
    ),
    _hole(
        "no start check", "NoStartCheck", *PLANS, *RARE, Range("reading", 2, 40),
        fields={**BLIND, "planner.margin": 15.0},
    ),
    _hole(
        "late plans flown", "LatePlansFlown", *PLANS, *RARE, Range("reading", 20, 140),
        Range("faults.late_plan_rate", 0.0, 0.6), Range("late", 0.0, 5.0), fields={**BLIND, "planner.margin": 10.0},
    ),
    _hole(
        "tracking bound halved", "HalvedBound",
        Range("height", 0.0, 6.0), Range("speed_max", 20.0, 40.0), Range("planner.bandwidth", 0.6, 1.6),
        Choice("estimator.rate", (20.0, 5.0, 2.0, 1.0)),
        Range("faults.gust_rms", 0.0, 3.0), Range("faults.gust_time_constant", 0.2, 10.0, log=True),
        ends=ACROSS, derived=partial(_level, 0.5), product=partial(_level, 1.0), measured="clearance_in_bounds",
        fields=LEVEL,
    ),
)  # fmt: skip
