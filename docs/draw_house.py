"""The floors of the sources as a picture, drawn from the code: docs/_static/house.svg.

    python docs/draw_house.py           draws the picture
    python docs/draw_house.py --check   exits with 1 if the committed picture is not what the code says

A floor is a top-level folder; the highest is ``src/mathnavi``, the front door. pyproject.toml has their order and the
rooms inside some of them. An arrow leads from a floor, or from a room of one, to another that it imports from; it is
left out where other arrows lead there too. Imports inside functions and for type checkers count. Circles of modules are
counted below, those of the benchmarks among them.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "_static" / "house.svg"
FRONT, ITSELF = "src/mathnavi", "mathnavi"  # folder of the front door, and the module that ``import mathnavi`` loads
FOLDERS = (
    "interfaces", "models", "controllers", "estimators", "sim", "renders", "studies", FRONT, "benchmarks",
)  # fmt: skip

WIDTH, BOX, HEIGHT, GAP, MARGIN, PAD = 860, 236, 46, 36, 20, 14  # [px]
PURPOSE = {
    FRONT: "front door",
    "sim": "closed loops and their evidence",
    "mathnavi": "the public names",
    "scripting": "what `import mathnavi` declares",
    "commands": "the command line",
    "learning": "adapters for learners",
    "studies": "tables and figures of the thesis",
    "renders": "videos, figures, reports",
    "sim.search": "worst missions and rare events",
    "sim.sweep": "trials and jobs over many seeds",
    "sim.environments": "dm_env, Gymnasium, batches",
    "sim.scenarios": "closed-loop missions",
    "sim.metrics": "figures of a run",
    "sim.logs": "logs of others, as recorded",
    "sim.records": "run folders, store, claims",
    "sim.engine": "loop, plants, faults, network",
    "sim.plugin": "what is installed",
    "controllers": "estimate to plan to command",
    "estimators": "measurements to estimate",
    "models": "bodies, terrain, manifolds",
    "interfaces": "signals, protocols, checks",
}


def modules() -> dict[str, Path]:
    """Every module of the sources by its name without ``mathnavi.``, and those of the benchmarks."""
    files = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))
    named = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}
    return {name.removeprefix("src.mathnavi").removeprefix(".") or ITSELF: path for name, path in named.items()}


def imports(path: Path, known: Mapping[str, Path]) -> Iterator[str]:
    """The modules that a file imports from, inside functions and for type checkers too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            while name.partition(".")[0] in (ITSELF, "benchmarks"):
                if (inner := name.removeprefix("mathnavi.")) in known:
                    yield inner
                    break
                name = name.rpartition(".")[0]


