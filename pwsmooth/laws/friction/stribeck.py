"""The Stribeck curve that several laws share: g(v) = F_c + (F_s - F_c) exp(-|v/v_s|^2)."""

import sympy as sp


def stribeck(v, p):
    """g(v) of the parameters F_c, F_s, v_s: even and smooth, so that v = 0 is no surface of it."""
    return p.F_c + (p.F_s - p.F_c) * sp.exp(-((v / p.v_s) ** 2))


def check_stribeck(law):
    """Static friction is no smaller than kinetic friction."""
    if law.F_s < law.F_c:
        raise ValueError(
            f"`F_s` of {type(law).__name__} is {law.F_s:g}, below `F_c` = {law.F_c:g}; static friction is at "
            "least the kinetic one."
        )
