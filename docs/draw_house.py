"""The rooms and floors of the sources as a picture, drawn from the code: docs/_static/house.svg.

    python docs/draw_house.py           draws the picture
    python docs/draw_house.py --check   exits with 1 if the committed picture is not what the code says

A room is a folder of the sources; its floor is the layer that pyproject.toml gives it. An arrow leads from a room to
one that it imports from; it is left out where other arrows lead there too. Circles of modules, by imports inside
functions and for type checkers too, are counted below, those of the benchmarks among them.
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
FOLDERS = (
    "interfaces", "models", "controllers", "estimators", "sim", "renders", "studies", "src/mathnavi", "benchmarks",
)  # fmt: skip

WIDTH, BOX, HEIGHT, GAP, MARGIN = 1200, 250, 46, 44, 24  # [px]
COLUMN = {  # of the width, so that few arrows cross; a room that is not named stands in the middle
    "commands": 0.38, "scripting": 0.66, "studies": 0.5, "sim.search": 0.26, "sim.sweep": 0.26,
    "sim.environments": 0.72, "renders": 0.2, "sim.scenarios": 0.62, "sim.records": 0.28, "sim.metrics": 0.52,
    "estimators": 0.13, "sim.engine": 0.4, "controllers": 0.66, "models": 0.4, "sim.plugin": 0.88,
    "interfaces": 0.52,
}  # fmt: skip
PURPOSE = {
    "scripting": "what `import mathnavi` declares",
    "commands": "the command line",
    "studies": "tables and figures of the thesis",
    "sim.search": "worst missions and rare events",
    "sim.sweep": "trials and jobs over many seeds",
    "sim.environments": "dm_env, Gymnasium, batches",
    "sim.scenarios": "closed-loop missions",
    "renders": "videos, figures, reports",
    "sim.metrics": "figures of a run",
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
    return {name.removeprefix("src.mathnavi").removeprefix(".") or "mathnavi": path for name, path in named.items()}


def imports(path: Path, known: Mapping[str, Path]) -> Iterator[str]:
    """The modules that a file imports from, inside functions and for type checkers too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            while name.startswith(("mathnavi.", "benchmarks.")):
                if (inner := name.removeprefix("mathnavi.")) in known:
                    yield inner
                    break
                name = name.rpartition(".")[0]


def floors() -> list[list[str]]:
    """The rooms of each floor, from the top, as the import contract has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(contract["layers"] for contract in settings["contracts"] if contract["type"] == "layers")
    return [[room.strip(" ()") for part in layer.split("|") for room in part.split(":")] for layer in layers]


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
    rooms = {room for floor in floors() for room in floor}
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
    """The length of the longest way down from a room."""
    return 1 + max((depth(other, arrows) for other in arrows[room]), default=-1)


def _port(middle: float, k: int, count: int) -> float:
    """Where the k-th of several arrows meets the side of a box [px]."""
    return middle + (k - (count - 1) / 2) * min(40.0, 0.8 * BOX / max(1, count))


def drawn(arrows: Mapping[str, set[str]], loops: list[list[str]]) -> str:
    """The picture of what ``house`` finds."""
    known = set(arrows)
    if circles(arrows):
        raise SystemExit(f"rooms import each other in a circle: {circles(arrows)}")
    depths = {room: depth(room, arrows) for room in known}
    rows = max(depths.values()) + 1
    places = {
        room: (COLUMN.get(room, 0.5) * WIDTH, MARGIN + (rows - 1 - depths[room]) * (HEIGHT + GAP) + HEIGHT / 2)
        for room in known
    }
    height = MARGIN * 2 + rows * (HEIGHT + GAP)
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" role="img" '
        'aria-label="Rooms and floors of the sources: a room imports only from floors below its own">',
        '<defs><marker id="head" markerUnits="userSpaceOnUse" markerWidth="11" markerHeight="11" refX="10" refY="5.5" '
        'orient="auto"><path d="M0,1 L11,5.5 L0,10 z" fill="#5b6b7b"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    entering = {room: sorted(other for other in known if room in arrows[other]) for room in known}
    short = reduced(arrows)
    for room in sorted(known):
        leaving = sorted(short[room], key=lambda other: places[other])
        for k, other in enumerate(leaving):
            comers = sorted((one for one in entering[other] if other in short[one]), key=lambda one: places[one])
            x0, x1 = _port(places[room][0], k, len(leaving)), _port(places[other][0], comers.index(room), len(comers))
            top, bottom = places[room][1] + HEIGHT / 2, places[other][1] - HEIGHT / 2
            pull = 0.5 * (bottom - top)
            lines.append(
                f'<path d="M{x0:.0f},{top:.0f} C{x0:.0f},{top + pull:.0f} {x1:.0f},{bottom - pull:.0f} '
                f'{x1:.0f},{bottom:.0f}" fill="none" stroke="#5b6b7b" stroke-width="1.6" marker-end="url(#head)"/>'
            )
    for room in sorted(known):
        x, y = places[room]
        name = f"mathnavi.{room}"
        lines.append(
            f'<rect x="{x - BOX / 2:.0f}" y="{y - HEIGHT / 2:.0f}" width="{BOX}" height="{HEIGHT}" rx="7" '
            f'fill="{"#e6eef7" if room.startswith("sim") else "#f7efdf"}" stroke="#30475e"/>'
            f'<text x="{x:.0f}" y="{y - 4:.0f}" text-anchor="middle" font-size="15" font-weight="600" fill="#1c2b3a">'
            f'{escape(name)}</text><text x="{x:.0f}" y="{y + 15:.0f}" text-anchor="middle" font-size="13" '
            f'fill="#41566b">{escape(PURPOSE.get(room, ""))}</text>'
        )
    drawn_arrows = sum(len(others) for others in short.values())
    lines.append(
        f'<text x="{WIDTH / 2}" y="{height - 12}" text-anchor="middle" font-size="13" fill="#41566b">'
        f"{len(known)} rooms on {rows} floors; {drawn_arrows} arrows drawn, direct ones left out where others "
        f"lead there too; {len(loops)} circles of modules</text></svg>"
    )
    return "\n".join(lines) + "\n"


def main() -> int:
    picture = drawn(*house())
    if "--check" in sys.argv[1:]:
        return int(not PICTURE.is_file() or PICTURE.read_text(encoding="utf-8") != picture)
    PICTURE.write_text(picture, encoding="utf-8")
    print(PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
