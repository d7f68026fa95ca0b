"""The Stribeck curve that several laws share: g(v) = F_c + (F_s - F_c) exp(-|v/v_s|^delta)."""

import sympy as sp


def stribeck(v, p):
    """g(v) of the parameters F_c, F_s, v_s; an exponent `delta` that is no 2 needs |v|, a kink at v = 0."""
    exponent = getattr(p, "delta", 2)
    ratio = v / p.v_s if exponent == 2 else sp.Abs(v) / p.v_s
    return p.F_c + (p.F_s - p.F_c) * sp.exp(-(ratio**exponent))


def check_stribeck(law):
    """Static friction is no smaller than kinetic friction."""
    if law.F_s < law.F_c:
        raise ValueError(
            f"`F_s` of {type(law).__name__} is {law.F_s:g}, below `F_c` = {law.F_c:g}; static friction is at "
            "least the kinetic one."
        )
