"""The scenario of the robot that localises itself: drawn starts, the known start, faults, and repeatability.

Flown by a fixed pattern and an estimator that only reckons, so that nothing here depends on a filter.
"""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.range_localisation import RangeLocalisation
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig, RangingMismatch, RangingNoise, WallFields
from tests.localisation import DeadReckoner, Pattern, PatternConfig, PatternPlanner, PatternTracker, run
from tests.unicycle import STANDARD

SILENT = RangingNoise(range_relative=0.0, odometry_noise=(0.0, 0.0), odometry_bias=0.0)
KNOWN_START: dict[str, Any] = {"start": (0.3, -0.2, 70.0), "start_known": True, "start_error": (0.0, 0.0, 0.0)}
NOISY: dict[str, Any] = {
    "duration": 3.0,
    "noise": RangingNoise(dropout=0.2, outliers=0.1),
    "start_known": True,
    "outage": ((1.0, 1.5),),
}


def kinds(outcome: RunData) -> list[str]:
    return [event.kind for event in outcome.recording.events]


def build(seed: int, controller: PluginSpec | None = None, **fields: Any) -> Any:
    parts = controller or PluginSpec.with_fields(Pattern), PluginSpec.with_fields(DeadReckoner)
    return RangeLocalisation.build(RangeLocalisationConfig(**fields), seed, *parts)


@pytest.fixture(scope="module")
def silent() -> RunData:
    """Without noise, from a start that is known."""
    return run(noise=SILENT, **KNOWN_START)


def test_who_knows_the_start_and_reckons_without_noise_never_errs(silent: RunData) -> None:
    summary = silent.summary
    assert silent.success
    assert summary["converged"] is True
    assert summary["position_rms_m"] < 1e-10
    assert summary["heading_rms_deg"] < 1e-9
    assert summary["convergence_time_s"] == 0.0
    assert summary["run_time_s"] == 20.0
    assert summary["lost_ranges"] == summary["lost_s"] == 0.0


def test_the_log_has_the_readings_that_the_mission_declares(silent: RunData) -> None:
    arrays = silent.arrays
    poses = arrays["truth.x"][:, :3]
    angles = np.radians([-60.0, 60.0])
    rho = np.array([STANDARD.ranges(pose, angles)[0] for pose in poses])
    np.testing.assert_allclose(arrays["measurement.ranges"], rho, rtol=0.0, atol=1e-12)
    assert np.isnan(arrays["measurement.odometry"][0]).all()
    np.testing.assert_allclose(arrays["measurement.odometry"][1:], arrays["command.u"][:-1], rtol=0.0, atol=1e-10)
    assert silent.recording.state_names["robot"][:3] == ("position_x_1 [m]", "position_x_2 [m]", "position_phi [rad]")


def test_the_robot_starts_where_it_is_put(silent: RunData) -> None:
    np.testing.assert_allclose(silent.arrays["truth.x"][0, :3], [0.3, -0.2, math.radians(70.0)], atol=1e-15)


@pytest.mark.parametrize("drive", ["ideal", "differential"])
def test_the_same_seed_gives_the_same_log_and_another_one_another(drive: str) -> None:
    one, again, other = (run(seed, drive=drive, **NOISY) for seed in (3, 3, 4))
    assert one.arrays.keys() == again.arrays.keys()
    for name, values in one.arrays.items():
        np.testing.assert_array_equal(values, again.arrays[name])
    assert not np.array_equal(one.arrays["truth.x"][0], other.arrays["truth.x"][0])
    assert not np.array_equal(one.arrays["estimate.x"], other.arrays["estimate.x"])


def test_a_drawn_start_can_be_given_and_the_run_is_the_same() -> None:
    drawn = run(7, **NOISY)
    given = run(7, **NOISY, start=tuple(drawn.config["fields"]["start"]))
    for name, values in drawn.arrays.items():
        np.testing.assert_array_equal(values, given.arrays[name])


def test_drawn_starts_keep_the_margin_and_differ() -> None:
    starts = [build(seed, margin=0.5).config["mission"]["start"] for seed in range(20)]
    assert len({tuple(start) for start in starts}) == 20
    assert all(STANDARD.contains(np.array(start[:2]), 0.5) for start in starts)


