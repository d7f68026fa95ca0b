"""What a public docstring must have; the tests and the build of these pages refuse one that lacks it.

Numpydoc's own checks for the sections and the names in them, and five of this house: a shape for every array, a unit
for every quantity, the exceptions of what raises by itself, the source of what comes from the literature, an example
that can be run.
"""

import ast
import dataclasses
import enum
import functools
import inspect
import re
import sys
import textwrap
import types
from collections.abc import Callable, Iterator
from typing import Any

from numpydoc.docscrape import get_doc_object
from numpydoc.validate import validate
from public_names import INTERNAL, members, public_names
from sphinx.pycode import ModuleAnalyzer

# Sections known, ordered, none missing or without a description; every argument named, in the order of the call.
NUMPYDOC = {"GL06", "GL07", "GL08", "SS01", "SS02", "SS03", "PR04", "PR07", "RT01", "RT03", "YD01"}
ARGUMENTS = {"PR01", "PR02", "PR03"}

# An array of drawings has neither shape nor unit.
QUANTITY = re.compile(r"\b(float|array|array_like|ndarray|number)\b(?! of [A-Z])")
ARRAY = re.compile(r"\b(array|array_like|ndarray)\b(?! of [A-Z])|sequence of float")
SHAPE = re.compile(r"\bshapes?\b|\blength\b|\([\w+*/ -]+,[\w+*/, -]*\)")
WORDS = re.compile(r"\b(dimensionless|units?|radians|coefficients?)\b", re.IGNORECASE)
SYMBOLS = re.compile(r"(?<![\w`])(1/)?(N|kg|Pa|J|W|Hz|rad|mm|um|m|s)(\^\d|/\w+(\^\w+)?| [sm])*(?![\w`])")

# Where formulas of the literature are computed: each public name there says which.
LITERATURE = tuple(
    f"pwsmooth.{module}."
    for module in (
        "analysis.continuation.bifurcations",
        "analysis.sticking.capture",
        "analysis.continuation.following",
        "analysis.continuation.two_parameters",
        "analysis.equilibria.finding",
        "analysis.equilibria.equilibrium",
        "analysis.continuation.equilibria.branch",
        "analysis.continuation.equilibria.hopf",
        "analysis.lyapunov",
        "analysis.global_objects.manifolds",
        "analysis.global_objects.portraits",
        "analysis.sticking.regions",
        "definition.sigmoids",
        "laws.contact",
        "laws.friction",
        "laws.inclusions",
    )
)
CITATION = re.compile(r"\b(1[789]|20)\d\d\b|\beqs?\b|\bet al\b")


def shortcomings(name: str, value: Any) -> list[str]:
    """What the docstring of a public name, and of the methods that it defines, lacks; empty for a complete one."""
    if isinstance(value, types.GenericAlias) or not (inspect.isclass(value) or callable(value)):
        return (
            [] if name.rpartition(".")[2] in _data_described() else [f"{name}: data without a comment `#: ...`"]
        )
    missing = [*_lacking(value), *_example(value), *_source(name, value)]
    if inspect.isclass(value):
        for member, method in members(value).items():
            if inspect.getdoc(getattr(value, member)) is None:
                missing.append(f".{member}: no docstring")
            elif _own_doc(method):
                missing += [
                    f".{member}: {text}" for text in _lacking(_function(method), property_=_is_property(method))
                ]
    return [f"{name}{'' if text.startswith('.') else ': '}{text}" for text in missing]


def every_shortcoming() -> list[str]:
    """Of all public names."""
    return [text for name, value in public_names().items() for text in shortcomings(name, value)]


@functools.cache
def _data_described() -> set[str]:
    """Names of data that a comment `#:` describes where they are defined."""
    own = [
        name for name in sys.modules if name.partition(".")[0] == "pwsmooth" and not name.startswith(INTERNAL)
    ]
    found = (ModuleAnalyzer.for_module(name).find_attr_docs() for name in own)
    return {attribute for docs in found for owner, attribute in docs if not owner}


def _is_property(member: Any) -> bool:
    return isinstance(member, property) or hasattr(member, "attrname")


def _function(member: Any) -> Any:
    """What carries the docstring and the arguments of a member of a class."""
    return next((getattr(member, a) for a in ("fget", "__func__", "func") if hasattr(member, a)), member)


def _own_doc(member: Any) -> bool:
    return bool(_function(member).__doc__)


