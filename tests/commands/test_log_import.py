"""``mathnavi log import``: a run folder from a log, which the commands for runs take, with all its disorder named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.sim.plugin.named_object import named_object
from mathnavi.sim.records.run_folder import read_log, read_signal_names
from tests.estimators.beacons.drives import PERIOD, PLACES, drive
from tests.estimators.invariant.handheld import handled

MISSION = f"""
import mathnavi as mn

mission = mn.BeaconMission(
    {PLACES!r}, ranges=mn.BeaconQuality(0.3, outliers=0.05), range_scale=0.1,
    odometry=mn.OdometryQuality((0.05, 0.02), 0.02), interval=0.5, period={PERIOD},
)
"""
IMPORT = (
    *("--time-column", "0", "--rates", "DR", "--spread", "TD:TD 2=TD:TD 1"),
    *("--readings", "beacon_ranges=TD 2", "odometry=DR", "--reference", "GT", "--signal-units", "GT 3=rad"),
    *("--reference-names", "x [m],y [m],heading [rad]"),
)


@pytest.fixture
def mower(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a log in MATLAB arrays: distance and turn, ranges by node, truth; three of its stamps are wrong."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mower.py").write_text(MISSION)
    driven = drive(count=400)
    t, odometry = 1000.0 + driven.log.t, driven.log.readings["odometry"]
    rows = np.flatnonzero(np.isfinite(odometry[:, 0]))
    steps = np.diff(t[rows], prepend=t[rows[0]] - PERIOD)
    ranges = [
        [t[k], float(i), rho[i]]
        for k, rho in enumerate(driven.log.readings["beacon_ranges"])
        for i in np.flatnonzero(np.isfinite(rho)).tolist()
    ]
    ranges[40], ranges[41] = ranges[41], ranges[40]  # late
    ranges.insert(60, ranges[60])  # doubled
    arrays = {
        "DR": np.column_stack([t[rows], odometry[rows] * steps[:, None]]),
        "TD": np.array(ranges),
        "GT": np.column_stack([t, driven.truth]),
    }
    savemat(tmp_path / "mower.mat", arrays)
    return tmp_path


def test_a_log_becomes_a_run_that_is_estimated_smoothed_reported_and_compared(
    mower: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "import", "mower.mat", "--out", "run", *IMPORT, "--disorder", "sort"]) == 0
    printed = capsys.readouterr().out
    assert "1 stamp before an earlier one, sorted" in printed
    assert "1 reading left out, whose stamp an earlier one has" in printed
    log = read_log(mower / "run")
    config = json.loads((mower / "run" / "config.json").read_text())
    assert (config["scenario"], config["fields"]["file"], config["fields"]["start"]) == (
        "recorded-log", "mower.mat", "1000.07",
    )  # fmt: skip
    assert len(config["inputs"]["file"]) == 64
    assert (log.summary["stamps_late"], log.summary["stamps_doubled"]) == (1, 1)
    (signals,) = read_signal_names(mower / "run").values()
    assert signals.states == ("x [m]", "y [m]", "heading [rad]")
    assert signals.readings["beacon_ranges"] == ("TD 1=0", "TD 1=1", "TD 1=2", "TD 1=3")

    assert main(["estimate", "beacon_bank", "run", "--mission", "mower.py:mission", "--out", "found"]) == 0
    assert main(["estimate", "smoother", "found", "--mission", "mower.py:mission", "--out", "smoothed"]) == 0
    printed = capsys.readouterr().out
    found, smoothed = (read_log(mower / name).summary for name in ("found", "smoothed"))
    assert "position rms" in printed
    assert smoothed["position_rms_m"] < found["position_rms_m"] < 0.6
    assert found["wrong_share"] < 0.05
    assert found["initialising_s"] > smoothed["initialising_s"]
    again = mn.read_log(mower / "mower.mat", time_column=0).rates("DR").spread("TD:TD 2", by="TD:TD 1")
    own = again.sensor_log(readings={"beacon_ranges": "TD 2", "odometry": "DR"}, disorder="sort")
    namespace: dict[str, mn.BeaconMission] = {}
    exec(MISSION, namespace)
    alone = mn.estimate("beacon_bank", namespace["mission"], own)
    assert alone.x[-1] == pytest.approx(read_log(mower / "found").arrays["estimate.x"][-1], abs=1e-6)

    assert main(["report", "found"]) == 0
    assert main(["view", "run", "found", "--save", "page.html"]) == 0
    assert main(["compare", "found", "smoothed", "--out", "compared.html"]) == 0


TABLE = "\n".join(["stamp,r0,r1,r2,r3,v,w", *(f"{0.2 * k:.1f},20,30,40,30,0,0" for k in range(60)), ""])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "log import still.csv --out x",
            "no column 't'; it has stamp, r0, r1, r2, r3, v, w; --time stamp names the one",
        ),
        ("log import still.csv --time stamp --out x --spread", "--spread without a value"),
        (
            "log import still.csv --time stamp --out x --rates r0 r0",
            "the rate of table:r0 is taken twice; allowed: once",
        ),
        (
            "log import still.csv --time stamp --out x --spread table=r0",
            "'table' is a channel of 6 signals; allowed: one",
        ),
        (
            "log import still.csv --time stamp --out x --spread r0=w table:r0=w",
            "channel 'r0' already; allowed: another",
        ),
        ("log import run --out x", "run is the folder of a run; allowed: a log"),
        ("log show run", "run is the folder of a run; allowed: a log"),
        ("estimate beacon_bank run", "--mission is missing; allowed: FILE.py:NAME"),
        ("estimate beacon_bank none --mission mower.py:mission", "none does not exist; allowed: a log"),
        (
            "estimate beacon_bank still.csv --mission mower.py:mission --readings odometry=v,w",
            "--time stamp names the one",
        ),
        (
            "estimate beacon_bank still.csv --mission mower.py:mission --time stamp --readings odometry=v,w "
            "beacon_ranges=r0,r1",
            "beacon_ranges has 2 columns; allowed: 4, as many as the beacons of the mission have",
        ),
    ],
)
def test_what_is_missing_twice_or_of_another_kind_is_one_line(
    mower: Path, words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (mower / "still.csv").write_text(TABLE)
    assert main(["log", "import", "still.csv", "--time", "stamp", "--out", "run"]) == 0
    assert main(words.split()) == 2
    assert said in capsys.readouterr().err.replace("\n", " ")
    assert not (mower / "x").exists()


def test_the_run_in_the_current_folder_is_estimated_next_to_it(mower: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (mower / "still.csv").write_text(TABLE)
    words = ("--time", "stamp", "--readings", "beacon_ranges=r0,r1,r2,r3", "odometry=v,w", "--out", "run")
    assert main(["log", "import", "still.csv", *words]) == 0
    monkeypatch.chdir(mower / "run")
    assert main(["estimate", "beacon_bank", ".", "--mission", f"{mower}/mower.py:mission"]) in (0, 1)
    assert (mower / "run-beacon_bank" / "summary.json").is_file()


@pytest.mark.parametrize(
    ("column", "code", "said"),
    [
        ("", 0, ""),
        ("nan", 0, ""),
        ("inf", 0, "not finite"),
        ("-20", 0, "out of range"),
        ("0", 0, "out of range"),
        ("lost", 2, "column 'r2': 'lost'; allowed: a number"),
    ],
)
def test_a_beacon_that_is_never_read_right_is_left_out_and_the_others_are_used(
    mower: Path, column: str, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    log = drive(count=200).log
    ranges, odometry = log.readings["beacon_ranges"], log.readings["odometry"]
    rows = [
        [f"{t:.3f}", *("" if np.isnan(each) else f"{each:.4f}" for each in (*ranges[k], *odometry[k]))]
        for k, t in enumerate(log.t.tolist())
    ]
    for row in rows:
        row[3] = column if row[3] else ""
    Path("log.csv").write_text("\n".join(["t,r0,r1,r2,r3,v,w", *(",".join(row) for row in rows), ""]))
    words = ("--mission", "mower.py:mission", "--readings", "beacon_ranges=r0,r1,r2,r3", "odometry=v,w")
    assert main(["estimate", "beacon_bank", "log.csv", *words]) == code
    printed, error = capsys.readouterr()
    assert said in printed + error
    assert "beacon_ranges: beacon 0 is 'r0', beacon 1 is 'r1', beacon 2 is 'r2', beacon 3 is 'r3'" in error or code


def test_places_of_numpy_are_plain_numbers_in_a_mission_and_its_messages() -> None:
    ranges, places = mn.BeaconQuality(0.3), np.array([(0.0, 1.0), (2.0, 3.0)])
    for given in (places, places.tolist(), tuple(map(tuple, places)), [*places]):
        made = mn.BeaconMission(given, ranges=ranges)  # type: ignore[arg-type]
        assert made == mn.BeaconMission(((0.0, 1.0), (2.0, 3.0)), ranges=ranges)
        assert "float64" not in repr(made)
    with pytest.raises(mn.MissionError, match=r"beacons = \(\(0\.0, 1\.0\), None\) with beacon_certified"):
        mn.estimate(
            "beacon_certified",
            mn.BeaconMission((places[0], None), ranges=ranges),
            mn.SensorLog([0.0], {}),  # type: ignore[arg-type]
        )
    flown = mn.FlightBeacons(np.array([(0.0, 1.0, 2.0), (3.0, 4.0, 5.0)]))  # type: ignore[arg-type]
    assert flown.places == ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0))


def test_what_replaces_an_earlier_run_says_so_and_leaves_no_report_of_it(
    mower: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = "\n".join(["t,r0,r1,r2,r3,v,w", *(f"{0.2 * k:.1f},20,30,40,30,0,0" for k in range(60)), ""])
    (mower / "still.csv").write_text(table)
    mission = ("--mission", "mower.py:mission")
    readings = ("--readings", "beacon_ranges=r0,r1,r2,r3", "odometry=v,w")
    commands = {
        "run": (["log", "import", "still.csv", *readings], (0,)),
        "found": (["estimate", "beacon_bank", "run", *mission], (0, 1)),
        "table": (["estimate", "beacon_bank", "still.csv", *mission, *readings], (0, 1)),
    }
    for out, (words, codes) in commands.items():
        assert main([*words, "--out", out]) in codes
        assert "replaced" not in capsys.readouterr().err
    for out, (words, codes) in commands.items():
        (mower / out / "report.html").write_text("of the first")
        (mower / out / "notes.txt").write_text("of the user")
        assert main([*words, "--out", out]) in codes
        what = "estimates" if out == "table" else "run"
        gone = "" if out == "table" else ", and removed its report.html"
        assert f"replaced the {what} in {out}{gone}\n" in capsys.readouterr().err
        assert (mower / out / "report.html").exists() is (out == "table")
        assert (mower / out / "notes.txt").read_text() == "of the user"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*IMPORT,), "--disorder sort sorts them"),
        ((*IMPORT[:9], "--reference", "GP", "--disorder", "sort"), "no signal 'GP'"),
        ((*IMPORT[:13], "--reference-names", "x,y", "--disorder", "sort"), "2 names of 3 references"),
        ((*IMPORT, "--disorder", "sort", "--delays", "DR=soon"), "--delays = DR=soon"),
    ],
)
def test_what_cannot_be_imported_is_one_line_and_leaves_nothing(
    mower: Path, words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "import", "mower.mat", "--out", "run", *words]) == 2
    error = capsys.readouterr().err
    assert said in error.replace("\n", " ")
    assert not (mower / "run").exists()


@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_a_reference_has_the_units_of_its_columns(mower: Path, unit: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A heading that crosses pi is compared as an angle, and stamps that are doubled are events where they are."""
    t, heading = 0.1 * np.arange(80), np.mod(3.0 + 0.01 * np.arange(80) + np.pi, 2.0 * np.pi) - np.pi
    shown = heading if unit == "rad" else np.degrees(heading)
    rows = [f"{t[k]:.1f},{k % 7},0.5,1,{shown[k]:.6f}" for k in range(80)]
    rows.insert(51, rows[50])
    Path("cart.csv").write_text("\n".join([f"t [s],range,x [m],y [m],heading [{unit}]", *rows, ""]))
    words = ["log", "import", "cart.csv", "--readings", "beacon_ranges=range", "--reference", "x,y,heading"]
    assert main([*words, "--disorder", "sort", "--out", "run"]) == 0
    assert "no unit" not in capsys.readouterr().out
    log, signals = read_log(Path("run")), read_signal_names(Path("run"))["vehicle"]
    assert signals.states == ("x [m]", "y [m]", "heading [rad]")
    assert log.x[:, 2] == pytest.approx(heading, abs=1e-6)
    assert [event.t for event in log.events if event.kind == "log-disorder"] == pytest.approx([5.0])