@dataclass(frozen=True)
class Cautious:
    """A pattern that states where it leads."""

    Config = PatternConfig

    @staticmethod
    def build(config: PatternConfig, mission: RangingMission) -> tuple[PatternPlanner, PatternTracker]:
        return Pattern.build(config, mission)

    @staticmethod
    def nominal_path(config: PatternConfig, mission: RangingMission, start: Array) -> Array:
        """Straight on for two seconds."""
        reach = np.linspace(0.0, 2.0 * config.speed, 50)[:, None]
        return start + reach * [math.cos(start[2]), math.sin(start[2]), 0.0]


def test_where_a_controller_tells_its_path_starts_whose_path_keeps_the_margin_are_drawn() -> None:
    part = PluginSpec.with_fields(Cautious, speed=0.8, cycle=0.0)
    for seed in range(12):
        start = np.array(build(seed, part).config["mission"]["start"])
        path = Cautious.nominal_path(part.config, RangingMission(STANDARD, (0.0,)), start)
        assert all(STANDARD.contains(place, 0.299) for place in path[:, :2])


def test_a_path_that_fits_nowhere_is_refused() -> None:
    with pytest.raises(ValueError, match=r"margin = 0.3: .*1000 starts.*Cautious.*allowed"):
        build(0, PluginSpec.with_fields(Cautious, speed=5.0, cycle=0.0))


def test_the_known_start_errs_as_declared_and_within_the_wall() -> None:
    starts = []
    for seed in range(60):
        mission = build(seed, start=(0.0, 0.0, 0.0), start_known=True, start_error=(0.5, 0.2, 30.0)).config["mission"]
        known = np.array(mission["known_start"]["pose"])
        assert STANDARD.contains(known)
        np.testing.assert_allclose(mission["known_start"]["deviation"], [0.5, 0.2, math.radians(30.0)])
        starts.append(known)
    np.testing.assert_allclose(np.std(starts, axis=0), [0.5, 0.2, math.radians(30.0)], rtol=0.3)
    assert build(0).config["mission"]["known_start"] is None


def test_touching_the_wall_ends_the_run_as_a_failure() -> None:
    outcome = run(controller=PluginSpec.with_fields(Pattern, cycle=0.0), **KNOWN_START, noise=SILENT)
    assert not outcome.success
    (contact,) = [event for event in outcome.recording.events if event.kind == "contact"]
    assert re.fullmatch(r"touches wall_\d+ at \[-?\d\.\d, -?\d\.\d\] with 0\.\d m/s", contact.message)
    summary = outcome.summary
    assert summary["touched_wall"] is True
    assert summary["run_time_s"] < 4.0
    assert summary["wall_clearance_min_m"] == pytest.approx(0.0, abs=0.015)


def test_an_outage_takes_the_ranges_and_nothing_else() -> None:
    arrays = run(duration=3.0, outage=((0.5, 1.0), (2.0, 2.2)), **KNOWN_START).arrays
    t, lost = arrays["t"], np.isnan(arrays["measurement.ranges"]).all(axis=1)
    expected = ((t > 0.495) & (t < 0.995)) | ((t > 1.995) & (t < 2.195))
    np.testing.assert_array_equal(lost, expected)
    assert not np.isnan(arrays["measurement.odometry"][1:]).any()


def test_beyond_its_reach_a_sensor_reads_nothing_or_if_it_is_not_declared_its_reach() -> None:
    exact = RangingNoise(range_relative=0.0)
    true, declared, saturated = (
        run(duration=3.0, noise=noise, mismatch=mismatch, **KNOWN_START).arrays["measurement.ranges"]
        for noise, mismatch in (
            (exact, RangingMismatch()),
            (dataclasses.replace(exact, range_maximum=2.0), RangingMismatch()),
            (exact, RangingMismatch(range_saturation=2.0)),
        )
    )
    assert 0.1 < (true > 2.0).mean() < 0.9
    np.testing.assert_array_equal(declared, np.where(true < 2.0, true, np.nan))
    np.testing.assert_array_equal(saturated, np.minimum(true, 2.0))
    outcome = RangeLocalisation.build(RangeLocalisationConfig(noise=RangingNoise(range_maximum=2.0)), 1).run()
    assert outcome.summary["converged"]


def test_sensors_that_are_mounted_at_other_angles_read_as_those_of_a_robot_that_is_turned() -> None:
    exact, known = RangingNoise(range_relative=0.0), {**KNOWN_START, "sensors": (-60.0, 60.0)}
    turned, stated = (
        run(duration=0.5, noise=exact, mismatch=mismatch, **{**known, **fields}).arrays["measurement.ranges"][0]
        for mismatch, fields in ((RangingMismatch(mounting=10.0), {}), (RangingMismatch(), {"sensors": (-50.0, 70.0)}))
    )
    np.testing.assert_allclose(turned, stated)


