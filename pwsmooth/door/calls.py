"""Calls that do not fit the signature of what is called, in words: the wrong name, and the one that was meant.

    sweep(system, start=...)  ->  "sweep() has no argument `start`; did you mean `x0`?"

Chain: Python's own TypeError -> **misfit** -> checks.door, which every public call passes.
"""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

# Options of solve() that a tool passes on to its runs.
STEPS = ("rtol", "atol", "order", "max_step", "max_steps")
RUNS = (*STEPS, "method", "max_seconds", "strict")  # of a map: to all that it looks for
POINTS = (*STEPS, "method", "parameters")  # of compiled orbits
SWEEPS = (*POINTS, "max_seconds")  # of sweep() itself
KEPT = ("t_eval", "dense_output", "by", "noise")
SOLVE = (*RUNS, *KEPT, "parameters", "local", "record", "threads")  # all
# Names of one thing, here and in other packages.
_ALIKE = (
    ("x0", "start", "y0", "u0", "initial_state", "initial_values"),
    ("t_span", "span", "tspan", "times"),
    ("t_eval", "times", "saveat", "t"),
    ("parameters", "params", "args", "values"),
    ("max_step", "longest_step", "hmax", "dtmax", "dt"),
    ("max_seconds", "timeout", "budget"),
    ("by", "with_respect_to", "wrt", "over", "free"),
    ("seen", "period", "section", "direction", "phase", "symmetry"),
    ("over", "parameter", "range", "ranges", "to"),
    ("steps", "step", "longest_step", "shortest_step"),
    ("work", "executor", "workers", "chunk", "store", "progress"),
    ("rtol", "reltol"),
    ("atol", "abstol"),
    ("method", "solver", "algorithm"),
    ("restitution", "e"),
)
_REMEDIES = {  # of options of solve() that a tool cannot pass on
    "parameters": "give `system.with_parameters({...})` as the system.",
    "t_eval": "it chooses its own times; leave it out.",
    "dense_output": "it chooses what its runs keep; leave it out.",
    "by": "it chooses what it differentiates by; leave it out.",
    "noise": "it is for motions without noise; leave it out.",
    "record": "its runs keep their steps; leave it out.",
    "local": "its runs are those of the whole system; leave it out.",
    "threads": "its runs are those of the whole system; leave it out.",
    "strict": "it reads the ambiguities of its runs itself; leave it out.",
}


def closest(name: str, known: Iterable[str]) -> str:
    """The name that was meant, of those that are known; empty if none is near."""
    folded = {_folded(k): k for k in reversed(list(known))}
    asked = _folded(name)
    if asked in folded:
        return folded[asked]
    for names in _ALIKE:
        if name in names:
            for other in names:
                if other in folded.values():
                    return other
    if near := difflib.get_close_matches(asked, folded, n=1, cutoff=0.6):
        return folded[near[0]]
    starts = [
        k for k in folded if min(len(k), len(asked)) >= 3 and (k.startswith(asked) or asked.startswith(k))
    ]
    return folded[starts[0]] if starts else ""


def _folded(name: str) -> str:
    return name.replace("_", "").replace("-", "").lower()


def hint(name: Any, known: Iterable[Any]) -> str:
    """A last sentence, " Did you mean 'x'?"; empty where no known name is near."""
    asked = getattr(name, "name", name)  # of a Symbol
    near = closest(asked, map(str, known)) if isinstance(asked, str) else ""
    return f" Did you mean {near!r}?" if near else ""


def symbols_hint(error: Exception) -> str:
    """Where SymPy or numpy refused a formula: what to write instead; empty for any other error."""
    said = str(error)
    if "Cannot convert expression to float" in said or "convert complex to float" in said:
        return " In formulas take sympy's functions, such as sympy.sin(x), not those of math."
    if found := re.search(r"has no callable (\w+) method", said):
        return f" In formulas take sympy's functions, such as sympy.{found[1]}(x), not those of numpy."
    if "truth value of Relational" in said:
        return (
            " A condition on a symbol has no truth value yet: in formulas take sympy.sign, Max, Min and Piecewise, not "
            "those of numpy, and not Python's if, max and min."
        )
    return ""


