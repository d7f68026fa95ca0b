"""What results and systems show of themselves: a title and rows, as short text and as a table in a notebook.

`Described` makes both of one method; the rows of a System are here, those of others beside what they describe.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import sympy as sp
from sympy.printing.latex import LatexPrinter

SHOWN = 12  # entries of a list; families can be long
LONGEST = 160  # characters of an entry: what is longer nobody reads
_FILIPPOV = [
    "filippov: on a surface the convex combination of both sides, in place of terms nonlinear in its switch"
]


class Formula(NamedTuple):
    """An equation: as text, as LaTeX, and what is said of it in words."""

    text: str
    latex: str
    note: str = ""


Rows = Iterable[tuple[str, Sequence[Any]]]  # (heading, entries), each a str or a Formula


class Described:
    """A short `repr` and a table in notebooks, from `_described`."""

    def _described(self) -> tuple[str, Rows]:
        """Title and rows; rows without entries are left out."""
        raise NotImplementedError

    def __repr__(self) -> str:
        title, rows = self._described()
        told = [(heading, entries) for heading, entries in rows if entries]
        width = max((len(heading) for heading, _ in told), default=0)
        lines = [title]
        for heading, entries in told:
            for entry in some(entries):
                text = cut(entry.text) + entry.note if isinstance(entry, Formula) else cut(entry)
                lines.append(f"  {heading:<{width}} {text}".rstrip())
                heading = ""
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        title, rows = self._described()
        left = "style='text-align:left;vertical-align:top'"
        body = "".join(
            f"<tr><th {left}>{escape(heading)}</th><td {left}>{'<br>'.join(map(_html, some(entries)))}</td></tr>"
            for heading, entries in rows
            if entries
        )
        return f"<table><caption {left}>{escape(title)}</caption>{body}</table>"


def _html(entry: Any) -> str:
    if not isinstance(entry, Formula):
        return escape(cut(entry))
    if len(entry.text) > LONGEST:
        return f"<code>{escape(cut(entry.text))}</code>{escape(entry.note)}"
    # Notebooks look for formulas everywhere, pages of Sphinx in this class.
    return rf"<span class='math'>\({escape(entry.latex)}\)</span>{escape(entry.note)}"


def cut(text: str) -> str:
    """A text on one line, without its middle where it is long."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 40]} ... {text[-30:]}"


def some(entries: Sequence[Any]) -> list[Any]:
    """The first entries of a long list, and how many there are more."""
    if len(entries) <= SHOWN + 1:
        return list(entries)
    return [*entries[:SHOWN], f"... and {len(entries) - SHOWN} more"]


def listed(entries: Sequence[str]) -> list[str]:
    """Short entries in one line, for a row, as many as it holds; nothing for none."""
    shown = list(entries[:1])
    while len(shown) < len(entries) and len(", ".join(shown)) + len(entries[len(shown)]) < LONGEST - 20:
        shown.append(entries[len(shown)])
    more = [f"... and {len(entries) - len(shown)} more"] * (len(shown) < len(entries))
    return [", ".join([*shown, *more])] if shown else []


def values(names: Iterable[Any], numbers: Iterable[float]) -> list[str]:
    """A row of names with their values."""
    return listed([f"{name} = {value:.9g}" for name, value in zip(names, numbers)])


def number(value: complex) -> str:
    """Six digits of a number that may be complex."""
    return f"{value.real:.6g}" if value.imag == 0 else f"{value:.6g}"


class _Latex(LatexPrinter):
    """As sympy sets an expression, with sums and neighbours of families."""

    def _print_MemberSum(self, e: Any) -> str:
        return rf"\sum_i {self.parenthesize(e.args[0], 50)}"

    def _print_Symbol(self, expr: Any, style: str = "plain") -> str:
        if not expr.name.isidentifier():  # sgn(x - 2) is the name of a switch
            return rf"\text{{{expr.name}}}"
        greek = re.sub(r"^lam(?=_|\d|$)", "lambda", expr.name)
        return super()._print_Symbol(sp.Symbol(greek), style)

    def _print_Member(self, e: Any) -> str:
        shift = f"{e.offset:+d}" if e.offset else ""
        if e.links is not None:
            return rf"{{{self._print_Symbol(e)}}}_{{i({e.offset})}}"
        return "i" if e.name == "i" and e.is_integer else rf"{{{self._print_Symbol(e)}}}_{{i{shift}}}"