def test_a_reference_without_a_unit_is_said(mower: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("cart.csv").write_text("t,range,heading\n0,1,3.1\n1,2,-3.1\n2,3,-3\n")
    words = ["log", "import", "cart.csv", "--readings", "beacon_ranges=range", "--reference", "heading", "--out", "run"]
    assert main(words) == 0
    assert "the reference 'heading' has no unit" in " ".join(capsys.readouterr().out.split())


def test_a_log_without_a_reference_is_imported_too(mower: Path) -> None:
    words = [word for word in IMPORT if word not in ("--reference", "GT")]
    place = words.index("--reference-names")
    del words[place : place + 2]
    assert main(["log", "import", "mower.mat", "--out", "run", *words, "--disorder", "sort"]) == 0
    assert read_log(mower / "run").x.shape[1] == 0
    assert main(["estimate", "beacon_bank", "run", "--mission", "mower.py:mission", "--out", "found"]) == 0
    assert "position_rms_m" not in read_log(mower / "found").summary
    assert main(["report", "found"]) == 0
    assert main(["report", "run"]) == 0
    assert main(["view", "found", "--save", "page.html"]) == 0


def test_a_smoother_needs_an_estimator_and_a_folder_no_readings(
    mower: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "import", "mower.mat", "--out", "run", *IMPORT, "--disorder", "sort"]) == 0
    assert main(["estimate", "smoother", "run", "--mission", "mower.py:mission"]) == 2
    assert "the folder that `mathnavi estimate` has written" in capsys.readouterr().err.replace("\n", " ")
    words = ("--mission", "mower.py:mission", "--readings", "beacon_ranges=TD 2")
    assert main(["estimate", "beacon_bank", "run", *words]) == 2
    assert "--readings with run" in capsys.readouterr().err
    (mower / "wrong.py").write_text("import mathnavi as mn\nmission = mn.BeaconQuality(-0.1)\n")
    assert main(["estimate", "beacon_bank", "run", "--mission", "wrong.py:mission"]) == 2
    assert "absolute = -0.1; allowed: a finite value >= 0 (" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("beacons=((0.0, 1.0), (0.0, 1.0)), ranges=mn.BeaconQuality(0.3)", "holds one place twice"),
        ("beacons=((0.0, float('nan')),), ranges=mn.BeaconQuality(0.3)", "finite places"),
        ("beacons=((0.0, 1.0, 2.1),), ranges=mn.BeaconQuality(0.3)", "each two numbers"),
        ("beacons=((0.0, 1.0),), ranges=mn.BeaconQuality(-0.1)", "absolute = -0.1; allowed: a finite value >= 0"),
        ("beacons=(None, None), range_differences=mn.BeaconQuality(0.3)", "beacon"),
        (
            "beacons=((0.0, 1.0),), ranges=mn.BeaconQuality(0.3), odometry=mn.OdometryQuality((0.05, float('nan')))",
            "nan",
        ),
        ("beacons=((0.0, 1.0),), ranges=mn.BeaconQuality(0.3), start=mn.KnownStart((0.0, 0.0, float('inf')))", "inf"),
    ],
)
@pytest.mark.parametrize("form", ["mission = {}", "def mission():\n    return {}"])
def test_what_a_mission_in_a_file_may_not_be_is_named_with_its_line(
    form: str, of: str, said: str, tmp_path: Path
) -> None:
    place = tmp_path / "site.py"
    place.write_text(f"import mathnavi as mn\n\n{form.format(f'mn.BeaconMission({of})')}\n")
    with pytest.raises(mn.PluginError) as refused:
        named_object(f"{place}:mission")
    assert said in str(refused.value)
    assert f"{place}:{3 + form.count('return')}" in str(refused.value)


