"""The ladder of friction laws under one law, and how each gets its parameters from it.

    Coulomb -> static + kinetic -> Stribeck curve -> Dahl -> LuGre -> elastoplastic -> XKY -> Maxwell slip -> GMS
            -> multistate XKY

Matching, from the richest law's own steady curve s(v) and elements, at the typical speed V of its own run:
level F_c = s(V);  static level F_s = s(0+);  stiffness = slope of the virgin curve at 0;  micro-damping = sum of the
elements';  elastic range = deflection at which the first element yields;  C = F_c/tau_d.
Chain: laws -> rungs.py -> **friction** -> catalogue.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np

from ...door import checks
from ...laws import Law
from ...laws import friction as laws
from ...scenes import Scene
from .rungs import Observable, Rung, Setting, top_rung

NAMES = {  # poorest first
    "Coulomb": "Coulomb",
    "StaticKinetic": "static + kinetic",
    "StribeckFriction": "Stribeck curve",
    "Dahl": "Dahl",
    "LuGre": "LuGre",
    "Elastoplastic": "elastoplastic",
    "XKY": "XKY",
    "MaxwellSlip": "Maxwell slip",
    "GMS": "GMS",
    "MultistateXKY": "multistate XKY",
}
ORDER = tuple(NAMES)


class _Richest:
    """What poorer laws take from the richest one."""

    def __init__(self, law: Law, speed: float) -> None:
        def each(value):
            return np.broadcast_to(np.atleast_1d(value), (law.elements,)).astype(float)

        values = law.values
        self.level = abs(float(law.steady_force(speed)))
        self.typical = f"the steady force at the slip speed {speed:.3g}"
        self.F_c, self.v_s = values.get("F_c", self.level), values.get("v_s")
        self.F_s = values.get("F_s", max(self.level, self.F_c))
        self.curve = dict(F_c=self.F_c, F_s=self.F_s, v_s=self.v_s, sigma2=values.get("sigma2", 0.0))
        self.tau_d = values.get("tau_d")
        kappa = values.get("kappa", values.get("sigma0"))
        self.kappa = self.stiffness = None
        if kappa is not None:
            self.kappa = each(kappa)
            self.stiffness = float(self.kappa.sum())
        self.sigma = each(values.get("sigma", values.get("sigma1", 0.0)))
        self.damping = float(self.sigma.sum())
        self.share = each(values.get("share", 1.0))


def _each(values):
    return tuple(values.tolist())


def _Coulomb(r):
    return laws.Coulomb(F_c=r.level), f"level F_c = {r.level:.5g}, {r.typical}"


def _StaticKinetic(r):
    return laws.StaticKinetic(F_c=r.level, F_s=r.F_s), (
        f"kinetic level {r.level:.5g}, {r.typical}; static level {r.F_s:.5g}, that at rest"
    )


def _StribeckFriction(r):
    return laws.StribeckFriction(**r.curve), "the whole steady curve"


def _Dahl(r):
    return laws.Dahl(sigma0=r.stiffness, F_c=r.level), (
        f"stiffness {r.stiffness:.5g} of the virgin curve at 0; level {r.level:.5g}, {r.typical}"
    )


def _LuGre(r):
    return laws.LuGre(sigma0=r.stiffness, sigma1=r.damping, **r.curve), (
        f"the whole steady curve; stiffness {r.stiffness:.5g} of the virgin curve at 0; damping {r.damping:.5g}, the "
        "sum of the elements'"
    )


def _Elastoplastic(r):
    # Where the first element yields at the level F_s, kept below the bound F_c/stiffness of the law.
    first = float(np.min(r.share * r.F_s / r.kappa))
    z_ba = min(first, 0.999 * r.F_c / r.stiffness)
    return laws.Elastoplastic(sigma0=r.stiffness, sigma1=r.damping, z_ba=z_ba, **r.curve), (
        f"as LuGre; elastic up to {z_ba:.3g}, where the first element yields"
    )


def _XKY(r):
    return laws.XKY(kappa=r.stiffness, sigma=r.damping, **r.curve), (
        f"the whole steady curve; stiffness {r.stiffness:.5g} and damping {r.damping:.5g}, the sums of the elements'"
    )


def _MaxwellSlip(r):
    return laws.MaxwellSlip(kappa=_each(r.kappa), strength=_each(r.share * r.level)), (
        f"the elements' stiffnesses; strengths their shares of {r.level:.5g}, {r.typical}"
    )


def _GMS(r):
    C = r.F_c / r.tau_d
    law = laws.GMS(C=C, kappa=_each(r.kappa), share=_each(r.share), sigma=_each(r.sigma), **r.curve)
    return law, f"all parameters; C = F_c/tau_d = {C:.4g}"


# What a law needs of the richest one, besides a steady curve.
_NEEDS = {
    "StribeckFriction": ("v_s",),
    "Dahl": ("kappa",),
    "LuGre": ("kappa", "v_s"),
    "Elastoplastic": ("kappa", "v_s"),
    "XKY": ("kappa", "v_s"),
    "MaxwellSlip": ("kappa",),
    "GMS": ("kappa", "v_s", "tau_d"),
}


@checks.door()
def friction_rungs(richest: Law, build: Callable[[Law], Scene], speed: float) -> list[Rung]:
    """The rungs below a friction law, poorest first, matched to it.

    Parameters
    ----------
    richest : Law
        A law with a steady curve.
    speed : float, in the velocity unit of the law
        Typical speed of sliding, > 0, at which laws with one level take it.

    Returns
    -------
    list of Rung
        Without the richest itself.

    Raises
    ------
    ValueError
        A speed that is not positive, or a law that stands on no rung.

    Notes
    -----
    Levels, stiffness and damping are those of the richest law's steady and virgin curves.

    >>> [rung.name for rung in friction_rungs(LuGre(), block_on_belt, speed=0.1)]
    ['Coulomb', 'static + kinetic', 'Stribeck curve', 'Dahl']
    """
    name = type(richest).__name__
    if name not in ORDER:
        raise ValueError(
            f"`richest` is {name}, which stands on no rung of friction; choose one of {', '.join(ORDER)}."
        )
    if not speed > 0:
        raise ValueError(f"`speed` is {speed!r}; give the typical speed of sliding, > 0.")
    about = _Richest(richest, speed)
    rungs: list[Rung] = []
    for kind in ORDER[: ORDER.index(name)]:
        missing = [what for what in _NEEDS.get(kind, ()) if getattr(about, what) is None]
        # One element needs no laws of several, and a steady curve that does not fall has no static excess.
        alone = kind in ("MaxwellSlip", "GMS") and richest.elements == 1
        if missing or alone or (kind == "StaticKinetic" and not about.F_s > about.level):
            continue
        law, words = globals()[f"_{kind}"](about)
        rungs.append(Rung(NAMES[kind], functools.partial(build, law), words))
    return rungs


@checks.door()
def friction_setting(
    name: str, title: str, richest: Law, build: Callable[[Law], Scene], observables: Sequence[Observable],
    *, window: tuple[float, float], velocity: str = "v", points: int = 8001,
) -> Setting:  # fmt: skip
    """A setting whose rungs are friction laws in one scene.

    Parameters
    ----------
    richest : Law
        The most complete one, with a steady curve.
    window : (float, float), s
        Span that the observables look at, and over which the typical speed is the root mean square of the slip.
    velocity : str
        Name of the slip velocity in the scene.

    Returns
    -------
    Setting
        For `ladder`.

    >>> belt = friction_setting("slow belt", "a slow belt", XKY(), lambda law: block_on_belt(law, pull=0.05),
    ...                         [peak("top speed", "v", "m/s")], window=(20.0, 35.0))
    >>> belt.richest.name, belt.observable("top speed").unit
    ('XKY', 'm/s')
    """

    def coarser(motion):
        speeds = motion(np.linspace(*window, points), velocity)
        return friction_rungs(richest, build, float(np.sqrt(np.mean(speeds**2))))

    top = top_rung(NAMES, richest, build)
    return Setting(name, title, top, coarser, tuple(observables), window, points)
