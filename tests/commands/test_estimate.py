"""``mathnavi estimate``: estimators over finished runs, and what it refuses."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.interfaces.protocols import Sensor, StateView
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.renders.report import events_sections
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS, is_wall_clock
from mathnavi.sim.records.run_folder import read_log
from mathnavi.sim.scenarios.missile_fields import MissileGuidanceConfig
from mathnavi.sim.scenarios.missile_guidance import MissileGuidance

OSCILLATION = ("textbook-observer", "--system", "krener-isidori", "--noise", "0.02", "--duration", "2")
RANGES = ("range-localisation", "--duration", "2", "--sensors", "0", "90", "-100", "--noise.dropout", "0.1")
DIVE = ("missile-guidance", "--controller", "tests.missile:Glide", "--target", "200", "0", "0")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the run ``oscillation``, by Luenberger's observer."""
    folder = tmp_path_factory.mktemp("recorded")
    out = ("--tolerance", "1", "--out", str(folder / "oscillation"))
    assert main(["run", *OSCILLATION, "--estimator", "output_injection", "--estimator.poles", "-3", "-4", *out]) == 0
    return folder


def arrays(folder: Path) -> dict[str, Array]:
    with np.load(folder / "log.npz") as log:
        return dict(log)


def assert_same_run(one: Path, other: Path) -> None:
    """Logs bit for bit, events, and every figure that is no time of a clock."""
    first, second = arrays(one), arrays(other)
    assert set(first) == set(second)
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name], err_msg=name)
    summaries = [json.loads((run / "summary.json").read_text()) for run in (one, other)]
    figures = [{key: value for key, value in summary.items() if not is_wall_clock(key)} for summary in summaries]
    assert figures[0] == figures[1]
    events = [sorted((run / "events.jsonl").read_text().splitlines()) for run in (one, other)]
    assert events[0] == events[1]  # in another order within a control step: the commands are known from the start


def test_the_recorded_estimator_estimates_the_same_again(folder: Path, tmp_path: Path) -> None:
    assert main(["estimate", "output_injection", str(folder / "oscillation"), "--out", str(tmp_path / "again")]) == 0
    assert_same_run(folder / "oscillation", tmp_path / "again")
    config = json.loads((tmp_path / "again" / "config.json").read_text())
    assert config["estimator"]["fields"]["poles"] == [-3.0, -4.0]  # as they were
    assert config["recorded"] == str(folder / "oscillation")


@pytest.mark.parametrize(
    "words",
    [
        (*RANGES, "--outage", "0.5", "1.2", "--noise.outliers", "0.05", "--estimator", "feasible_set_bank"),
        (*RANGES, "--drive", "differential", "--friction", "0.3", "--estimator", "range_ekf"),
        (*DIVE, "--estimator", "missile_kalman", "--noise.position", "0.5", "--noise.dropout-rate", "0.2"),
        (*DIVE, "--estimator", "full_state", "--estimator.rate", "50", "--target-velocity", "20", "0", "0"),
    ],
)
def test_a_run_is_estimated_the_same_again(words: Sequence[str], tmp_path: Path) -> None:
    main(["run", *words, "--out", str(tmp_path / "dive")])
    again = ["--out", str(tmp_path / "again"), "--trust"]  # tests.missile:Glide is not installed
    main(["estimate", words[words.index("--estimator") + 1], str(tmp_path / "dive"), *again])
    assert_same_run(tmp_path / "dive", tmp_path / "again")


def test_readings_between_control_steps_and_plans_under_certificate_are_the_same_again(
    mission: tuple[str, ...], tmp_path: Path
) -> None:
    words = ("--estimator", "kalman", "--noise.position", "2", "--noise.position-rate", "15", "--faults.dropout-rate")
    main(["run", *mission, *words, "0.1", "--faults.gust-rms", "0.5", "--out", str(tmp_path / "flight")])
    main(["estimate", "kalman", str(tmp_path / "flight")])
    assert_same_run(tmp_path / "flight", tmp_path / "flight-kalman")


class Boaster(Kalman):
    """Estimator that declares a tenth of the error that it has, and names what happens to it."""

    @staticmethod
    def build(config: KalmanConfig, mission: FlightMission) -> Boaster:
        return Boaster(config, mission)

    @staticmethod
    def quality(config: KalmanConfig, mission: FlightMission) -> EstimateQuality:
        quality = Kalman.quality(config, mission)
        return replace(quality, error=0.01 * quality.error, driving=0.01 * quality.driving)

    def events(self) -> list[tuple[str, str]]:
        return [("boast", "it is sure")] if self.period else []


def test_an_estimator_that_did_not_fly_has_no_part_in_the_flight(mission: tuple[str, ...], tmp_path: Path) -> None:
    """The tracking bound rests on the quality of the estimator that flew, not on that of this one."""
    flight, other = tmp_path / "flight", tmp_path / "other"
    words = ("--estimator", "kalman", "--noise.position", "2", "--faults.gust-rms", "0.5")
    main(["run", *mission, *words, "--out", str(flight)])
    main(["estimate", "tests.commands.test_estimate:Boaster", str(flight), "--out", str(other)])
    flown, estimated = (json.loads((run / "summary.json").read_text()) for run in (flight, other))
    for group in ("mission", "path", "safety", "tracking", "planning", "solver"):
        keys = set(SUMMARY_GROUPS[group]) & set(flown)
        assert {key: estimated[key] for key in keys} == {key: flown[key] for key in keys}, group
    configs = [json.loads((run / "config.json").read_text()) for run in (flight, other)]
    assert configs[0]["mission"] == configs[1]["mission"]
    log = read_log(other)
    of_estimate, of_flight = events_sections(log.events, log.config)
    assert "it is sure" in of_estimate
    assert "it is sure" not in of_flight
    assert f"As they were recorded in {flight}" in of_flight
    assert "guarantee held" not in of_estimate
    assert "guarantee held" in of_flight