DEVICE = """
import mathnavi as mn

mission = mn.InertialMission(period=0.01)
"""


def test_an_inertial_log_with_a_rate_in_place_of_times_and_an_attitude_as_reference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As BROAD's files are: an array for each sensor, the rate as a number, quaternions of either sign and some NaN."""
    device = handled(seconds=6.0, rest=2.0)
    attitude = device.truth * np.where(np.arange(len(device.truth)) % 7 == 3, -1.0, 1.0)[:, None]
    attitude[100:103] = np.nan
    imu = device.log.readings["imu"]
    savemat(tmp_path / "trial.mat", {"gyr": imu[:, :3], "acc": imu[:, 3:], "opt": attitude, "rate": 100.0})
    (tmp_path / "device.py").write_text(DEVICE)
    monkeypatch.chdir(tmp_path)
    names = ",".join(f"attitude {axis} [-]" for axis in "wxyz")
    words = ["--rate-array", "rate", "--readings", "imu=gyr,acc", "--reference", "opt", "--reference-names", names]
    assert main(["log", "import", "trial.mat", "--out", "run", *words]) == 0
    assert "no unit" not in capsys.readouterr().out
    truth = read_log(tmp_path / "run").x
    assert np.abs((truth * device.truth).sum(axis=1)).min() > 0.9999
    assert main(["estimate", "inertial_attitude", "run", "--mission", "device.py:mission", "--out", "found"]) == 0
    assert "inclination rms" in capsys.readouterr().out
    summary = read_log(tmp_path / "found").summary
    assert summary["inclination_rms_deg"] < 1.0
    assert (summary["wrong_share"], summary["usable_share"]) == (0.0, pytest.approx(1.0, abs=0.15))
