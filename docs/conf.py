"""How the documentation is built: `make docs`."""

from __future__ import annotations

import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

project = "mathnavi"
version = release = installed("mathnavi")
extensions = ["myst_parser", "sphinx_design", "mathml"]
exclude_patterns = ["_build", "_ext"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = "mathnavi"
html_static_path = ["_static"]
html_css_files = ["mathnavi.css"]
html_show_copyright = False
