"""Result of a run in a script: data, which plots, films and reports itself."""

from __future__ import annotations

import base64
import dataclasses
import io
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Literal

from mathnavi.interfaces.checks import PAGES, checked_ending
from mathnavi.interfaces.short_tables import Row, html_table, short_table, value_text
from mathnavi.interfaces.writing import write_text
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL, SUMMARY_GROUPS, label
from mathnavi.sim.records.timing import slow_components
from mathnavi.sim.scenarios import closed_loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 12  # figures of a summary in a short table


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class RunResult(closed_loop.RunData):
    """Result of a run: its arrays by dotted name, summary, events, and whether the mission succeeded.

    ``run["truth.x"]`` is an array of the log, (n, nx) by control step; ``run.arrays`` names them all.
    """

    trusted: bool = True  # whether its own drawing, which may be any code, may run; False for one read from a folder

    @staticmethod
    def of(result: closed_loop.RunData) -> RunResult:
        """Return the result of a run that this process has flown."""
        return RunResult(**{field.name: getattr(result, field.name) for field in dataclasses.fields(result)})

    def plot(self) -> Figure:
        """Figure of the run: the map of a flight, the field of a robot, or a velocity with its estimate."""
        from mathnavi.renders.run_figure import run_figure  # what draws takes a while to import

        with self._in_folder() as folder:
            return run_figure(folder)

    def video(
        self,
        path: str | Path,
        camera: str = "tour",
        *,
        width: int | None = None,
        height: int | None = None,
        fps: float | Fraction | None = None,
        progress: bool = False,
        codec: Literal["h264", "av1", "vp9"] | None = None,
    ) -> Path:
        """Write a video and return its path, whose ending says the format: .mp4, .webm, .gif or .webp.

        ``width`` and ``height`` [pixels] are 1280 x 720, ``fps`` 24 pictures a second, of a GIF or WebP 640 x 360 and
        12, if not given. ``codec`` is h264 in an MP4, vp9 in a WebM, if not given. Raises ValueError for another
        ending, a size, rate or codec that the format does not have, and a camera that the run does not have,
        RuntimeError without OpenGL.
        """
        from mathnavi.renders.video import write_video

        size = {"width": width, "height": height}
        with self._in_folder() as folder:
            return write_video(folder, camera, path=path, fps=fps, progress=progress, codec=codec, **size)

    def report(self, path: str | Path) -> Path:
        """Write the run as one HTML page that needs no network, and return its path, which ends in .html or .htm.

        Raises ValueError for another ending.
        """
        checked_ending(path, PAGES)
        from mathnavi.renders.report import report_page

        with self._in_folder() as folder:
            text = str(report_page(folder))
        if self.folder is None:  # the command that flies the run again names the folder it will be saved in
            text = text.replace(str(folder), "FOLDER")
        write_text(Path(path), text)
        return Path(path)

    @contextmanager
    def _in_folder(self) -> Iterator[Path]:
        """Folder of the run, to be drawn; a temporary one if it was not saved yet."""
        with trusting(self.trusted), ExitStack() as stack:
            if self.folder is not None:
                yield self.folder
                return
            scratch = Path(stack.enter_context(TemporaryDirectory()))
            self.write_files(scratch)
            yield scratch

    def _table(self) -> tuple[str, list[Row]]:
        shortfall = self.summary.get(SHORTFALL)
        ended = "mission succeeded" if self.success else "mission FAILED"
        title = f"{self.config['scenario']}, seed {self.config['seed']}: {ended}{f': {shortfall}' * bool(shortfall)}"
        if status := self.summary.get(PLANNER_STATUS):
            title += f"; but the planner {status}"
        slow = {} if self.timing is None else slow_components(self.timing, on_the_whole=True)
        title += "".join(f"; {component}: {words}" for component, words in slow.items())
        grouped = [key for keys in SUMMARY_GROUPS.values() for key in keys if key in self.summary]
        own = [
            key
            for key in self.summary
            if key not in grouped and key not in (SHORTFALL, PLANNER_STATUS, "seed", "version")
        ]
        rows = [
            (name, value_text(self.summary[key]), unit)
            for key in [*grouped, *own][:SHOWN]
            for name, unit in (label(key),)
        ]
        return title, [*rows, ("control steps", str(len(self.t)), ""), ("events", str(len(self.events)), "")]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        """The table and the figure, for a notebook."""
        picture = io.BytesIO()
        self.plot().savefig(picture, format="png", dpi=80)
        image = base64.b64encode(picture.getvalue()).decode()
        return f"{html_table(*self._table())}<img src='data:image/png;base64,{image}'>"
