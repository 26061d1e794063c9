"""A run on one page: ``report.html``, which needs nothing beside itself and no network.

Figures are SVG inside the page, so that they follow the reader's light or dark theme and print sharply; the overview is
a PNG in the page where OpenGL is at hand, and one line that says how to install it where not.
"""

from __future__ import annotations

import base64
import html
import io
import json
import math
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from renders import figures, opengl
from renders.run_data import RunData, described, load_run
from renders.storyboard import EXAGGERATION
from renders.video import write_still
from sim.log import write_text
from sim.metrics import SUMMARY_GROUPS, label

MOST_EVENTS = 200  # rows of the table; the rest is counted

CSS = """
:root { color-scheme: light dark; --ink: #1b2733; --soft: #5a6876; --paper: #f4f6f8; --card: #ffffff; --grid: #cfd6dd;
  --good: #0b6b3f; --bad: #b3122f; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6ebf0; --soft: #9fb0c0; --paper: #11181f; --card: #1a232d;
  --grid: #3a4753; --good: #5fd39b; --bad: #ff7d90; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 24px 18px 48px; }
h1 { font-size: 26px; margin: 0; line-height: 1.25; } h2 { font-size: 18px; margin: 32px 0 10px; }
header p { margin: 4px 0 0; color: var(--soft); }
.verdict { font-weight: 700; } .good { color: var(--good); } .bad { color: var(--bad); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(170px, 1fr)); gap: 12px; margin: 20px 0; }
.tiles div, figure, .tables section, details { background: var(--card); border: 1px solid var(--grid);
  border-radius: 10px; }
.tiles div { padding: 12px 16px; } .tiles b { display: block; font-size: 23px; } .tiles span { color: var(--soft); }
figure { margin: 0 0 14px; padding: 12px; } figure svg, figure img { display: block; width: 100%; height: auto; }
figure.map svg { max-width: 760px; margin: 0 auto; } figcaption { color: var(--soft); font-size: 13.5px; }
.tables { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 12px; }
.tables section { padding: 8px 16px 12px; } .tables h3 { font-size: 14px; margin: 4px 0; color: var(--soft); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; font-weight: 400; padding: 3px 8px 3px 0; border-top: 1px solid var(--grid);
  vertical-align: top; }
.tables td { text-align: right; padding-right: 0; white-space: nowrap; } .tables tr:first-child > * { border-top: 0; }
thead th { font-weight: 600; color: var(--soft); }
footer { margin-top: 32px; color: var(--soft); font-size: 13.5px; }
pre { overflow-x: auto; background: var(--card); border: 1px solid var(--grid); border-radius: 10px; padding: 12px 16px;
  font-size: 13px; } details { padding: 8px 16px; } details pre { border: 0; padding: 0; }
@media print { :root { --paper: #fff; --card: #fff; --ink: #000; --soft: #444; --grid: #bbb; } main { max-width: none; }
  figure, .tables section, .tiles div { break-inside: avoid; } h2 { break-after: avoid; } }
"""


def write_report(run_dir: str | Path) -> Path:
    """Write ``report.html`` into the run's folder, whole or not at all, and return its path.

    Raises FileNotFoundError or ValueError for a run that is not there or broken.
    """
    run = load_run(run_dir)
    path = run.directory / "report.html"
    write_text(path, page(run))
    return path


def page(run: RunData) -> str:
    """The report's HTML."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(run.title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>\n"
        + _headline(run)
        + _overview(run)
        + "<h2>Summary</h2>\n"
        + _summary(run.summary)
        + "<h2>The flight</h2>\n"
        + _figures(run)
        + "<h2>Events</h2>\n"
        + _events(run)
        + "<h2>Do it again</h2>\n"
        + _again(run)
        + _footer(run.summary)
        + "</main>\n</body>\n</html>\n"
    )


def _text(value: object) -> str:
    return html.escape(str(value), quote=True)


def _number(value: object) -> str:
    """A figure of the summary with the digits that a reader can use."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    size = abs(value)
    if 0.0 < value < 1e-3:
        return "< 0.001"
    if size < 1.0:
        return f"{value:#.2g}" if value else "0"
    return f"{value:.2f}" if size < 10.0 else f"{value:.1f}" if size < 1e3 else f"{value:,.0f}"


def _quantity(summary: Mapping[str, Any], key: str) -> str:
    number = _number(summary.get(key))
    return number if number == "–" else f"{number} {label(key)[1]}".strip()


