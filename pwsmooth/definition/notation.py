"""Notation that means other notation: mass matrices, impulses, states written as functions of time.

    M(t, x) du/dt = F(t, x)      ->  an algebraic unknown for every rate that its row does not give
    DiracDelta(t - t0) on a rate ->  a jump of that state at t0
    y(t), Derivative(y(t), t)    ->  the state y, and as a key its rate

Chain: primitives.py -> **notation** -> reading.py.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp
from sympy.core.function import AppliedUndef

from ..door import checks
from .primitives import Algebraic, Event


def time_of(time, *mappings):
    """`time`, or the one symbol of which the states are functions where they are written as y(t)."""
    written = [e for pairs in mappings for pair in pairs for e in pair if isinstance(e, sp.Basic)]
    functions = sorted({f for e in written for f in e.atoms(AppliedUndef)}, key=str)
    clocks = {f.args[0] for f in functions if isinstance(f.args[0], sp.Symbol)}
    if time is None and len(clocks) == 1 and clocks.isdisjoint(x for pairs in mappings for x, _ in pairs):
        return clocks.pop()
    if other := [f for f in functions if str(f.args[0]) != str(time)]:
        raise ValueError(
            f"the system contains {other[0]}; what is written as a function is a state at the present time, as y(t) "
            "with time=t."
        )
    return time


def rate_of(key):
    """The state whose rate a key of `rates` names: y, y(t) or Derivative(y(t), t)."""
    if isinstance(key, sp.Derivative) and key.derivative_count == 1:
        key = key.expr
    return checks.named(key)


# ---- mass matrices


def named_rows(rates, forcing):
    """(rates, forcing) of what was given; a column of forces belongs to the states that `rates` lists."""
    if hasattr(rates, "mass_matrix_full"):
        raise TypeError(f"`rates` is a {type(rates).__name__} K; write System.from_mechanics(K).")
    if not isinstance(forcing, sp.MatrixBase):
        return rates, forcing
    states = () if isinstance(rates, Mapping) else checks.several(rates, "`rates`")
    if forcing.shape != (len(states), 1) or any(isinstance(x, (tuple, list)) for x in states):
        raise ValueError(
            f"`forcing` is a matrix of the shape {forcing.shape}, whose rows name no states; give a mapping "
            "forcing=dict(zip(states, F)), or a column and the list of its states in the place of `rates`."
        )
    return (), tuple(zip(states, forcing))


def solved_for_rates(rates, algebraic, mass_matrix, forcing):
    """(rates, algebraic) with the equations M dx/dt = F: an unknown for each rate that stands in several rows.

    A row with one entry gives its rate at once, such as dq/dt = u in the full matrix of a mechanism.
    """
    if mass_matrix is None and forcing is None:
        return rates, algebraic
    if mass_matrix is None or forcing is None:
        raise ValueError("`mass_matrix` and `forcing` belong together: M(t, x) dx/dt = F(t, x); give both.")
    force = {
        rate_of(x): checks.expression(e, f"`forcing` of {x}") for x, e in checks.pairs(forcing, "`forcing`")
    }
    states, forces = list(force), list(force.values())
    n = len(states)
    try:
        M = sp.ImmutableMatrix(mass_matrix)
    except (TypeError, ValueError):
        raise TypeError(
            f"`mass_matrix` is {checks.shown(mass_matrix)}; give a matrix of expressions."
        ) from None
    if M.shape != (n, n):
        raise ValueError(
            f"`mass_matrix` has the shape {M.shape}, and `forcing` {n} states; give one row and one column for each."
        )
    M = M.applyfunc(lambda e: checks.expression(e, "`mass_matrix`"))
    for i in range(n):
        if M[i, i] == 0:
            raise ValueError(
                f"row {i + 1} of `mass_matrix` has no entry in its own column; order the rows of `mass_matrix` and "
                "`forcing` as the states, so that each has its own rate."
            )
    found, residuals = solved_rows(M, forces, [rate_symbol(x) for x in states])
    return (*rates, *zip(states, found)), (*residuals, *algebraic)


def rate_symbol(x):
    """The unknown that is the rate of a state."""
    return sp.Symbol(f"d{getattr(x, 'name', x)}/dt", real=True)


def solved_rows(M, forces, unknowns):
    """(y, algebraic) of M y = F; a row with one entry gives its unknown at once, others as an Algebraic."""
    alone = [M[i, i] != 0 and all(M[i, j] == 0 for j in range(M.cols) if j != i) for i in range(M.rows)]
    y = [forces[i] / M[i, i] if alone[i] else x for i, x in enumerate(unknowns)]
    # They are solved together; each is written with a row in which it stands; a constraint lacks its own.
    rows = list(range(M.rows))
    if any(M[i, i] == 0 for i in rows):
        from scipy.sparse import csr_array  # which the import of the package does without
        from scipy.sparse.csgraph import maximum_bipartite_matching

        stands = csr_array([[int(e != 0) for e in M.row(i)] for i in rows])
        rows = maximum_bipartite_matching(stands, perm_type="row").tolist()
    residuals = [
        Algebraic(x, sp.Add(*(M[rows[j], k] * e for k, e in enumerate(y))) - forces[rows[j]])
        for j, x in enumerate(unknowns)
        if not alone[j]
    ]
    return y, residuals


# ---- impulses


def without_impulses(rates, time):
    """(rates, events): every c*DiracDelta(a*t + b) on a rate as a jump by c/|a| at t = -b/a."""
    jumps: dict[sp.Expr, dict] = {}
    smooth = []
    for x, e in rates:
        for delta in sorted(e.atoms(sp.DiracDelta), key=str) if isinstance(e, sp.Expr) else ():
            instant, slope = _instant(delta, time)
            impulse = sp.Dummy(real=True)
            e = e.xreplace({delta: impulse})
            strength, e = e.diff(impulse), e.xreplace({impulse: sp.S.Zero})
            if impulse in strength.free_symbols:
                raise ValueError(
                    f"the rate of {x} is not linear in {delta}; an impulse stands as a term c*{delta}."
                )
            jump = (strength / sp.Abs(slope)).xreplace({time: instant})
            at = jumps.setdefault(instant, {})
            at[x] = at.get(x, 0) + jump
        smooth.append((x, e))
    for instant, at in jumps.items():
        for x, jump in at.items():
            if moved := [y for y in at if y in jump.free_symbols]:
                raise ValueError(
                    f"the impulse on {x} at t = {instant} is multiplied by {checks.listing(moved)}, which jumps then: "
                    "the product has no value. Give an Event with the values after the impulse."
                )
    events = tuple(
        Event(at=instant, update={x: x + jump for x, jump in at.items()}, name=f"impulse at {instant}")
        for instant, at in jumps.items()
    )
    return tuple(smooth), events


def _instant(delta, time):
    """(t0, a) of DiracDelta(a*(t - t0))."""
    argument, *order = delta.args
    slope = argument.diff(time) if time is not None else sp.S.Zero
    inside = slope.free_symbols | (argument - slope * (time or 0)).expand().free_symbols
    if slope == 0 or time in inside or any(order):
        raise ValueError(
            f"{delta} stands in a rate; an impulse is DiracDelta(t - t0), with time and numbers or parameters in it. "
            "What the state decides is an Event(surface, update=...) or a Unilateral; impulses again and again are an "
            "Event(every=...)."
        )
    return (time - argument / slope).expand(), slope
