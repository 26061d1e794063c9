"""Table of the commands by name: the module of each, and its purpose."""

from __future__ import annotations

COMMANDS = {
    "list": (
        "mathnavi.sim.commands.listing",
        "what is installed: controllers, estimators, consensus, scenarios, studies, terrains, drawings",
    ),
    "run": ("mathnavi.sim.commands.run", "fly a scenario and write its log, summary, video and report"),
    "sweep": (
        "mathnavi.sim.commands.sweep",
        "fly a scenario over many seeds and variations, into a store that resumes",
    ),
    "search": (
        "mathnavi.sim.commands.search",
        "search a scenario for its worst missions, or estimate how probable a rare event is",
    ),
    "store": ("mathnavi.sim.commands.store", "show or export what a sweep has stored"),
    "study": ("mathnavi.sim.commands.study", "tables and figures of the thesis, and what holds of its claims"),
    "estimate": ("mathnavi.sim.commands.estimate", "run an estimator over the measurements of a finished run"),
    "render": ("mathnavi.sim.commands.render", "a video, a still or a clip of a run"),
    "view": ("mathnavi.sim.commands.view", "a run in MuJoCo's own viewer, or in a browser"),
    "compare": ("mathnavi.sim.commands.compare", "two runs, sweeps or studies side by side"),
    "terrain": ("mathnavi.sim.commands.terrain", "import an elevation model, show a map"),
    "completion": ("mathnavi.sim.commands.completion", "a script for bash, zsh or fish that completes what is typed"),
}