def _lacking(value: Any, property_: bool = False) -> Iterator[str]:
    doc = get_doc_object(value, config={"show_class_members": False})
    codes = set(NUMPYDOC)
    named = _named_fields(value)
    # An exception takes its text, and what a protocol describes is nobody's constructor.
    plain_class = inspect.isclass(value) and (
        issubclass(value, Exception) or getattr(value, "_is_protocol", False)
    )
    if named is None and not property_ and not plain_class:
        codes |= ARGUMENTS
    if property_:
        codes -= {"RT01"}
    for code, text in validate(doc)["errors"]:
        if code in codes:
            yield text
    entries = [*doc["Parameters"], *doc["Attributes"]]
    if named is not None:
        written = {word.strip(" *") for entry in entries for word in entry.name.split(",")}
        for field in named:
            if field not in written:
                yield f"field `{field}` is not described under Parameters or Attributes"
    given = [*doc["Returns"], *doc["Yields"]]
    for entry in [*entries, *given]:
        label = entry.name or entry.type
        text = entry.type + " " + " ".join(entry.desc)
        # The unit stands behind the type; of a result it may stand in the sentence, which has no other letters alone.
        where_unit = _after_comma(entry.type) + (" " + " ".join(entry.desc) if entry in given else "")
        if ARRAY.search(entry.type) and not SHAPE.search(text):
            yield f"`{label}` is an array without a shape"
        if QUANTITY.search(entry.type) and not (WORDS.search(text) or SYMBOLS.search(where_unit)):
            yield f"`{label}` is a quantity without a unit ('dimensionless' is one)"
    if _raises(value) and not doc["Raises"]:
        yield "it raises, and has no section Raises"


def _after_comma(text: str) -> str:
    """`float, N/m` -> ` N/m`: the type itself is no unit."""
    return text.partition(",")[2]


def _named_fields(value: Any) -> list[str] | None:
    """Names that a class has as data; None where its signature is what counts."""
    if not inspect.isclass(value):
        return None
    if issubclass(value, enum.Enum):
        return [member.name for member in value]
    if dataclasses.is_dataclass(value):
        return [f.name for f in dataclasses.fields(value) if not f.name.startswith("_")]
    return list(value._fields) if hasattr(value, "_fields") else None


def _raises(value: Any) -> bool:
    """Whether its own body raises, beyond the checks at the door, of which the package's docstring speaks."""
    for function in _bodies(value):
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Raise)
                and node.exc is not None
                and "NotImplemented" not in ast.dump(node.exc)
            ):
                return True
    return False


def _bodies(value: Any) -> list[Callable[..., Any]]:
    if not inspect.isclass(value):
        return [value] if inspect.isfunction(value) else []
    made_by = (vars(value).get(name) for name in ("__new__", "__init__", "__post_init__", "check"))
    functions = [getattr(f, "__func__", f) for f in made_by if f is not None]
    # What dataclass and NamedTuple write has no source.
    return [f for f in functions if inspect.isfunction(f) and f.__code__.co_filename == inspect.getfile(value)]


def _example(value: Any) -> Iterator[str]:
    if ">>>" not in "\n".join(get_doc_object(value, config={"show_class_members": False})["Examples"]):
        yield "no example"


def _source(name: str, value: Any) -> Iterator[str]:
    """Publications and derivations stand in a paragraph `Source: ...` of the Notes, which says nothing else."""
    doc = get_doc_object(value, config={"show_class_members": False})
    notes = re.split(r"\n\s*\n", "\n".join(doc["Notes"]))
    sources = [text for text in notes if re.match(r"Sources?: \S", text)]
    home = f"{getattr(value, '__module__', '')}."
    if home.startswith(LITERATURE) and not sources:
        yield "no source: it computes what is in the literature; Notes need a paragraph `Source: ...`"
    others = [
        " ".join([*doc["Summary"], *doc["Extended Summary"]]),
        *(text for text in notes if text not in sources),
    ]
    if any(CITATION.search(text) for text in others):
        yield "it cites outside of a paragraph `Source: ...` of its Notes"
    if any("defined here" in text for text in sources):
        yield "a source that is none: what is defined here needs no paragraph `Source: ...`"


if __name__ == "__main__":
    found = every_shortcoming()
    print("\n".join(found))
    raise SystemExit(bool(found))