def stories() -> list[dict[str, list[str]]]:
    """The folders of each floor from the top, each with its rooms, as the import contract has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(contract["layers"] for contract in settings["contracts"] if contract["type"] == "layers")
    found: list[dict[str, list[str]]] = [{FRONT: [ITSELF]}]
    for layer in layers:
        for k, room in enumerate(part.strip() for part in layer.split("|")):
            name = room.partition(".")[0]
            folder = name if (ROOT / name).is_dir() else FRONT
            if k == 0 and folder not in found[-1]:
                found.append({})
            found[-1].setdefault(folder, []).append(room)
    return found


def room_of(module: str, rooms: set[str]) -> str:
    """The room that a module stands in; "" for a package's own empty file."""
    return next((room for room in rooms if module == room or module.startswith(f"{room}.")), "")


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other in a circle (Tarjan's strongly connected components)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = [stack.pop()]
            while group[-1] != node:
                group.append(stack.pop())
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def house() -> tuple[dict[str, set[str]], list[list[str]]]:
    """The arrows between rooms, and the circles of modules."""
    known = modules()
    rooms = {room for story in stories() for inside in story.values() for room in inside}
    graph = {name: set(imports(path, known)) - {name} for name, path in known.items()}
    arrows: dict[str, set[str]] = {room: set() for room in rooms}
    for name, others in graph.items():
        own = room_of(name, rooms)
        if own:
            arrows[own] |= {room_of(other, rooms) for other in others} - {own, ""}
    return arrows, circles(graph)


def reduced(arrows: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """The arrows without those that lead where others lead too (transitive reduction of a graph without circles)."""

    def below(room: str) -> set[str]:
        return arrows[room].union(*(below(other) for other in arrows[room])) if arrows[room] else set()

    return {
        room: {other for other in others if not any(other in below(between) for between in others - {other})}
        for room, others in arrows.items()
    }


def depth(room: str, arrows: Mapping[str, set[str]]) -> int:
    """Return the length of the longest path down from a room."""
    return 1 + max((depth(other, arrows) for other in arrows[room]), default=-1)


def between_folders(arrows: Mapping[str, set[str]], folder: Mapping[str, str]) -> dict[str, set[str]]:
    """The arrows between folders, ``folder`` that of each room."""
    found: dict[str, set[str]] = {name: set() for name in folder.values()}
    for room, others in arrows.items():
        found[folder[room]] |= {folder[other] for other in others} - {folder[room]}
    return found


def rows_of(rooms: list[str], arrows: Mapping[str, set[str]]) -> list[list[str]]:
    """The rooms of a folder in rows from the top: each stands above all those that it imports from."""
    inside = {room: arrows[room].intersection(rooms) for room in rooms}
    depths = {room: depth(room, inside) for room in rooms}
    return [[room for room in rooms if depths[room] == k] for k in range(max(depths.values()), -1, -1)]


def drawn(arrows: Mapping[str, set[str]], loops: list[list[str]]) -> str:
    """The picture of what ``house`` finds."""
    floors = stories()
    folder = {room: name for story in floors for name, rooms in story.items() for room in rooms}
    level = {name: k for k, story in enumerate(floors) for name in story}
    outer = between_folders(arrows, folder)
    if circles(arrows) or circles(outer):
        raise SystemExit(f"rooms import each other in a circle: {circles(arrows) or circles(outer)}")
    if up := [(name, other) for name, others in outer.items() for other in others if level[other] <= level[name]]:
        raise SystemExit(f"floors import from floors that are not below them: {up}")
    places: dict[str, tuple[float, float, float, float]] = {}  # x, y of the middle, width, height
    shapes, top = [], float(MARGIN)
    for story in floors:
        width = (WIDTH - 2 * MARGIN - PAD * (len(story) - 1)) / len(story)
        tallest = 0.0
        for k, (name, rooms) in enumerate(sorted(story.items())):
            x = MARGIN + width / 2 + k * (width + PAD)
            rows = rows_of(rooms, arrows) if rooms != [name] else []
            height = len(rows) * (HEIGHT + GAP) - GAP * bool(rows) + 2 * PAD * bool(rows) or HEIGHT
            places[name] = (x, top + height / 2, width, height)
            shapes.append(_box(places[name], name + "/", PURPOSE[name], "#f7efdf", beside=bool(rows)))
            for i, row in enumerate(rows):
                for j, room in enumerate(row):
                    middle = x + 90 + (j - (len(row) - 1) / 2) * (BOX + PAD)
                    places[room] = (middle, top + PAD + i * (HEIGHT + GAP) + HEIGHT / 2, BOX, HEIGHT)
                    shapes.append(_box(places[room], room, PURPOSE[room], "#e6eef7"))
            tallest = max(tallest, height)
        top += tallest + GAP
    inner = {room: {other for other in others if folder[other] == folder[room]} for room, others in arrows.items()}
    short = {**reduced(outer), **{room: others for room, others in reduced(inner).items() if room not in outer}}
    lines = [_arrow(room, other, short, places) for room in sorted(short) for other in sorted(short[room])]
    return (
        "\n".join(
            [
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top + 14:.0f}" '
                'font-family="sans-serif" role="img" '
                'aria-label="Floors of the sources: a floor imports only from floors below its own">',
                '<defs><marker id="head" markerUnits="userSpaceOnUse" markerWidth="11" markerHeight="11" refX="10" '
                'refY="5.5" orient="auto"><path d="M0,1 L11,5.5 L0,10 z" fill="#5b6b7b"/></marker></defs>',
                f'<rect width="{WIDTH}" height="{top + 14:.0f}" fill="#ffffff"/>',
                *shapes,
                *lines,
                f'<text x="{WIDTH / 2}" y="{top:.0f}" text-anchor="middle" font-size="13" fill="#41566b">'
                f"{len(outer)} folders on {len(floors)} floors; direct arrows left out where others lead there too; "
                f"{len(loops)} circles of modules</text></svg>",
            ]
        )
        + "\n"
    )


def _box(place: tuple[float, float, float, float], title: str, text: str, fill: str, *, beside: bool = False) -> str:
    """A box with its title and purpose, in its middle, or ``beside`` the rooms inside it, at its left."""
    x, y, width, height = place
    at = f'x="{x:.0f}" text-anchor="middle"' if not beside else f'x="{x - width / 2 + PAD:.0f}"'
    return (
        f'<rect x="{x - width / 2:.0f}" y="{y - height / 2:.0f}" width="{width:.0f}" height="{height:.0f}" rx="7" '
        f'fill="{fill}" stroke="#30475e"/>'
        f'<text {at} y="{y - 4:.0f}" font-size="15" font-weight="600" fill="#1c2b3a">{escape(title)}</text>'
        f'<text {at} y="{y + 15:.0f}" font-size="13" fill="#41566b">{escape(text)}</text>'
    )


def _arrow(
    room: str, other: str, short: Mapping[str, set[str]], places: Mapping[str, tuple[float, float, float, float]]
) -> str:
    """An arrow from the lower side of a box to the upper side of another."""
    leaving = sorted(short[room], key=lambda each: places[each])
    coming = sorted((each for each in short if other in short[each]), key=lambda each: places[each])
    (x0, y0, width0, height0), (x1, y1, width1, height1) = places[room], places[other]
    begin = _port(x0, width0, leaving.index(other), len(leaving), x1)
    end = _port(x1, width1, coming.index(room), len(coming), x0)
    top, bottom = y0 + height0 / 2, y1 - height1 / 2
    pull = 0.5 * (bottom - top)
    return (
        f'<path d="M{begin:.0f},{top:.0f} C{begin:.0f},{top + pull:.0f} {end:.0f},{bottom - pull:.0f} '
        f'{end:.0f},{bottom:.0f}" fill="none" stroke="#5b6b7b" stroke-width="1.6" marker-end="url(#head)"/>'
    )


def _port(middle: float, width: float, k: int, count: int, towards: float) -> float:
    """Return where [px] the k-th of several arrows meets the side of a box; a single one is nearest to ``towards``."""
    if count > 1:
        return middle + (k - (count - 1) / 2) * min(0.5 * width, 0.8 * width / count)
    return min(max(towards, middle - 0.4 * width), middle + 0.4 * width) if width > BOX else middle


def main() -> int:
    picture = drawn(*house())
    if "--check" in sys.argv[1:]:
        return int(not PICTURE.is_file() or PICTURE.read_text(encoding="utf-8") != picture)
    PICTURE.write_text(picture, encoding="utf-8")
    print(PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
