"""Names of a summary's figures: their groups and units, and which of them are wall-clock times."""

from __future__ import annotations

from collections.abc import Mapping

# Readable names of the summary's figures, for every table that shows them.
SUMMARY_GROUPS: dict[str, tuple[str, ...]] = {
    "impact": (
        "hit", "hit_ground", "miss_m", "aspect_error_deg", "path_angle_error_deg", "impact_speed_m_s", "impact_time_s",
    ),
    "estimate": (
        "converged", "position_rms_m", "heading_rms_deg", "convergence_time_s", "position_error_max_m",
        "inclination_rms_deg", "heading_drift_rms_deg", "attitude_rms_deg",
        "heading_error_max_deg", "nees_mean", "usable_share", "wrong_share", "observable", "lost_ranges",
        "left_out_beacons", "initialising_s", "lost_s",
        "velocity_rms", "position_rms", "velocity_rms_last_quarter", "velocity_error_start", "velocity_error_end",
        "found_from_s", "error_start", "error_rms", "error_end", "error_max", "decay_rate_per_s", "escaped",
        "escape_time_s", "degraded_s", "beacons_found", "beacon_error_max_m", "beacon_deviation_max_m", "beacon_places",
    ),
    "mission": (
        "vehicles", "arrived", "arrived_vehicles", "spread_s", "first_arrival_s", "arrival_time_s", "deadline_s",
        "deadline_left_s",
        "planned_time_s", "flight_time_s", "run_time_s", "speed_max",
    ),
    "path": (
        "path_length_m", "straight_line_m", "mean_height_m", "apex_m", "attack_angle_max_deg",
        "cost", "planned_cost", "control_effort", "radar_exposure_s",
    ),
    "safety": (
        "min_clearance_m", "clearance_margin_m", "separation_min_m", "separation_allowed_m", "separation_margin_m",
        "nearest_pair", "wall_clearance_min_m",
        "ground_contacts", "touched_wall", "speed_max_m_s",
        "missed_passes", "guarantee_lost", "deadlines_lost", "filtered_share", "filter_margin_min_m",
    ),
    "tracking": (
        "attitude_rms_rad", "settled_at_s",
        "tracking_breaches", "tracking_bound_share", "tracking_error_max_m", "tracking_error_rms_m", "tracking_bound_m",
        "tracking_bound_horizontal_m", "tracking_bound_vertical_m", "rebased_plans",
        "tilt_max_deg", "thrust_mean_share", "thrust_max_share", "saturated_share", "saturated_s", "inputs_clipped",
    ),
    "planning": (
        "planner_share", "replans", "plans_adopted", "plans_rejected", "plans_not_admitted", "proposals_refused",
        "arrivals_deferred", "arrivals_unkept", "outliers", "clocks_apart", "manoeuvres_rejected", "late_plans",
        "fallback_steps",
    ),
    "solver": ("solver_failures", "iteration_limits", "solve_ms_mean", "solve_ms_p50", "solve_ms_p99", "solve_ms_max"),
    "bound": ("efficiency", "efficiency_basis"),
    "log": ("log_time_s", "samples", "stamps_late", "stamps_doubled", "readings_missing", "longest_gap_s"),
    "readings": ("unused_readings", "unused_reasons", "waits_for"),
}  # fmt: skip
# All figures above are numbers, or null if not known, except these.
TRUTH_VALUES = frozenset(("hit", "hit_ground", "converged", "escaped", "arrived", "touched_wall"))
TEXTS = frozenset(
    (
        "observable", "left_out_beacons", "nearest_pair", "efficiency_basis", "unused_reasons", "waits_for",
        "beacon_places",
    )
)  # fmt: skip
# Units by the end of a name; longer ones first.
UNITS = {"_per_s": "1/s", "_m_s": "m/s", "_deg": "deg", "_rad": "rad", "_ms": "ms", "_s": "s", "_m": "m"}
# Labels that do not follow from the name; |v| is a length in the metric of the system.
LABELS = {
    "efficiency": ("rms over Cramér-Rao", ""),
    "efficiency_basis": ("computed from", ""),
    "velocity_rms": ("velocity error, rms", "in units of v"),
    "position_rms": ("distance of position, rms", "in the metric"),
    "velocity_rms_last_quarter": ("|Δv| of the last quarter", "in the metric"),
    "velocity_error_start": ("|Δv| at the start", "in the metric"),
    "velocity_error_end": ("|Δv| at the end", "in the metric"),
    "found_from_s": ("velocity found after", "s"),
    "speed_max": ("highest |v|", "in the metric"),
    "attitude_rms_rad": ("angle to reference, rms", "rad"),
    "settled_at_s": ("on the reference after", "s"),
    "straight_line_m": ("straight line to target", "m"),
    "planner_share": ("share flown as planned", ""),
    "tracking_bound_share": ("share of bound used", ""),
    "deadline_left_s": ("deadline left", "s"),
    "log_time_s": ("length of the log", "s"),
    "unused_readings": ("readings not used", ""),
    "unused_reasons": ("of these", ""),
    "waits_for": ("the estimator", ""),
}
SHORTFALL = "shortfall"  # the summary's key for why a run failed; without it the mission succeeded
UNUSED_READINGS, UNUSED_REASONS, WAITS_FOR = "unused_readings", "unused_reasons", "waits_for"
PLANNER_STATUS = "planner_status"  # the summary's key for a planner that had no part in the run; without it, it had


def label(key: str) -> tuple[str, str]:
    """Return the readable name and the unit ("" for none) of a key of the summary."""
    if key.startswith("solve_ms_"):
        return f"solve time {key.removeprefix('solve_ms_')}", "ms"
    if key in LABELS:
        return LABELS[key]
    end = next((end for end in UNITS if key.endswith(end)), "")
    return key.removesuffix(end).replace("_", " "), UNITS.get(end, "")


def rest_heading(summary: Mapping[str, object]) -> str:
    """Return the heading of figures of no group: those that a scenario has made, or the reference of a log."""
    return "reference" if "log_time_s" in summary else "scenario"


def is_wall_clock(key: str) -> bool:
    """Return True if a key of a summary is a wall-clock time: such figures differ from run to run."""
    return key.startswith("solve_ms") or key.endswith("_wall_s") or key == "real_time_factor"
