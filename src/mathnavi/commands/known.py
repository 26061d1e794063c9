"""Table of the commands by name: the module of each, its purpose, and the dataclass of its flags."""

from __future__ import annotations

COMMANDS = {
    "list": (
        "mathnavi.commands.listing",
        "installed controllers, estimators, consensus, scenarios, studies, terrains, drawings, logs",
    ),
    "run": ("mathnavi.commands.run", "fly a scenario and write its log, summary, video and report"),
    "sweep": (
        "mathnavi.commands.sweep",
        "fly a scenario over many seeds and variations, into a store that resumes",
    ),
    "search": (
        "mathnavi.commands.search",
        "search a scenario for its worst missions, or estimate how probable a rare event is",
    ),
    "store": ("mathnavi.commands.store", "show or export the results of a sweep"),
    "study": ("mathnavi.commands.study", "tables and figures of the thesis, with a verdict on each claim"),
    "estimate": ("mathnavi.commands.estimate", "run an estimator over a finished run, or over your own log"),
    "render": ("mathnavi.commands.render", "a video, a still or a clip of a run"),
    "report": ("mathnavi.commands.report", "a page of a run: verdict, figures, charts, pictures, events"),
    "view": ("mathnavi.commands.view", "a run in MuJoCo's own viewer, or in a browser"),
    "export": ("mathnavi.commands.export", "a run as a file for Rerun, or for Foxglove (MCAP)"),
    "compare": ("mathnavi.commands.compare", "two runs, sweeps or studies side by side"),
    "new": (
        "mathnavi.commands.new",
        "a folder with your own vehicle, planner, observer, scenario or terrain, which runs at once",
    ),
    "check": ("mathnavi.commands.check", "a check of a model or a plug-in before a run: what fits and what is missing"),
    "log": ("mathnavi.commands.log", "contents of a recorded log: channels, rates, gaps, ranges"),
    "map": ("mathnavi.commands.map", "walls of a building from laser scans or a ROS map"),
    "identify": ("mathnavi.commands.identify", "joints of an arm from its log: gains, rotor inertia, friction"),
    "terrain": ("mathnavi.commands.terrain", "import an elevation model, show a map"),
    "completion": ("mathnavi.commands.completion", "a completion script for bash, zsh or fish"),
}
FLOWN = ("run", "search", "sweep")  # commands with the flags of a scenario
OPTIONS = {  # dataclass of a command's own flags
    "run": "mathnavi.commands.run:RunOptions",
    "search": "mathnavi.commands.search:SearchOptions",
    "sweep": "mathnavi.commands.sweep:SweepOptions",
    "study": "mathnavi.commands.study:StudyOptions",
    "estimate": "mathnavi.commands.estimate:EstimateOptions",
    "render": "mathnavi.commands.render:RenderOptions",
    "report": "mathnavi.commands.report:ReportOptions",
    "view": "mathnavi.commands.view:ViewOptions",
    "export": "mathnavi.commands.export:ExportOptions",
    "compare": "mathnavi.commands.compare:CompareOptions",
    "new": "mathnavi.commands.new:NewOptions",
    "check": "mathnavi.commands.check:CheckOptions",
    "store show": "mathnavi.commands.store:StoreShowOptions",
    "store export": "mathnavi.commands.store:StoreExportOptions",
    "log show": "mathnavi.commands.log:LogShowOptions",
    "map import": "mathnavi.commands.map:MapImportOptions",
    "map show": "mathnavi.commands.map:MapShowOptions",
    "identify": "mathnavi.commands.identify:IdentifyOptions",
    "terrain import": "mathnavi.commands.terrain:TerrainImportOptions",
    "terrain show": "mathnavi.commands.terrain:TerrainShowOptions",
}
LOG_OPTIONS = (  # of `estimate` over a file
    "mathnavi.commands.estimate_log:EstimateLogOptions",
    "mathnavi.interfaces.reading.table_format:TableFormat",
)
