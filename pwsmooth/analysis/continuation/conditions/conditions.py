"""What holds all along a curve in two parameters, beside the fixed point: c(x, p, q, e) = 0.

    fold, flip, symmetry breaking      g = 0,   (DP - mu   b) (v)   (0)
                                                (c^T       0) (g) = (1),     mu = 1, -1, -1 of the half-period map
    torus                              the same with DP^2 - 2 kappa DP + 1, two columns b and c, kappa an unknown
    branch point                       g = 0 and w F_p = 0 of F + e b, e an unknown (0 while the branches meet)

g is as smooth as DP and vanishes with det(DP - mu), whose size it does not have (Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, 2000); b and c follow the null vectors from point to point.

Chain: impacts.py, pieces.py -> **conditions** -> tangencies.py, curves/problem.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...maps.impacts import EventImage
from ...maps.multipliers import balanced
from ...maps.pieces import Pieces, by_root, critical, spectrum, square
from ...maps.poincare import Word
from ...maps.scales import extents, units_of_motion
from ...maps.segments import Shooting
from ...maps.windows import TOUCHED
from ...orbits.fixed_points import pinned
from ...orbits.normal_forms import flip_coefficient

_STEP = 6e-6  # DP has some twelve digits: its differences have half of them, enough for Newton's method
_SOONER = 1e2  # the part of it that is left at least: four digits of slopes are roundings then
_ROUNDED, _LEFT = 1e-12, 1e-3  # of the entries of DP; of its changes, that may be roundings
_PART, _LEAST = 1.0, 1e-7  # of the curve's step, and the least of that: five digits are left


class Place(NamedTuple):
    """The map at a point: F = P - x (n,) and its slopes DF (n, n + 2) by the point and both parameters, not scaled."""

    map: Any
    image: Any  # Image, or PartedImage
    x: np.ndarray
    F: np.ndarray
    DF: np.ndarray
    names: tuple[str, str]

    @property
    def DP(self) -> np.ndarray:
        return self.image.jacobian

    @property
    def n(self) -> int:
        """Of the point on the section: of an orbit in segments the first ones of its unknowns."""
        return len(self.x) // self.map.number if isinstance(self.map, Shooting) else len(self.x)

    def critical(self, root: int) -> np.ndarray:
        """DP - root; of a motion from an event to the next one the pencil of its multipliers."""
        if isinstance(self.image, EventImage):
            A, B = self.image.pencil
            return B - root * A
        return critical(self.map, self.DP, root)

    @property
    def multipliers(self) -> np.ndarray:
        if isinstance(self.image, EventImage):
            from scipy.linalg import eigvals

            A, B = self.image.pencil
            mu = eigvals(B, A)
            # One of them is no multiplier but the condition h = 0, and infinite; without speed another one is.
            mu = np.delete(mu, np.argmax(np.where(np.isfinite(mu), np.abs(mu), np.inf)))
            return mu[np.isfinite(mu)]
        return spectrum(self.map, self.DP)


def place_of(map_: Any, image: Any, x: np.ndarray, names: tuple[str, str]) -> Place:
    DF = np.column_stack([image.jacobian - np.eye(len(x)), image.by_parameter])
    return Place(map_, image, x, image.x - x, DF, names)


class Condition:
    """c = 0 and its unknowns beside x, p, q; slopes by differences of `value` unless `slopes` gives them."""

    kind: str
    extras = 0
    of_multipliers = True  # it asks nothing of a surface, so that a map may leave one out
    in_segments = True  # its slopes know the points of an orbit in segments

    def start(self, place: Place) -> np.ndarray:
        """First values of the unknowns of its own, (extras,); frames are set."""
        self.frame(place, np.empty(0))
        return np.empty(0)

    def frame(self, place: Place, extra: np.ndarray) -> None:
        """What is kept fixed while the next point is sought."""

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        """c, (1 + extras,)."""
        raise NotImplementedError

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        """Of c by x, p, q and the extras, (1 + extras, n + 2 + extras), where they are exact."""
        return None

    def bent(self, place: Place) -> tuple[np.ndarray, np.ndarray] | None:
        """w and v, (n,), where c is one number whose slopes by x, p, q are -w D2F(v, .), of no unknowns of its own."""
        return None

    def unfolding(self, extra: np.ndarray) -> np.ndarray | float:
        """What is added to F, (n,)."""
        return 0.0

    def unfolding_slopes(self, n: int) -> np.ndarray:
        return np.zeros((n, self.extras))

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        """Functions that change their sign at points of codimension 2, by the name of these."""
        return {}

    def ends(self, name: str) -> str:
        """Why the curve ends at such a point, or is virtual from there on; empty where it goes on."""
        return ""

    def confirmed(self, name: str, place: Place) -> bool:
        """Whether a zero of a test function is what its name says: of a torus, no real pair with the product 1."""
        return not name.partition(" + ")[2].startswith("torus") or on_circle(place.multipliers)

    def beyond(self, place: Place, extra: np.ndarray) -> bool:
        """Whether a point is none of the bifurcation's, as on the other side of where its curve begins."""
        return not self.admissible(place)

    def twin(self, place: Place) -> bool:
        """Whether it holds at two events at once."""
        return False

    def admissible(self, place: Place) -> bool:
        """Whether the orbit does what the curve says of it: of a map with a window, keeps to its side."""
        near = getattr(place.image, "approach", None)
        return near is None or bool(min(near.h, near.others) >= -TOUCHED)

    def word(self, place: Place) -> Word:
        """The itinerary, without what is open on the curve."""
        return place.image.word


