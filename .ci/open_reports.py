"""Open pages in headless Chromium; fail unless each is whole, in the light and the dark theme and at three widths.

Whole means: no error on the console, no exception, no request beyond the file itself, every drawing, picture and 3-D
view shows something, nothing is wider than the window, and axe-core (https://github.com/dequelabs/axe-core) finds
nothing that is serious or critical for a reader who needs contrast, a keyboard or a screen reader. The browser is
controlled over a pipe by its DevTools protocol, JSON messages that end with NUL: https://chromedevtools.github.io/devtools-protocol/
"""

from __future__ import annotations

import argparse
import base64
import importlib.util
import io
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

FLAGS = (
    "--headless=new", "--remote-debugging-pipe", "--no-first-run", "--disable-background-networking",
    "--hide-scrollbars",
    "--no-sandbox",  # root may not have one, and the pages are our own
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",  # WebGL without a graphics card
)  # fmt: skip
WIDTHS, HEIGHT = (390, 768, 1440), 900  # [pixels] of a telephone, a tablet and a screen
TALLEST = 4000  # [pixels] that are taken at once; of more Chromium repeats the first ones
PATIENCE = 120.0  # [s] for one page
LEAST_COLOURS = 2000  # in a 3-D view that shows a terrain

READY = """(() => {
  document.querySelectorAll('details').forEach((part) => { part.open = true; });  // what is folded in has no size
  return document.readyState === 'complete' && [...document.images].every((image) => image.complete)
    && (document.querySelector('#app') === null || document.body.dataset.drawn > 0);
})()"""
FOUND = """(() => {
  const found = (part, drawn) => {
    const { x, y, width, height } = part.getBoundingClientRect();
    const name = part.getAttribute('aria-label') || part.alt;
    return { name, x, y: y + scrollY, width, height, drawn: Boolean(drawn && width && height) };
  };
  const all = (selector, test) => [...document.querySelectorAll(selector)].map((part) => found(part, test(part)));
  const hasContext = (canvas) => canvas.getContext('webgl') || canvas.getContext('webgl2');
  return {
    height: document.documentElement.scrollHeight,
    drawings: all('figure > svg', (svg) => svg.getBBox().width * svg.getBBox().height),
    pictures: all('img', (image) => image.naturalWidth),
    views: all('#app:not(.flat) #canvas', (canvas) => document.body.dataset.drawn && hasContext(canvas)),
  };
})()"""
WIDER = """(() => {
  const rolls = (part) => part !== null && part !== document.documentElement
    && (part !== document.body && getComputedStyle(part).overflowX !== 'visible' || rolls(part.parentElement));
  const fixed = (part) => part !== null && (getComputedStyle(part).position === 'fixed' || fixed(part.parentElement));
  const over = (part) => {
    const { left, right, width } = part.getBoundingClientRect();
    if ((right <= 0 || left >= innerWidth) && fixed(part)) return false;  // a drawer that is closed
    return width > 0 && (right > innerWidth + 1 || left < -1) && !rolls(part.parentElement);
  };
  const named = ({ tagName, id, classList }) => [tagName.toLowerCase(), id && `#${id}`, ...classList].join(' ');
  const found = [...document.body.querySelectorAll('*')].filter(over).map(named);
  const { scrollWidth } = document.documentElement;
  if (scrollWidth > innerWidth) found.unshift(`the page, ${scrollWidth} pixels`);
  return found.slice(0, 5);
})()"""
AXE = """axe.run(document, { preload: false, resultTypes: ['violations'] }).then(({ violations }) => violations
  .filter(({ impact }) => impact === 'serious' || impact === 'critical')
  .map(({ id, impact, help, nodes }) => {
    const contrast = ({ any }) => any[0]?.data?.contrastRatio ? ` (${any[0].data.contrastRatio})` : '';
    const places = nodes.slice(0, 3).map((node) => node.target.join(' ') + contrast(node));
    return `${impact}, ${id}: ${help}: ${nodes.length} times, as ${places.join('; ')}`;
  }))"""


