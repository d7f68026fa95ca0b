"""Claims: a statement beside what the equations give, with the origin of the value that it is held against.

A number that a source prints, one that follows from its equations, one that another program has computed and one that
cannot come out otherwise are evidence of different worth. So each claim says which it is, its verdict has the word of
its origin, and origins are counted apart: only what is printed in a source can be reproduced.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from pwsmooth.door import checks

__all__ = ["Claim", "counted", "tally"]


class Origin(NamedTuple):
    """Where expected values of one kind come from, and the verdicts where a claim holds and where it does not."""

    meaning: str
    good: str
    bad: str


ORIGINS = {
    "printed": Origin("in a source, with section or equation", "reproduced", "differs"),
    "derived": Origin("in closed form from the equations", "follows", "does not follow"),
    "independent": Origin("computed by another program", "agrees", "disagrees"),
    "reconstruction": Origin("a source's words on equations that were not available", "shown", "not shown"),
    "expected": Origin("by us, before the computation", "holds", "does not hold"),
    "identity": Origin("a check of the code, no claim", "passes", "is broken"),
}


@checks.door()
@dataclass(frozen=True)
class Claim:
    """A statement beside what the equations give here.

    Parameters
    ----------
    statement : str
        What is said.
    source, ours : str
        The value or words that it is held against, and ours.
    holds : bool
        Whether they agree.
    reason : str
        Why they differ; required if they do.
    origin : str
        Where the expected value comes from: ``"printed"`` in a source, ``"derived"`` from the equations, an
        ``"independent"`` computation, a ``"reconstruction"`` (a source's words, of equations that had to be
        reconstructed), ``"expected"`` by us, or an ``"identity"``: a check of the code, no claim.
    where : str
        Source with section or equation; required of what is printed in one.

    Raises
    ------
    ValueError
        The origin is unknown; what is printed does not say where; they differ, and there is no reason.

    Examples
    --------
    >>> from paper_figures.claims import Claim
    >>> fold = dict(statement="height of the fold", source=1.78, ours=16 / 9, tolerance=0.005)
    >>> Claim.number(**fold, origin="printed", where="solid friction, (17)").verdict
    'reproduced'
    >>> Claim.number(**fold, origin="independent").verdict
    'agrees'
    """

    statement: str
    source: str
    ours: str
    holds: bool
    reason: str = ""
    origin: str = "expected"
    where: str = ""

    def __post_init__(self) -> None:
        if self.origin not in ORIGINS:
            raise ValueError(f"`origin` is {self.origin!r}; it is one of {', '.join(ORIGINS)}.")
        if self.origin == "printed" and not self.where:
            raise ValueError(
                f"`where` is empty although {self.statement!r} is printed; name source and section."
            )
        if not self.holds and not self.reason:
            raise ValueError(f"`reason` is empty although {self.statement!r} differs; say why it does.")

    @classmethod
    def number(
        cls,
        statement: str,
        source: float,
        ours: float,
        tolerance: float,
        *,
        digits: int = 6,
        reason: str = "",
        origin: str = "expected",
        where: str = "",
    ) -> Claim:
        """A claim on a number: it holds if source and ours differ by the tolerance at most.

        Parameters
        ----------
        statement : str
            What is said, with its unit.
        source, ours : float, in the unit of the statement
            The expected value, and ours.
        tolerance : float, in the unit of the statement
            To which the expected value is known.
        digits : int
            Significant digits that are shown.
        reason : str
            Why they differ; the difference by default.
        origin, where : str
            Where the expected value comes from.

        Returns
        -------
        Claim
            With both numbers as text.
        """
        same = bool(abs(source - ours) <= tolerance)
        why = "" if same else reason or f"off by {ours - source:.3g}, tolerance {tolerance:.2g}"
        return cls(statement, f"{source:.{digits}g}", f"{ours:.{digits}g}", same, why, origin, where)

    @property
    def verdict(self) -> str:
        """The origin's word: "reproduced" or "differs" of what is printed."""
        words = ORIGINS[self.origin]
        return words.good if self.holds else words.bad

    def record(self) -> dict[str, Any]:
        """The claim as it stands in claims.json.

        Returns
        -------
        dict
            claim, source, ours, holds, reason, origin, where, verdict.
        """
        fields = asdict(self)
        return {"claim": fields.pop("statement"), **fields, "holds": bool(self.holds), "verdict": self.verdict}