def test_true_errors_may_be_others_than_the_declared_ones() -> None:
    """The same draws, twice as large; what the estimator is built for is what is declared."""
    declared = RangingNoise(odometry_noise=(0.0, 0.0))
    outcome, other = (
        run(duration=2.0, noise=declared, mismatch=mismatch, **KNOWN_START)
        for mismatch in (RangingMismatch(), RangingMismatch(range_noise=2.0, odometry_bias=0.05))
    )
    assert outcome.config["mission"] == other.config["mission"]
    assert other.config["fields"]["mismatch"] == dataclasses.asdict(
        RangingMismatch(range_noise=2.0, odometry_bias=0.05)
    )
    rho = np.array([STANDARD.ranges(x[:3], np.radians([-60.0, 60.0]))[0] for x in outcome.arrays["truth.x"]])
    noise, more = (found.arrays["measurement.ranges"] - rho for found in (outcome, other))
    np.testing.assert_allclose(more, 2.0 * noise, atol=1e-9)
    scale, further = (
        found.arrays["measurement.odometry"][1:] / found.arrays["command.u"][:-1] for found in (outcome, other)
    )
    np.testing.assert_allclose(np.abs(scale - 1.0), 0.02, atol=1e-9)
    np.testing.assert_allclose(further - 1.0, 3.5 * (scale - 1.0), atol=1e-9)


def test_outliers_need_not_be_declared() -> None:
    mismatch = RangingMismatch(outliers=0.4)
    outcome = run(duration=3.0, noise=dataclasses.replace(SILENT, outliers=0.1), mismatch=mismatch, **KNOWN_START)
    rho = np.array([STANDARD.ranges(x[:3], np.radians([-60.0, 60.0]))[0] for x in outcome.arrays["truth.x"]])
    assert np.mean(np.abs(outcome.arrays["measurement.ranges"] - rho) > 1e-6) == pytest.approx(0.5, abs=0.08)
    assert outcome.config["mission"]["ranging"]["outliers"] == 0.1


def test_commands_beyond_what_the_wheels_can_are_reported() -> None:
    outcome = run(duration=2.0, speed_max=0.3, **KNOWN_START)
    assert outcome.summary["inputs_clipped"] == 1
    path = np.linalg.norm(np.diff(outcome.arrays["truth.x"][:, :2], axis=0), axis=1).sum()
    assert path == pytest.approx(0.6, abs=0.01)


def test_wheels_that_slip_mislead_who_reckons() -> None:
    grip, slip = (
        run(drive="differential", friction=mu, noise=SILENT, duration=8.0, **KNOWN_START) for mu in (1.0, 0.02)
    )
    assert grip.summary["position_rms_m"] < 0.1
    assert slip.summary["position_rms_m"] > 2.0 * grip.summary["position_rms_m"]
    assert not {"contact", "ground-contact"} & set(kinds(grip))


