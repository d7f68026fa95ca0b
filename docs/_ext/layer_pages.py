"""What architecture.md shows of the imports: a picture of the layers and a table of who may import whom.

The layers are those of [tool.importlinter] in pyproject.toml, the arrows the imports that are really there.
"""

from __future__ import annotations

import itertools
import random
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import grimp
from page import AUTO, ROOT, Raw, plain, table, write

LAYERS = AUTO / "layers"
PICTURES = {
    "pwsmooth": {"definition", "codegen", "kernels", "paths", "results"},
    "kernels": {"machine", "surface", "step", "instant", "trajectory"},
}
# In inches. As wide as a phone shows without shrinking the words by more than a fifth.
WIDTH, ROW, BOX, GAP = 4.6, 0.64, (0.98, 0.32), 0.08
TRIES = 12_000
Arrow = tuple[str, str]
Node = str | tuple[str, int]  # a box, or the point at which an arrow to that box passes a layer


def write_pages() -> None:
    """Pictures and tables of all contracts about layers."""
    graph = grimp.build_graph("pwsmooth", cache_dir=None)
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    for rule in rules:
        if rule["type"] == "layers":
            found = imports(graph, rule["containers"][0])
            write(LAYERS / f"{rule['id']}.txt", _table(rule, rules, found))
            if rule["id"] in PICTURES:
                _draw(rule, found, LAYERS / f"{rule['id']}.svg", PICTURES[rule["id"]])


def imports(graph: grimp.ImportGraph, package: str) -> set[Arrow]:
    """(importer, imported) among the files and folders of a package, imports inside functions included."""
    arrows = set()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            ends = [name.removeprefix(f"{package}.").partition(".")[0] for name in (module, imported)
                    if name.startswith(f"{package}.")]  # fmt: skip
            if len(set(ends)) == 2:
                arrows.add((ends[0], ends[1]))
    return arrows


def layers(rule: dict[str, Any]) -> list[list[str]]:
    """Names in each layer, the highest first."""
    return [[name.strip() for name in layer.split("|")] for layer in rule["layers"]]


def _forbidden(rules: Iterable[dict[str, Any]], package: str, name: str) -> set[str]:
    """What other contracts keep a member of the package from."""
    return {
        target.removeprefix(f"{package}.")
        for rule in rules
        if rule["type"] == "forbidden" and f"{package}.{name}" in rule["source_modules"]
        for target in rule["forbidden_modules"]
    }


def _table(rule: dict[str, Any], rules: list[dict[str, Any]], found: set[Arrow]) -> str:
    """For every member of a package what it imports, and what it might."""
    rows: list[tuple[Any, ...]] = []
    all_layers = layers(rule)
    for i, layer in enumerate(all_layers):
        for name in layer:
            if name == "__main__":
                continue
            below = list(itertools.chain.from_iterable(all_layers[i + 1 :]))
            kept_off = _forbidden(rules, rule["containers"][0], name)
            does = [b for b in below if (name, b) in found]
            might = [b for b in below if (name, b) not in found and b not in kept_off]
            rows.append((Raw(f"**{plain(name)}**"), *(Raw(plain(", ".join(names))) for names in (does, might))))
    return table(("", "imports", "could import too"), rows)


def unimplied(arrows: set[Arrow]) -> set[Arrow]:
    """The arrows without those that follow from others: a -> c where a -> b -> c."""
    beyond: dict[str, set[str]] = {}

    def reach(name: str) -> set[str]:
        if name not in beyond:
            nexts = {b for a, b in arrows if a == name}
            beyond[name] = nexts.union(*map(reach, nexts))
        return beyond[name]

    return {(a, c) for a, c in arrows if not any(c in reach(b) for x, b in arrows if x == a and b != c)}


