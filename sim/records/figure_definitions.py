"""Meanings of the figures of a summary, a sentence each, which reports open at their names."""

from __future__ import annotations

DEFINITIONS: dict[str, str] = {
    # impact
    "hit": "The missile came nearer to the target than the miss that is allowed.",
    "hit_ground": "The missile ended below the ground without a hit.",
    "miss_m": "Least distance to the true position of the target, over the whole flight.",
    "aspect_error_deg": (
        "Angle between the nose and the required direction, where the missile is nearest to the target."
    ),
    "path_angle_error_deg": "Angle between the velocity and the required direction, at the same place.",
    "impact_speed_m_s": "Speed where the missile is nearest to the target.",
    "impact_time_s": "Time at which the missile is nearest to the target.",
    # estimate
    "converged": "The error of the estimate is within its limits over the last part of the run.",
    "position_rms_m": (
        "Root mean square error of the estimated position, over the last quarter of the run; of a log while the "
        "estimate is usable."
    ),
    "heading_rms_deg": (
        "Root mean square error of the estimated heading, over the last quarter of the run; of a log while the "
        "estimate is usable."
    ),
    "inclination_rms_deg": "Root mean square angle between the estimated vertical and that of the reference.",
    "heading_drift_rms_deg": (
        "Root mean square error of the heading, relative to that when the estimate could be used first."
    ),
    "attitude_rms_deg": "Root mean square angle of the error of the attitude, with the drift of its heading.",
    "convergence_time_s": (
        "Last time at which position or heading is off by more than its limit, or there is no estimate."
    ),
    "beacons_found": "Number of beacons, of those whose places the estimator was not given, that it has found.",
    "beacon_error_max_m": "Largest distance of a beacon that was found from its true place, at the end of the run.",
    "beacon_deviation_max_m": (
        "Largest standard deviation that the estimator states of the place of a beacon that it has found, at the end "
        "of the run: of both coordinates together in the plane, in the worst direction in space."
    ),
    "beacon_places": (
        "Places that the estimator has of the beacons that it was not given, by their numbers, at the end of the run."
    ),
    "position_error_max_m": (
        "Largest error of the estimated position after the convergence time; of a log while the estimate is usable."
    ),
    "heading_error_max_deg": "Largest error of the estimated heading after the convergence time.",
    "nees_mean": (
        "Mean of e'P⁻¹e over the last quarter, e the error and P the covariance that the estimator states: about "
        "the number of components if P is right, more if the estimator is overconfident. Of a log: while the estimate "
        "is usable, over the number of components."
    ),
    "usable_share": "Share of the times of a log at which the estimate may be used: it is OK or DEGRADED.",
    "wrong_share": (
        "Share of the times of a log at which the estimate may be used, but is off by more than its covariance allows "
        "in all but one of a thousand cases."
    ),
    "observable": "The most that ranges to this wall can determine, however the robot moves.",
    "lost_ranges": "Share of the single ranges that did not arrive.",
    "left_out_beacons": "Numbers of the beacons that the estimator has left out at some time; none if it used all.",
    "initialising_s": "Time before the first estimate.",
    "lost_s": "Time during which the estimator reported LOST.",
    "degraded_s": "Time during which the estimator reported DEGRADED: the estimate is worse than it should be.",
    "velocity_rms": "Root mean square error of the components of velocity, from the time on at which errors count.",
    "position_rms": (
        "Root mean square of the distance between true and estimated position, measured by the metric of the "
        "space, from the time on at which errors count."
    ),
    "velocity_rms_last_quarter": (
        "Root mean square of |Δv| over the last quarter of the run. Δv is the true velocity less the estimated "
        "one, carried to the true position; its length is measured by the metric, which for a mechanism is its "
        "mass matrix."
    ),
    "velocity_error_start": (
        "|Δv| of the first estimate: true velocity less the estimated one, carried to the true position, its "
        "length measured by the metric."
    ),
    "velocity_error_end": (
        "|Δv| of the last estimate: true velocity less the estimated one, carried to the true position, its "
        "length measured by the metric."
    ),
    "found_from_s": "Last time at which |Δv| is more than a hundredth of the first speed, or there is no estimate.",
    "error_start": "Length of the error of the first estimate, over all states.",
    "error_rms": "Root mean square of the length of the error, over the last part of the run.",
    "error_end": "Length of the error of the last estimate.",
    "error_max": "Largest length of the error.",
    "decay_rate_per_s": "λ of the exponential c e^(−λt) that fits the errors best, until noise takes over.",
    "escaped": "The solution of the system left every bound in finite time.",
    "escape_time_s": "Time at which it did.",
    # mission
    "vehicles": "Number of vehicles.",
    "arrived": "The vehicle, or every vehicle of a fleet, came within the arrival radius of its target.",
    "arrived_vehicles": "Number of vehicles that came within the arrival radius of their targets.",
    "spread_s": "Time between the first arrival and the last one.",
    "first_arrival_s": "Time of the first arrival.",
    "arrival_time_s": "Time of arrival, of a fleet that of its last vehicle.",
    "deadline_s": "Time by which the mission has to be completed.",
    "deadline_left_s": "Time that was left to the deadline at the arrival; negative for an end after it.",
    "planned_time_s": "Time of impact by the first plan.",
    "flight_time_s": "Time from the start to the end of the flight.",
    "run_time_s": "Simulated time of the run.",
    "speed_max": (
        "Greatest length of the true velocity, measured by the metric of the space, which for a mechanism is its "
        "mass matrix."
    ),
    # path
    "path_length_m": (
        "Length of the way that was covered. Where a run ends at the arrival radius of its target, this may be "
        "less than the straight line to it."
    ),
    "straight_line_m": ("Distance from the start to the target itself; the run ends at the arrival radius before it."),
    "mean_height_m": "Mean height above the ground below, over time.",
    "apex_m": "Greatest height.",
    "attack_angle_max_deg": "Largest angle between the nose and the velocity, up to the target.",
    "cost": "Cost J of the mission along the flight.",
    "planned_cost": "Cost J of the first plan.",
    "control_effort": "Integral of the square of the commanded acceleration over time, in m²/s³.",
    "radar_exposure_s": (
        "Time in sight of a radar that is on, of a fleet the sum over its vehicles. A radar is a cost of the plan "
        "and no wall: a path may lead through its dome."
    ),
    # safety
    "min_clearance_m": "Least height above the ground below, exact between the samples too.",
    "clearance_margin_m": "Least clearance less the height that is required; negative where that was not kept.",
    "separation_min_m": "Least distance between any two vehicles at any time.",
    "separation_allowed_m": "Distance that the vehicles have to keep.",
    "separation_margin_m": "Least separation less the distance that is required; negative where that was not kept.",
    "nearest_pair": "The two vehicles of the least separation.",
    "wall_clearance_min_m": "Least distance between the robot's hull and the wall.",
    "ground_contacts": "Number of times that a vehicle touched the ground.",
    "touched_wall": "The robot touched the wall.",
    "speed_max_m_s": "Greatest speed.",
    "missed_passes": (
        "Number of times that the vehicle passed its moving target outside the arrival radius although its plan met it."
    ),
    "guarantee_lost": (
        "Number of times that the guarantee was lost, or never began: that the vehicle can go on to its target, "
        "or to a hover, above the ground."
    ),
    "deadlines_lost": (
        "Number of plans that took over although they end after the deadline, because there was none in time."
    ),
    "filtered_share": "Share of the commands that the safety filter changed.",
    "filter_margin_min_m": (
        "Least clearance beyond the required height and the tracking bound that was left until the vehicle could "
        "have stopped, behind any command that the safety filter let pass."
    ),
    # tracking
    "attitude_rms_rad": (
        "Root mean square of the angle between the body and its reference, from the time on at which errors count."
    ),
    "settled_at_s": "Last time at which the body is more than 0.05 rad off its reference.",
    "tracking_breaches": "Number of times that the vehicle was farther off its plan than the tracking bound.",
    "tracking_bound_share": (
        "Largest deviation from the plan, as a share of the tracking bound; above 1 it is a breach."
    ),
    "tracking_error_max_m": "Largest distance from the plan.",
    "tracking_error_rms_m": "Root mean square of the distance from the plan.",
    "tracking_bound_m": (
        "Largest deviation from the plan that the tracker declares. Plans are certified for it; an excess is a breach."
    ),
    "tracking_bound_horizontal_m": "Horizontal part of the tracking bound.",
    "tracking_bound_vertical_m": "Vertical part of the tracking bound.",
    "rebased_plans": (
        "Number of plans that start from the estimated state, because the previous plan could not be flown any more. "
        "All others start on the previous plan."
    ),
    "tilt_max_deg": "Largest angle between the thrust and the vertical.",
    "thrust_mean_share": "Mean thrust that was asked of a rotor, over the greatest one.",
    "thrust_max_share": "Largest thrust that was asked of a rotor, over the greatest one.",
    "saturated_share": "Share of the commands to rotors that are at a bound of their thrust.",
    "saturated_s": "Time during which a command exceeded the bounds of an input.",
    "inputs_clipped": ("Number of times that a command left the bounds of an input and was clipped."),
    # planning
    "planner_share": (
        "Share of the time in which the planner's own choice was flown; the rest is safety manoeuvres, "
        "completions and plans of the fallback planner."
    ),
    "replans": "Number of requests for a plan.",
    "plans_adopted": "Number of plans that took over.",
    "plans_rejected": "Number of plans that the certificate refused.",
    "plans_not_admitted": (
        "Number of plans that the other vehicles had not acknowledged in time, and that did not take over."
    ),
    "proposals_refused": "Number of plans that another vehicle refused, because they come too near to its own.",
    "arrivals_deferred": "Number of times that a vehicle postponed its arrival, because its plans came too late.",
    "arrivals_unkept": "Number of agreed arrival times that the current plan does not keep.",
    "outliers": "Number of times that a vehicle gave up its own time of arrival for that on which the others agree.",
    "clocks_apart": "Number of times that two clocks of a fleet differed by more than is allowed.",
    "manoeuvres_rejected": "Number of plans that were refused because of the safety manoeuvre at their end.",
    "late_plans": "Number of plans that were ready only after the time at which they were to start.",
    "fallback_steps": (
        "Number of planning steps in which the vehicle stayed on its previous plan, because the new one was missing, "
        "refused or late."
    ),
    # solver
    "solver_failures": "Number of planning requests that ended with an error or without a plan.",
    "iteration_limits": "Number of plans at which the solver had stopped at its iteration limit.",
    "solve_ms_mean": "Mean wall-clock time of one optimisation of the planner.",
    "solve_ms_p50": "Median wall-clock time of one optimisation of the planner.",
    "solve_ms_p99": "Wall-clock time that 99 % of the planner's optimisations did not exceed.",
    "solve_ms_max": "Longest wall-clock time of one optimisation of the planner.",
    # bound
    "efficiency": (
        "Root mean square error of the estimate over the least that any estimator could have with these readings "
        "(the posterior Cramér-Rao bound): 1 is the best, and chance makes it scatter."
    ),
    "efficiency_basis": "What the efficiency is computed from, or why there is none.",
    # log
    "log_time_s": "Time from the first to the last sample of a recorded log.",
    "samples": "Number of times at which anything was read, or commanded.",
    "stamps_late": "Number of readings with a stamp before that of an earlier one.",
    "stamps_doubled": "Number of readings with the stamp of an earlier one.",
    "readings_missing": "Number of readings that are missing in the gaps of the log.",
    "longest_gap_s": "Longest gap in the readings of a channel.",
    # readings
    "unused_readings": "Number of readings that no estimator used; not known of one that does not count them.",
    "unused_reasons": "Why they were not used.",
    "waits_for": "What an estimator that never began still waits for.",
}


def definition(key: str) -> str:
    """Return what a figure of a summary means; "" for a figure of a scenario from elsewhere."""
    return DEFINITIONS.get(key, "")
