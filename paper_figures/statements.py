"""Every statement of the three sources, section by section, with the claims that test it, or why none does.

The table stands in statements_SOURCE.toml: place, statement, and the claims of figures and studies that test it, each
by "NAME: beginning of the claim". Nothing is judged here: a statement holds if all claims that it points to hold.
"""

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

from paper_figures.claims import ORIGINS

SOURCES = {
    "solid_friction": "M. R. Jeffrey, On the mathematical basis of solid friction",
    "friction_thesis": "X. Xiong's thesis: the end of chapter 4 and the beginning of chapter 5",
    "clearance_joint": "Wang, Liu and Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545, as lecture slides show it",
}
RESULTS = Path(__file__).resolve().parent.parent / "experiments" / "results"
NOT_TESTED, PLAIN = "not tested", "plain from the formula"
MEANINGS = {
    ORIGINS["printed"].good: "a source prints it, and its equations give it",
    ORIGINS["printed"].bad: "a source prints it, and its equations give something else",
    ORIGINS["reconstruction"].good: "on equations that had to be reconstructed, which give it",
    ORIGINS["reconstruction"].bad: "on equations that had to be reconstructed, which give something else",
    PLAIN: "its formula leaves no other answer",
    NOT_TESTED: "no claim tests it; the reason stands in its place",
}
RECONSTRUCTED = "chapter 4"  # of the thesis: its equations are not in the excerpt


@dataclass(frozen=True)
class Statement:
    """What a source says at a place, and by which claims it is tested; or why it is not."""

    where: str
    says: str
    by: tuple[str, ...] = ()
    untested: str = ""


def statements(source):
    """The rows of a source, in the order of its text."""
    path = Path(__file__).resolve().parent / f"statements_{source}.toml"
    return [
        Statement(where, says, untested=test) if isinstance(test, str) else Statement(where, says, tuple(test))
        for where, rows in tomllib.loads(path.read_text(encoding="utf-8")).items()
        for says, test in rows.items()
    ]


def records(figures):
    """Name of a figure or study -> its claims' records; `figures` is what claims.json holds."""
    found = {name: entry["claims"] for name, entry in figures.items()}
    for path in sorted(RESULTS.glob("*.json")):
        claims = json.loads(path.read_text(encoding="utf-8")).get("claims")
        if claims:
            found[path.stem] = claims
    return found


def claims_of(statement, found):
    """(name, claim) of each pointer; a LookupError where one leads to no claim or to several."""
    result = []
    for pointer in statement.by:
        name, _, begins = pointer.partition(": ")
        here = [claim for claim in found.get(name, ()) if claim["claim"].startswith(begins)]
        if len(here) != 1:
            raise LookupError(f"{pointer!r} leads to {len(here)} claims")
        result.append((name, here[0]))
    return result


def verdict(statement, found):
    """(word, whether it holds or None, reasons): the word of what is printed, reconstructed, or cannot be otherwise."""
    if statement.untested:
        return NOT_TESTED, None, statement.untested
    claims = [claim for _, claim in claims_of(statement, found)]
    origins = {claim["origin"] for claim in claims}
    words = ORIGINS["printed"]
    words = words._replace(good=PLAIN) if origins == {"identity"} else words
    rebuilt = "reconstruction" in origins or statement.where.startswith(RECONSTRUCTED)
    words = ORIGINS["reconstruction"] if rebuilt else words
    good = all(claim["holds"] for claim in claims)
    return (
        words.good if good else words.bad,
        good,
        "; ".join(claim["reason"] for claim in claims if claim["reason"]),
    )


def counts(found):
    """Source -> verdict -> number of its statements."""
    result = {}
    for source in SOURCES:
        words = [verdict(statement, found)[0] for statement in statements(source)]
        result[source] = {word: words.count(word) for word in dict.fromkeys(words)}
    return result


def overall(found):
    """Verdict -> number of the statements of all sources, in the order of MEANINGS."""
    total = dict.fromkeys(MEANINGS, 0)
    for words in counts(found).values():
        for word, number in words.items():
            total[word] += number
    return total
