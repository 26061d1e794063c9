"""``mathnavi view``: a finished run in MuJoCo's own viewer, or as a page for a browser.

The viewer shows it in real time, repeatedly until it is closed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.command_line import CommandLine, prepare
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.recorded_spec import RecordedSpec
from mathnavi.commands.run import build
from mathnavi.commands.served_address import Port, address_of, check_address
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.checks import PAGES, checked_ending
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER, Positional
from mathnavi.models.opengl_probe import FaultError, try_glfw
from mathnavi.sim.engine.scene_record import RecordedMotion
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.documents import LOG_SCENARIO
from mathnavi.sim.records.run_folder import RunLog, read_fleet, read_log, read_record, read_state_names

DESCRIPTION = (
    "Replay a run in MuJoCo's viewer until its window is closed; with --web in a browser, at this machine alone unless "
    "--host names another address, until Ctrl-C. Two runs or more are compared there: their paths in one scene, their "
    "signals in one chart each."
)
FRAME = 1.0 / 60.0  # [s]
REST = 1.0  # [s] at the end, before it begins again
MOST_POINTS = 300  # of a path
PATH = (0.93, 0.45, 0.05, 1.0)  # colour
DISTANCE = 12.0  # of the camera, in sizes of a vehicle
NO_MODEL = "allowed: `mathnavi view DIR --web`, which shows its plan and charts, or `mathnavi report DIR`"
NO_DISPLAY = "allowed: a desktop, or `mathnavi view DIR --web`, or `mathnavi render DIR` for a video"


@configuration
class ViewOptions:
    """Flags of the command: the run to show, and how fast."""

    folders: Annotated[tuple[Path, ...], TOGETHER, Positional("DIR...")]
    """folders of runs; two or more are shown side by side, on one time axis, with --web or --save"""
    speed: Positive | None = None
    """speed of the replay, as a multiple of real time; if not given 1, in a browser a replay of about half a minute"""
    web: bool = False
    """whether to show the run in a browser; prints the URL"""
    save: Path | None = None
    """file to write the page to, .html or .htm, which then needs neither a server nor a network"""
    host: str | None = None
    """address of this machine at which --web serves; 127.0.0.1 if not given; the URL of any other has a token"""
    port: Port | None = None
    """port at which --web serves; 8765 if not given; 0 chooses a free one"""
    trust: bool = False
    """whether to import code that DIR names and that is not installed; it runs with your rights"""

    def __post_init__(self) -> None:
        if not self.folders:
            raise FieldError("DIR is missing; allowed: the folder of a run")
        if len(self.folders) > 1 and not self.web and self.save is None:
            raise FieldError(f"DIR is given {len(self.folders)} times; allowed: once, or together with --web or --save")
        check_address(self.host, self.port, web=self.web)
        if self.save is not None:
            checked_ending(self.save, PAGES, "--save")


def main(argv: Sequence[str]) -> int:
    (options,) = parse(argv, "mathnavi view", DESCRIPTION, FlagGroup(ViewOptions))
    prepare()
    if options.web or options.save is not None:
        from mathnavi.commands.view_web import show  # which the viewer does not need

        address = address_of(options.host, options.port) if options.web else None
        with trusting(options.trust):
            return show(options.folders, options.speed, options.save, address)
    with trusting(options.trust):
        replay = read_replay(options.folders[0])
    check_display()
    import mujoco.viewer  # needs GLFW

    try:
        window = mujoco.viewer.launch_passive(
            replay.plant.model, replay.plant.data, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # on macOS, unless it is run by mjpython
        raise BadInputError(f"view: {error}") from error
    with window as viewer:
        play(replay, viewer, options.speed or 1.0)
    return 0


def read_replay(folder: Path) -> RecordedMotion:
    """Read the run in a folder; BadInputError if it cannot be shown."""
    if not (folder / "config.json").is_file():
        raise BadInputError(f"DIR = {folder}: there is no {folder / 'config.json'}; allowed: the folder of a run")
    with bad_input():
        if read_record(folder)[0].get("scenario") == LOG_SCENARIO:
            raise BadInputError(f"DIR = {folder}: a recorded log has no model for MuJoCo's viewer; {NO_MODEL}")
    recorded = RecordedSpec.read(folder)
    with bad_input():
        logs = _logs(folder)
    closed_loop = build(CommandLine("mathnavi view", recorded.spec), recorded)
    try:
        states, inputs = (
            {name: part(log) for name, log in logs.items()} for part in (attrgetter("x"), attrgetter("u"))
        )
        return RecordedMotion(closed_loop.plant, next(iter(logs.values())).t, states, inputs)
    except ValueError as error:
        raise BadInputError(f"{folder} cannot be shown: {error}") from error


def check_display() -> None:
    """Raise BadInputError if no window can be opened; MuJoCo's viewer would wait for it forever."""
    try:
        try_glfw()
    except FaultError as fault:
        raise BadInputError(f"view: {fault}; {NO_DISPLAY}") from None


def play(replay: RecordedMotion, viewer: Any, speed: float, clock: Callable[[], float] = time.perf_counter) -> None:
    """Show the run in a viewer of ``mujoco.viewer`` until it is closed."""
    with viewer.lock():
        _draw_paths(replay, viewer)
    began = clock()
    while viewer.is_running():
        t = (clock() - began) * speed % (replay.duration + REST * speed)
        with viewer.lock():
            replay.show(min(t, replay.duration))
        viewer.sync()
        time.sleep(FRAME)


def _draw_paths(replay: RecordedMotion, viewer: Any) -> None:
    """Draw the path of every vehicle as a line, and put the camera behind the first one."""
    import mujoco

    scene, model = viewer.user_scn, replay.plant.model
    paths = {name: replay.path(name, MOST_POINTS) for name in replay.plant.names}
    for points in paths.values():
        for begin, end in pairwise(points):
            if scene.ngeom >= scene.maxgeom:
                break
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(
                geom, mujoco.mjtGeom.mjGEOM_LINE, np.zeros(3), np.zeros(3), np.zeros(9), np.array(PATH, np.float32)
            )
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_LINE, 3.0, begin, end)
            scene.ngeom += 1
    name, points = next(iter(paths.items()))
    body = replay.body(name)
    viewer.cam.type, viewer.cam.trackbodyid = mujoco.mjtCamera.mjCAMERA_TRACKING, body
    own = model.geom_rbound[model.body_rootid[model.geom_bodyid] == model.body_rootid[body]]
    viewer.cam.distance = DISTANCE * float(own.max())
    viewer.cam.elevation = -20.0


def _logs(folder: Path) -> dict[str, RunLog]:
    """Return the log of every vehicle."""
    names = list(read_state_names(folder))
    if len(names) > 1:
        return dict(read_fleet(folder).vehicles)
    return {name: read_log(folder, may_diverge=True) for name in names}