@checks.door()
def tally(claims: Iterable[Mapping[str, Any]]) -> dict[str, tuple[int, int]]:
    """How many claims of each origin hold, and how many do not.

    Parameters
    ----------
    claims : iterable of mapping
        Records of claims.

    Returns
    -------
    dict of str to (int, int)
        Origin -> (hold, do not), in a fixed order; origins without a claim are left out.

    Examples
    --------
    >>> from paper_figures.claims import Claim, tally
    >>> tally([Claim("1 < 2", "yes", "yes", True, origin="identity").record()])
    {'identity': (1, 0)}
    """
    found = {origin: [0, 0] for origin in ORIGINS}
    for claim in claims:
        found[claim["origin"]][not claim["holds"]] += 1
    return {origin: (good, bad) for origin, (good, bad) in found.items() if good or bad}


@checks.door()
def counted(claims: Iterable[Mapping[str, Any]]) -> str:
    """How many hold, in words.

    Parameters
    ----------
    claims : iterable of mapping
        Records of claims.

    Returns
    -------
    str
        As "printed 2 of 3, derived 1 of 1".

    Examples
    --------
    >>> from paper_figures.claims import Claim, counted
    >>> one = Claim("the peak is at 1.2", "1.2", "1.3", False, "a misprint", "printed", "section 2")
    >>> counted([one.record()])
    'printed 0 of 1'
    """
    return ", ".join(f"{origin} {good} of {good + bad}" for origin, (good, bad) in tally(claims).items())


def print_claims(console: Any, entries: Mapping[str, Mapping[str, Any]], *, everything: bool = False) -> None:
    """The counts by origin and what does not hold; with `everything` then a row for every claim."""
    from rich.markup import escape
    from rich.table import Table

    rows = [(name, claim) for name, entry in entries.items() for claim in entry["claims"]]
    if not rows:
        return
    counts = Table(title="Claims by the origin of what they are held against")
    for header in ("origin", "claims", "hold", "do not"):
        counts.add_column(header, justify="left" if header == "origin" else "right")
    for origin, (good, bad) in tally(claim for _, claim in rows).items():
        counts.add_row(f"{origin}: {ORIGINS[origin].meaning}", str(good + bad), str(good), str(bad))
    console.print(counts)
    failing = [(name, claim) for name, claim in rows if not claim["holds"]]
    if failing:
        short = Table(title="What does not hold", show_lines=True)
        for header, ratio in (("figure", 1), ("claim", 6), ("verdict", 8)):
            short.add_column(header, ratio=ratio, overflow="fold")
        for name, claim in failing:
            short.add_row(name, escape(claim["claim"]), _verdict(claim))
        console.print(short)
    if not everything:
        return
    long = Table(title="What is claimed and what the equations give", show_lines=True)
    for header, ratio in (("figure", 1), ("claim", 7), ("source", 4), ("ours", 5), ("verdict", 6)):
        long.add_column(header, ratio=ratio, overflow="fold")
    for name, claim in rows:
        long.add_row(name, *(escape(claim[key]) for key in ("claim", "source", "ours")), _verdict(claim))
    console.print(long)


def _verdict(claim: Mapping[str, Any]) -> str:
    from rich.markup import escape

    colour, why = ("green", "") if claim["holds"] else ("yellow", f": {escape(claim['reason'])}")
    return f"[{colour}]{claim['verdict']}[/]{why}"
