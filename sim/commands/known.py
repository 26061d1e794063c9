"""The commands by name: the module of each, and what it is for."""

from __future__ import annotations

COMMANDS = {
    "list": (
        "sim.commands.listing",
        "what is installed: controllers, estimators, consensus, scenarios, studies, terrains",
    ),
    "run": ("sim.commands.run", "fly a scenario and write its log, summary, video and report"),
    "sweep": ("sim.commands.sweep", "fly a scenario over many seeds and variations, into a store that resumes"),
    "store": ("sim.commands.store", "show or export what a sweep has stored"),
    "study": ("sim.commands.study", "tables and figures of the thesis, and what holds of its claims"),
    "estimate": ("sim.commands.estimate", "run an estimator over the measurements of a finished run"),
    "render": ("sim.commands.render", "a video, a still or a clip of a run"),
    "view": ("sim.commands.view", "a run in MuJoCo's own viewer"),
    "compare": ("sim.commands.compare", "two runs, sweeps or studies side by side"),
    "terrain": ("sim.commands.terrain", "import an elevation model, show a map"),
    "completion": ("sim.commands.completion", "a script for bash, zsh or fish that completes what is typed"),
}