def test_another_estimator_sees_the_same_readings(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = folder / "oscillation"
    assert main(["estimate", "textbook_ekf", str(run), "--out", str(tmp_path / "ekf")]) == 0
    printed = capsys.readouterr().out
    assert "recorded: output_injection" in printed
    assert "x_1 [-]" in printed
    one, other = arrays(run), arrays(tmp_path / "ekf")
    for name in ("t", "truth.x", "measurement.output", "command.u", "plan.u", "plan.adopted"):
        np.testing.assert_array_equal(one[name], other[name])
    assert (one["estimate.x"] != other["estimate.x"]).any()


def test_fields_are_given_anew(folder: Path, tmp_path: Path) -> None:
    words = ["--estimator.poles", "-8", "-9", "--out", str(tmp_path / "fast")]
    assert main(["estimate", "output_injection", str(folder / "oscillation"), *words]) == 0
    rates = [
        json.loads((run / "summary.json").read_text())["decay_rate_per_s"]
        for run in (folder / "oscillation", tmp_path / "fast")
    ]
    assert rates[1] > 1.3 * rates[0]


def test_a_run_without_the_sensors_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = folder / "oscillation"
    for words, message in (
        ((), "ESTIMATOR is missing; allowed: "),
        (("textbook_ekf",), "DIR is missing; allowed: folder of a run"),
        (("textbook_ekf", "--out", "x"), "DIR is missing"),
        (("textbook_ekf", ""), "DIR is missing"),
        (("nothing", str(run)), "--estimator: 'nothing' is not known; allowed: "),
        (("textbook_ekf", str(folder / "none")), "does not exist"),
        (("textbook_ekf", str(run), "--out", str(run)), "is what is read; allowed: another name"),
        (("textbook_ekf", str(run), "--out", str(folder)), "holds other files than a run's"),
        (("textbook_ekf", str(run), "--seed", "3"), "--seed is not a field"),
        (("textbook_ekf", str(run), "--estimator.timeout", "0"), "--estimator.timeout = 0.0; allowed"),
        (("example_2_2", str(run)), "allowed with this observer: example-2-2"),
        (("tests.commands.test_estimate:Deaf", str(run)), "it reads bell (1), and the run measured output (1)"),
        (("tests.commands.test_estimate:Slow", str(run)), "it estimates every 0.02 s; allowed: every 0.01 s"),
    ):
        assert main(["estimate", *words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert message in line
    assert [path.name for path in folder.iterdir()] == ["oscillation"]


def test_help_is_printed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "--help"]) == 0
    assert "ESTIMATOR DIR" in capsys.readouterr().out
    assert main(["estimate", "output_injection", str(folder / "oscillation"), "--help"]) == 0
    assert "--estimator.poles" in capsys.readouterr().out


def test_errors_of_a_missile_are_in_the_thesis_coordinates() -> None:
    x = np.array([[100.0, 1.0, 0.0, math.radians(179.0), 5.0, -6.0]])
    joints = np.zeros((1, 6))
    errors = MissileGuidance.errors(MissileGuidanceConfig(), x, joints)
    assert list(errors)[3] == "theta [rad]"
    assert errors["x_e [m]"][0] == pytest.approx(5.0)


@dataclass(frozen=True)
class NoFields:
    """None."""


class Slow:
    """An estimator of another rate."""

    Config = NoFields
    period = 0.02

    @classmethod
    def build(cls, config: NoFields, mission: TextbookMission) -> Slow:
        return cls()

    @staticmethod
    def sensors(config: NoFields, mission: TextbookMission) -> tuple[Sensor, ...]:
        return (mission.sensor,)

    @staticmethod
    def quality(config: NoFields, mission: TextbookMission) -> None:
        return None

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> None:
        raise AssertionError


class Bell:
    name, size, rate = "bell", 1, None

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        return np.zeros(1)


class Deaf(Slow):
    """An estimator that wants what the run has not."""

    period = 0.01

    @staticmethod
    def sensors(config: NoFields, mission: TextbookMission) -> tuple[Sensor, ...]:
        return (Bell(),)


@pytest.mark.parametrize("method", ["rts", "batch"])
def test_the_smoother_of_a_recorded_filter_is_nearer_to_the_truth(
    method: str, ranged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--estimator.method", method, "--out", str(tmp_path / "smooth")]
    assert main(["estimate", "smoother", str(ranged), *words]) == 0
    summaries = [json.loads((run / "summary.json").read_text()) for run in (ranged, tmp_path / "smooth")]
    assert summaries[1]["position_rms_m"] < summaries[0]["position_rms_m"]
    before, after = arrays(ranged), arrays(tmp_path / "smooth")
    np.testing.assert_array_equal(before["truth.x"], after["truth.x"])
    assert after["estimate.x"].shape == before["estimate.x"].shape
    config = json.loads((tmp_path / "smooth" / "config.json").read_text())
    assert config["estimator"]["name"].endswith(":RangeEkf"), "it can be estimated again"
    assert config["smoother"]["method"] == method
    assert "smoother over" in capsys.readouterr().out


@pytest.fixture(scope="module")
def ranged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run of a robot whose start is known, by an extended Kalman filter."""
    folder = tmp_path_factory.mktemp("ranged") / "run"
    main(["run", *RANGES, "--seed", "1", "--start-known", "--estimator", "range_ekf", "--out", str(folder)])
    return folder


def test_a_run_of_another_estimator_is_not_smoothed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["estimate", "smoother", str(folder / "oscillation")]) == 2
    assert "OutputInjection; allowed: kalman" in capsys.readouterr().err