class Critical(Condition):
    """A multiplier of the map is `root`, 1 or -1."""

    def __init__(self, kind: str, root: int) -> None:
        self.kind, self.root = kind, root
        self.b = self.c = self.units = np.empty(0)

    def start(self, place: Place) -> np.ndarray:
        self.units = units_of(place)
        left, _, right = np.linalg.svd(place.critical(self.root) * self.units / self.units[:, None])
        self.b, self.c = left[:, -1] * self.units, right[-1] / self.units
        return np.empty(0)

    def frame(self, place: Place, extra: np.ndarray) -> None:
        v, w, _ = self.null(place)
        self.units = units_of(place)
        self.b, self.c = w * self.units**2, v / self.units**2
        self.b /= np.linalg.norm(self.b / self.units)
        self.c /= np.linalg.norm(self.c * self.units)

    def null(self, place: Place) -> tuple[np.ndarray, np.ndarray, float]:
        """v, w (n,) and g."""
        n, units = len(place.x), self.units
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = place.critical(self.root) * units / units[:, None]
        matrix[:n, n], matrix[n, :n] = self.b / units, self.c * units
        last = np.append(np.zeros(n), 1.0)
        right, left = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        return right[:n] * units, left[:n] / units, float(right[n])

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([self.null(place)[2]])

    def bent(self, place: Place) -> tuple[np.ndarray, np.ndarray] | None:
        # Of a motion from event to event a pencil of two matrices is critical, no slopes of one map.
        if self.extras or isinstance(place.image, EventImage):
            return None
        v, w, _ = self.null(place)
        return by_root(place.map, w, self.root), v

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        v, w, _ = self.null(place)
        v, w = v / np.linalg.norm(v / self.units), w / np.linalg.norm(w * self.units)
        rest = others(place.multipliers, [complex(self.root)])
        double = "1:1 resonance" if self.root > 0 else "1:2 resonance"
        image = place.image
        if isinstance(image, EventImage):
            # The pencil's leading coefficient has the speed as a factor.
            found = {
                **{f"{self.kind} + {change}": value for change, value in image.more.items()},
                f"{self.kind} + {place.map.touches}": image.speed,
                double: float(w @ image.pencil[0] @ v) / (image.speed or np.nan),
            }
        else:
            found = {double: float(w[: place.n] @ v[: place.n])}
        if self.root > 0:
            flip = "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"
            found |= {"cusp": float(slopes[0, : len(v)] @ v), f"fold + {flip}": factors(rest, -1)}
        else:
            found[f"{self.kind} + fold"] = factors(rest, 1)
            if not isinstance(place.map, Shooting) and not isinstance(image, EventImage):
                degenerate = flip_coefficient(place.map, image, place.x, v, w)
                found[f"degenerate {self.kind}"] = degenerate
        return found | {f"{self.kind} + torus": pairs(rest)}

    def ends(self, name: str) -> str:
        if "grazing impact" in name:
            return "there the impact has no speed, and beyond it the curve is virtual"
        if "exit by a fold" in name:
            return "there the fold comes to the end of the layer, and what is let go has no speed"
        return "beyond it nothing parts the stick" if "adding-sliding" in name else ""

    def admissible(self, place: Place) -> bool:
        return getattr(place.image, "speed", 1.0) > -TOUCHED and super().admissible(place)


