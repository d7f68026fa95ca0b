"""A periodic orbit: a fixed point of a Poincare map, its multipliers, its runs.

    P(x) = x;     Floquet multipliers: eigenvalues of D P on the section

For the half-period map of a symmetric orbit the multipliers of the whole period are the squares of those of the map,
and -1 is where the symmetry breaks. Of segments the multipliers are those of the product of their matrices.

Chain: sections.py, segments.py, multipliers.py -> **periodic_orbit** -> fixed_points.py, orbits.py.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...door import calls, checks
from ...door.describe import Described, Rows, listed, number, some, values
from ...results.solution import Solution
from ...solving import solve
from ..maps.multipliers import cyclic_multipliers, within_roundings
from ..maps.poincare import Word
from ..maps.sections import Section, Stroboscopic
from ..maps.segments import Segments, Shooting

__all__ = ["PeriodicOrbit"]

_RESTS = 1e-9  # of the size of the states: what moves less rests
_ROUNDED = 1e-14  # of the largest multiplier: smaller ones are roundings
MULTIPLIERS = 1e-9  # to which multipliers are known, with something to spare


@checks.door()
@dataclass(frozen=True, repr=False)
class PeriodicOrbit(Described):
    """A periodic orbit, or the best that Newton's method reached (`success` False, `message` why).

    Attributes
    ----------
    map : Stroboscopic or Section
        The Poincare map of which `x` is a fixed point, with the system and its parameters.
    x : ndarray, shape (n,)
        The point on the section, in the units of the states.
    residual : float, dimensionless
        Largest |P(x) - x|, relative to what the return moves (and to 1e-3 |D P| |x|: what roundings of x grow to
        counts little).
    jacobian : ndarray, shape (n, n)
        D P at x (of the half-period map where `map` has a symmetry), in the units of the states; with segments the
        product of their matrices.
    word : tuple
        Events of one application of the map: (switch, kind, "from to to").
    time : float, in the unit of the model's time
        That one application takes.
    steps : int
        Of Newton's method.
    success : bool
        Whether it converged, and repeats in the period that follows.
    message : str
        In words, with what to try next; also where the orbit is not isolated, or shorter than was asked for.
    degenerate : tuple of str
        Where the map has no derivative at this orbit (grazing, corners).
    segments : Segments or None
        How it was shot over, where deviations grow too much for one piece.
    moves : ndarray, shape (n,)
        From the smallest to the largest value of each state in one application of the map, in the units of the states.
    corner : bool
        Whether it meets two surfaces at one instant and deviations go on differently in either order: then its
        multipliers are those of one order.
    accuracy : float, dimensionless
        To which its multipliers are known.
    integrals : ndarray, shape (k, n), or None
        Gradients of what the motion keeps beside it, first integrals and constraints, in 1 over the units of the
        states: k multipliers are 1 for that, and `stable` leaves them out.

    The orbit of dx/dt = cos t - x has the multiplier exp(-2 pi):

    >>> t, x = sp.symbols("t x", real=True)
    >>> orbit = find_orbit(System({x: sp.cos(t) - x}, time=t), {x: 0}, seen=Strobe(2 * sp.pi))
    >>> print(f"{orbit.x0['x']:.9f} {orbit.multipliers[0].real:.9f} {math.exp(-2 * math.pi):.9f}")
    0.500000000 0.001867443 0.001867443
    """

    map: Stroboscopic | Section
    x: np.ndarray
    residual: float
    jacobian: np.ndarray
    word: Word
    time: float
    steps: int
    success: bool
    message: str
    degenerate: tuple[str, ...] = ()
    segments: Segments | None = None
    moves: np.ndarray | None = None
    corner: bool = False
    accuracy: float = MULTIPLIERS
    integrals: np.ndarray | None = None
    _image: Any = field(default=None, repr=False, compare=False)  # of x, while the orbit is being looked at

    @property
    def system(self) -> Any:
        """The system, with the orbit's parameter values."""
        return self.map.system

    @property
    def symmetric(self) -> bool:
        """Whether it was found as a fixed point of the half-period map."""
        return getattr(self.map, "symmetry", None) is not None

    @property
    def period(self) -> float:
        """Period of the orbit, in the unit of the model's time."""
        return 2 * self.time if self.symmetric else self.time

    @functools.cached_property
    def map_multipliers(self) -> np.ndarray:
        """Eigenvalues of D P on the section, largest first; of the half-period map for a symmetric orbit."""
        if not np.isfinite(self.jacobian).all():
            return np.full(len(self.x), np.nan, complex)
        free = self._free_multipliers
        kept = 0 if self.integrals is None else len(self.integrals)
        values = np.append(free, np.ones(kept))
        return values[np.argsort(-np.abs(values), kind="stable")]

    @functools.cached_property
    def _free_multipliers(self) -> np.ndarray:
        """Those of deviations along which nothing is changed that the motion keeps, largest first."""
        matrices = self._matrices
        if len(matrices) > 1:
            return cyclic_multipliers(matrices)
        (matrix,) = matrices
        if self.integrals is not None:
            rows = self.integrals * self.map.unit @ self._basis
            free = np.linalg.svd(rows)[2][len(rows) :].T
            matrix = free.T @ matrix @ free
        values = np.linalg.eigvals(matrix).astype(complex)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def _basis(self) -> np.ndarray:
        """Directions in which multipliers are looked for, (n, k), in units of the states."""
        if not isinstance(self.map, Section):
            return np.eye(len(self.x))
        # Tangent to the section: the direction across it would only add an eigenvalue 0.
        return np.linalg.svd((self.map.gradient(self.x) * self.map.unit)[None])[2][1:].T

    @property
    def _matrices(self) -> list[np.ndarray]:
        """Whose product has the multipliers: of the segments, or D P."""
        unit = self.map.unit  # one that all states have changes no bit
        matrices = [self.jacobian] if self.segments is None else list(self.segments.matrices)
        matrices = [matrix * unit / unit[:, None] for matrix in matrices]
        if isinstance(self.map, Section):
            basis = self._basis
            matrices[0] = matrices[0] @ basis
            matrices[-1] = basis.T @ matrices[-1]
        return matrices

    def _at_rounding(self, root: int) -> bool:
        """Whether the map has the multiplier 1 or -1 but for roundings, as orbits at rest have one everywhere."""
        return within_roundings(self._matrices, root)

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers over `period`, largest first, without the 1 of an autonomous flow."""
        return self.map_multipliers**2 if self.symmetric else self.map_multipliers

    @property
    def exponents(self) -> np.ndarray:
        """Lyapunov exponents log|m|/period, largest first, in units of 1/time; -inf where the orbit sticks or lands.

        Without the 0 along an autonomous flow. A multiplier below its rounding counts as 0.
        """
        sizes = np.abs(self.multipliers)
        sizes[sizes < _ROUNDED * max(1.0, sizes.max(initial=0.0))] = 0.0
        with np.errstate(divide="ignore"):
            return np.log(sizes) / self.period

    @property
    def stable(self) -> bool:
        """Whether it is an orbit whose multipliers lie inside the unit circle, by more than their own rounding."""
        free = self._free_multipliers if self.integrals is not None else self.map_multipliers
        free = free**2 if self.symmetric else free
        known = self.success and not self.corner and (self.integrals is None or len(free) > 0)
        return known and bool(np.all(np.abs(free) < 1 - self.accuracy))

    @property
    def isolated(self) -> bool:
        """Whether no multiplier of the map is 1: where one is, orbits beside it may be periodic too."""
        return not np.any(np.abs(self.map_multipliers - 1) <= self.accuracy)

    @property
    def rest(self) -> bool:
        """Whether nothing moves along it, as in a stick that holds through the period; none of a section."""
        if (
            self.moves is None
            or isinstance(self.map, Section)
            or any("reset" in kind for _, kind, _ in self.word)
        ):
            return False
        return self.success and bool(np.all(self.moves <= _RESTS * (self.map.unit + np.abs(self.x))))

    @functools.cached_property
    def winding(self) -> dict[str, int]:
        """How many turns each state goes in one period that `find_orbit` was told to be an angle, by name."""
        turns = self.map.angles or ()
        if not any(turns):
            return {}
        went = sum(run.x[:, -1] - run.x[:, 0] for run in self.runs())
        names = map(str, self.system.model.states)
        return {name: round(way / turn) for name, way, turn in zip(names, went.tolist(), turns) if turn}

    @property
    def x0(self) -> dict[str, float]:
        """State on the section by name, as `solve` takes it."""
        return {str(s): float(value) for s, value in zip(self.system.model.states, self.x)}

    def after(self, applications: int) -> np.ndarray:
        """The orbit after some periods (returns) of its `count`.

        Parameters
        ----------
        applications : int
            How many, 1 to `count`.

        Returns
        -------
        ndarray, shape (n,)
            On the section, in the units of the states.
        """
        if self.segments is not None:
            firsts = Shooting(self.map, self.segments.cuts).firsts
            return self.segments.nodes[firsts[applications % len(firsts)]]
        return replace(self.map, count=applications).image(self.x).x

    def runs(self, dense_output: bool = False) -> tuple[Solution, ...]:
        """One whole period as it was shot over: a run for each segment, of a symmetric orbit for both halves.

        Parameters
        ----------
        dense_output : bool
            Whether they have it.

        Returns
        -------
        tuple of Solution
            In order of time; of a return map the time of each begins anew.
        """
        if self.segments is None:
            return (self.map._over(self.x, self.period, dense_output),)
        return tuple(run for _, run in self._legs(0, dense_output))

    def _legs(self, periods: int, dense_output: bool = False) -> Iterator[tuple[np.ndarray, Solution]]:
        """The segments of the orbit so many periods later: what each should end at, and its run."""
        assert self.segments is not None
        map_: Any = self.map
        nodes = self.segments.nodes
        legs = Shooting(map_, self.segments.cuts).legs
        halves = [np.eye(len(self.x)), map_.symmetry] if self.symmetric else [np.eye(len(self.x))]
        for half, seen in enumerate(halves):
            moved = half + periods * len(halves) * map_.turns
            targets = [*nodes[1:] @ seen.T, (halves[half - 1] if self.symmetric else seen) @ nodes[0]]
            for x, target, (k, begin, end) in zip(nodes @ seen.T, targets, legs):
                yield target, map_.leg(x, (k + moved, begin, end), () if dense_output else None).runs[0]

    @checks.door((*calls.RUNS, *calls.KEPT), periods=checks.integer(1, 10**9))
    def solution(self, periods: int = 1, **options: Any) -> Solution:
        """The orbit over whole periods.

        Parameters
        ----------
        periods : int
            How many.

        Returns
        -------
        Solution
            With dense output.

        Notes
        -----
        One run, which leaves the orbit as fast as its multipliers say: for those of 1e8 and more take `runs`.
        """
        t0 = self.map.start_time if isinstance(self.map, Stroboscopic) else 0.0
        atol = {} if self.map.scale is None else {"atol": self.map.tolerance}
        chosen = {"rtol": 1e-10, "dense_output": True, **atol, **self.map.options, **options}
        return solve(self.system, (t0, t0 + periods * self.period), list(map(float, self.x)), **chosen)

    def _described(self) -> tuple[str, Rows]:
        unstable = np.any(np.abs(self.multipliers) > 1 + self.accuracy)
        holds = {
            "undecided (a corner)": self.corner, "stable": self.stable, "unstable": unstable, "neutral": self.isolated,
            "not isolated": True,
        }  # fmt: skip
        kind = ("rest, " if self.rest else "symmetric " if self.symmetric else "") + next(
            word for word in holds if holds[word]
        )
        pieces = (
            f", in {len(self.segments)} segments"
            if self.segments is not None and len(self.segments) > 1
            else ""
        )
        told = self.message.startswith("no orbit")
        missing = f"N{self.message[1:]}" if told else f"No orbit: {self.message}"
        return f"PeriodicOrbit: {kind}, period {self.period:.9g}{pieces}" if self.success else missing, {
            "at": values(self.x0, self.x),
            "turns": [f"{name} {count}" for name, count in self.winding.items()] if self.success else [],
            "multipliers": listed(list(map(number, self.multipliers))),
            "events": [" | ".join(some([kind for _, kind, _ in self.word])) or "none"],
            "message": [self.message] if self.success else [],
            "degenerate": list(self.degenerate),
        }.items()


def none_found(map_: Any, x: np.ndarray, message: str) -> PeriodicOrbit:
    n = len(x)
    return PeriodicOrbit(map_, x, np.inf, np.full((n, n), np.nan), (), np.nan, 0, False, message)
