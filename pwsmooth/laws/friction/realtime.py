"""Real-time forms: a law's one-step update as a compiled function, with the range of steps for which it is stable.

Chain: law -> stepping.py (the closed forms) -> **realtime** (numbers, compiled).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...door import checks
from ..contract import Law
from . import stepping
from .coulomb import Coulomb, StribeckFriction
from .dahl import Dahl
from .lugre import LuGre
from .maxwell_slip import MaxwellSlip
from .xky import XKY, MultistateXKY

__all__ = ["RealTime", "real_time"]

# For which steps each kind of update is stable.
_STABLE = {
    "elements": "every h > 0: |f| <= g, and without drive the energy m v^2/2 + sum kappa_i a_i^2/2 never grows "
    "(backward Euler of a passive law; the Stribeck curve is taken at the old velocity)",
    "bristle": "every h > 0 at a given velocity: |z| <= max(|z_0|, F_s/sigma0); with a mass bounded for every h > 0 in "
    "tests, accurate for h below sqrt(m/sigma0)",
    "switch": "every h > 0: without drive |v| never grows, and rest is exact",
}


@checks.door()
@dataclass
class RealTime:
    """The one-step update of a law.

    Attributes
    ----------
    given : callable
        (p, e, state, v, h) -> f: force at the end of a step in which the velocity is v; overwrites `state`. Compiled;
        callable from other compiled code.
    coupled : callable
        (p, e, state, v, u, m, h) -> v: velocity of a mass m after a step under the force u.
    p : ndarray, shape (np,)
        Parameters, in the units of the law.
    e : ndarray, shape (3, n)
        Elements (stiffness, micro-damping, share or strength), in the units of the law.
    state : ndarray, shape (ns,)
        Internal state, in the units of the law; `force` and `move` advance it.
    stable : str
        For which steps the update is stable.

    Source: derived here, backward Euler in closed form; the projection in it is the theorem Sgn -> sat of Kikuuwe and
    Xiong (inclusions.py).

    >>> block = real_time(Coulomb(F_c=1.0))
    >>> round(block.move(v=0.5, u=0.0, m=1.0, h=0.1), 9), block.move(v=0.05, u=0.0, m=1.0, h=0.1)
    (0.4, 0.0)
    """

    given: Callable[..., float]
    coupled: Callable[..., float]
    p: np.ndarray
    e: np.ndarray
    state: np.ndarray
    stable: str

    def force(self, v: float, h: float) -> float:
        """Advance by a step h at the velocity v.

        Parameters
        ----------
        v : float, m/s
            Velocity during the step.

        Returns
        -------
        float
            Friction force at the end of the step, N.
        """
        return self.given(self.p, self.e, self.state, v, h)

    def move(self, v: float, u: float, m: float, h: float) -> float:
        """Advance a mass at velocity v under a force by a step.

        Parameters
        ----------
        u : float, N
            Force besides friction.
        m : float, kg
            Mass.

        Returns
        -------
        float
            Velocity at the end, m/s.
        """
        return self.coupled(self.p, self.e, self.state, v, u, m, h)

    def copy(self) -> RealTime:
        """Another one, with its own state.

        Returns
        -------
        RealTime
            It shares parameters and compiled functions.
        """
        return replace(self, state=self.state.copy())


_HELPERS: list[Any] = []


@functools.cache
def _compiled(kind: str) -> tuple[Callable[..., float], Callable[..., float]]:
    """The two functions of a kind, compiled: nothing in them raises."""
    from numba import njit
    from numba.extending import register_jitable

    if not _HELPERS:
        _HELPERS.extend(register_jitable(getattr(stepping, f)) for f in ("strength", "lagged", "carried"))
    compiled: Any = njit(nogil=True, error_model="numpy")
    return compiled(getattr(stepping, f"{kind}_given")), compiled(getattr(stepping, f"{kind}_coupled"))


@checks.door(law=checks.instance(Law, "a friction law"), v=checks.number)
def real_time(law: Law, v: float = 0.0) -> RealTime:
    """The one-step form of a law.

    Parameters
    ----------
    law : Law
        Coulomb, StribeckFriction, Dahl (exponent 1), LuGre, XKY, MultistateXKY or MaxwellSlip.

    Returns
    -------
    RealTime
        The update, with an internal state at rest.

    Raises
    ------
    ValueError
        The law has no update without iteration.

    Source: derived here, backward Euler in closed form; the projection in it is the theorem Sgn -> sat of Kikuuwe and
    Xiong (inclusions.py).

    >>> block = real_time(XKY())
    >>> v = 0.1
    >>> for _ in range(1000):  # a 1 kg block slides to rest in steps of 1 ms
    ...     v = block.move(v, u=0.0, m=1.0, h=1e-3)
    >>> abs(v) < 1e-12
    True
    """
    if isinstance(law, MultistateXKY):
        p = [law.F_c, law.F_s, law.v_s, law.sigma2, law.tau_d]
        return _elements(p, v, np.atleast_1d(law.kappa), law.sigma, law.share)
    if isinstance(law, XKY):
        p = [law.F_c, law.F_s, law.v_s, law.sigma2, 0.0]
        return _elements(p, v, np.atleast_1d(law.kappa), law.sigma, 1.0)
    if isinstance(law, MaxwellSlip):
        return _elements([1.0, 1.0, 1.0, 0.0, 0.0], v, np.atleast_1d(law.kappa), 0.0, law.strength)
    if type(law) is LuGre:  # not what inherits from it
        return _update("bristle", [law.F_c, law.F_s, law.v_s, law.sigma2, law.sigma0, law.sigma1], [0.0])
    if isinstance(law, Dahl) and law.alpha == 1:
        return _update("bristle", [law.F_c, law.F_c, 1.0, 0.0, law.sigma0, 0.0], [0.0])
    if isinstance(law, StribeckFriction):
        return _update("switch", [law.F_c, law.F_s, law.v_s, law.sigma2], [])
    if isinstance(law, Coulomb):
        return _update("switch", [law.F_c, law.F_c, 1.0, law.sigma2], [])
    raise ValueError(
        f"{type(law).__name__} has no one-step update without iteration; Coulomb, StribeckFriction, Dahl (alpha = 1), "
        "LuGre, XKY, MultistateXKY and MaxwellSlip have one."
    )


def _elements(p: Any, v: float, *each: Any) -> RealTime:
    e = np.array(np.broadcast_arrays(*each), float)
    return _update("elements", p, [stepping.strength(p, v), *np.zeros(e.shape[1])], e)


def _update(kind: str, p: Any, state: Any, e: Any = ((), (), ())) -> RealTime:
    return RealTime(
        *_compiled(kind), np.array(p, float), np.array(e, float), np.array(state, float), _STABLE[kind]
    )
