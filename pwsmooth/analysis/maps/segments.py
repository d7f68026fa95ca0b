"""Orbits shot over in segments (multiple shooting): fixed points of the shift map of N points on the way.

    X = (x_0, ..., x_N-1)  ->  (phi_N(x_N-1), phi_1(x_0), ..., phi_N-1(x_N-2))

Its matrix is block-cyclic, with the exact matrices of the segments. A deviation grows by no more than a segment's
growth, so that an orbit whose multiplier is 1e8, or 1e80, is no harder than others. Points stand where the motion is
free and no event is near: in a slide a deviation lives on the surface alone. Only where deviations grow too much
within a slide (a canard along a hidden term) points stand there too. A return map's inner points stand at fixed times
after a return; the last segment ends at the next one, so that the time needs no equation of its own.

Source: U. Ascher, R. Mattheij, R. Russell, Numerical Solution of Boundary Value Problems for ODEs (1995), ch. 4.

Chain: sections.py, multipliers.py -> **segments** -> periodic_orbit.py, orbits.py, arclength.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...results.solution import Solution
from .first_order import sticks_at_start
from .poincare import Cuts, Image, Leg

TOO_LONG = 1e4  # multiplier beyond which an orbit is not shot over in one piece
_MOST = 1e3  # growth of a segment, with which it is cut anew
LONG_ENOUGH = 1e2  # of a segment that is newly cut: with it both exp(kT) and exp(-kT) are known to nine digits
CALM = 10.0  # growth from anywhere on the way to anywhere, likewise: a tenth of that of new segments
SHORT = 1e3  # growth of a whole orbit that needs no segments any more
_LESS = 0.1  # of that growth: with less, segments that begin in a slide are better than those that do not
_APART = 1e-9  # of a period: the least length of a segment that the clock tells
_MARGIN = 3e-3  # of an application's time: nearer to an event no segment begins
_CLOSE = 1e-3  # the same: a beginning to which an event has come so near is moved
_LAST, _LATEST = 0.9, 0.97  # of the time to a return: where the last segment begins at first, and at most
_CANDIDATES = 24  # at which a segment of an application may begin


@dataclass(frozen=True)
class Segments:
    """How an orbit was shot over: where its segments begin, the points there, the matrices of the segments.

    Attributes
    ----------
    cuts : tuple of tuple of float
        For each period (return) of the orbit: where it is cut, in parts of it (in time since the return).
    nodes : ndarray, shape (N, n)
        The points at which segments begin, in the units of the states.
    matrices : ndarray, shape (N, n, n)
        Of the segments, in the units of the states.
    asked : bool
        Whether their number was asked for.
    held : bool
        Whether some may begin in a slide, where too much happens for one segment.

    Examples
    --------
    >>> import sympy as sp
    >>> from pwsmooth import System, find_orbit
    >>> t, x = sp.symbols("t x", real=True)
    >>> orbit = find_orbit(System({x: 3 * x + sp.cos(t)}, time=t), {x: 0}, seen=Strobe(2 * sp.pi))
    >>> len(orbit.segments), bool(abs(orbit.segments.matrices).max() < 1e4 < abs(orbit.multipliers[0]))
    (5, True)
    """

    cuts: Cuts
    nodes: np.ndarray
    matrices: np.ndarray
    asked: bool = False
    held: bool = False

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def kept(self) -> tuple[bool, bool]:
        """`asked` and `held`."""
        return self.asked, self.held

    def eigenvector(self, root: float) -> np.ndarray:
        """How the points move along the eigenvector of the multiplier nearest to a real one, shape (N, n).

        Parameters
        ----------
        root : float
            The multiplier, of the map.

        Returns
        -------
        ndarray, shape (N, n)
            Of length 1 in all, in the units of the states.
        """
        N, n = self.nodes.shape
        matrix = np.zeros((N, n, N, n))
        for k, one in enumerate(self.matrices):
            matrix[(k + 1) % N, :, k] += one / (root if k == N - 1 else 1.0)
        return np.linalg.svd(matrix.reshape(N * n, N * n) - np.eye(N * n))[2][-1].reshape(N, n)


@dataclass(frozen=True)
class Shooting:
    """The shift map of the segments of a Stroboscopic or Section: as these to Newton's method, with N n unknowns."""

    map: Any
    cuts: Cuts

    @property
    def unit(self) -> np.ndarray:
        """Sizes of the states against which deviations are measured, shape (n,)."""
        return self.map.unit

    @property
    def tolerance(self) -> np.ndarray:
        """Absolute tolerances of the runs, shape (n,)."""
        return self.map.tolerance

    def with_parameters(self, values: Mapping[Any, float]) -> Shooting:
        return Shooting(self.map.with_parameters(values), self.cuts)

    @property
    def number(self) -> int:
        """How many segments."""
        return sum(1 + len(inner) for inner in self.cuts)

    @property
    def legs(self) -> list[Leg]:
        """The segments: which application, from where to where."""
        return [
            (k, *leg) for k, inner in enumerate(self.cuts) for leg in zip((0.0, *inner), (*inner, self.map.end))
        ]

    @property
    def firsts(self) -> list[int]:
        """The segments with which applications of the map begin."""
        return np.cumsum([0, *(1 + len(inner) for inner in self.cuts[:-1])]).tolist()

    def image(self, X: np.ndarray, parameters: Sequence[Any] | None = None) -> Image:
        """Ends of the segments, each in the place of the point that it should be, and their derivatives."""
        return self.joined(self.ends(X, parameters), parameters is not None)

    def ends(self, X: np.ndarray, parameters: Sequence[Any] | None = None) -> list[Image]:
        """Ends of the segments in the order in which these begin, up to the first one that does not end."""
        images: list[Image] = []
        for x, leg in zip(X.reshape(self.number, -1), self.legs):
            images.append(self.map.leg(x, leg, parameters))
            if not images[-1].success:
                return images
        images[-1] = self.map.closed(images[-1])
        return images

    def joined(self, images: Sequence[Image], derivatives: bool) -> Image:
        """The image of all points, from the ends of the segments."""
        runs, n, N = tuple(run for one in images for run in one.runs), len(images[0].x), self.number
        if not images[-1].success:
            return Image(np.full(N * n, np.nan), math.nan, runs, reason=images[-1].reason)
        shifted = [images[-1], *images[:-1]]
        x, time = np.concatenate([one.x for one in shifted]), sum(one.time for one in images)
        if not derivatives:
            return Image(x, time, runs)
        matrix = np.zeros((N, n, N, n))
        for k, one in enumerate(images):
            matrix[(k + 1) % N, :, k] += one.jacobian
        return Image(
            x, time, runs, matrix.reshape(N * n, N * n), np.concatenate([one.by_parameter for one in shifted]),
            tuple(said for one in images for said in one.degenerate),
        )  # fmt: skip

    def matrices(self, jacobian: np.ndarray) -> np.ndarray:
        """Of the segments (N, n, n), from the block-cyclic one."""
        N = self.number
        blocks = jacobian.reshape(N, len(jacobian) // N, N, -1)
        return np.array([blocks[(k + 1) % N, :, k] for k in range(N)])


def restless(shooting: Shooting, image: Image, held: bool, scales: Any) -> bool:
    """Whether segments must be cut anew: one has grown too long, or begins in a slide or too near to an event.

    `held` are those that may begin in a slide, `scales` are those of the image's parameters.
    """
    size = sizes(image.runs)
    if (
        max(growth(A, size) for A in shooting.matrices(image.jacobian)) > _MOST
        or answers(image, scales) > _MOST
    ):
        return True
    near = _CLOSE * image.time / shooting.map.turns
    before = image.by_legs[-1]
    for runs, (_, begin, end) in zip(image.by_legs, shooting.legs):
        if begin > 0 and not _keeps_off(before[-1], runs[0], near, held):
            return True
        before = runs
        # The next return must not come within the last segment but one.
        time = sum(run.t[-1] - run.t[0] for run in runs)
        if end == math.inf and begin > _LATEST * (begin + time):
            return True
    return False


def _keeps_off(before: Solution, run: Solution, near: float, held: bool) -> bool:
    """Whether no event is near to the beginning of a run, behind another one, which slides only if it is `held`."""
    if not held and sticks_at_start(run) or np.any(_inner(run) < run.t[0] + near):
        return False
    return not np.any(_inner(before) > before.t[-1] - near)


def _inner(run: Solution) -> np.ndarray:
    """Times of a run's events, without its ends."""
    times = np.array([e.time for e in run.events])
    return times[(times > run.t[0]) & (times < run.t[-1])]


def pressed(image: Image, scales: Any, largest: float) -> bool:
    """Whether an orbit of one piece asks for segments: by the largest multiplier, or by what grows on the way."""
    return largest > TOO_LONG or answers(image, scales) > _MOST


def settled(matrices: Sequence[np.ndarray], size: np.ndarray, largest: float) -> bool:
    """Whether an orbit in segments needs none any more."""
    return largest < SHORT and swelling(matrices, size) < CALM


def answers(image: Image, scales: Any) -> float:
    """How far ends move with parameters, each state measured by its size on the orbit.

    What grows on the way and is gone at the end shows there: a parameter acts all along.
    """
    size = sizes(image.runs)
    moved = (image.by_parameter * scales).reshape(-1, len(size), image.by_parameter.shape[1])
    return float(np.abs(moved / size[:, None]).max(initial=0.0))


def growth(matrix: np.ndarray, size: np.ndarray) -> float:
    """By how much deviations grow, each state measured by its size on the orbit."""
    return float(np.linalg.norm(matrix * size / size[:, None], 2))


def sizes(runs: Sequence[Solution]) -> np.ndarray:
    """Of the states along an orbit, shape (n,)."""
    size = np.max([np.abs(run.x).max(axis=1) for run in runs], axis=0)
    size = np.maximum(size, 1e-3 * size.max(initial=0.0))
    return np.where(size > 0, size, 1.0)


@dataclass(frozen=True)
class _Piece:
    """A little part of the orbit, from one candidate to the next: its leg, point, the point's way, its matrix.

    `begins` is False where an old segment begins that an event has come near to: no new one may. `slides` says whether
    the motion is held there.
    """

    leg: Leg
    x: np.ndarray
    way: np.ndarray
    matrix: np.ndarray
    begins: bool = True
    slides: bool = False


def cut(
    shooting: Shooting,
    X: np.ndarray,
    image: Image,
    *,
    number: int | None = None,
    way: np.ndarray | None = None,
    speed: float = 0.0,
    name: str | None = None,
    also: float | None = None,
) -> tuple[Cuts, np.ndarray, np.ndarray, bool] | None:
    """New segments of a known orbit: cuts, points (N n,), the way (N n,) in which they move, and whether some begin in
    a slide.

    `way` is that of the old points, with `speed` that of the parameter `name`. As many segments as are asked for, or
    as keep each one's growth low, and one that begins at `also` in each application. None where the motion along the
    old points ends.
    """
    way, size, must = np.zeros_like(X) if way is None else way, sizes(image.runs), {0.0, also}
    known = _pieces(shooting, X, image, number, way, speed, name, also)
    if known is None:
        return None
    # What grows within a slide is seen too where no segment may begin there.
    free = [replace(one, begins=one.begins and not one.slides) for one in known]
    chosen, most = _chosen(free, size, must, number)
    held = False
    if most > _MOST:
        within, less = _chosen(known, size, must, number)
        if held := less < _LESS * most:
            chosen = within
    cuts = tuple(
        tuple(one.leg[1] for one in chosen if one.leg[0] == k and one.leg[1] > 0)
        for k in range(shooting.map.turns)
    )
    return cuts, np.concatenate([one.x for one in chosen]), np.concatenate([one.way for one in chosen]), held


def _chosen(
    pieces: list[_Piece], size: np.ndarray, must: set[float | None], number: int | None
) -> tuple[list[_Piece], float]:
    """Those with which segments begin, and the largest growth within a segment."""
    return _as_grown(pieces, size, must) if number is None else _even(pieces, size, must, number)


def _pieces(shooting, X, image, number, way, speed, name, also) -> list[_Piece] | None:
    map_, n = shooting.map, len(X) // shooting.number
    time, size = image.time / map_.turns, sizes(image.runs)
    grown = sum(math.log(max(1.0, growth(A, size))) for A in shooting.matrices(image.jacobian))
    wanted = max(_CANDIDATES, 4 * (number or 0), math.ceil(3 * grown / math.log(LONG_ENOUGH)))
    parameters = () if name is None else (name,)
    pieces = []
    barred = getattr(map_, "barred", lambda k, place: False)
    before = image.by_legs[-1]
    for j, ((k, first, last), runs) in enumerate(zip(shooting.legs, image.by_legs)):
        keeps = _keeps_off(before[-1], runs[0], _MARGIN * time, True)
        before = runs
        free, begin = dict[float, bool](), first
        for run in runs:
            for s, slides in _free(run, time, time / wanted):
                free[float(begin + (s - run.t[0]) / map_.beat)] = slides
            begin += float(run.t[-1] - run.t[0]) / map_.beat
        free = {place: slides for place, slides in free.items() if not barred(k, place)}
        if last == math.inf:
            free = {place: slides for place, slides in free.items() if place < _LAST * begin}
        if also is not None and first < also < min(last, 1.0):
            free = {place: slides for place, slides in free.items() if abs(place - also) > _APART}
            free = dict(sorted({also: False, **free}.items()))
        free = {first: sticks_at_start(runs[0]), **free}
        x, moving = X[j * n : (j + 1) * n], way[j * n : (j + 1) * n]
        for leg in zip(free, (*list(free)[1:], last)):
            piece = map_.leg(x, (k, *leg), parameters)
            if not piece.success:
                return None
            begins, slides = keeps or leg[0] != first, free[leg[0]]
            pieces.append(_Piece((k, *leg), x, moving, piece.jacobian, begins, slides))
            x, moving = piece.x, piece.jacobian @ moving
            if name is not None:
                moving = moving + speed * piece.by_parameter[:, 0]
    return pieces


def _free(run: Solution, time: float, spacing: float) -> list[tuple[float, bool]]:
    """Times of a run at which no event is near, about so far apart, and whether something slides there."""
    bounds = np.unique(np.concatenate([run.t[:1], _inner(run), run.t[-1:]]))
    column = np.searchsorted(run.t, (bounds[1:] + bounds[:-1]) / 2, side="right") - 1
    found: list[tuple[float, bool]] = []
    for begin, end, slides in zip(bounds, bounds[1:], run._holds(run.status[:, column]).tolist()):
        if end - begin > 2 * _MARGIN * time:
            k = max(1, round((end - begin) / spacing))
            found += [(at, slides) for at in (begin + (end - begin) * (np.arange(k) + 0.5) / k).tolist()]
    return found


def _as_grown(pieces: list[_Piece], size: np.ndarray, must: set[float | None]) -> tuple[list[_Piece], float]:
    """Those with which segments begin, as late as the growth allows; the largest growth within a segment.

    From anywhere in it: where deviations shrink at first and then grow, those of roundings on the way do nothing else.
    """
    chosen, most, since = [], 0.0, np.empty((0, len(size), len(size)))
    for piece in pieces:
        grown = _since(since, piece.matrix)
        if piece.leg[1] in must or piece.begins and _most(grown, size) > LONG_ENOUGH:
            chosen.append(piece)
            grown = piece.matrix[None]
        since, most = grown, max(most, _most(grown, size))
    return chosen, most


def swelling(matrices: Sequence[np.ndarray], size: np.ndarray) -> float:
    """The largest growth from the beginning of one segment to the end of the same or a later one."""
    since, most = np.empty((0, len(size), len(size))), 0.0
    for matrix in matrices:
        since = _since(since, matrix)
        most = max(most, _most(since, size))
    return most


def _since(since: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Matrices (m, n, n) from m beginnings on, one step further, and that of the step itself."""
    return np.concatenate([matrix @ since, matrix[None]])


def _most(since: np.ndarray, size: np.ndarray) -> float:
    return float(np.linalg.norm(since * size / size[:, None], axis=(1, 2)).max())


def _even(
    pieces: list[_Piece], size: np.ndarray, must: set[float | None], number: int
) -> tuple[list[_Piece], float]:
    """Those with which so many segments begin (no fewer than applications), of about the same growth each; and 0."""
    # Where nothing grows, segments are equally long.
    load = np.cumsum([0.0, *(0.1 + math.log(max(1.0, growth(piece.matrix, size))) for piece in pieces)])
    barred = np.array([0.0 if piece.begins else np.inf for piece in pieces])
    chosen = {k for k, piece in enumerate(pieces) if piece.leg[1] in must}
    for j in range(1, number):
        barred[list(chosen)] = np.inf
        at = int(np.argmin(np.abs(load[:-1] - load[-1] * j / number) + barred))
        if len(chosen) < number:
            chosen.add(at)
    return [pieces[k] for k in sorted(chosen)], 0.0


def rotated(
    shooting: Shooting, X: np.ndarray, way: np.ndarray, place: float
) -> tuple[Shooting, np.ndarray, np.ndarray]:
    """The shift map on the section that stands at a place in every application, where segments begin.

    A place beyond 1 is that in one of the next applications.
    """
    map_, n = shooting.map, len(X) // shooting.number
    G = np.eye(n) if map_.symmetry is None else map_.symmetry
    found: list[Any] = []
    turns, phase = int(place // 1), map_.phase + place * map_.beat / map_.forcing_period
    place -= turns
    for (k, first, _), x, moving in zip(shooting.legs, X.reshape(-1, n), way.reshape(-1, n)):
        passed = first < place
        turned = np.linalg.matrix_power(G, turns + (passed and k == 0))
        at = ((k - turns - passed) % map_.turns, first - place + passed)
        found.append((at, turned @ x, turned @ moving))
    found.sort(key=lambda one: one[0])
    cuts = tuple(tuple(at for (k, at), *_ in found if k == turn and at > 0) for turn in range(map_.turns))
    nodes, ways = (np.concatenate([one[k] for one in found]) for k in (1, 2))
    return Shooting(map_.at_phase(phase), cuts), nodes, ways


def best_place(shooting: Shooting, image: Image) -> tuple[float, float]:
    """The place farthest from all events and slides of all applications, and how far it is from them."""
    places, slides = [], []
    for runs, (_, first, _) in zip(image.by_legs, shooting.legs):
        for run in runs:
            at = first + (run.t - runs[0].t[0]) / shooting.map.beat
            places += [
                first + (e.time - runs[0].t[0]) / shooting.map.beat for e in run.events if e.time > run.t[0]
            ]
            stuck = run._holds(run.status[:, :-1])
            slides += [(a, b) for a, b in zip(at[:-1][stuck], at[1:][stuck]) if b > a]
    marks = np.unique(np.array(places) % 1.0)
    if not marks.size:
        return 0.0, 1.0
    ends = np.append(marks[1:], marks[0] + 1.0)
    middles = (marks + ends) / 2 % 1.0
    free = np.array([not any(a < middle < b for a, b in slides) for middle in middles])
    lengths = (ends - marks) * free
    best = int(np.argmax(lengths))
    return float(middles[best]), float(lengths[best] / 2)
