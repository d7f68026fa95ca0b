"""Completes docstrings by what shared.py has.

In the source a docstring holds what is special to it. `completed` adds the rest, so that help(), Sphinx and doctest see
a whole text of numpydoc:

    Parameters     an argument without an entry gets the shared one
    Returns        likewise, by the annotation of the result
    Notes          the heading of a paragraph `Source: ...`
    Examples       the heading of the first `>>>`, and of the paragraph in front of it that ends with a colon
    imports        of the names that an example uses, in front of it

Whatever has a door (`checks.door`) is completed there, a law by `law`; what only results hold, by `@complete`.
Chain: shared.py -> **documenting** -> checks.door, law.
"""

from __future__ import annotations

import functools
import inspect
import re
import symtable
import sys
from collections.abc import Mapping
from typing import Any, TypeVar

from .shared import ARGUMENTS, HOMES, STATEMENTS

T = TypeVar("T")

_PACKAGE = __name__.partition(".")[0]

# In the order of numpydoc.
_SECTIONS = (
    "Parameters", "Attributes", "Methods", "Returns", "Yields", "Other Parameters", "Raises", "Warns", "See Also",
    "Notes", "References", "Examples",
)  # fmt: skip
_HEADING = re.compile(rf"^({'|'.join(_SECTIONS)})\n-+$", re.MULTILINE)
_ENTRY = re.compile(r"^\S.*(?:\n(?: .*)?$)*", re.MULTILINE)  # a name and its type, and the indented text below
_SOURCE = re.compile(r"^Sources?: \S", re.MULTILINE)
_EXAMPLE = re.compile(r"^(?:\S.*\n)*\S.*:\n\n(?=>>> )|^>>> ", re.MULTILINE)


def complete(made: T, own: Mapping[str, str] | None = None, more: Mapping[str, str] | None = None) -> T:
    """The same function or class, with its docstring completed; of a class those of its members, too.

    `own` has entries of its arguments, which go before ARGUMENTS, and `more` what is added to sections.
    """
    _complete(made, made, made.__module__, own or {}, more or {})
    for member in vars(made).values() if isinstance(made, type) else ():
        function = next((f for a in ("fget", "__func__", "func") if (f := getattr(member, a, None))), member)
        if inspect.isfunction(function) and not function.__name__.startswith("_"):
            for holder in {id(h): h for h in (function, member)}.values():
                _complete(holder, function, made.__module__, {}, {})
    return made


def _complete(holder: Any, signed: Any, module: str, own: Any, more: Any) -> None:
    text = inspect.cleandoc(holder.__doc__ or "")  # none under -OO
    if "\n" in text or text and (own or any(more.values())):
        holder.__doc__ = completed(text, *_signature(signed), module, own, more)


def _signature(made: Any) -> tuple[list[str], str]:
    """Names of the arguments of a function or of the fields of a class; what the function gives, as it is annotated."""
    if isinstance(made, type) and "__init__" not in vars(made):
        return list({name: 0 for base in made.__mro__[::-1] for name in inspect.get_annotations(base)}), ""
    function = inspect.unwrap(vars(made)["__init__"] if isinstance(made, type) else made)
    return list(inspect.signature(function).parameters), str(function.__annotations__.get("return", ""))


def completed(text: str, names: list[str], gives: str, module: str, own: Any, more: Any) -> str:
    """A docstring with what its source leaves out; one of a sentence alone stays one."""
    for heading, start in (("Notes", _SOURCE), ("Examples", _EXAMPLE)):
        found = start.search(text)
        if found and f"{heading}\n---" not in text:
            text = f"{text[: found.start()]}{heading}\n{'-' * len(heading)}\n{text[found.start() :]}"
    summary, *parts = _HEADING.split(text)
    sections = {heading: body.strip("\n") for heading, body in zip(parts[::2], parts[1::2])}
    if not sections and not own and not any(more.values()):
        return text
    shared = {**_shared(module), **own}
    fields = "Attributes" if "Attributes" in sections and "Parameters" not in sections else "Parameters"
    sections[fields] = _entries(sections, fields, names, shared)
    if f"-> {gives}" in shared and not sections.keys() & {"Returns", "Yields"}:
        sections["Returns"] = shared[f"-> {gives}"].removeprefix("-> ")
    for heading, words in more.items():
        sections[heading] = f"{sections.get(heading, '')}\n\n{words}".strip("\n")
    if "Examples" in sections:
        sections["Examples"] = _with_imports(sections["Examples"], module)
    parts = [f"{h}\n{'-' * len(h)}\n{sections[h]}" for h in _SECTIONS if sections.get(h)]
    return "\n\n".join([summary.strip(), *parts]) + "\n"