class Browser:
    """A Chromium with one page; it ends with the context."""

    def __init__(self, program: str, profile: str) -> None:
        to_child, from_here = os.pipe()
        to_here, from_child = os.pipe()
        # Chromium reads from descriptor 3 and writes to 4, whatever numbers the pipes have here.
        redirected = f'exec "$@" 3<&{to_child} 4>&{from_child}'
        self._process = subprocess.Popen(
            ["bash", "-c", redirected, "bash", program, *FLAGS, f"--user-data-dir={profile}"],
            pass_fds=(to_child, from_child),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in (to_child, from_child):
            os.close(end)
        self._out, self._in = os.fdopen(from_here, "wb", 0), os.fdopen(to_here, "rb", 0)
        self._received, self._asked, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> Browser:
        page = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")
        return self

    def __exit__(self, *_: object) -> None:
        self._session = ""
        self.ask("Browser.close")
        self._process.wait(PATIENCE)
        self._out.close()
        self._in.close()

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method and return its result; events that arrive meanwhile are kept in ``events``."""
        self._asked += 1
        session = {"sessionId": self._session} if self._session else {}
        message = {"id": self._asked, "method": method, "params": parameters} | session
        self._out.write(json.dumps(message).encode() + b"\0")
        hangs = threading.Timer(PATIENCE, self._process.kill)
        hangs.start()
        try:
            while (answer := self._read()).get("id") != self._asked:
                self.events.append(answer)
        finally:
            hangs.cancel()
        if "error" in answer:
            raise RuntimeError(f"Chromium does not do {method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return result

    def value(self, expression: str) -> Any:
        """Return the value of a JavaScript expression, or of its promise."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"the page cannot be looked at: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def screenshot(self, **clip: Any) -> bytes:
        options: dict[str, Any] = {"clip": clip | {"scale": 1}} if clip else {}
        return base64.b64decode(self.ask("Page.captureScreenshot", captureBeyondViewport=True, **options)["data"])

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._received:
            more = self._in.read(1 << 20)
            if not more:
                raise RuntimeError(f"Chromium ended, or said nothing for {PATIENCE:g} s")
            self._received += more
        first, _, self._received = self._received.partition(b"\0")
        message: dict[str, Any] = json.loads(first)
        return message


def complaints(events: list[dict[str, Any]], url: str, own: str) -> list[str]:
    """Actions of a page that it must not take; what lies below the address ``own`` belongs to it."""
    found = []
    for event in events:
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            found.append(f"exception: {details.get('exception', {}).get('description', details['text'])}")
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
            found.append(f"console: {' '.join(str(part.get('value', part)) for part in parameters['args'])}")
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            found.append(f"console: {parameters['entry']['text']}")
        elif method == "Network.requestWillBeSent":
            asked = parameters["request"]["url"]
            if asked != url and not asked.startswith(("data:", "blob:", own)):
                found.append(f"request: {asked}")
    return found


def axe() -> str:
    """Return axe-core's script."""
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        raise SystemExit("axe-playwright-python is missing; to install it: make .venv")
    return Path(found.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def set_width(browser: Browser, width: int) -> None:
    """Give the window a width [pixels]; what lies in it has been drawn again when this returns."""
    size = {"width": width, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
    browser.ask("Emulation.setDeviceMetricsOverride", **size)
    browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")


def whole_page(browser: Browser, width: int) -> Image.Image:
    """A picture of the page as it is at first, with the meanings of figures folded in."""
    fold = "document.querySelectorAll('details.term').forEach((part) => { part.open = %s; })"
    browser.value(fold % "false")
    if width == WIDTHS[0]:  # on a telephone the page itself folds in the layers
        browser.value("document.querySelectorAll('#legend').forEach((part) => { part.open = false; })")
    height = browser.value("document.documentElement.scrollHeight")
    found = Image.new("RGB", (width, height))
    for y in range(0, height, TALLEST):
        part = browser.screenshot(x=0, y=y, width=width, height=min(TALLEST, height - y))
        found.paste(Image.open(io.BytesIO(part)), (0, y))
    browser.value(fold % "true")
    return found


def examine(
    browser: Browser,
    report: Path,
    theme: str,
    screenshots: Path | None,
    wanted: Sequence[str],
    root: Path | None = None,
) -> tuple[list[str], str]:
    """Return the faults of a page and the numbers of its parts; it must have one of each kind ``wanted`` or more.

    A page stands alone, or may load what lies in the folder ``root``.
    """
    url = report.resolve().as_uri()
    own = url if root is None else root.resolve().as_uri()
    browser.events.clear()
    browser.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
    set_width(browser, WIDTHS[-1])
    browser.ask("Page.navigate", url=url)
    until = time.monotonic() + PATIENCE
    while not browser.value(READY) and time.monotonic() < until:
        time.sleep(0.2)
    found = browser.value(FOUND)
    wrong = [
        f"not drawn: {part['name']}"
        for kind in ("drawings", "pictures", "views")
        for part in found[kind]
        if not part["drawn"]
    ]
    wrong += [f"it has no {kind}" for kind in wanted if not found[kind]]
    for view in found["views"]:
        seen = browser.screenshot(**{side: view[side] for side in ("x", "y", "width", "height")})
        pixels = np.asarray(Image.open(io.BytesIO(seen)).convert("RGB")).reshape(-1, 3)
        if len(np.unique(pixels, axis=0)) < LEAST_COLOURS:
            wrong.append(f"blank: {view['name']}")
    said = complaints(browser.events, url, own)
    browser.value(f"{axe()}; true")
    for width in WIDTHS:
        set_width(browser, width)
        wrong += [f"at {width} pixels wider than the window: {part}" for part in browser.value(WIDER)]
        if width != WIDTHS[1]:  # in between nothing else is shown
            wrong += [f"at {width} pixels {violation}" for violation in browser.value(AXE)]
        if screenshots is not None:
            screenshots.mkdir(parents=True, exist_ok=True)
            whole_page(browser, width).save(screenshots / f"{report.parent.name}-{report.stem}-{theme}-{width}.png")
    counts = ", ".join(f"{len(found[kind])} {kind}" for kind in ("drawings", "pictures", "views"))
    return said + wrong, counts


def documented(root: Path | None, pages: Sequence[str]) -> list[Path]:
    """The pages of a documentation, all of them where none is named; none without one."""
    if root is None:
        return []
    static = root / "_static"
    return [root / page for page in pages] or [p for p in sorted(root.rglob("*.html")) if static not in p.parents]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("program", help="the Chromium to open the reports with")
    parser.add_argument("reports", nargs="*", type=Path, metavar="REPORT.html")
    parser.add_argument("--flat", nargs="*", default=[], type=Path, metavar="REPORT.html", help="without a terrain")
    parser.add_argument("--texts", nargs="*", default=[], type=Path, metavar="PAGE.html", help="without a drawing")
    parser.add_argument("--scenes", nargs="*", default=[], type=Path, metavar="PAGE.html", help="of a viewer")
    parser.add_argument("--docs", type=Path, metavar="FOLDER", help="built documentation, with the pages below")
    parser.add_argument("--pages", nargs="*", default=[], metavar="PAGE.html", help="in it; all if none is named")
    parser.add_argument("--screenshots", type=Path, metavar="FOLDER", help="keep a picture of each page here")
    arguments = parser.parse_args()
    named = [*arguments.reports, *arguments.flat, *arguments.texts, *arguments.scenes]
    missing = [page for page in (*named, *documented(arguments.docs, arguments.pages)) if not page.is_file()]
    if missing:  # Chromium would show a page of its own in place of it
        parser.error(f"no such page: {', '.join(map(str, missing))}")
    failed = False
    # Chromium's helpers may write into the profile for a moment after it has ended.
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
        Browser(arguments.program, profile) as browser,
    ):
        kinds = (
            (arguments.reports, ("drawings", "views")),
            (arguments.flat, ("drawings",)),
            (arguments.scenes, ("views",)),
            (arguments.texts, ()),
        )
        found = [(page, parts, None) for pages, parts in kinds for page in pages]
        found += [(page, (), arguments.docs) for page in documented(arguments.docs, arguments.pages)]
        for report, wanted, root in found:
            for theme in ("light", "dark"):
                wrong, counts = examine(browser, report, theme, arguments.screenshots, wanted, root)
                print(
                    f"{report}, {theme}: {counts}, {report.stat().st_size / 1e6:.1f} MB"
                    if not wrong
                    else f"{report}, {theme}:"
                )
                for line in wrong:
                    print(f"    {line}", file=sys.stderr)
                failed = failed or bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