def misfit(
    function: Callable[..., Any],
    args: tuple[Any, ...],
    kwargs: Mapping[str, Any],
    known: Collection[str] | None = None,
) -> TypeError | None:
    """What does not fit a signature, as the error to raise; None where all does.

    `known` are all names that a function with ``**options`` takes.
    """
    all_parameters = list(inspect.signature(function).parameters.values())
    bound = bool(all_parameters) and all_parameters[0].name in ("self", "cls") and "." in function.__qualname__
    parameters = all_parameters[bound:]
    owner, args = args[:bound], args[bound:]
    who = _called(function, owner)
    by_name = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    by_place = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    kinds = {p.kind for p in parameters}
    names = [*by_name, *sorted(set(known or ()) - set(by_name))]
    if inspect.Parameter.VAR_KEYWORD not in kinds or known is not None:
        for name in kwargs:
            if name not in names:
                return TypeError(_unknown(who, name, names, [n for n in by_name if n not in kwargs]))
    if len(args) > len(by_place) and inspect.Parameter.VAR_POSITIONAL not in kinds:
        places = f"takes {len(by_place)} arguments without a name ({', '.join(by_place)})"
        places = places if by_place else "takes its arguments by name"
        rest = [n for n in by_name if n not in by_place and n not in kwargs]
        advice = f"give the others by name, such as `{rest[0]}=...`" if rest else "leave the others out"
        return TypeError(f"{who}() {places}, and got {len(args)} without one; {advice}.")
    for name in by_place[: len(args)]:
        if name in kwargs:
            return TypeError(f"{who}() gets `{name}` twice, by its place and by its name; give it once.")
    placed = set(by_place[: len(args)])
    missing = [p for p in parameters if p.name in {*by_name, *by_place} and p.default is p.empty]
    missing = [p for p in missing if p.name not in placed and p.name not in kwargs]
    if missing:
        said = " and ".join(f"`{p.name}`{_kind(function, owner, p.name)}" for p in missing)
        return TypeError(f"{who}() needs {said}; give {', '.join(f'{p.name}=...' for p in missing)}")
    return None


def remedy(name: str, known: Collection[str]) -> str:
    """What to do instead of giving an option that does not exist there."""
    return _REMEDIES.get(name) or f"it has {', '.join(known)}."


def _unknown(who: str, name: str, names: list[str], free: list[str]) -> str:
    if name in _REMEDIES:
        return f"{who}() has no argument `{name}`: {_REMEDIES[name]}"
    near = closest(name, free) or closest(name, names)
    if near:
        return f"{who}() has no argument `{name}`; did you mean `{near}`?"
    return f"{who}() has no argument `{name}`; " + (f"it has {', '.join(names)}." if names else "it has none.")


def _called(function: Callable[..., Any], owner: tuple[Any, ...]) -> str:
    """The name by which a user calls it: of a constructor that of the class."""
    if not owner:
        return function.__qualname__.rpartition("<locals>.")[2]
    cls = owner[0] if isinstance(owner[0], type) else type(owner[0])
    return (
        cls.__name__
        if function.__name__ in ("__init__", "__new__", "__call__")
        else f"{cls.__name__}.{function.__name__}"
    )


def _kind(function: Callable[..., Any], owner: tuple[Any, ...], name: str) -> str:
    """What an argument is, from the docstring: " (Kicks or Diffusion)"."""
    constructor = function.__name__ in ("__init__", "__new__") and owner
    text = (
        (owner[0] if isinstance(owner[0], type) else type(owner[0])).__doc__
        if constructor
        else function.__doc__
    )
    found = re.search(rf"^ *(?:\w+, )*{re.escape(name)}(?:, \w+)* : (.+)$", text or "", re.MULTILINE)
    return f" ({found[1]})" if found else ""
