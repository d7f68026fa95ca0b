"""Contacts of mechanisms whose accelerations are unknowns: how these follow a reaction.

    A(t, q) a + c + rho(R, lambda) = 0     ->     a = a_0 - B rho,     A a_0 + c = 0,     A B = 1

The free accelerations a_0 and the mobilities B, those columns of A^-1 in whose rows reactions stand, are unknowns in
the place of a. Rates then show reactions, and the friction in their pushes, as those of a body alone do: impacts,
closed contacts and derivatives need nothing else. B does not jump where velocities do.

Source: Brogliato, Nonsmooth Mechanics, 2016, sec. 5.1 (M^-1 in the impact law and in Delassus' matrix).
Chain: reading.py -> **mobilities** -> lowering.py.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from .lowering import Field


def with_mobilities(field: Field) -> Field:
    """The field in which no unknown that rates need follows a reaction; itself where that is so."""
    reactions = {R for R, _, _ in field.contacts}
    rows = {a: r for a, r in field.algebraic if a in _moving(field, reactions)}
    if not rows:
        return field
    A = {(j, i): _coefficient(field, r, i, rows, reactions) for j, r in rows.items() for i in rows}
    nothing, rest = dict.fromkeys(reactions, sp.S.Zero), dict.fromkeys(rows, sp.S.Zero)
    pushes = {}
    for k, r in rows.items():
        terms = [e for e in sp.Add.make_args(r.xreplace(rest)) if not reactions.isdisjoint(e.free_symbols)]
        if terms:
            pushes[k] = sp.Add(*(e - e.xreplace(nothing) for e in terms))
    free = {a: sp.Symbol(f"free {a.name}", real=True) for a in rows}
    unknowns = [(free[a], r.xreplace(nothing | free)) for a, r in rows.items()]
    whole = dict(free)
    for k, push in pushes.items():
        block = _coupled(k, A, rows)
        B = {i: sp.Symbol(f"mobility({i.name}, {k.name})", real=True) for i in block}
        whole |= {i: whole[i] - B[i] * push for i in block}
        unknowns += [(B[j], sp.Add(*(A[j, i] * B[i] for i in block)) - int(j == k)) for j in block]
    others = tuple((a, r) for a, r in field.algebraic if a not in rows)
    taken = {name for name, _ in field.outputs}
    field = replace(
        field,
        algebraic=others,
        outputs=(*field.outputs, *((a.name, a) for a in rows if a.name not in taken)),
    ).map(lambda e: e.xreplace(whole))
    return replace(field, algebraic=(*unknowns, *field.algebraic))


def _moving(field, reactions):
    """The unknowns that follow reactions and that rates need."""
    rows = dict(field.algebraic)
    moved = {a for a, r in rows.items() if not reactions.isdisjoint(r.free_symbols)}
    while more := {a for a, r in rows.items() if a not in moved and not moved.isdisjoint(r.free_symbols)}:
        moved |= more
    needed = rows.keys() & set().union(*(e.free_symbols for e in field.rates))
    while more := rows.keys() & set().union(*(rows[a].free_symbols for a in needed)) - needed:
        needed |= more
    return moved & needed


def _coupled(k, A, rows):
    """The unknowns that stand in one equation with unknown k, or with one that does."""
    block, found = set(), {k}
    while found:
        block |= found
        found = {i for i in rows if i not in block and any(A[i, j] != 0 or A[j, i] != 0 for j in block)}
    return [i for i in rows if i in block]


def _coefficient(field, residual, a, rows, reactions):
    """The factor of unknown a in an equation; refused if an impact would change it."""
    slope = residual.diff(a)
    if not slope.free_symbols.isdisjoint({*rows, *reactions}):
        slope = sp.expand(slope)
    jumping = {*rows, *reactions}
    jumping |= {x for x, rate in zip(field.states, field.rates, strict=True) if jumping & rate.free_symbols}
    turned = [lam for disc in field.discs for lam in disc.components if jumping & disc.square.free_symbols]
    for lam, h in field.switches:
        if not h.free_symbols.isdisjoint({*jumping, *turned}):
            turned.append(lam)
    if found := sorted(slope.free_symbols & {*rows, *reactions, *turned}, key=str):
        raise ValueError(
            f"the reactions {', '.join(sorted(map(str, reactions)))} act through the unknown {a}, whose factor in the "
            f"equation {residual} = 0 depends on {found[0]}: an impact would change it, and its impulse has no law. "
            f"Let {a} stand there as an acceleration does, with a factor of coordinates alone; a friction force may "
            "have the reaction of a contact as its load, but no such unknown."
        )
    return slope
