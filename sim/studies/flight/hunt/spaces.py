"""Where the study ``hunt`` searches: for each hunt a scenario, the fields that are searched over, and its trials.

All missions are short, in canyons of 640 m. What is searched over are noise and gusts as declared to the controller,
faults, bounds, heights, seeds and what changes on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mathnavi.models.terrain.library import load_terrain
from mathnavi.sim.search.space import Choice, Dimension, Range, Values
from mathnavi.sim.sweep.trial import Trial, trial

MEASURE = "mathnavi.sim.studies.flight.hunt.measures:violations"
MUTANTS = "mathnavi.sim.studies.flight.hunt.mutants"
SEEDS = 100_000
CANYONS = ("canyon:3", "canyon:7")
GRID = {"planner.grid_nodes": 17}  # of the cost-to-go, so that a mission is built quickly
SHORT = {"drawn_separation": (0.2, 0.35), "deadline_factor": 1.5, **GRID}


@dataclass(frozen=True)
class Hunt:
    """A scenario and what is searched over."""

    name: str
    space: tuple[Dimension, ...]
    scenario: str = "safe-flight"
    fields: Mapping[str, Any] = field(default_factory=dict)  # at values of their own
    controller: str | None = None
    derived: Callable[[Values], dict[str, Any]] = lambda values: dict(values)  # fields, of the values of the space

    def make(self, values: Values) -> Trial:
        """The trial at these values; FieldError where the configuration refuses them."""
        fields = {**self.fields, **self.derived(values)}
        seed = fields.pop("seed")
        return trial(self.scenario, seed, self.controller, fields=fields, measure=MEASURE)


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


def _low(values: Values) -> dict[str, Any]:
    """Ends drawn between h_min and ``height`` above it."""
    fields = dict(values)
    fields["drawn_heights"] = (0.0, fields.pop("height"))
    return fields


SAFE_FLIGHT = Hunt(
    "safe-flight",
    (
        Choice("terrain", CANYONS), SEED, *FAULTS, *AIR,
        Choice("estimator.rate", (60.0, 20.0, 5.0, 1.0)), Range("planner.margin", 0.0, 25.0),
        Range("height", 1.0, 60.0), Range("clearance_min", 2.0, 60.0),
        Range("speed_max", 20.0, 150.0), Range("acceleration_max", 8.0, 40.0),
    ),
    fields={**SHORT, "estimator.timeout": 60.0},
    derived=_low,
)  # fmt: skip


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
    fields={"vehicles": 3, "drawn_distance": (0.2, 0.6), "clearance_min": 20.0, "spread": 10.0, **GRID},
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
    fields={"drawn_separation": (0.05, 0.12), "planner.flight.grid_nodes": 17},
    derived=_low,
)  # fmt: skip


def _changing(values: Values) -> dict[str, Any]:
    """A hill that becomes known on the way, a radar that appears and drives, and a target that moves.

    Places are shares of the map, the target's a step [m] from the middle of the map.
    """
    fields = _low(values)
    given = {name: fields.pop(name) for name in list(fields) if name in CHANGES}
    ground = load_terrain(fields["terrain"])
    hill = (given["hill_x"] * ground.width, given["hill_y"] * ground.depth, given["hill_radius"], given["hill_height"])
    x, y = given["radar_x"] * ground.width, given["radar_y"] * ground.depth
    there = (given["target_x"] * ground.width, given["target_y"] * ground.depth)
    z = float(ground.height(*there)) + fields["drawn_heights"][1] + float(given["hill_height"]) + 60.0
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
UPDATES = Hunt(
    "updates",
    (
        Choice("terrain", CANYONS), SEED, *CHANGES.values(), Range("faults.solver_failure_rate", 0.0, 0.9),
        Range("planner.margin", 0.0, 25.0), Range("height", 5.0, 60.0), Range("speed_max", 20.0, 100.0),
    ),
    fields={**SHORT, "clearance_min": 10.0},
    derived=_changing,
)  # fmt: skip

HUNTS = (SAFE_FLIGHT, FLEET, QUADROTOR, UPDATES)


def _between(values: Values) -> dict[str, Any]:
    """From one place over the canyon to another, both ``height`` above h_min."""
    fields = dict(values)
    height, ground = fields.pop("height"), load_terrain(CANYONS[0])
    for name in ("start", "target"):
        x, y = fields.pop(f"{name}_x"), fields.pop(f"{name}_y")
        fields[name] = (x, y, float(ground.height(x, y)) + LOWEST + height)
    return fields


LOWEST = 20.0  # [m] h_min over the canyon of the mutants


def _mutant(name: str, attribute: str, *space: Dimension, **fields: Any) -> Hunt:
    given = {"terrain": CANYONS[0], "clearance_min": LOWEST, "deadline_factor": 1.5, **GRID, **fields}
    return Hunt(name, (SEED, *space), fields=given, controller=f"{MUTANTS}:{attribute}", derived=_between)


ENDS = tuple(Range(f"{end}_{axis}", 80.0, 560.0) for end in ("start", "target") for axis in "xy")
MARGIN = Range("planner.margin", 0.0, 100.0)
GUSTS = Range("faults.gust_rms", 0.0, 1.0)
FAILURES = Range("faults.solver_failure_rate", 0.0, 0.95)
# Missions that are high at both ends, so that what is found lies on the way.
HIGH = (
    *ENDS, Range("height", 20.0, 200.0), MARGIN, Range("speed_max", 15.0, 150.0),
    Range("acceleration_max", 3.0, 40.0), GUSTS, FAILURES,
)  # fmt: skip
HOLES = (
    _mutant("no clearance check", "NoClearanceCheck", *HIGH),
    _mutant(
        "no start check", "NoStartCheck",
        *ENDS, Range("height", 0.0, 200.0), MARGIN, Range("speed_max", 30.0, 150.0),
        Range("acceleration_max", 8.0, 40.0), GUSTS, FAILURES,
    ),
    _mutant(
        "late plans flown", "LatePlansFlown",
        *HIGH, Range("planner.late_every", 1, 10), Range("planner.lateness", 0.0, 1.0),
    ),
    _mutant(
        "tracking bound halved", "HalvedBound",
        *ENDS, Range("height", 0.0, 200.0), GUSTS, Range("faults.gust_time_constant", 0.5, 10.0, log=True),
        **{"planner.margin": 0.0, "noise.position": 0.5, "speed_max": 40.0, "acceleration_max": 10.0},
    ),
)  # fmt: skip
