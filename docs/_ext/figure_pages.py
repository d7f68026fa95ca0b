"""A page for every paper figure, their gallery, and the replication report, from claims.json and the scripts."""

from __future__ import annotations

import ast
import json
from pathlib import Path

from page import (
    AUTO,
    ROOT,
    Raw,
    card,
    claims_table,
    code,
    coloured,
    grid,
    headline,
    picture,
    plain,
    prose,
    shown,
    table,
    toctree,
    write,
)

from paper_figures import statements
from paper_figures.claims import ORIGINS, counted, tally

GALLERY = AUTO / "figures"


def entries(figures: Path) -> dict[str, dict]:
    """claims.json of a directory that `pwsmooth figures --out` has filled, one entry for every figure's script.

    Raises
    ------
    FileNotFoundError
        The directory lacks figures.
    """
    record = figures / "claims.json"
    found = json.loads(record.read_text(encoding="utf-8")) if record.is_file() else {}
    drawn = {Path(entry["files"][0]).stem for entry in found.values()}
    wanted = {path.stem for path in (ROOT / "paper_figures").glob("figure_*.py")}
    if wanted - drawn:
        raise FileNotFoundError(
            f"{figures} lacks {', '.join(sorted(wanted - drawn))}: `python docs/build.py` draws them, or "
            f"`pwsmooth figures --out {figures}`"
        )
    return {name: entry for name, entry in found.items() if Path(entry["files"][0]).stem in wanted}


def write_pages(figures: Path) -> None:
    """All pages of the figures, and the report."""
    found = entries(figures)
    stems = {name: Path(entry["files"][0]).stem for name, entry in found.items()}
    for name, entry in found.items():
        _write_figure(figures, name, stems[name], entry)
    helpers = [p for p in sorted((ROOT / "paper_figures").glob("*.py")) if p.stem not in stems.values()]
    _write_helpers([p for p in helpers if p.stem != "__init__"])
    fast = any(entry["fast"] for entry in found.values())
    note = (
        "\n:::{note}\nDrawn in the fast mode: coarser curves and shorter sweeps. The full figures are made by "
        "`pwsmooth figures`.\n:::\n" if fast else ""
    )  # fmt: skip
    cards = [
        card(f"Figure {plain(name)}", entry["title"], stems[name], f"thumbnails/{stems[name]}.png")
        for name, entry in found.items()
    ]
    write(
        GALLERY / "index.md",
        "# Paper figures\n\nThe figures of the sources, computed from their equations by `pwsmooth figures`; each with "
        "what it claims, what its equations give, and its code. The verdicts on one page: "
        "[replication report](../replication.md).\n" + note + "\n" + grid(cards)
        + toctree([*stems.values(), "shared"]),
    )  # fmt: skip
    _write_report(found, stems, note)
    _write_statements(found, stems, note)


def _write_figure(figures: Path, name: str, stem: str, entry: dict) -> None:
    picture(figures / f"{stem}.png", GALLERY / f"{stem}.png")
    document = figures / f"{stem}.pdf"
    if document.is_file():
        (GALLERY / f"{stem}.pdf").write_bytes(document.read_bytes())
    script = ROOT / "paper_figures" / f"{stem}.py"
    docstring = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    # What the figure's script says of itself, without the name that is the page's title already.
    about = docstring.partition(":")[2].strip() if docstring.lower().startswith("figure") else docstring
    write(
        GALLERY / f"{stem}.md",
        f"# Figure {plain(name)}: {headline(entry['title'])}\n\n"
        f"```{{image}} {stem}.png\n:alt: {plain(entry['title'])}\n:width: 100%\n```\n\n"
        f"{shown(entry['caption'])}\n\n"
        f"{{download}}`PDF <{stem}.pdf>`\n\n"
        f"## Claims\n\n{claims_table(entry['claims']) if entry['claims'] else 'None.'}\n"
        f"## How it is made\n\n{prose(about)}\n"
        f"`pwsmooth figures {name}`{' with `--fast`' if entry['fast'] else ''}; pwsmooth {plain(entry['pwsmooth'])}."
        f" What several figures use is [here](shared.md).\n\n{code(script)}",
    )


def _write_helpers(helpers: list[Path]) -> None:
    parts = ["# What several figures use\n"]
    for path in helpers:
        docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        parts += [f"## {plain(path.stem.replace('_', ' '))}\n", prose(docstring), code(path)]
    write(GALLERY / "shared.md", "\n".join(parts))


def _write_report(found: dict[str, dict], stems: dict[str, str], note: str) -> None:
    every = [c for entry in found.values() for c in entry["claims"]]
    rows = [
        (Raw(f"[{plain(name)}](figures/{stems[name]}.md)"), entry["title"], counted(entry["claims"]))
        for name, entry in found.items()
    ]
    parts = [
        "# Replication report\n",
        "What the figures claim, held against what the sources print, against closed forms and against other "
        "programs: evidence of different worth, counted apart. Where one does not hold, the reason stands beside it. "
        "The report is made from `claims.json`, which `pwsmooth figures` writes. All statements of the sources, "
        f"section by section: [what the sources say](statements.md).\n{note}",
        table(
            ("origin", "what it is", "hold", "do not", "verdict"),
            (
                (origin, ORIGINS[origin].meaning, good, bad, f"{ORIGINS[origin].good}; {ORIGINS[origin].bad}")
                for origin, (good, bad) in tally(every).items()
            ),
        ),
        table(("figure", "title", "claims that hold"), rows),
    ]
    for name, entry in found.items():
        if entry["claims"]:
            parts += [
                f"## Figure {plain(name)}: {headline(entry['title'])}\n",
                claims_table(entry["claims"]),
                f"[Figure and code](figures/{stems[name]}.md)\n",
            ]
    write(AUTO / "replication.md", "\n".join(parts))


def _write_statements(found: dict[str, dict], stems: dict[str, str], note: str) -> None:
    """Every statement of the sources, with links to what tests it."""
    known = statements.records(found)
    parts = [
        "# What the sources say\n",
        "Figures and studies make claims that test a statement. It is reproduced if all of its claims hold. "
        f"The claims with their values: [replication report](replication.md).\n{note}",
        table(
            ("verdict", "statements", "what it means"),
            ((word, number, statements.MEANINGS[word]) for word, number in statements.overall(known).items()),
        ),
        table(
            ("source", "verdicts"),
            (
                (statements.SOURCES[source], ", ".join(f"{number} {word}" for word, number in words.items()))
                for source, words in statements.counts(known).items()
            ),
        ),
    ]
    for source, title in statements.SOURCES.items():
        rows = []
        for one in statements.statements(source):
            word, good, why = statements.verdict(one, known)
            names = dict.fromkeys(name for name, _ in statements.claims_of(one, known))
            tested = ", ".join(
                f"[figure {plain(name)}](figures/{stems[name]}.md)" if name in stems
                else f"[{plain(name.replace('_', ' '))}](experiments/{name}.md)"
                for name in names
            )  # fmt: skip
            rows.append((one.where, one.says, Raw(tested or "–"), coloured(word, good, why)))
        parts += [f"## {plain(title)}\n", table(("place", "statement", "tested by", "verdict"), rows)]
    write(AUTO / "statements.md", "\n".join(parts))
