"""``mathnavi check``: what it finds is what a run fails at, and what it finds nothing in runs."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import dm_control
import gymnasium
import mujoco
import numpy as np
import pytest

from mathnavi.commands import check_model
from mathnavi.commands.cli import main
from mathnavi.interfaces.signals import Event
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.records.run_spec import RunSpec

SUITE = Path(dm_control.__file__).parent / "suite"
GYMNASIUM = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
STRANGERS = [
    *(SUITE / f"{name}.xml" for name in ("acrobot", "ball_in_cup", "cheetah", "manipulator", "point_mass", "walker")),
    *(GYMNASIUM / f"{name}.xml" for name in ("ant", "inverted_double_pendulum", "pusher", "swimmer")),
]
Printed = Callable[..., str]


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Printed:
    """What the command prints, in one line, after its exit code was as expected."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "400")

    def check(subject: str, code: int) -> str:
        capsys.readouterr()
        assert main(["check", subject]) == code
        return " ".join(capsys.readouterr().out.split())

    return check


@pytest.mark.parametrize("path", STRANGERS, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_a_file_of_a_stranger_in_which_nothing_is_found_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run that the check prints goes on for its five seconds; here with fewer readings."""
    monkeypatch.setattr(check_model, "TIME_STEPPED", 0.5)  # of the check itself, for the time that it takes
    result = check_model.check_model(str(path))
    assert result.fits
    command = shlex.split(result.command)
    assert command[:5] == ["mathnavi", "run", "arm-velocity", "--mechanism", str(path)]
    assert command[-2:] == ["--duration", "5"]
    controller = command[command.index("--controller") + 1] if "--controller" in command else "joint_tracking"
    fields = {"mechanism": str(path), "duration": 5.0, "rate": 100.0, "speed_max": 1e4}
    closed_loop = RunSpec.of("arm-velocity", 0, controller, "filtered_differences", fields).build()
    recording = simulate(closed_loop.plant, closed_loop.agents, 5.0, closed_loop.finished)
    assert recording.t[-1] == pytest.approx(5.0)
    assert np.isfinite(recording.truths["mechanism"]).all()
    assert not {"diverged", "raised"} & {event.kind for event in recording.events}


ARM = """<mujoco>{before}<worldbody><body pos="0 0 1">{joint}<geom type="capsule" size=".04" fromto="0 0 0 .1 0 -.5"
mass="1"/>{body}</body></worldbody>{after}</mujoco>"""
HINGE = '<joint name="a" axis="0 1 0"/>'
MOTOR = '<actuator><motor joint="a"/></actuator>'
FLAWS = {
    "no joints": ({"joint": "", "after": ""}, "no joints", "joints, each of which moves mass"),
    "a joint without mass": (
        {"body": '<body name="empty"><joint axis="1 0 0"/></body>'}, "empty", ""
    ),
    "an attribute that there is not": ({"before": '<option tymestep="1"/>'}, "unrecognized attribute: 'tymestep'", ""),
    "an actuator on nothing": ({"after": f'{MOTOR}<actuator><motor joint="b"/></actuator>'}, "'b'", ""),
    "a sensor on nothing": ({"after": f'{MOTOR}<sensor><jointpos joint="b"/></sensor>'}, "b", ""),
    "a contact with nothing": ({"after": f'{MOTOR}<contact><exclude body1="q" body2="q"/></contact>'}, "q", ""),
    "armature of a tendon": (
        {"after": f'<tendon><fixed armature="1"><joint joint="a" coef="1"/></fixed></tendon>{MOTOR}'},
        "armature of tendons", "joints, each of which moves mass",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("content", "said", "write"),
    [
        ('<mujoco>\n<worldbody>\n<geom type="capsul" size="1"/></worldbody></mujoco>', "'capsul'", "line 3 of arm.xml"),
        ('<mujoco>\n<actuator><motor joint="b"/></actuator></mujoco>', "transmission target 'b'", "line 2 of arm.xml"),
        ("<mujoco><worldbody>", "XML_ERROR_MISMATCHED_ELEMENT", "line 1 of arm.xml"),
    ],
)
def test_a_file_that_mujoco_refuses_is_said_to_be_refused_in_its_words_with_the_line(
    content: str, said: str, write: str, checked: Printed
) -> None:
    Path("arm.xml").write_text(content)
    shown = checked("arm.xml", 1)
    assert "arm.xml: MuJoCo refuses it refused " in shown
    assert said in shown
    assert f"write correct {write}: https://mujoco.readthedocs.io" in shown
    assert "missing" not in shown


@pytest.mark.parametrize(("parts", "what", "write"), FLAWS.values(), ids=FLAWS)
def test_what_is_missing_is_what_a_run_refuses(
    parts: dict[str, str], what: str, write: str, checked: Printed, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("arm.xml").write_text(ARM.format(**{"before": "", "joint": HINGE, "body": "", "after": MOTOR, **parts}))
    said = checked("arm.xml", 1)
    assert what in said
    assert write in said
    assert main(["run", "arm-velocity", "--mechanism", "arm.xml", "--duration", "5", "--out", "run"]) == 2
    assert what in capsys.readouterr().err


def test_a_timestep_that_is_too_long_is_found_and_the_one_to_write_runs(checked: Printed) -> None:
    servo = '<actuator><position joint="a" kp="2e6" dampratio="0"/></actuator>'
    start = '<keyframe><key qpos="0.1"/></keyframe>'
    stiff = {"joint": HINGE, "body": "", "after": servo + start}
    Path("arm.xml").write_text(ARM.format(before='<option timestep="0.01"/>', **stiff))
    said = checked("arm.xml", 1)
    assert "the simulation diverged in the joint 'a'" in said
    run = ["run", "arm-velocity", "--mechanism", "arm.xml", "--controller", "input_signal", "--duration", "5"]
    assert main([*run, "--estimator", "filtered_differences", "--out", "run"]) == 1
    assert "diverged" in Path("run/events.jsonl").read_text()
    line = said.partition("write ")[2].partition("/>")[0] + "/>"
    assert line.startswith("<option timestep=")
    Path("arm.xml").write_text(ARM.format(before=line, **stiff))
    checked("arm.xml", 0)
    assert main([*run[:-1], "1.2", "--estimator", "filtered_differences", "--out", "run"]) in (0, 1)
    assert "diverged" not in Path("run/events.jsonl").read_text()


CART = """<mujoco><worldbody><geom {floor} type="plane" size="5 5 1"/><body name="cart/box" pos="0 0 0.1">
<joint name="cart/x" type="slide" axis="1 0 0"/><joint name="cart/z" type="slide" axis="0 0 1"/>
<geom size=".1" mass="1"/><site name="imu"/>
<body {arm} pos="0 0 .2"><joint {hinge} axis="0 1 0"/><geom size=".05" pos=".3 0 0"/></body></body></worldbody>
<actuator><motor {motor} joint="cart/x"/></actuator><sensor><gyro {gyro} site="imu"/></sensor></mujoco>"""
NAMED = {part: f'name="{name}"' for part, name in {
    "floor": "floor", "arm": "cart/arm", "hinge": "cart/hinge", "motor": "cart/motor", "gyro": "cart/gyro"
}.items()}  # fmt: skip


def test_what_fits_of_a_vehicle_is_listed_with_how_it_is_read(checked: Printed) -> None:
    Path("cart.xml").write_text(CART.format(**NAMED))
    said = checked("cart.xml", 0)
    for words in (
        "cart: state 6: position_x [m], position_z [m], position_hinge [rad]",
        "cart: input 1: motor [N] without a bound",
        'gyro: <gyro>, 3 numbers [rad/s], exact, read by MujocoSensor.of(model, "cart", "gyro", rate=HZ)',
        'cart touches floor at rest, which is an event write VehicleSetup(..., ignored_contacts=("floor",))',
    ):
        assert words in said
    assert "missing body" not in said


@pytest.mark.parametrize(
    ("part", "name", "what", "code"),
    [
        ("arm", "arm", "body 'arm' moves with cart and lacks its name", 1),
        ("hinge", "hinge", "joint 'hinge' of cart lacks its name: it is no state", 1),
        ("motor", "motor", "actuator 'motor' acts on cart and lacks its name", 1),
        ("gyro", "gyro", "the sensor 'gyro' (<gyro>) belongs to no vehicle", 0),
    ],
)
def test_what_lacks_the_name_of_its_vehicle_is_found_with_the_name_to_write(
    part: str, name: str, what: str, code: int, checked: Printed
) -> None:
    Path("cart.xml").write_text(CART.format(**{**NAMED, part: f'name="{name}"'}))
    said = checked("cart.xml", code)
    assert what in said
    assert f'name="cart/{name}"' in said


def test_what_is_found_of_a_vehicle_is_what_its_plant_does(checked: Printed) -> None:
    """Without its name a motor is no input; declared, the floor is no event, for five seconds."""
    Path("cart.xml").write_text(CART.format(**{**NAMED, "motor": 'name="motor"'}))
    model = mujoco.MjModel.from_xml_path("cart.xml")

    def events(*ignored: str) -> list[Event]:
        setup = VehicleSetup(np.zeros(6), ignored_contacts=ignored)
        plant = MujocoPlant(model, {"cart": setup}, np.random.default_rng(0))
        with pytest.raises(ValueError, match=r"shape \(1,\); allowed: \(0,\)"):
            plant.step({"cart": np.ones(1)})
        return [event for _ in range(500) for event in plant.step({}, 5) if event.kind == "ground-contact"]

    assert events()
    assert not events("floor")


SCENARIO = """
class Broken:
    "A scenario."
    {0}
"""


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("controller = 'full_state'", "as a scenario: 'mine:Broken' declares no frozen dataclass named Config"),
        ("sensors = 1", "as an estimator: 'mine:Broken' declares no frozen dataclass named Config"),
        ("pass", "as a controller: 'mine:Broken' declares no frozen dataclass named Config"),
    ],
)
def test_a_class_that_is_no_plug_in_is_told_what_it_lacks(
    body: str, said: str, checked: Printed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    Path("mine.py").write_text(SCENARIO.format(body))
    assert said in checked("mine.py:Broken", 1)


PARTS = """
from dataclasses import dataclass
from types import SimpleNamespace

from mathnavi.controllers.flight.plugin import FlightController
from mathnavi.estimators.kalman import Kalman
from mathnavi.models.aerial.mission import FlightMission


class Looker(Kalman):
    {looker}


class Steerer(FlightController):
    {steerer}
"""
REFUSED = {
    "quality None": ("looker", "quality = staticmethod(lambda config, mission: None)", "quality() returned None"),
    "sensors none": ("looker", "sensors = staticmethod(lambda config, mission: 3)", "sensors() returned an int"),
    "a sensor without a rate": (
        "looker",
        "sensors = staticmethod(lambda config, mission: [SimpleNamespace(name='a', size=1, read=None)])",
        "without rate",
    ),
    "no update": ("looker", "build = staticmethod(lambda config, mission: SimpleNamespace(period=0.1))", "update()"),
    "build raises": ("looker", "build = staticmethod(lambda config, mission: 1 / 0)", "ZeroDivisionError"),
    "a period between ticks": (
        "looker",
        "build = staticmethod(lambda config, mission: SimpleNamespace(period=0.0123, update=print))",
        "0.0123",
    ),
    "no pair": ("steerer", "build = staticmethod(lambda config, mission: None)", "build() returned None"),
    "no plan": (
        "steerer",
        "build = staticmethod(lambda config, mission: (SimpleNamespace(period=1.0), SimpleNamespace(period=1.0)))",
        "without plan()",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("part", "line", "what"), REFUSED.values(), ids=REFUSED)
def test_what_a_run_refuses_of_a_part_the_check_refuses_in_the_same_words(
    part: str,
    line: str,
    what: str,
    checked: Printed,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    Path("mine.py").write_text(PARTS.format(**{"looker": "pass", "steerer": "pass", part: line}))
    place = f"mine:{part.capitalize()}"
    said = checked(f"mine.py:{part.capitalize()}", 1)
    flag = {"looker": "--estimator", "steerer": "--controller"}[part]
    assert main(["run", "safe-flight", flag, place, "--out", "run"]) == 2
    refusal = " ".join(capsys.readouterr().err.split())
    assert what in refusal
    assert refusal.removeprefix("mathnavi: ").partition("; allowed: ")[0] in said


def test_the_check_flies_a_part_for_half_a_second(
    checked: Printed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    made = "SimpleNamespace(period=mission.control_period, update=lambda *given: 3)"
    looker = f"build = staticmethod(lambda config, mission: {made})"
    Path("mine.py").write_text(PARTS.format(looker=looker, steerer="pass"))
    said = checked("mine.py:Looker", 0)
    assert "scenarios safe-flight, simultaneous-arrival" in said
    assert "vehicle: estimate-unusable, " in said


@pytest.mark.parametrize("name", ["kazantzis_kravaris", "beacon_bank", "gatekeeper"])
def test_a_part_that_fits_no_scenario_as_it_stands_is_no_fault_of_the_part(name: str, checked: Printed) -> None:
    assert "nothing is missing" in checked(name, 0)


def test_an_estimator_is_shown_the_scenarios_that_it_fits(checked: Printed) -> None:
    said = checked("range_ekf", 0)
    assert "built for a RangingMission" in said
    assert "run mathnavi run range-localisation --estimator range_ekf" in said
    assert "--estimator.timeout" in said


@pytest.mark.parametrize(
    ("subject", "said"),
    [
        ("nowhere.xml", "the path of an MJCF file"),
        ("nowhere.py:Mine", "there is no file nowhere.py"),
        ("../elsewhere.py:Mine", "there is no file"),
        ("nowhere:Mine", "there is no module 'nowhere'"),
    ],
)
def test_what_is_not_there_is_one_line(
    subject: str, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", subject]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "yard.py",
            "yard.py is a file of Python code; allowed: `mathnavi check yard.py:CLASS` for the class of a plug-in",
        ),
        ("yard.py", "`mathnavi check ESTIMATOR --mission yard.py:mission` for a mission"),
        ("yard.py:mission", "yard:mission is a BeaconMission, no class of a plug-in"),
        ("yard.csv", "yard.csv is no model; allowed: an MJCF file, .xml, or a plug-in"),
    ],
)
def test_a_file_of_another_kind_is_named_with_the_command_that_takes_it(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    code = "import mathnavi as mn\nmission = mn.BeaconMission(((0.0, 1.0),), ranges=mn.BeaconQuality(0.3))\n"
    (tmp_path / "yard.py").write_text(code)
    (tmp_path / "yard.csv").write_text("t,x\n0,1\n")
    monkeypatch.delitem(sys.modules, "yard", raising=False)
    assert main(["check", words]) == 2
    assert said in capsys.readouterr().err
