"""The table of the sources' statements: nothing left out, every row tested or with its reason, counted by verdict."""

import pytest

from paper_figures import statements
from paper_figures.claims import Claim
from paper_figures.statements import Statement


def a_claim(text, holds=True, origin="printed"):
    return Claim(text, "1", "1", holds, "" if holds else "a misprint", origin, "section 3").record()


FOUND = {
    "1": [
        a_claim("the peak is high"),
        a_claim("the peak is broad", holds=False),
        a_claim("1 = 1", origin="identity"),
    ],
    "drive": [a_claim("it sticks", origin="reconstruction")],
}


@pytest.mark.parametrize(
    "by, word, good",
    [
        (("1: the peak is high",), "reproduced", True),
        (("1: the peak is high", "1: the peak is broad"), "differs", False),
        (("drive: it", "1: the peak is high"), "shown", True),
        (("1: 1 = 1",), "plain from the formula", True),
        (("1: 1 = 1", "1: the peak is high"), "reproduced", True),
    ],
)
def test_a_statement_holds_if_all_its_claims_do(by, word, good):
    assert statements.verdict(Statement("section 1", "a peak", by), FOUND)[:2] == (word, good)


def test_a_statement_that_differs_says_why_and_one_that_is_not_tested_too():
    differs = Statement("section 1", "a peak", ("1: the peak is broad",))
    assert statements.verdict(differs, FOUND)[2] == "a misprint"
    untested = Statement("section 1", "a prospect", untested="no data")
    assert statements.verdict(untested, FOUND) == ("not tested", None, "no data")


def test_of_the_chapter_without_equations_nothing_counts_as_reproduced():
    assert (
        statements.verdict(Statement("chapter 4, figure 4.8", "a loop", ("1: the peak is high",)), FOUND)[0]
        == "shown"
    )


@pytest.mark.parametrize("pointer", ["1: the peak", "1: nothing", "2: the peak is high"])
def test_a_pointer_to_no_claim_or_to_several_is_an_error(pointer):
    with pytest.raises(LookupError, match="leads to"):
        statements.verdict(Statement("section 1", "a peak", (pointer,)), FOUND)


# What the texts number: sections, figures, propositions, tables.
NUMBERED = {
    "solid_friction": [
        *(f"section {n}" for n in range(1, 10)), "appendix A", "appendix B", *(f"proposition {n}" for n in range(1, 6)),
        *(f"figure {n}" for n in range(1, 14) if n not in (2, 4)),  # which draw what sections 2 and 5 say
    ],
    "friction_thesis": ["chapter 4", "section 5.1", "figure 5.1", *(f"figure 4.{n}" for n in range(8, 12))],
    "clearance_joint": ["section 1", "section 5", "Table 1", "Table 2", "Table 3", "last figures", "section 7"],
}  # fmt: skip


@pytest.mark.parametrize("source", NUMBERED)
def test_no_numbered_part_of_a_source_is_left_out(source):
    places = [one.where.replace(",", " ").split("  ") for one in statements.statements(source)]
    told = " | ".join(" ".join(parts) for parts in places) + " |"
    for part in NUMBERED[source]:
        assert any(f"{part}{end}" in told for end in (" ", " |", "|")), part
    for one in statements.statements(source):
        assert one.where and one.says and bool(one.by) != bool(one.untested)