def test_other_walls_are_seen_by_mujoco_as_they_are() -> None:
    outcome = run(
        field=WallFields("bean"), noise=SILENT, duration=2.0, sensors=(0.0, 90.0, -90.0), start=(0.5, 0.3, 10.0)
    )
    poses = outcome.arrays["truth.x"][:, :3]
    rho = np.array([BEAN.ranges(pose, np.radians([0.0, 90.0, -90.0]))[0] for pose in poses])
    np.testing.assert_allclose(outcome.arrays["measurement.ranges"], rho, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize(
    ("field", "observable"),
    [
        (WallFields(), "the pose, up to 2 rotations"),
        (WallFields("egg"), "the pose"),
        (WallFields(half_axes=(2.0, 2.0)), "distance from the centre, heading relative to its direction"),
    ],
    ids=["ellipse", "egg", "circle"],
)
def test_the_summary_says_what_can_be_observed(field: WallFields, observable: str) -> None:
    outcome = run(field=field, duration=0.5, start=(0.2, 0.1, 30.0), start_known=True, start_error=(0.0, 0.0, 0.0))
    assert outcome.summary["observable"] == observable
    assert outcome.summary["converged"] is True


@pytest.mark.parametrize("start", [(4.0, 0.0, 0.0), (3.7, 0.0, 0.0), (0.0, 1.2543, 0.0)])
def test_a_start_outside_the_wall_or_too_near_to_it_is_refused(start: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"start = .*allowed"):
        build(0, start=start)


def test_a_margin_that_no_place_keeps_is_refused() -> None:
    with pytest.raises(ValueError, match=r"margin = 5.0: .*allowed"):
        build(0, margin=5.0)


def test_a_field_of_fourier_coefficients_is_a_field() -> None:
    rows = ((0.0, 0.0, 0.0, 0.0), (2.5, 0.0, 0.0, 1.5), (0.3, 0.0, 0.0, 0.2))
    outcome = run(field=WallFields("fourier", coefficients=rows), duration=0.5, start=(0.2, 0.1, 30.0))
    assert outcome.config["mission"]["coefficients"] == [list(row) for row in rows]


@pytest.mark.parametrize(
    ("named", "make"),
    [
        ("field.half_axes", lambda: WallFields(half_axes=(0.0, 1.0))),
        ("field.half_axes", lambda: WallFields("egg", half_axes=(2.0, 1.0))),
        ("field.coefficients", lambda: WallFields("fourier")),
        ("field.coefficients", lambda: WallFields("egg", coefficients=((0.0,) * 4,))),
        (
            "field.coefficients: the curve crosses itself",
            lambda: WallFields("fourier", coefficients=((0.0,) * 4, (2.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))),
        ),
        (
            "field.coefficients: a wall 50 m off",
            lambda: WallFields("fourier", coefficients=((0.0,) * 4, (50.0, 0.0, 0.0, 50.0))),
        ),
        ("noise.range_relative", lambda: RangingNoise(range_relative=-0.1)),
        ("noise.dropout", lambda: RangingNoise(dropout=1.1)),
        ("noise.odometry_noise", lambda: RangingNoise(odometry_noise=(0.0, -1.0))),
        ("mismatch.range_noise", lambda: RangingMismatch(range_noise=0.0)),
        (
            "mismatch.outliers = 0.6 with noise.outliers = 0.5",
            lambda: RangeLocalisationConfig(noise=RangingNoise(outliers=0.5), mismatch=RangingMismatch(outliers=0.6)),
        ),
        ("sensors", lambda: RangeLocalisationConfig(sensors=())),
        ("sensors", lambda: RangeLocalisationConfig(sensors=(0.0, 360.0))),
        ("sensors", lambda: RangeLocalisationConfig(sensors=tuple(float(k) for k in range(65)))),
        ("start", lambda: RangeLocalisationConfig(start=(math.inf, 0.0, 0.0))),
        ("start_error", lambda: RangeLocalisationConfig(start_known=True, start_error=(0.1, 0.1, -5.0))),
        (
            r"start_error = \(0.1, 0.1, 5.0\) with start_known = False",
            lambda: RangeLocalisationConfig(start_error=(0.1, 0.1, 5.0)),
        ),
        ("friction", lambda: RangeLocalisationConfig(friction=0.0)),
        ("friction", lambda: RangeLocalisationConfig(friction=0.5)),  # which the ideal drive does not have
        ("duration", lambda: RangeLocalisationConfig(duration=0.0)),
        ("margin", lambda: RangeLocalisationConfig(margin=0.1)),
        ("outage", lambda: RangeLocalisationConfig(outage=((2.0, 1.0),))),
        ("outage", lambda: RangeLocalisationConfig(outage=((0.0, math.nan),))),
    ],
)
def test_fields_out_of_range_are_refused_by_their_names(named: str, make: Any) -> None:
    with pytest.raises(ValueError, match=rf"{named}.*allowed"):
        make()


def test_by_default_the_robot_finds_itself_from_anywhere() -> None:
    """With the built-in controller and estimator, 5 % noise and an unknown start."""
    outcome = RangeLocalisation.build(RangeLocalisationConfig(duration=10.0), 0).run()
    assert outcome.success
    assert outcome.summary["position_rms_m"] < 0.05
    assert outcome.summary["convergence_time_s"] < 5.0


def test_seconds_without_ranges_are_reported_and_survived() -> None:
    outcome = RangeLocalisation.build(RangeLocalisationConfig(duration=12.0, outage=((4.0, 6.0),)), 1).run()
    statuses = [event for event in outcome.recording.events if event.kind == "estimator-status"]
    assert any(event.message.startswith("lost") and 4.0 < event.t < 6.0 for event in statuses)
    assert outcome.summary["lost_s"] == pytest.approx(1.5, abs=0.1)
    assert np.isfinite(outcome.arrays["estimate.x"]).all()
    assert outcome.success
