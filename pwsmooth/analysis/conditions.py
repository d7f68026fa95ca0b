"""What holds all along a curve in two parameters, beside the fixed point: c(x, p, q, e) = 0.

    fold, flip, symmetry breaking      g = 0,   (DP - mu   b) (v)   (0)
                                                (c^T       0) (g) = (1),     mu = 1, -1, -1 of the half-period map
    torus                              the same with DP^2 - 2 kappa DP + 1, two columns b and c, kappa an unknown
    branch point                       g = 0 and w F_p = 0 of F + e b, e an unknown (0 while the branches meet)
    grazing (of a stop, a surface)     the smallest s h of a window, within which the surface acts on nothing, is 0

g is as smooth as DP and vanishes with det(DP - mu), whose size it does not have (Govaerts, Numerical Methods for
Bifurcations of Dynamical Equilibria, 2000); b and c follow the null vectors from point to point.

Chain: sections.py, windows.py -> **conditions** -> curves.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..paths.linearised import linearise
from .poincare import RETURN, Word, after_start
from .windows import TOUCHED, FromImpact, ImpactImage, function_of


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

    def critical(self, root: int) -> np.ndarray:
        """DP - root; of a motion from an impact to the next one the pencil of its multipliers."""
        if isinstance(self.image, ImpactImage):
            A, B = self.image.pencil
            return B - root * A
        return self.DP - root * np.eye(len(self.x))

    @property
    def multipliers(self) -> np.ndarray:
        if isinstance(self.image, ImpactImage):
            from scipy.linalg import eigvals

            A, B = self.image.pencil
            mu = eigvals(B, A)
            # One of them is no multiplier but the condition h = 0, and infinite; without speed another one is.
            mu = np.delete(mu, np.argmax(np.where(np.isfinite(mu), np.abs(mu), np.inf)))
            return mu[np.isfinite(mu)]
        return np.linalg.eigvals(self.DP).astype(complex)


class Condition:
    """c = 0 and its unknowns beside x, p, q; slopes by differences of `value` unless `slopes` gives them."""

    kind: str
    extras = 0

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
        self.b = self.c = np.empty(0)

    def start(self, place: Place) -> np.ndarray:
        left, _, right = np.linalg.svd(place.critical(self.root))
        self.b, self.c = left[:, -1], right[-1]
        return np.empty(0)

    def frame(self, place: Place, extra: np.ndarray) -> None:
        v, w, _ = self.null(place)
        self.b, self.c = w / np.linalg.norm(w), v / np.linalg.norm(v)

    def null(self, place: Place) -> tuple[np.ndarray, np.ndarray, float]:
        """v, w (n,) and g."""
        n = len(place.x)
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = place.critical(self.root)
        matrix[:n, n], matrix[n, :n] = self.b, self.c
        last = np.append(np.zeros(n), 1.0)
        right, left = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        return right[:n], left[:n], float(right[n])

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([self.null(place)[2]])

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        v, w, _ = self.null(place)
        v, w = v / np.linalg.norm(v), w / np.linalg.norm(w)
        rest = others(place.multipliers, [complex(self.root)])
        double = "1:1 resonance" if self.root > 0 else "1:2 resonance"
        image = place.image
        if isinstance(image, ImpactImage):
            # The pencil's leading coefficient has the speed as a factor.
            found = {
                f"{self.kind} + grazing impact": image.speed,
                double: float(w @ image.pencil[0] @ v) / image.speed,
            }
        else:
            found = {double: float(w @ v)}
        if self.root > 0:
            flip = "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"
            found |= {"cusp": float(slopes[0, : len(v)] @ v), f"fold + {flip}": factors(rest, -1)}
        else:
            found[f"fold + {self.kind}"] = factors(rest, 1)
        return found | {f"{self.kind} + torus": pairs(rest)}

    def ends(self, name: str) -> str:
        return (
            "there the impact has no speed, and beyond it the curve is virtual"
            if "grazing impact" in name
            else ""
        )

    def admissible(self, place: Place) -> bool:
        return getattr(place.image, "speed", 1.0) > -TOUCHED and super().admissible(place)


class Torus(Condition):
    """A pair of multipliers is exp(+-i theta), kappa = cos theta."""

    kind, extras = "torus", 1

    def __init__(self) -> None:
        self.b = self.c = self.mix = np.empty((0, 0))

    def _matrix(self, place: Place, kappa: float) -> np.ndarray:
        return place.DP @ place.DP - 2 * kappa * place.DP + np.eye(len(place.x))

    def start(self, place: Place) -> np.ndarray:
        mu = np.linalg.eigvals(place.DP)
        mu = mu[np.abs(mu.imag) > 0]
        kappa = float(mu[np.argmin(np.abs(np.abs(mu) - 1))].real) if mu.size else 1.0
        left, _, right = np.linalg.svd(self._matrix(place, kappa))
        self.b, self.c = left[:, -2:], right[-2:].T
        self._mixed(place, kappa)
        return np.array([kappa])

    def _mixed(self, place: Place, kappa: float) -> None:
        """The two of the four entries' combinations that move: with DP and the unit matrix in the plane of the pair."""
        directions = (self.c.T @ place.DP @ self.c, np.eye(2))
        moved = np.array([(self.b.T @ self.c @ d).ravel() for d in directions])
        self.mix = np.linalg.svd(moved)[2][:2]

    def _solved(self, place: Place, kappa: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n = len(place.x)
        matrix = np.zeros((n + 2, n + 2))
        matrix[:n, :n] = self._matrix(place, kappa)
        matrix[:n, n:], matrix[n:, :n] = self.b, self.c.T
        last = np.vstack([np.zeros((n, 2)), np.eye(2)])
        right, left = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        return right[:n], left[:n], right[n:]

    def frame(self, place: Place, extra: np.ndarray) -> None:
        v, w, _ = self._solved(place, float(extra[0]))
        self.b, self.c = np.linalg.qr(w)[0], np.linalg.qr(v)[0]
        self._mixed(place, float(extra[0]))

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


class Touch(Condition):
    """The orbit comes to a surface and touches it: the smallest s h of a window is 0 (windows.py)."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([place.image.approach.h])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return place.image.approach.slopes[None]

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        near, mu = place.image.approach, place.multipliers
        found = {
            f"{self.kind} + fold": factors(mu, 1), f"{self.kind} + flip": factors(mu, -1),
            f"{self.kind} + torus": pairs(mu), f"{self.kind} twice": near.others / (1 + near.others)
            if np.isfinite(near.others) else 1.0,
        }  # fmt: skip
        side = self.side_of_impacts(place)
        return found if side is None else {"degenerate grazing": side, **found}

    def side_of_impacts(self, place: Place) -> float | None:
        """det K(1) from contact to contact: its sign says to which side orbits with a slow impact exist."""
        map_, near, T = place.map, place.image.approach, 1.0
        contacts = [str(mu.symbol) for mu in map_.system.model.multipliers if mu.kind == "contact"]
        if map_.window.name not in contacts or getattr(map_.base, "symmetry", None) is not None:
            return None
        D = place.image.time
        if map_.driven:
            T = map_.forcing_period
        at = (near.place - (map_.start_time if map_.driven else 0.0)) / T
        behind, before = ((part * T / D) for part in (map_.window.end - at, at - map_.window.begin))
        contact = FromImpact(map_.base, map_.window.name, behind, before)
        image = contact.image(np.append(near.x, near.place if map_.driven else D), ())
        if not isinstance(image, ImpactImage):
            return None
        A, B = image.pencil
        K = B - A
        return float(np.linalg.det(K / (1e-300 + np.linalg.norm(K, axis=1, keepdims=True))))

    def ends(self, name: str) -> str:
        if name == f"{self.kind} twice":
            return "beyond it the orbit crosses the surface elsewhere, and the curve is virtual"
        return ""


class TwoSided(Condition):
    """The map has another slope on either side of c = 0: what its multipliers do is looked at on both."""

    def tests(self, place: Place, extra: np.ndarray, slopes: np.ndarray) -> dict[str, float]:
        found: dict[str, float] = {}
        flip = "symmetry breaking" if getattr(place.map, "symmetry", None) is not None else "flip"
        w = np.append(place.x, [_value(place.map, name) for name in place.names])
        for side, sign in (("below", -1.0), ("above", 1.0)):
            near = []
            for aside in (_ASIDE, 2 * _ASIDE):
                u = w + sign * aside * slopes[0] / (slopes[0] @ slopes[0])
                near.append(_slope_at(place, u))
            # To c = 0, along a line.
            slope = 2 * near[0] - near[1]
            if not np.isfinite(slope).all():
                continue
            mu = np.linalg.eigvals(slope).astype(complex)
            found |= {
                f"{self.kind} + fold, {side}": factors(mu, 1), f"{self.kind} + {flip}, {side}": factors(mu, -1),
                f"{self.kind} + torus, {side}": pairs(mu),
            }  # fmt: skip
        return found


class Border(TwoSided):
    """A surface h(x, p) = 0 on the section: a fixed point of a map meets the border of its branches."""

    kind = "border collision"

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    def _row(self, place: Place) -> tuple[float, np.ndarray]:
        system = place.map.system
        model = system.model
        chosen = tuple(p for name in place.names for p in system.parameters if p.name == name)
        mult, values = np.zeros(len(model.multipliers)), np.array(system.parameter_values, float)
        t = getattr(place.map, "start_time", 0.0)
        h = function_of(model, self.surface)(np.array([t]), place.x[:, None], mult[:, None], values)[0]
        return float(h), linearise(model, chosen).gradient(self.surface, t, place.x, mult, values)[0]

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return np.array([self._row(place)[0]])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray:
        return self._row(place)[1][None]


class AtEvent(TwoSided):
    """Something vanishes at one event of the orbit: the events are known with their slopes (windows.py).

    `ordinal` counts the switch's events of its sort: those that come to the surface, or those that leave a stick.
    """

    arrives = True

    def __init__(self, kind: str, switch: str, ordinal: int) -> None:
        self.kind, self.switch, self.ordinal = kind, switch, ordinal

    def events(self, run: Any) -> list[int]:
        """Places of the events that are counted, among all of a run."""
        begin = after_start(run)
        return [
            k for k, e in enumerate(run.events)
            if e.switch == self.switch and e.time > begin and (e.kind in ("crossing", "stick")) == self.arrives
            and (self.arrives or e.kind.startswith("slip by"))
        ]  # fmt: skip

    def place_of(self, image: Any) -> int | None:
        """Of the event itself; None where the orbit does not have it."""
        found = self.events(image.parts[0].run)
        return found[self.ordinal] if self.ordinal < len(found) else None

    def word(self, place: Place) -> Word:
        """Without a slip that follows at once, which comes and goes along the curve."""
        run, k = place.image.parts[0].run, self.place_of(place.image)
        begin = after_start(run)
        letters = []
        events = run.events
        at = events[k].time if k is not None else np.nan
        near = TOGETHER * float(run.t[-1] - run.t[0])
        for i, e in enumerate(events):
            if not e.time > begin or e.switch == RETURN:
                continue
            if e.switch == self.switch and abs(e.time - at) <= near:
                if i == k:
                    letters.append((e.switch, "arrival" if self.arrives else "slip", e.note.split(" to ")[0]))
                continue
            letters.append((e.switch, e.kind, e.note))
        return tuple(letters)

    def state(
        self, place: Place, k: int | None = None
    ) -> tuple[Any, int, float, np.ndarray, np.ndarray, int] | None:
        """Of the event: part, instant, time, state and multipliers before it, and the side it comes from or goes to."""
        k, part = self.place_of(place.image) if k is None else k, place.image.parts[0]
        if k is None or not len(part.instant_t):
            return None
        run, event = part.run, part.run.events[k]
        column = int(np.searchsorted(run.t, event.time, side="left"))
        sides = event.note.split(" to ")
        side = int(sides[0] if self.arrives else sides[1])
        instant = int(np.argmin(np.abs(part.instant_t - event.time)))
        return part, instant, event.time, run.x[:, column], run.mult[:, column].copy(), side

    def measured(self, place: Place, k: int | None = None) -> tuple[float, np.ndarray] | None:
        """c and its slopes by the point on the section and the parameters, (n + 2,)."""
        found = self.state(place, k)
        if found is None:
            return None
        part, instant, t, x, mult, side = found
        model, n = part.run.model, len(x)
        chosen = tuple(p for name in place.names for p in part.run.system.parameters if p.name == name)
        line, p = linearise(model, chosen), part.run.tape.p
        j = next(j for j, mu in enumerate(model.multipliers) if str(mu.symbol) == self.switch)
        e, value, mult = self.quantity(line, j, t, x, mult, p, side)
        w, by_time, _ = line.gradient(e, t, x, mult, p)
        slopes = w[:n] @ part.instant_w[instant, :n] + by_time * part.instant_dt[instant]
        slopes[n:] += w[n:]
        return value, slopes

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        """The expression that is 0, its value, and the multipliers with which it is evaluated."""
        raise NotImplementedError

    def twin(self, place: Place) -> bool:
        """Whether the same holds at another event too, as it does all along a curve of symmetric orbits."""
        own, run = self.place_of(place.image), place.image.parts[0].run
        found = [self.measured(place, k) for k in self.events(run) if k != own]
        return any(abs(other[0]) < _TWIN for other in found if other is not None)

    def value(self, place: Place, extra: np.ndarray) -> np.ndarray:
        found = self.measured(place)
        return np.array([np.nan if found is None else found[0]])

    def slopes(self, place: Place, extra: np.ndarray) -> np.ndarray | None:
        found = self.measured(place)
        return None if found is None else found[1][None]


class Arrival(AtEvent):
    """The orbit comes to a surface where it begins to be held: the largest s dh/dt of lambda in [-1, 1] is 0 there.

    It comes from the side s with s dh/dt < 0, and lambda goes to -s: what stops it is the first zero on the way. With
    lambda linear the largest value is that at -s (the field beyond is tangent); of a hidden term, that of its fold.
    """

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        e = line.speed(j)
        lam = np.linspace(-1.0, 1.0, _LAYER)
        values = self._over(line, e, j, t, x, mult, p, side, lam)
        k = int(np.argmax(values))
        best = float(lam[k])
        if 0 < k < _LAYER - 1:
            from scipy.optimize import minimize_scalar

            found = minimize_scalar(
                lambda at: -self._over(line, e, j, t, x, mult, p, side, np.array([at]))[0],
                bounds=(lam[k - 1], lam[k + 1]), method="bounded", options={"xatol": 1e-10},
            )  # fmt: skip
            best = float(found.x)
        mult[j] = best
        return side * e, float(self._over(line, e, j, t, x, mult, p, side, np.array([best]))[0]), mult

    @staticmethod
    def _over(line, e, j, t, x, mult, p, side, lam) -> np.ndarray:
        """s dh/dt over values of the multiplier."""
        at = np.tile(mult[:, None], (1, len(lam)))
        at[j] = lam
        states = np.tile(x[:, None], (1, len(lam)))
        return side * function_of(line.model, e)(np.full(len(lam), t), states, at, p)


class Exit(AtEvent):
    """The orbit leaves a stick at the end of the layer and at its fold at once: d(dh/dt)/d lambda is 0 at that end."""

    arrives = False

    def quantity(
        self, line: Any, j: int, t: float, x: np.ndarray, mult: np.ndarray, p: np.ndarray, side: int
    ) -> tuple[Any, float, np.ndarray]:
        e = line.speed(j).diff(line.symbols[j])
        mult[j] = float(side)
        return e, float(function_of(line.model, e)(np.array([t]), x[:, None], mult[:, None], p)[0]), mult


def _slope_at(place: Place, w: np.ndarray) -> np.ndarray:
    """DP at another (x, p, q); nan where there is none."""
    n = len(place.x)
    try:
        image = place.map.with_parameters(dict(zip(place.names, map(float, w[n:])))).image(w[:n], ())
    except ValueError:  # outside the assumptions of a parameter
        return np.full((n, n), np.nan)
    return image.jacobian if image.success else np.full((n, n), np.nan)


def _value(map_: Any, name: str) -> float:
    return next(float(value) for p, value in map_.system.parameters.items() if p.name == name)


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


def differences(
    at: Callable[[np.ndarray], Place | None], place: Place, u: np.ndarray, value: Callable[[Place], np.ndarray]
) -> np.ndarray | None:
    """Slopes of `value` by the entries of u = (x, p, q), (c, n + 2), within the itinerary of `place`; None without."""
    columns = []
    middle = value(place)
    for j in range(len(u)):
        h = _STEP * (1 + abs(u[j]))
        sides = []
        for step in (h, -h):
            moved = u.copy()
            moved[j] += step
            beside = at(moved)
            same = beside is not None and beside.image.word == place.image.word
            sides.append(value(beside) if same and beside is not None else None)
        above, below = sides
        if above is not None and below is not None:
            columns.append((above - below) / (2 * h))
        elif above is not None:
            columns.append((above - middle) / h)
        elif below is not None:
            columns.append((middle - below) / h)
        else:
            return None
    return np.array(columns).T


TOGETHER = 1e-3  # of the period: events that come and go together at a change of itinerary
_ASIDE = 1e-8  # of c: so far to either side of it the map's slope is looked at
_TWIN = 1e-7
_LAYER = 201  # places in [-1, 1] at which a layer is looked at
_STEP = 6e-6  # DP has some twelve digits: its differences have half of them, enough for Newton's method
