"""What the generated pages share: Markdown that shows text as it stands, tables, blocks of a script's docstring."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
AUTO = ROOT / "docs" / "auto"

_MEANS_SOMETHING = re.compile(r"([\\`*_{}\[\]<>()#+\-.!|$~^:&@])")


def plain(text: Any) -> str:
    """Markdown that shows this text as it is, on one line."""
    return _MEANS_SOMETHING.sub(r"\\\1", " ".join(str(text).split()))


def number(value: Any) -> str:
    """A table's entry: four digits of a float; nothing for what was not measured."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(number(v) for v in value)
    return str(value)


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A pipe table; cells that are already Markdown are given as `Raw`."""

    def line(cells):
        return "| " + " | ".join(c if isinstance(c, Raw) else plain(number(c)) for c in cells) + " |"

    return "\n".join([line(head), "|" + " --- |" * len(head), *(line(row) for row in rows)]) + "\n"


class Raw(str):
    """Markdown that is taken as it stands."""


def prose(docstring: str) -> str:
    """A script's docstring as Markdown: paragraphs flow, what is laid out in columns or indented stays as typed."""
    blocks = re.split(r"\n\s*\n", docstring.strip("\n"))
    parts = []
    for block in blocks:
        lines = block.splitlines()
        head = len(lines) > 1 and re.fullmatch(r"[-=]{3,}", lines[1].strip())
        if head:
            parts.append(f"**{plain(lines[0])}**")
            lines = lines[2:]
        if not lines:
            continue
        typed = any(line.startswith((" ", "\t")) or "   " in line.strip() for line in lines)
        parts.append(fenced("\n".join(lines)) if typed else plain(" ".join(lines)))
    return "\n\n".join(parts) + "\n"


def fenced(text: str, language: str = "text") -> str:
    """A block of literal text."""
    return f"````{{code-block}} {language}\n{text}\n````"


def code(path: Path, *, title: str = "Code", opened: bool = False) -> str:
    """The source of a file of the repository, folded away."""
    inside = path.relative_to(ROOT).as_posix()
    option = ":open:\n" if opened else ""
    return (
        f"::::{{dropdown}} {title}: {inside}\n{option}:icon: code\n\n"
        f"```{{literalinclude}} /../{inside}\n:language: python\n```\n::::\n"
    )


def claims_table(claims: Sequence[dict[str, str]], *, source: str = "source") -> str:
    """Statement, the source's value, ours, verdict with its reason."""
    rows = []
    for claim in claims:
        good = claim["verdict"] == "reproduced"
        verdict = f"[{claim['verdict']}]{{.verdict-{claim['verdict']}}}"
        rows.append(
            (claim["claim"], claim["source"], claim["ours"],
             Raw(verdict if good else f"{verdict}: {plain(claim['reason'])}"))
        )  # fmt: skip
    return table(("claim", source, "ours", "verdict"), rows)


def provenance_text(record: dict[str, Any]) -> str:
    """Versions and machine, one line each."""
    versions = ", ".join(f"{name} {v}" for name, v in (record.get("versions") or {}).items() if v)
    rest = [f"Python {record['python']}"] if record.get("python") else []
    rest += [str(record[k]) for k in ("machine", "system") if record.get(k)]
    if record.get("cores"):
        rest.append(f"{record['cores']} cores")
    return plain(f"{versions}; {', '.join(rest)}" if versions else ", ".join(rest))


def write(path: Path, text: str) -> None:
    """Write a page if it says something new, so that Sphinx reads again only what changed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def picture(source: Path, target: Path, *, thumbnail: int = 480) -> None:
    """Copy a PNG, and a small one of it beside under thumbnails/."""
    from PIL import Image

    target.parent.mkdir(parents=True, exist_ok=True)
    content = source.read_bytes()
    small = target.parent / "thumbnails" / target.name
    if target.is_file() and target.read_bytes() == content and small.is_file():
        return
    target.write_bytes(content)
    small.parent.mkdir(exist_ok=True)
    with Image.open(source) as image:
        image = image.convert("RGB")
        image.thumbnail((2 * thumbnail, thumbnail))
        image.save(small)


def card(title: str, text: str, page: str, image: str | None) -> str:
    """One card of a grid."""
    shown = f":img-top: {image}\n:img-alt: {plain(title)}\n" if image else ""
    return f"::::{{grid-item-card}} {title}\n:link: {page}\n:link-type: doc\n{shown}\n{plain(text)}\n::::\n"


def grid(cards: Iterable[str]) -> str:
    """Cards, three in a row on a wide page and one on a phone."""
    return ":::::{grid} 1 2 3 3\n:gutter: 3\n\n" + "\n".join(cards) + ":::::\n"


def toctree(pages: Iterable[str], *, hidden: bool = True, depth: int = 1) -> str:
    """The pages below this one."""
    option = ":hidden:\n" if hidden else ""
    return f"```{{toctree}}\n{option}:maxdepth: {depth}\n\n" + "\n".join(pages) + "\n```\n"