def _draw(rule: dict[str, Any], found: set[Arrow], target: Path, chain: set[str]) -> None:
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
    from matplotlib.path import Path as Curve

    rows, short = layers(rule), _by_way_points(layers(rule), unimplied(found))
    place = _arrange(rows, short)
    height = ROW * len(rows)
    with matplotlib.rc_context(
        {"svg.hashsalt": "pwsmooth", "svg.fonttype": "none", "font.family": "sans-serif"}
    ):
        figure = Figure(figsize=(WIDTH, height))
        ax = figure.add_axes((0, 0, 1, 1))
        ax.set(xlim=(0, WIDTH), ylim=(0, height))
        ax.axis("off")
        for i in range(0, len(rows), 2):
            ax.axhspan(height - (i + 1) * ROW, height - i * ROW, color="#F1F1F1", linewidth=0, zorder=0)
        half = BOX[1] / 2
        for a, b in sorted(short, key=str):
            (x, y), (u, v) = place[a], place[b]
            begin, end, middle = height - y - half, height - v + half, height - (y + v) / 2
            ends = isinstance(b, str)
            bend = Curve([(x, begin), (x, middle), (u, middle), (u, end)], [1, 4, 4, 4])
            ax.add_patch(FancyArrowPatch(
                path=bend, arrowstyle="-|>" if ends else "-", mutation_scale=8, linewidth=0.9, color="#666666",
                shrinkA=0, shrinkB=0, zorder=1,
            ))  # fmt: skip
            if not ends:
                ax.plot([u, u], [end, end - BOX[1]], color="#666666", linewidth=0.9, zorder=1)
        for name in itertools.chain.from_iterable(rows):
            x, y = place[name]
            inside = name in chain
            ax.add_patch(FancyBboxPatch(
                (x - BOX[0] / 2, height - y - half), *BOX, boxstyle="round,pad=0,rounding_size=0.06", zorder=2,
                facecolor="#0072B2" if inside else "white", edgecolor="#0072B2" if inside else "#555555",
            ))  # fmt: skip
            ax.text(x, height - y, name, ha="center", va="center_baseline", fontsize=11, zorder=3,
                    color="white" if inside else "black")  # fmt: skip
        target.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(target, metadata={"Date": None})


def _by_way_points(rows: list[list[str]], arrows: set[Arrow]) -> set[tuple[Node, Node]]:
    """Arrows from a layer to the next: longer ones go by way points, which all those to one target share."""
    level = {name: i for i, row in enumerate(rows) for name in row}
    short = set()
    for a, b in arrows:
        way: list[Node] = [a, *((b, i) for i in range(level[a] + 1, level[b])), b]
        short.update(itertools.pairwise(way))
    return short


def _arrange(rows: list[list[str]], short: set[tuple[Node, Node]]) -> dict[Node, tuple[float, float]]:
    """Middle of every box and way point, so that few arrows cross: the best of many tries, the same each time."""
    chance = random.Random(1)
    points = {b for _, b in short if not isinstance(b, str)}
    orders: list[list[Node]] = [
        [*row, *sorted((p for p in points if p[1] == i), key=str)] for i, row in enumerate(rows)
    ]
    between: list[list[tuple[Node, Node]]] = [[] for _ in rows]
    level = {node: i for i, order in enumerate(orders) for node in order}
    for a, b in sorted(short, key=str):
        between[level[a]].append((a, b))
    manner = [(0.0, 0.0)] * len(rows)
    best, least = {}, float("inf")
    for _ in range(TRIES):
        i = chance.randrange(len(rows))
        before = orders[i][:], manner[i]
        if chance.random() < 0.5:
            manner[i] = chance.choice((0.0, 0.5, 1.0)), chance.choice((-1.0, -0.5, 0.0, 0.5, 1.0))
        else:
            one, other = chance.randrange(len(orders[i])), chance.randrange(len(orders[i]))
            orders[i][one], orders[i][other] = orders[i][other], orders[i][one]
        place = {
            n: (x, (k + 0.5) * ROW) for k, order in enumerate(orders) for n, x in _spread(order, *manner[k])
        }
        cost = sum(_cost(place, pairs) for pairs in between)
        if cost <= least:
            best, least = place, cost
        else:
            orders[i], manner[i] = before
    return best


def _spread(order: list[Node], width: float, shift: float) -> Iterator[tuple[Node, float]]:
    """Places in one layer: how much of the room there is lies between them, and to which side the rest is."""
    sizes = [BOX[0] if isinstance(node, str) else 0.06 for node in order]
    room = WIDTH - sum(sizes) - GAP * (len(order) + 1)
    inner = width * room / (len(order) + 1)
    x = GAP + inner + (1.0 + shift) / 2 * (room - inner * (len(order) + 1))
    for node, size in zip(order, sizes):
        yield node, x + size / 2
        x += size + GAP + inner


def _cost(place: dict[Node, tuple[float, float]], arrows: list[tuple[Node, Node]]) -> float:
    """Crossings, and how far arrows go aside."""
    ways = [(place[a][0], place[b][0]) for a, b in arrows]
    crossings = sum((x - u) * (y - v) < 0 for (x, y), (u, v) in itertools.combinations(ways, 2))
    return crossings + sum(0.4 * abs(y - x) + 0.3 * abs(y - x) ** 2 for x, y in ways)
