"""Pages of papers and exercises as PDF, ``papers/NAME.pdf``, printed from the built pages by Chromium.

A browser typesets MathML and the print style sheet as a reader's browser does; LaTeX would need a second description of
every page. Without Chromium the build prints a note, and the pages have no link to a PDF.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FOLDERS = ("papers/", "exercises/")
LINK = '<p class="pdf"><a href="{}.pdf">This page as PDF, to print</a></p>\n'
PATIENCE = 300  # [s] for a page, on a busy machine

logger = logging.getLogger(__name__)


def browser() -> str | None:
    """Return the path of a Chromium; None if it is not installed."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def is_printed(page: str) -> bool:
    """True for the pages of papers and exercises, without their lists."""
    return page.startswith(FOLDERS) and not page.endswith("/index")


def add_link(app: Sphinx, page: str, template: str, context: dict[str, Any], document: Any) -> None:
    """Link a page to its PDF."""
    if is_printed(page) and browser() is not None:
        context["body"] = LINK.format(page.rpartition("/")[2]) + context["body"]


def print_pages(app: Sphinx, error: Exception | None) -> None:
    """Print every page that has a link; ExtensionError if the browser fails."""
    if error is not None or app.builder.format != "html":
        return
    found = browser()
    if found is None:
        logger.info("no PDFs: none of %s is installed", ", ".join(BROWSERS))
        return
    for page in sorted(filter(is_printed, app.env.found_docs)):
        logger.info("printing %s.pdf", page)
        print_page(found, Path(app.outdir) / f"{page}.html", Path(app.outdir) / f"{page}.pdf")


def print_page(found: str, page: Path, pdf: Path) -> None:
    """Print one page; ExtensionError if the browser fails."""
    with tempfile.TemporaryDirectory() as profile:
        command = [
            found, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
            "--no-pdf-header-footer", f"--print-to-pdf={pdf}", page.as_uri(),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    if done.returncode or not pdf.is_file():
        raise ExtensionError(f"{pdf.name}: {found} ended with {done.returncode}: {done.stderr[-500:]}")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", add_link)
    app.connect("build-finished", print_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
