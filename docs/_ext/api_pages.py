"""The API reference: a page for every public module, from docs/public_names.py and the docstrings."""

from __future__ import annotations

import importlib
import inspect
import types
from collections import defaultdict

from page import AUTO, write
from public_names import members, public_names

API = AUTO / "api"
FRONT = "pwsmooth"  # whose names have a page each
# Order and headings of the index; modules that fit nowhere come last, under their own heading.
GROUPS = {
    "Defining and solving": (
        "pwsmooth",
        "pwsmooth.results.solution",
        "pwsmooth.results.records",
        "pwsmooth.definition.sigmoids",
    ),
    "Analysis": ("pwsmooth.analysis",),
    "Laws": ("pwsmooth.laws",),
    "Scenes": ("pwsmooth.scenes",),
    "Sweeps and fits": ("pwsmooth.studies", "pwsmooth.fitting"),
    "Comparisons": ("pwsmooth.compare",),
    "Charts": ("pwsmooth.plotting",),
}


def write_pages() -> None:
    """A page a module and the index."""
    by_module: dict[str, dict[str, object]] = defaultdict(dict)
    for full, value in public_names().items():
        module, _, name = full.rpartition(".")
        by_module[module][name] = value
    for module, names in by_module.items():
        write(API / f"{module}.rst", _module_page(module, names))
    write(API / "index.rst", _index(by_module))


def _title(text: str, line: str) -> str:
    return f"{text}\n{line * len(text)}\n"


def _module_page(module: str, names: dict[str, object]) -> str:
    parts = [_title(module, "="), f".. automodule:: {module}\n", f".. currentmodule:: {module}\n"]
    parts.append(_table(module, names))
    if module == FRONT:
        parts.append(".. toctree::\n   :hidden:\n\n" + "".join(f"   {module}/{name}\n" for name in names))
        for name, value in names.items():
            text = f"{_title(name, '=')}\n.. currentmodule:: {module}\n\n{_entry(name, value)}"
            write(API / module / f"{name}.rst", text)
        return "\n".join(parts)
    return "\n".join([*parts, *(_entry(name, value) for name, value in names.items())])


def _table(module: str, names: dict[str, object]) -> str:
    """A line a name: a link to its entry, and the first sentence of its docstring."""
    rows = [f"   * - :obj:`~{module}.{name}`\n     - {_summary(value)}\n" for name, value in names.items()]
    return ".. list-table::\n   :widths: 30 70\n\n" + "".join(rows)


def _entry(name: str, value: object) -> str:
    """The directive that documents one name of the current module."""
    if inspect.isclass(value):
        shown = ", ".join(members(value))
        return f".. autoclass:: {name}\n" + (f"   :members: {shown}\n" if shown else "")
    if inspect.isroutine(value):
        return f".. autofunction:: {name}\n"
    if isinstance(value, types.GenericAlias):
        return f".. py:type:: {name}\n   :canonical: {value}\n"
    return f".. autodata:: {name}\n   :no-value:\n"


def _summary(value: object) -> str:
    """First sentence of a docstring; nothing for data, whose docstring is their type's."""
    if not (inspect.isclass(value) or inspect.isroutine(value)):
        return ""
    first = (inspect.getdoc(value) or "").split("\n\n")[0]
    return " ".join(first.split()).replace("|", r"\|")


def _index(by_module: dict[str, dict[str, object]]) -> str:
    left = dict.fromkeys(by_module)
    parts = [
        _title("API reference", "="),
        "Every public name, from its docstring: shapes and units, what is raised, the source, an example. What is not "
        "listed here is internal.\n",
    ]
    groups = {}
    for heading, roots in GROUPS.items():
        groups[heading] = [
            m for m in left if any(m == r or (r != "pwsmooth" and m.startswith(r + ".")) for r in roots)
        ]
        for module in groups[heading]:
            del left[module]
    groups["More"] = list(left)
    for heading, modules in groups.items():
        if modules:
            parts.append(_title(heading, "-"))
            for module in modules:
                doc = (importlib.import_module(module).__doc__ or "").strip().split("\n\n")[0]
                parts.append(f":doc:`{module}`: {' '.join(doc.split())}\n")
                parts.append(_table(module, by_module[module]))
            parts.append(".. toctree::\n   :hidden:\n\n" + "".join(f"   {m}\n" for m in modules))
    return "\n".join(parts)
