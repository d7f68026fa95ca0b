"""By hand: is there a verdict of a figure or a study that cannot fail?

    python -m tests.verdicts [NAME ...]         figures (`02`, `c3`) in their fast form, studies from their kept data

Of every claim the expression that decides is evaluated again with one of the values in it replaced: made larger and
smaller, turned round, put to 0, or to another value of the same expression. A truth that was computed before is looked
for where it is assigned. A claim whose verdict no replacement turns cannot fail, or has too much in it: it is listed.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import math
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

ROOT = Path(__file__).resolve().parent.parent
MAKERS = ("Claim", "claim", "said", "shown", "quoted")
COMPUTE = set(
    "abs all any bool dict float int len list map math max min np range round set sorted sum tuple zip".split()
)


def altered(value: Any, way: int, count: list[int]) -> Any:
    """A value of the same shape whose leaves are all changed, each in its own measure."""
    if isinstance(value, dict):
        return {k: altered(v, way, count) for k, v in value.items()}
    if isinstance(value, list) and (not value or way == WAYS):
        return [] if value else [1.0]
    if isinstance(value, (list, tuple, set)) and not hasattr(value, "_fields"):
        return type(value)(altered(v, way, count) for v in value)
    if isinstance(value, np.ndarray):
        return np.array([altered(v, way, count) for v in value.tolist()]) if value.ndim else value
    count[0] += 1
    wave = math.sin(2.0 * count[0])
    if isinstance(value, (bool, np.bool_)):
        return not value
    if isinstance(value, (int, float, np.number, sp.Number)):
        return (
            value
            if way == WAYS
            else (
                value * (1.5 + 0.3 * wave) + 0.5 + 0.1 * wave,
                0 * value,
                -value - 0.1 * wave,
                value * (1e3 + 100 * wave),
                value * (1e-3 + 1e-4 * wave),
                1e-12 * (1 + wave),
                abs(value) + count[0],
                1.05 * value,
                0.95 * value,
            )[way]
        )
    if isinstance(value, str):
        return "" if way == WAYS else value + " (altered)"
    return value


WAYS = 9


def changeable(value: Any) -> bool:
    """Whether there is a number, a truth or a text in it."""
    if isinstance(value, dict):
        return any(map(changeable, value.values()))
    if isinstance(value, (list, tuple, set)):
        return not value or any(map(changeable, value))
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "biuf" and value.size > 0
    return isinstance(value, (int, float, np.number, np.bool_, str, sp.Number))


def places_of(expression: ast.expr) -> list[ast.expr]:
    """The values that a verdict is made of: what stands in data, and what functions of the script give.

    Not what is computed from them on the spot, as an absolute value or a maximum: it might be put to what it cannot be.
    """
    found: dict[str, ast.expr] = {}

    def look(node: ast.AST) -> None:
        if isinstance(node, (ast.ListComp, ast.SetComp, ast.GeneratorExp, ast.DictComp)):
            return look(node.generators[0].iter)
        if isinstance(node, ast.Lambda):
            return None
        if isinstance(node, (ast.Subscript, ast.Attribute)) or (
            isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[0] not in COMPUTE
        ):
            found.setdefault(ast.unparse(node), node)
        for child in ast.iter_child_nodes(node):
            look(child)

    look(expression)
    return [node for text, node in found.items() if any(isinstance(n, ast.Name) for n in ast.walk(node))]


class Instead(ast.NodeTransformer):
    """A name in place of every occurrence of a sub-expression."""

    def __init__(self, text: str, name: str) -> None:
        self.text, self.name = text, name

    def visit(self, node: ast.AST) -> ast.AST:
        if isinstance(node, ast.expr) and ast.unparse(node) == self.text:
            return ast.Name(self.name, ast.Load())
        return self.generic_visit(node)


def value_of(expression: ast.expr, scope: dict) -> Any:
    tree = ast.fix_missing_locations(ast.Expression(expression))
    return eval(compile(tree, "<verdict>", "eval"), scope)


def turned_by(text: str, scope: dict) -> str:
    """What is replaced, and how, to turn the truth of an expression, or ""."""
    expression = ast.parse(text.strip(), mode="eval").body
    truth = bool(value_of(expression, scope))
    tried: list[tuple[str, ast.expr, Any]] = []
    for node in places_of(expression):
        try:
            tried.append((ast.unparse(node), Instead(ast.unparse(node), "_new").visit(copied(expression)),
                          value_of(copied(node), scope)))  # fmt: skip
        except Exception:
            continue
    for name in sorted({n.id for n in ast.walk(expression) if isinstance(n, ast.Name)} & scope.keys()):
        tried.append((name, Instead(name, "_new").visit(copied(expression)), scope[name]))
    tried = [one for one in tried if changeable(one[2]) and not isinstance(one[2], (bool, np.bool_))]
    values = [value for *_, value in tried]
    values += [n.value for n in ast.walk(expression) if isinstance(n, ast.Constant)]
    for what, changed, value in tried:
        other = [v for v in values if type(v) is type(value) or (np.isscalar(v) and np.isscalar(value))]
        for new in [altered(value, way, [0]) for way in range(WAYS + 1)] + other:
            try:
                if bool(value_of(copied(changed), {**scope, "_new": new})) != truth:
                    return f"{what} = {new!r:.60}"
            except Exception:
                continue
    return ""


def copied(expression: ast.expr) -> ast.expr:
    return ast.parse(ast.unparse(expression), mode="eval").body


class Watch:
    """What is told by the calls that were put into a module."""

    def __init__(self) -> None:
        self.waiting: list[dict] = []
        self.found: dict[str, str] = {}  # statement -> what turns it, or ""
        self.truths: dict[str, str] = {}  # name of a truth -> what turns one of its assignments
        self.turned: dict[str, str] = {}

    def truth(self, value: Any, names: str, text: str, scope: dict) -> Any:
        if isinstance(value, (bool, np.bool_)) and not self.truths.get(names):
            self.truths[names] = turned_by(text, scope)
        return value

    def holds(self, value: Any, text: str, scope: dict) -> Any:
        found = turned_by(text, scope)
        if not found:
            truths = {n.id for n in ast.walk(ast.parse(text.strip(), mode="eval")) if isinstance(n, ast.Name)}
            found = next((f"{n}: {self.truths[n]}" for n in sorted(truths) if self.truths.get(n)), "")
        self.waiting.append({"found": found})
        return value

    def made(self, claim: Any) -> Any:
        record = self.waiting.pop()
        if claim.origin != "identity":
            key, n = claim.statement, 1
            while key in self.found:
                n += 1
                key = f"{claim.statement} ({n})"
            self.found[key] = record["found"]
        return claim


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Name(name, ast.Load()), list(arguments), [])


def _scope() -> ast.expr:
    return ast.parse("{**globals(), **locals()}", mode="eval").body


class Watched(ast.NodeTransformer):
    """Puts the calls of a Watch into a module."""

    def __init__(self) -> None:
        self.parameters: list[set[str]] = []

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        given = node.args
        self.parameters.append({a.arg for a in [*given.args, *given.kwonlyargs, *given.posonlyargs]})
        self.generic_visit(node)
        self.parameters.pop()
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        text = ast.unparse(node.value)
        self.generic_visit(node)
        if self.parameters and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            node.value = _call(
                "_watch_truth", node.value, ast.Constant(node.targets[0].id), ast.Constant(text), _scope()
            )
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        text = ast.unparse(node.value)
        self.generic_visit(node)
        if self.parameters and isinstance(node.target, ast.Name):
            node.value = _call(
                "_watch_truth", node.value, ast.Constant(node.target.id), ast.Constant(text), _scope()
            )
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        name = node.func
        number = (
            isinstance(name, ast.Attribute) and name.attr == "number" and ast.unparse(name.value) == "Claim"
        )
        maker = isinstance(name, ast.Name) and name.id in MAKERS
        if not (number or maker):
            return self.generic_visit(node)
        named = {k.arg: k.value for k in node.keywords}
        if number:
            source, ours, tolerance = (
                [*node.args[1:4], *(named[k] for k in ("source", "ours", "tolerance") if k in named)]
                + [None] * 3
            )[:3]
            if tolerance is None:
                return self.generic_visit(node)
            # What is ours alone is replaced.
            text = (
                f"(lambda ours, source, tolerance: abs(source - ours) <= tolerance)({ast.unparse(ours)}, "
                + (f"*(({ast.unparse(source)}), ({ast.unparse(tolerance)}))[:])")
            )
            self.generic_visit(node)
            probe = _call("_watch_holds", ast.Constant(None), ast.Constant(text), _scope())
            return _call("_watch_made", ast.Subscript(
                ast.Tuple([probe, node], ast.Load()), ast.Constant(1), ast.Load()))  # fmt: skip
        if any(isinstance(a, ast.Starred) for a in node.args[:4]):
            return self.generic_visit(node)
        at = node.args[3] if len(node.args) > 3 else named.get("holds")
        if at is None or (isinstance(at, ast.Name) and any(at.id in p for p in self.parameters)):
            return self.generic_visit(node)
        text = ast.unparse(at)
        self.generic_visit(node)
        if len(node.args) > 3:
            node.args[3] = _call("_watch_holds", node.args[3], ast.Constant(text), _scope())
        else:
            for keyword in node.keywords:
                if keyword.arg == "holds":
                    keyword.value = _call("_watch_holds", keyword.value, ast.Constant(text), _scope())
        return _call("_watch_made", node)


def watched(path: Path, name: str) -> tuple[types.ModuleType, Watch]:
    """The module of a file with a Watch in it."""
    watch, module = Watch(), types.ModuleType(name)
    module.__file__ = str(path)
    module.__dict__.update(_watch_truth=watch.truth, _watch_holds=watch.holds, _watch_made=watch.made)
    sys.modules[name] = module
    tree = ast.fix_missing_locations(Watched().visit(ast.parse(path.read_text(encoding="utf-8"))))
    exec(compile(tree, str(path), "exec"), module.__dict__)
    return module, watch


def of_study(name: str, deep: bool = False) -> dict[str, str]:
    """Statement -> what turns its verdict, of a study's kept data."""
    sys.path[:0] = [str(ROOT / "experiments"), str(ROOT / "tests"), str(ROOT)]
    module, watch = watched(ROOT / "experiments" / f"{name}.py", f"watched_{name}")
    data = json.loads((ROOT / "experiments" / "results" / f"{name}.json").read_text(encoding="utf-8"))["data"]
    module.STUDY.claims(data)
    found = dict(watch.found)
    if deep or not all(found.values()):
        changed = by_data(name, importlib.import_module(name).STUDY.claims, data, found)
        found = {k: (changed[k] if deep else by or changed[k]) for k, by in found.items()}
    return found