def formula(text: str, *parts: Any, note: str = "") -> Formula:
    """A Formula from its text and its LaTeX in pieces, of which expressions are set."""
    long = len(text) > LONGEST  # not set, which would take longer than all else
    return Formula(text, "" if long else " ".join(p if isinstance(p, str) else _set(p) for p in parts), note)


def _set(e: Any) -> str:
    return _Latex().doprint(e)


class DescribedSystem(Described):
    """What a System shows."""

    def _described(self):
        system: Any = self
        model = system.model
        # A family in one line: as it was written.
        element = None if system._view else system._element
        definition = element.definition if element else system.definition
        if element and model.families:
            model = model.families.template.model
        working = {m.name for u in system._controls for m in u._memories}
        # A hidden term on a surface that slides has no template.
        hidden = () if element else system.hidden_terms
        gone = system._view.gone if system._view else {}
        classes = {m.symbol.name: f"   ({m.regularity})" for m in model.multipliers if m.kind == "switch"}
        slaved = {x: f"   ({why})" for x, why in gone.items() if why}
        rows = {
            "rates": [
                formula(f"{x}' = {e}", rf"\dot{{{_set(x)}}} =", e, note=slaved.get(x, "")) for x, e in definition.rates
            ],
            "algebraic": [
                formula(f"{a.unknown}: {a.residual} = 0", a.unknown, ":", a.residual, "= 0")
                for a in definition.algebraic
            ],
            "switches": [
                formula(f"{s} = sign({s.surface})", s, r"= \operatorname{sign}\left(", s.surface, r"\right)",
                        note=classes.get(s.name, ""))
                for s in definition.switches
            ],
            "discs": [
                formula(
                    f"{d.name} = h/|h|, h = {d.surfaces}", sp.Symbol(d.name), r"= h/|h|,\; h =", sp.Tuple(*d.surfaces)
                )
                for d in definition.discs
            ],
            "hidden terms": [formula(str(term), term, note=f"   in {where}'") for where, _, term in hidden],
            "contacts": [
                formula(f"0 <= {R.gap}, {R} >= 0", r"0 \leq", R.gap, r"\;\perp\;", R, r"\geq 0",
                        note=f", restitution {sp.sstr(R.restitution, full_prec=False)}")
                for R in definition.contacts
            ],
            "memories": listed([
                f"{m}, at first {m.initial:g}" for m in system.initial_memory if m.name not in working
            ]),
            "events": [_event(spec, event) for spec, event in zip(model.events, definition.events)],
            "controls": [u._words for u in definition.controls],
            "drives": [f"{u}: {drive!r}" for u, drive in system._arguments[-1].items()],
            "watched": [f"{e.name} at {e.surface} = 0   ({e.singular})" for e in model.events if e.singular],
            "outputs": [formula(f"{name} = {e}", rf"\text{{{name}}} =", e) for name, e in definition.outputs],
            "parameters": listed([f"{p} = {v:g}" for p, v in system.parameters.items()]),
            "convention": _FILIPPOV if system._convention == "filippov" else [],
            "view": [*([system._view.title] if system._view else []), *system._notes],
        }  # fmt: skip
        return (
            f"System with states {', '.join(listed([str(x) for x in system.states if x.name not in working]))}",
            rows.items(),
        )


def _event(spec, event):
    if event.surface is not None:
        instant = f"{event.surface} = 0" + {0: "", 1: ", rising", -1: ", falling"}[event.direction]
    else:
        instant = f"every {event.every}" if event.every is not None else f"at {', '.join(map(str, event.at))}"
    effect = ", ".join(f"{key} := {value}" for key, value in event.update)
    guard = "" if event.when is sp.true else f" if {event.when}"
    stop = ", stops" if event.terminal else ""
    if event.together:
        stop += f", beside others {event.together}"
    return f"{spec.name}: {instant}{guard}" + (f": {effect}" if effect else "") + stop
