"""Changes of itinerary along a branch of periodic orbits, located and named.

Two orbits on both sides of the change differ in a few events, which come together there. What they are says what
happened (di Bernardo, Budd, Champneys & Kowalczyk, Piecewise-smooth Dynamical Systems, 2008), for a switch met from
side s:

    nothing          <->  stick, slip to s                      grazing-sliding
    crossing         <->  stick, slip to -s                     crossing-sliding
    stick            <->  crossing, stick from -s               switching-sliding
    a stick goes on  <->  slip, stick again                     adding-sliding
    nothing          <->  crossing, crossing back               grazing
    nothing          <->  impact                                grazing impact
    nothing          <->  opening, closed contact               lift-off
    closed contact   <->  impacts that come to no end           end of complete chatter

Bounces that accumulate are one letter with the rest in which they end (A. B. Nordmark, P. T. Piiroinen, Nonlinear
Dynamics 58 (2009) 85-106, for complete and incomplete chatter).
Chain: orbits.py -> **itineraries** -> continuation.py.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...door import checks
from ...door.documenting import complete
from ..maps.poincare import after_start
from .periodic_orbit import PeriodicOrbit

__all__ = ["Change", "change_between", "same_itinerary"]

# Events that both orbits have differ by the square root of the bracket at most: 1e-6 at a bracket of 1e-12.
_TOGETHER = 1e-3
_AT_ONCE = 1e-12  # of the period: events of one instant, whose order is that of their roundings
JUMP, CHATTER = "jump of the orbit", "end of complete chatter"
_ORBIT = checks.instance(PeriodicOrbit, "a PeriodicOrbit, as find_orbit() gives it")


@dataclass(frozen=True)
class Letter:
    """One event of a full period: its time as a part of it, 0 <= time < 1; sides of the switch before and after."""

    time: float
    switch: str
    kind: str
    before: int
    after: int

    @property
    def word(self) -> tuple[str, str, int, int]:
        """Everything but the time."""
        return self.switch, self.kind, self.before, self.after

    def __str__(self) -> str:
        sides = f" {self.before:+d} to {self.after:+d}".replace("+0", "0") if self.before or self.after else ""
        return f"{self.kind}{sides} [{self.switch}]"


@complete
@dataclass(frozen=True)
class Change:
    """How two itineraries differ: the name of the bifurcation, and the events of either side.

    Attributes
    ----------
    name : str
        "grazing-sliding", "crossing-sliding", "switching-sliding", "adding-sliding", "grazing", "grazing impact",
        "lift-off", "end of complete chatter", "change of order", "change of itinerary" or "jump of the orbit".
    before, after : tuple of Letter
        Events that only one of the orbits has.
    time : float, dimensionless
        Where they are, as a part of the period.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the
    sliding bifurcations.

    >>> from pwsmooth.analysis.orbits.itineraries import Letter
    >>> print(Change("grazing impact", (), (Letter(0.25, "R", "impact", 0, 0),), 0.25))
    grazing impact: nothing -> impact [R], at 0.2500 of the period
    """

    name: str
    before: tuple[Letter, ...]
    after: tuple[Letter, ...]
    time: float

    def __str__(self) -> str:
        before, after = (", ".join(map(str, letters)) or "nothing" for letters in (self.before, self.after))
        return f"{self.name}: {before} -> {after}, at {self.time:.4f} of the period"


def letters(orbit: PeriodicOrbit) -> list[Letter]:
    """Events of one whole period, in order; kept, as they take a run."""
    if "_letters" not in orbit.__dict__:
        orbit.__dict__["_letters"] = _letters_of(orbit)
    return orbit.__dict__["_letters"]


def _letters_of(orbit: PeriodicOrbit) -> list[Letter]:
    # With the map's own tolerances: near a change of itinerary looser ones see another word.
    events: list[Letter] = []
    begin = 0.0  # of a run, as a part of the period
    for run in orbit.runs():
        start = after_start(run)
        for e in run.events:
            if not e.time > start or e.kind == "terminal":
                continue
            before, after = (int(part) for part in e.note.split(" to ")) if " to " in e.note else (0, 0)
            time = (begin + (e.time - run.t[0]) / orbit.period) % 1.0
            # Events of one instant share the phase of the first: sorted by phase, then switch, they have one order.
            if events and 0 <= time - events[-1].time <= _AT_ONCE:
                time = events[-1].time
            events.append(Letter(time, e.switch, e.kind, before, after))
        begin += float(run.t[-1] - run.t[0]) / orbit.period
    return _counted_once(sorted(events, key=lambda letter: (letter.time, letter.switch)))


def _counted_once(word: list[Letter]) -> list[Letter]:
    """A cyclic word in which infinitely many events before an accumulation or a rest are that one letter.

    How many of them a run has passed before it goes to their limit is a matter of rounding, and so is whether the
    limit has a record of its own where a contact closes.
    """
    gone: set[int] = set()
    for i, last in enumerate(word):
        if last.kind not in ("accumulation", "closed contact"):
            continue
        many = ("impact", "accumulation") if last.kind == "closed contact" else ("impact", "crossing")
        for k in range(i - 1, i - len(word), -1):
            letter = word[k]  # a negative place is the end of the period before
            if letter.switch == last.switch:
                if letter.kind not in many:
                    break
                gone.add(k % len(word))
    return [letter for k, letter in enumerate(word) if k not in gone]


@checks.door(one=_ORBIT, other=_ORBIT)
def same_itinerary(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    """Whether two orbits have the same events in the same cyclic order.

    Parameters
    ----------
    one, other : PeriodicOrbit
        Orbits of one system.

    Returns
    -------
    bool
        Where their period begins does not matter.

    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> F = sp.Symbol("F", positive=True)
    >>> dry = System({x: v, v: sp.sin(2 * t) - x - F * sp.sign(v)}, time=t, parameters={F: 0.3})
    >>> mirror = {x: -x, v: -v}
    >>> orbits = [find_orbit(dry.with_parameters({F: f}), {x: 1, v: 0.5}, seen=Strobe(sp.pi, symmetry=mirror))
    ...           for f in (0.3, 0.31, 0.7)]
    >>> same_itinerary(orbits[0], orbits[1]), same_itinerary(orbits[0], orbits[2])
    (True, False)
    """
    if one.word == other.word:
        return True
    a, b = ([letter.word for letter in letters(orbit)] for orbit in (one, other))
    return len(a) == len(b) and (not a or any(b[k:] + b[:k] == a for k in range(len(b))))


@checks.door(one=_ORBIT, other=_ORBIT)
def change_between(one: PeriodicOrbit, other: PeriodicOrbit) -> Change:
    """What happens between two orbits close to each other on both sides of a change of itinerary.

    Parameters
    ----------
    one, other : PeriodicOrbit
        Before and after the change.

    Returns
    -------
    Change
        Its name and its events; "jump of the orbit" where they lie far apart.

    Source: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, 2008, for the
    sliding bifurcations.

    >>> t, x, v = sp.symbols("t x v", real=True)
    >>> F = sp.Symbol("F", positive=True)
    >>> dry = System({x: v, v: sp.sin(2 * t) - x - F * sp.sign(v)}, time=t, parameters={F: 0.3})
    >>> orbit = find_orbit(dry, {x: 1, v: 0.5}, seen=Strobe(sp.pi, symmetry={x: -x, v: -v}))
    >>> (found,) = follow(orbit, {F: 0.8}, steps=Steps(first=0.1)).specials
    >>> change_between(found.point, found.beyond).name
    'crossing-sliding'
    """
    before, after = letters(one), letters(other)
    old, new = _unmatched(before, after), _unmatched(after, before)
    if chatter := _chatter(old, new):
        return chatter
    cluster = sorted([*((x.time, 0, x) for x in old), *((x.time, 1, x) for x in new)], key=lambda x: x[:2])
    if not cluster:
        gone, come = _swapped(before, after)
        return Change("change of order", gone, come, gone[0].time if gone else 0.0)
    first = [c for c in cluster if _distance(c[0], cluster[0][0]) < _TOGETHER]
    if len(cluster) > len(first) and _distance(cluster[-1][0], cluster[0][0]) < 2 * _TOGETHER:
        first = [c for c in cluster if _distance(c[0], cluster[0][0]) < 2 * _TOGETHER]
    gone = tuple(x for _, side, x in first if side == 0)
    come = tuple(x for _, side, x in first if side == 1)
    far = len(first) < len(cluster) and not _repeats(cluster, first, one.symmetric)
    time = first[0][0]
    name = _name(gone, come, _status_before(before if len(gone) > len(come) else after, time))
    if far or name is None and len(gone) + len(come) < 2:
        # Events far apart change at once: the orbit after is not the continuation of the one before.
        return Change(JUMP, tuple(old), tuple(new), time)
    return Change(name or "change of itinerary", gone, come, time)


def _chatter(old: list[Letter], new: list[Letter]) -> Change | None:
    """The change at which infinitely many bounces before a rest become finitely many without one; None for others."""
    if len({x.switch for x in (*old, *new)}) != 1:
        return None
    for rests, bounces in ((old, new), (new, old)):
        kinds = {x.kind for x in rests}
        if "closed contact" in kinds <= {"closed contact", "opening"} and {x.kind for x in bounces} == {
            "impact"
        }:
            time = next(x.time for x in rests if x.kind == "closed contact")
            return Change(CHATTER, tuple(old), tuple(new), time)
    return None


def _swapped(before: list[Letter], after: list[Letter]) -> tuple[tuple[Letter, ...], tuple[Letter, ...]]:
    """The events, close together, that stand in another order."""
    for at in before:
        gone, come = (
            sorted(
                (x for x in word if _distance(x.time, at.time) < _TOGETHER),
                key=lambda x: (x.time - at.time + 0.5) % 1.0,
            )
            for word in (before, after)
        )
        if [x.word for x in gone] != [x.word for x in come]:
            return tuple(gone), tuple(come)
    return (), ()


def _distance(a: float, b: float) -> float:
    """Of two phases, as parts of the period."""
    return abs((a - b + 0.5) % 1.0 - 0.5)


def _unmatched(these: list[Letter], those: list[Letter]) -> list[Letter]:
    """Events that the other orbit does not have at nearly the same phase."""
    free = list(those)
    lost = []
    for letter in these:
        near = [x for x in free if x.word == letter.word and _distance(x.time, letter.time) < _TOGETHER]
        if near:
            free.remove(min(near, key=lambda x: _distance(x.time, letter.time)))
        else:
            lost.append(letter)
    return lost


def _repeats(cluster, first, symmetric: bool) -> bool:
    """Whether the other changes are the mirror images, half a period later, of the first ones.

    A map of whole periods does not know that its orbit is symmetric: then their letters say it.
    """
    rest = [c for c in cluster if c not in first]
    at = first[0][0] + 0.5
    mirrored = [(side, x.switch, x.kind, -x.before, -x.after) for _, side, x in first]
    symmetric = symmetric or sorted(mirrored) == sorted((side, *x.word) for _, side, x in rest)
    return symmetric and len(rest) == len(first) and all(_distance(c[0], at) < 3 * _TOGETHER for c in rest)


def _status_before(word: list[Letter], time: float) -> dict[str, int]:
    """Status of every switch just before a phase, from the last event of each in the cyclic word."""
    ordered = sorted(word, key=lambda x: (x.time - time + 0.5 * _TOGETHER) % 1.0)
    return {letter.switch: letter.after for letter in ordered}


def _name(gone, come, status: dict[str, int]) -> str | None:
    """The name of a change, read in either direction; None if it has none."""
    if len({x.switch for x in (*gone, *come)}) > 1:
        return "corner"
    less, more = (gone, come) if len(gone) <= len(come) else (come, gone)
    kinds = [x.kind for x in more]
    moves = [(x.before, x.after) for x in more]
    slips = [k.startswith("slip by") for k in kinds]
    if not less:
        if kinds in (["impact"], ["reset"]):
            return "grazing impact" if kinds == ["impact"] else "grazing of an event"
        if kinds == ["crossing", "crossing"]:
            return "grazing"
        if sorted(kinds) == ["closed contact", "opening"]:
            return "lift-off"
        if len(more) == 2 and "stick" in kinds and any(slips):
            # The short piece at the change is the one that is new: a stick, or a slip within a stick.
            inside = kinds[0] != "stick" if status.get(more[0].switch) is None else status[more[0].switch] == 0
            return "adding-sliding" if inside else "grazing-sliding"
        return None
    one = less[0]
    if len(less) == 1 and len(more) == 2:
        if one.kind == "crossing" and kinds[0] == "stick" and slips[1] and moves[1][1] == one.after:
            return "crossing-sliding"
        if one.kind == "stick" and kinds == ["crossing", "stick"] and moves[0][0] == one.before:
            return "switching-sliding"
        if one.kind.startswith("slip by") and slips[0] and kinds[1] == "crossing":
            return "switching-sliding"  # the same, seen in reversed time: it leaves through the other side
    if len(less) == len(more) == 1 and one.kind.startswith("slip by") and slips[0]:
        return "exit by a fold" if "fold" in (one.kind + kinds[0]) and one.kind != kinds[0] else "exit side"
    return None