def script(name: str) -> str:
    path = ROOT / "experiments" / f"{name}.py"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def same_strip(data: dict) -> dict:
    """Proposition 5 as it would have to be: the slaved strip for every beta."""
    slaved = data["strip"]["slaved"]
    kept = {A: [width, "by hand"] for A, width in slaved.items()}
    return {**data, "strip": {beta: slaved if beta == "slaved" else kept for beta in data["strip"]}}


# What asks for several values at once to be right: study -> changed data.
BY_HAND = {"propositions": same_strip}


def by_data(name: str, claims: Any, data: Any, found: dict[str, str]) -> dict[str, str]:
    """The same with the data changed, a branch of them at a time, before anything is computed from them."""
    before = [c for c in claims(data) if c.origin != "identity"]
    turned: dict[int, str] = {}
    if name in BY_HAND:
        after = [c for c in claims(BY_HAND[name](data)) if c.origin != "identity"]
        turned = {k: "by hand" for k, (a, b) in enumerate(zip(before, after)) if a.holds != b.holds}
    for path in branches(data):
        for way in range(WAYS + 1):
            try:
                after = [c for c in claims(replaced(data, path, way)) if c.origin != "identity"]
            except Exception:
                continue
            if len(after) != len(before):
                continue
            for k, (a, b) in enumerate(zip(before, after)):
                if a.holds != b.holds:
                    turned.setdefault(k, f"data {'/'.join(map(str, path))}, way {way}")
        if len(turned) == len(before):
            break
    return {statement: turned.get(k, "") for k, statement in enumerate(found)}