def _headline(run: RunData) -> str:
    summary, mission = run.summary, run.mission
    arrived, clearance = bool(summary.get("arrived")), summary.get("min_clearance_m")
    safe = clearance is not None and clearance >= mission.clearance_min and not summary.get("ground_contacts")
    verdict = ("arrived" if arrived else "did not arrive") + (
        f", never below {mission.clearance_min:g} m over the ground" if safe else ", and came too close to the ground"
    )
    tiles = {
        "arrival": _quantity(summary, "arrival_time_s") if arrived else "–",
        "deadline": _quantity(summary, "deadline_s"),
        f"least clearance (allowed {mission.clearance_min:g} m)": _quantity(summary, "min_clearance_m"),
        "path flown": f"{run.travelled[-1] / 1e3:.2f} km",
        "radar exposure": _quantity(summary, "radar_exposure_s"),
    }
    boxes = "".join(f"<div><b>{_text(value)}</b><span>{_text(name)}</span></div>\n" for name, value in tiles.items())
    tone = "good" if arrived and safe else "bad"
    return (
        f"<header><h1>{_text(run.title)}</h1>\n"
        f'<p class="verdict {tone}">The vehicle {_text(verdict)}.</p></header>\n<div class="tiles">\n{boxes}</div>\n'
    )


def _overview(run: RunData) -> str:
    if opengl.available() is None:
        return f"<p>No picture of the scene: {_text(opengl.HOW_TO_INSTALL)}.</p>\n"
    with tempfile.TemporaryDirectory() as scratch:
        still = write_still(run.directory, "overview", Path(scratch) / "overview.png", t=run.duration)
        data = base64.b64encode(still.read_bytes()).decode("ascii")
    alt = f"The whole map of {run.terrain.name} seen from the south, with the path that was flown from start to target."
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{_text(alt)}">'
        f"<figcaption>The end of the flight. Heights are drawn {EXAGGERATION} times as tall as they are, "
        "the vehicle far larger.</figcaption></figure>\n"
    )


def _summary(summary: Mapping[str, Any]) -> str:
    sections = ""
    for name, group in SUMMARY_GROUPS.items():
        if keys := [key for key in group if key in summary]:
            rows = "".join(
                f'<tr><th scope="row">{_text(label(key)[0])}</th><td>{_text(_quantity(summary, key))}</td></tr>\n'
                for key in keys
            )
            sections += f"<section><h3>{name.capitalize()}</h3><table><tbody>\n{rows}</tbody></table></section>\n"
    return f'<div class="tables">\n{sections}</div>\n'


def _figures(run: RunData) -> str:
    least = _quantity(run.summary, "min_clearance_m")
    drawn = [
        (
            "map",
            figures.map_figure(run),
            f"Hill-shaded map of {run.terrain.name} with the path, radars, start and target.",
        ),
        (
            "profile",
            figures.profile_figure(run),
            f"Height of the path and of the ground along it; the least clearance is {least}, on the exact triangles. "
            "The clearance has a log scale.",
        ),
        ("motion", figures.motion_figure(run), "Speed and commanded acceleration over time with their bounds."),
    ]
    if run.plans:
        drawn.append(("cost", figures.cost_figure(run), "Composite cost of the plan being flown, over time."))
    if run.summary.get("solve_ms_mean") is not None:
        drawn.append(("solve", figures.solve_figure(run.summary), "Thread CPU time of one optimisation."))
    if run.events:
        drawn.append(("events", figures.events_figure(run), "The times at which each kind of event happened."))
    return "".join(
        f'<figure class="{name}">{inline_svg(figure, name, alt)}<figcaption>{_text(alt)}</figcaption></figure>\n'
        for name, figure, alt in drawn
    )


def inline_svg(figure: Figure, name: str, alt: str) -> str:
    """A figure as an SVG element in the page's theme; ``name`` keeps its identifiers apart from the others'."""
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    svg = svg.replace(figures.INK, "currentColor").replace(figures.GRID, "var(--grid)")
    return svg.replace("<svg", f'<svg role="img" aria-label="{_text(alt)}"', 1)


def _events(run: RunData) -> str:
    if not run.events:
        return "<p>Nothing happened that is worth a line.</p>\n"
    rows = "".join(
        f"<tr><td>{event.t:.2f} s</td><td>{_text(name)}</td><td>{_text(message)}</td></tr>\n"
        for event in run.events[:MOST_EVENTS]
        for name, message in [described(event)]
    )
    rest = len(run.events) - MOST_EVENTS
    more = f"<p>{rest} more in events.jsonl.</p>\n" if rest > 0 else ""
    head = '<thead><tr><th scope="col">time</th><th scope="col">kind</th><th scope="col">message</th></tr></thead>'
    title = f"{len(run.events)} event{'s' if len(run.events) > 1 else ''}"
    return f"<details open><summary>{title}</summary><table>{head}<tbody>\n{rows}</tbody></table>\n{more}</details>\n"


def _again(run: RunData) -> str:
    config = json.dumps(run.config, indent=2, ensure_ascii=False, default=str)
    command = f"mathnavi run {run.config['scenario']} --from {run.directory}"
    return (
        f"<p>The same seed on the same machine gives the same log, bit for bit.</p>\n<pre>{_text(command)}</pre>\n"
        f"<details><summary>config.json</summary><pre>{_text(config)}</pre></details>\n"
    )


def _footer(summary: Mapping[str, Any]) -> str:
    """What the summary's cards do not show: seed, version, how fast it ran."""
    named = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    rest = (f" · {label(key)[0]} {_quantity(summary, key)}" for key in summary if key not in named)
    return f"<footer>mathnavi{_text(''.join(rest))}</footer>\n"