class Torus(Condition):
    """A pair of multipliers is exp(+-i theta), kappa = cos theta."""

    kind, extras = "torus", 1

    def __init__(self) -> None:
        self.b = self.c = self.mix = np.empty((0, 0))

    def start(self, place: Place) -> np.ndarray:
        mu = place.multipliers
        mu = mu[np.abs(mu.imag) > 0]
        kappa = float(mu[np.argmin(np.abs(np.abs(mu) - 1))].real) if mu.size else 1.0
        left, _, right = np.linalg.svd(square(place.map, place.DP, kappa))
        self.b, self.c = left[:, -2:], right[-2:].T
        self._mixed(place)
        return np.array([kappa])

    def _mixed(self, place: Place) -> None:
        """The two of the four entries' combinations that move: with DP and the unit matrix in the plane of the pair."""
        n, b, c = place.n, self.b, self.c
        once = place.DP @ c if n == len(place.x) else c[len(place.x) : len(place.x) + n]
        moved = np.array([(b[:n].T @ direction).ravel() for direction in (once, c[:n])])
        self.mix = np.linalg.svd(moved)[2][:2]

    def _solved(self, place: Place, kappa: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n = len(self.b)
        matrix = np.zeros((n + 2, n + 2))
        matrix[:n, :n] = square(place.map, place.DP, kappa)
        matrix[:n, n:], matrix[n:, :n] = self.b, self.c.T
        last = np.vstack([np.zeros((n, 2)), np.eye(2)])
        right, left = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        return right[:n], left[:n], right[n:]

    def frame(self, place: Place, extra: np.ndarray) -> None:
        v, w, _ = self._solved(place, float(extra[0]))
        self.b, self.c = np.linalg.qr(w)[0], np.linalg.qr(v)[0]
        self._mixed(place)

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return self.mix @ self._solved(place, float(extra[0]))[2].ravel()

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        kappa = float(extra[0])
        sine = np.emath.sqrt(1 - kappa**2)
        rest = others(place.multipliers, [kappa + 1j * sine, kappa - 1j * sine])
        names = {"1:1 resonance": 1.0, "1:2 resonance": -1.0, "1:3 resonance": -0.5, "1:4 resonance": 0.0}
        return {
            **{name: kappa - at for name, at in names.items()},
            "torus + fold": factors(rest, 1), "torus + flip": factors(rest, -1),
        }  # fmt: skip

    def beyond(self, place: Place, extra: np.ndarray) -> bool:
        return bool(abs(extra[0]) > 1)

    def ends(self, name: str) -> str:
        if name in ("1:1 resonance", "1:2 resonance"):
            return "beyond it the pair is real, with the product 1, and no torus is born"
        return ""


class BranchPoint(Critical):
    """Two branches over one parameter meet: a multiplier 1 whose fold does not turn, kept so by a symmetry, say."""

    extras = 1

    def __init__(self, column: int) -> None:
        super().__init__("branch point", 1)
        self.column = column

    def start(self, place: Place) -> np.ndarray:
        super().start(place)
        return np.zeros(1)

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        _, w, g = self.null(place)
        return np.array([g, w @ place.DF[:, len(place.x) + self.column]])

    def unfolding(self, extra: np.ndarray) -> np.ndarray:
        return extra[0] * self.b

    def unfolding_slopes(self, n: int) -> np.ndarray:
        return self.b[:, None]

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        found = super().tests(place, extra, slopes)
        found.pop("cusp")
        return found


def units_of(place: Place) -> np.ndarray:
    """Of the unknowns, in which the null vectors of an orbit have entries of one size, (n,)."""
    if isinstance(place.map, Shooting):
        return balanced(place.DP)
    moves = extents(place.image.runs)
    return units_of_unknowns(units_of_motion(moves, place.x[: len(moves)]), len(place.x))


def units_of_unknowns(unit: np.ndarray, n: int) -> np.ndarray:
    """Of the n unknowns of a map, with those of its states: of all points, and 1 of an instant that is unknown."""
    return np.append(np.tile(unit, n // len(unit)), np.ones(n % len(unit)))


def others(mu: np.ndarray, critical: list[complex]) -> np.ndarray:
    """Multipliers without those nearest to the critical ones."""
    rest = mu
    for root in critical:
        rest = np.delete(rest, np.argmin(np.abs(rest - root)))
    return rest


def factors(mu: np.ndarray, root: int) -> float:
    """Product of mu - root, every factor bounded: zero where one of them is `root`."""
    return float(np.prod((mu - root) / (1 + np.abs(mu))).real)


def pairs(mu: np.ndarray) -> float:
    """Zero where two of them have the product 1."""
    products = np.array([mu[i] * mu[j] - 1 for i in range(len(mu)) for j in range(i)])
    return float(np.prod(products / (1 + np.abs(products))).real) if products.size else 1.0


def on_circle(mu: np.ndarray) -> bool:
    """Whether a pair that is not real lies on the unit circle."""
    return bool(np.any((np.abs(mu.imag) > 1e-6) & (np.abs(np.abs(mu) - 1) < 1e-3)))


def differences(
    at: Callable[[np.ndarray], Place | None], place: Place, u: np.ndarray, value: Callable[[Place], np.ndarray],
    reach: float = 1.0, wanted: np.ndarray | None = None,
) -> np.ndarray | None:  # fmt: skip
    """Slopes of `value` by the entries of u = (x, p, q), (c, n + 2), within the itinerary of `place`; None without.

    From places much nearer than `reach`, the length of the curve's step: beside a square root it bends within that.
    Of entries that are not `wanted` there are zeros.
    """
    steps = _steps(place, u, reach)
    columns, middle, first = [], value(place), 0
    # What comes back from everywhere nearby, as v = 0 of a section or segment that begins in a stick, is not moved.
    moves = ~np.append(pinned(place.image), [False, False])
    moves = moves if wanted is None else moves & wanted
    if isinstance(place.map, Pieces):
        found = _by_points(place, value, np.where(moves, steps, 0.0)[: len(place.x)])
        if found is None:
            return None
        columns, first = found, len(place.x)
    for j in range(first, len(u)):
        if not moves[j]:
            columns.append(np.zeros_like(middle))
            continue
        slope = _one(at, place, u, steps[j] * np.eye(len(u))[j], value)
        if slope is None:
            return None
        columns.append(slope / steps[j])
    return np.array(columns).T


def along(
    at: Callable[[np.ndarray], Place | None], place: Place, u: np.ndarray, value: Callable[[Place], np.ndarray],
    bent: tuple[np.ndarray, np.ndarray], reach: float = 1.0,
) -> np.ndarray | None:  # fmt: skip
    """The same of a value whose slopes are -w D2F(v, .): from two places on the line along v.

    D2F is symmetric, so that the change of the slopes DF along v is the change along all else of DF v. Where roundings
    of DF are too large a part of that, as w and v of an orbit in many segments have entries of all sizes, it is asked.
    """
    w, v = bent[0], np.where(pinned(place.image), 0.0, bent[1])
    size = float(np.max(np.abs(v) / _steps(place, u, reach)[: len(v)]))
    moved = _one(at, place, u, np.append(v / size, np.zeros(2)), lambda there: there.DF)
    if moved is None:
        return None
    slopes = -size * w @ moved
    # An entry that is the same to the last bit, as of a state that stays, has no rounding.
    rounding = _ROUNDED * size * np.abs(w) @ np.where(moved == 0, 0.0, np.abs(place.DF))
    rough = rounding > _LEFT * np.abs(slopes)
    if not rough.any():
        return slopes[None]
    asked = differences(at, place, u, value, reach, rough)
    return None if asked is None else np.where(rough, asked, slopes)


def _steps(place: Place, u: np.ndarray, reach: float) -> np.ndarray:
    """How far from u, in each of its entries, the map is asked for its changes."""
    near = min(_STEP, _PART * max(reach, _LEAST))
    steps = near * (1 + np.abs(u))
    if isinstance(place.image, EventImage):  # a motion from event to event is chosen to be even
        return steps
    # What moves the end by much bends the sooner.
    moved = np.abs(place.DF) * (1 + np.abs(u)) / (1 + np.abs(place.x[:, None]))
    return steps / np.clip(moved.max(axis=0, initial=0.0), 1.0, _SOONER)


def _one(at: Any, place: Place, u: np.ndarray, move: np.ndarray, value: Callable[[Place], np.ndarray]) -> Any:
    """How `value` changes by a move of u, within the itinerary of `place`; None where neither side has it."""
    sides = []
    for other in (u + move, u - move):
        beside = at(other)
        same = beside is not None and beside.image.word == place.image.word
        sides.append(value(beside) if same and beside is not None else None)
    return _slope(sides[0], sides[1], value(place), 1.0)


def _slope(above: Any, below: Any, middle: np.ndarray, h: float) -> np.ndarray | None:
    """From both sides, or from that which has the itinerary."""
    if above is not None and below is not None:
        return (above - below) / (2 * h)
    if above is not None:
        return (above - middle) / h
    return None if below is None else (middle - below) / h


def _by_points(
    place: Place, value: Callable[[Place], np.ndarray], steps: np.ndarray
) -> list[np.ndarray] | None:
    """Slopes of `value` by the points of segments, each of which moves the matrix of its own segment alone.

    Zeros where `steps` is 0.
    """
    pieces, X, n = place.map, place.x, place.n
    middle = value(place)
    columns = [np.zeros_like(middle)] * len(X)
    for i in range(n):
        moves = steps.reshape(-1, n) * np.eye(n)[i]
        if not moves.any():
            continue
        sides = [list(pieces.varied(X, place.image, sign * moves, place.names)) for sign in (1, -1)]
        for k, pair in enumerate(zip(*sides)):
            if not steps[k * n + i]:
                continue
            values = [
                None if there is None else value(place_of(pieces, there, X, place.names)) for there in pair
            ]
            slope = _slope(values[0], values[1], middle, steps[k * n + i])
            if slope is None:
                return None
            columns[k * n + i] = slope
    return columns
