"""Chromium without a window, and what it says of a page: requests, errors, pixels."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mathnavi.renders.palette import Picture

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
PATIENCE = 120_000.0  # [ms] a busy machine draws slowly


@dataclass
class Watched:
    """A page, and all that it asked for and complained of."""

    page: Any
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def open(self, url: str) -> None:
        """Open a page and wait until it has been drawn."""
        self.page.goto(url)
        self.page.wait_for_selector("body[data-drawn]")

    def drawn(self, script: str, *arguments: Any) -> None:
        """Do something to the page and wait until it has been drawn again."""
        before = int(self.page.evaluate("document.body.dataset.drawn"))
        self.page.evaluate(script, *arguments)
        self.until(f"Number(document.body.dataset.drawn) > {before}")

    def until(self, script: str) -> None:
        """Wait until an expression is true; the page's policy lets no script of the browser's driver wait in it."""
        ends = time.monotonic() + PATIENCE / 1000.0
        while not self.page.evaluate(script):
            assert time.monotonic() < ends, f"never became true: {script}"
            self.page.wait_for_timeout(20.0)

    def picture(self, selector: str) -> Picture:
        """(height, width, 3) what is to be seen of an element."""
        shot = self.page.locator(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright, which drives a browser, is missing")
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"there is no browser: none of {', '.join(NAMES)} is installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def watched(browser: Any, width: int = 640, height: int = 400) -> Iterator[Watched]:
    """A new page."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE)
    found = Watched(page)
    page.on("request", lambda request: found.requests.append(request.url))
    page.on("console", lambda message: found.complaints.append(message.text))
    page.on("pageerror", lambda error: found.complaints.append(str(error)))
    try:
        yield found
    finally:
        page.close()
