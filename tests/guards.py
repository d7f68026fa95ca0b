"""Which tests guard a module: those that import it, and those whose docstring says so.

    python tests/guards.py [pwsmooth/kernels/instant/resting.py ...]     (without a name: all modules)

A line `Guards: kernels/instant/, paths/growth.py` of a test's docstring names modules, or all those of a folder, from
pwsmooth/ on. tests/house/test_guards.py refuses a module that nothing guards.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

# What no test runs, and why.
UNGUARDED = {
    "costs/for_torch.py": "torch is not installed for the tests; `for_jax.py` beside it has its tests",
    "compare/efficiency/peers/": "the peers are not installed for the tests; experiments/bench_*.py run them",
}
TESTS = Path(__file__).resolve().parent
PACKAGE = TESTS.parent / "pwsmooth"


def modules() -> list[str]:
    """Every file of the package with code of its own, from pwsmooth/ on."""
    found = sorted(path for path in PACKAGE.rglob("*.py") if "_compiled" not in path.parts)
    return [str(path.relative_to(PACKAGE)) for path in found if len(_tree(path).body) > 1]


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _file_of(dotted: str) -> str | None:
    """The file of `pwsmooth.a.b`, or of the module that the name b of `pwsmooth.a` comes from."""
    parts = dotted.split(".")[1:]
    for path in (PACKAGE.joinpath(*parts).with_suffix(".py"), PACKAGE.joinpath(*parts, "__init__.py")):
        if parts and path.is_file():
            return str(path.relative_to(PACKAGE))
    return None


def _defined_by() -> dict[str, str]:
    """Files of the names that `pwsmooth` and its folders pass on."""
    found = {}
    for path in sorted(PACKAGE.rglob("__init__.py")):
        package = ["pwsmooth", *path.parent.relative_to(PACKAGE).parts]
        for node in ast.walk(_tree(path)):
            if isinstance(node, ast.ImportFrom):
                base = package[: len(package) - node.level + 1] if node.level else []
                for name in node.names:
                    source = ".".join([*base, *filter(None, [node.module])])
                    found[".".join([*package, name.asname or name.name])] = f"{source}.{name.name}"
            elif isinstance(node, ast.Dict):  # names that are loaded when they are asked for, and their modules
                for key, value in zip(node.keys, node.values):
                    if isinstance(key, ast.Constant) and isinstance(value, ast.Constant):
                        found[".".join([*package, str(key.value)])] = ".".join(
                            [*package, str(value.value), str(key.value)]
                        )
    return found


def _imported(tree: ast.Module, passed_on: dict[str, str]) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pwsmooth"):
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    files = set()
    for name in names:
        for _ in range(4):  # from folder to folder
            if file := _file_of(name):
                files.add(file)
                break
            if name not in passed_on:
                files |= {file} if (file := _file_of(name.rpartition(".")[0])) else set()
                break
            name = passed_on[name]
    return files


def _within(module: str, place: str) -> bool:
    return module == place or (place.endswith("/") and module.startswith(place))


def why_unguarded(module: str) -> str:
    """Why no test runs a module, empty if some has to."""
    return next((why for place, why in UNGUARDED.items() if _within(module, place)), "")


def guards() -> dict[str, list[str]]:
    """Test files, from tests/ on, of every module."""
    known, passed_on = modules(), _defined_by()
    found: dict[str, list[str]] = {module: [] for module in known}
    for path in sorted(TESTS.rglob("*.py")):
        if not (path.name.startswith("test_") or path.parent.name == "fuzz"):
            continue
        tree = _tree(path)
        said = re.findall(r"[\w/]+(?:\.py|/)", (ast.get_docstring(tree) or "").partition("Guards: ")[2])
        named = {m for m in known if any(_within(m, place) for place in said) and not why_unguarded(m)}
        for module in (_imported(tree, passed_on) | named) & found.keys():
            found[module].append(str(path.relative_to(TESTS)))
    return found


def main(names: list[str]) -> None:
    """Prints the guards of these modules, or of all."""
    wanted = {name.removeprefix("pwsmooth/") for name in names}
    for module, tests in guards().items():
        if not wanted or module in wanted:
            told = ", ".join(f"tests/{test}" for test in tests)
            print(f"pwsmooth/{module}: {told or why_unguarded(module) or 'NOTHING'}")


if __name__ == "__main__":
    main(sys.argv[1:])