def branches(data: Any, depth: int = 4, path: tuple = ()) -> list[tuple]:
    """Paths of the branches of data; of a list of records each name in all of them."""
    found = [path] if path else []
    if depth and isinstance(data, dict):
        for key, value in data.items():
            found += branches(value, depth - 1, (*path, key))
    elif depth and isinstance(data, list) and data and isinstance(data[0], (dict, list)):
        names = data[0] if isinstance(data[0], dict) else range(len(data[0]))
        found += [(*path, "*", name) for name in names if isinstance(data[0], dict) or len(data[0]) < 9]
        found += [(*path, k) for k in range(min(len(data), 12))]
    return found


def replaced(data: Any, path: tuple, way: int) -> Any:
    """The data with a branch altered."""
    if not path:
        return altered(data, way, [0])
    key, *rest = path
    if key == "*":
        count = [0]
        return [
            _with(one, rest[0], altered(one[rest[0]], way, count)) if rest[0] in _keys(one) else one
            for one in data
        ]
    return _with(data, key, replaced(data[key], tuple(rest), way))


def _keys(one: Any) -> Any:
    return one if isinstance(one, dict) else range(len(one))


def _with(one: Any, key: Any, value: Any) -> Any:
    if isinstance(one, dict):
        return {**one, key: value}
    return [*one[:key], value, *one[key + 1 :]]


def of_figure(name: str) -> dict[str, str]:
    """Statement -> what turns its verdict, of a figure in its fast form."""
    import matplotlib

    matplotlib.use("Agg")
    from pwsmooth import plotting

    stem = f"figure_{name}"
    importlib.import_module("paper_figures")
    module, watch = watched(ROOT / "paper_figures" / f"{stem}.py", f"paper_figures.watched_{stem}")
    with plotting.style():
        module.draw(True)
    return watch.found


def studies() -> list[str]:
    return sorted(
        p.stem
        for p in (ROOT / "experiments" / "results").glob("*.json")
        if "claims" in json.loads(p.read_text(encoding="utf-8")) and "STUDY = " in script(p.stem)
    )


def figures() -> list[str]:
    return sorted(p.stem.removeprefix("figure_") for p in (ROOT / "paper_figures").glob("figure_*.py"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="figures and studies; all by default")
    parser.add_argument("--verbose", action="store_true", help="what turns each verdict")
    parser.add_argument(
        "--deep", action="store_true", help="of studies: by changed data, before claims compute from them"
    )
    options = parser.parse_args()
    number = stuck = 0
    for name in options.names or [*figures(), *studies()]:
        found = of_figure(name) if name in figures() else of_study(name, options.deep)
        number += len(found)
        for statement, by in found.items():
            stuck += not by
            if options.verbose or not by:
                print(f"{name}: {statement}\n    {by or 'NOTHING TURNS IT'}", flush=True)
    print(f"{number} claims, of which {stuck} by nothing that was tried")


if __name__ == "__main__":
    main()
