"""Configuration of the documentation's build: `make docs`."""

from __future__ import annotations

import sys
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

project = "mathnavi"
version = release = installed("mathnavi")
extensions = [
    "myst_parser",
    "sphinx_design",
    "mathml",
    "api",
    "generated",
    "scenes",
    "signatures",
    "notebooks",
    "pdf",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_ext", "sg_execution_times.rst", "examples/sg_execution_times.rst"]

myst_enable_extensions = ["amsmath", "attrs_block", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3

sphinx_gallery_conf = {
    "examples_dirs": str(HERE.parent / "examples" / "gallery"),
    "gallery_dirs": "examples",
    "within_subsection_order": "FileNameSortKey",
    "show_memory": False,
    "write_computation_times": False,
    "abort_on_example_error": True,
}

smartquotes = False  # --planner is a flag, not a dash

python_use_unqualified_type_names = True  # `Array` is read, mathnavi.interfaces.signals.Array is where it leads
python_maximum_signature_line_length = 90
add_module_names = False
toc_object_entries = False  # a page holds a folder: its contents are the modules

html_theme = "furo"
html_title = "mathnavi"
html_static_path = ["_static"]
html_css_files = ["mathnavi.css"]
html_js_files = [("scroll.js", {"defer": "defer"})]
html_show_copyright = False
html_show_sourcelink = False
html_copy_source = False