def _entries(sections: Mapping[str, str], heading: str, names: list[str], shared: Mapping[str, str]) -> str:
    """The entries of a section and, each behind what it follows in the signature, those that it leaves out."""
    described = {
        n for h in _SECTIONS[:2] for entry in _ENTRY.findall(sections.get(h, "")) for n in _named(entry)
    }
    entries, before = [entry.rstrip() for entry in _ENTRY.findall(sections.get(heading, ""))], set()
    for name in names:
        before.add(name)
        entry = shared.get(name, "")
        if entry and name not in described and _named(entry) <= {*names}:
            place = max((i for i, e in enumerate(entries, 1) if before & _named(e)), default=0)
            entries.insert(place, entry)
            described |= _named(entry)
    return "\n".join(entries)


def _named(entry: str) -> set[str]:
    """`*args, **options : type` -> args, options."""
    return {name.strip(" *") for name in entry.partition("\n")[0].partition(" : ")[0].split(",")}


@functools.cache
def _shared(module: str) -> dict[str, str]:
    """Name -> entry of ARGUMENTS, the nearest folder's before those above it."""
    above = _shared(module.rpartition(".")[0]) if "." in module else {}
    entries = [entry.rstrip() for entry in _ENTRY.findall(ARGUMENTS.get(module, ""))]
    return {**above, **{name: entry for entry in entries for name in _named(entry)}}


def _with_imports(text: str, module: str) -> str:
    """An example with the imports of what it uses, in front of its first line."""
    code = "\n".join(line[4:] for line in text.splitlines() if line.startswith((">>>", "...")))
    try:
        tables = [symtable.symtable(code, "example", "exec")]
    except SyntaxError:  # in the docstring of somebody's law, which is not ours to refuse
        return text
    used: set[str] = set()
    for table in tables:  # of the example, then of its functions and comprehensions
        used |= {s.get_name() for s in table.get_symbols() if s.is_referenced() and s.is_global()}
        tables += table.get_children()
    used -= {s.get_name() for s in tables[0].get_symbols() if s.is_assigned() or s.is_imported()}
    needed: dict[str, list[str]] = {}
    for name in used:
        if home := _home(name, module):
            needed.setdefault(home, []).append(name)
    lines = [f">>> {line}" for name, line in STATEMENTS.items() if name in used]
    lines += [f">>> from {home} import {', '.join(sorted(names))}" for home, names in sorted(needed.items())]
    before, *example = text.partition(">>>")
    return before + "".join(f"{line}\n" for line in lines) + "".join(example)


def _home(name: str, module: str) -> str:
    """Where a name is imported from: the outermost package around the module that has it, the module itself, or any."""
    parts = module.split(".")
    around = [".".join(parts[:n]) for n in range(1, len(parts) + 1)]
    declared = (home for home in around if name in getattr(sys.modules.get(home), "__all__", ()))
    homes = _homes().get(name, [])
    return next(iter([*(home for home in around if home in homes), *declared, *homes]), "")


@functools.cache
def _homes() -> dict[str, list[str]]:
    """Name -> packages that examples import it from."""
    found: dict[str, list[str]] = {name: [_PACKAGE] for name in sys.modules[_PACKAGE].__all__}
    for home, names in HOMES.items():
        for name in names.split():
            found.setdefault(name, []).append(home)
    return found
