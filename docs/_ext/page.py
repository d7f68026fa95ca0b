"""What the generated pages share: Markdown that shows text as it stands, tables, blocks of a script's docstring."""

from __future__ import annotations

import re
import statistics
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
AUTO = ROOT / "docs" / "auto"

_MEANS_SOMETHING = re.compile(r"([\\`*_{}\[\]<>()#+\-.!|$~^:&@])")
_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eps": "ε", "epsilon": "ε", "eta": "η", "theta": "θ",
    "kappa": "κ", "lam": "λ", "lambda": "λ", "mu": "μ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ",
    "psi": "ψ", "omega": "ω",
}  # fmt: skip
_LETTER = "|".join(sorted(_GREEK, key=len, reverse=True))
_SYMBOL = re.compile(
    rf"(?<![\w.])(?<!--)(?P<base>{_LETTER}|[A-Za-z](?=_))(?:_(?P<sub>[A-Za-z0-9]{{1,3}}))?(?![\w_]|\.\w)"
)
_POWER = re.compile(r"(?:\^|\*\*)(?:\((?P<long>[^()]+)\)|(?P<short>-?\d+(?:\.\d+)?|[A-Za-z]))")
_CODE = re.compile(r"`+([^`|]+)`+")
_SIGNS = (("+-", "±"), ("<=", "≤"), (">=", "≥"), ("->", "→"), (" - ", " − "))
_NEGATIVE = re.compile(r"(?<![\w.\]})])-(?=\d)")


def plain(text: Any) -> str:
    """Markdown that shows this text as it is, on one line."""
    return _MEANS_SOMETHING.sub(r"\\\1", " ".join(str(text).split()))


def shown(text: Any) -> str:
    """Markdown of a text written for a terminal, its symbols set: lam_s^2 with a Greek letter, an index and a power."""
    roles: list[str] = []

    def kept(role: str) -> str:
        roles.append(role)
        return f"\x00{len(roles) - 1}\x01"

    def symbol(match: re.Match) -> str:
        letter = _GREEK.get(match["base"], match["base"])
        return letter + (kept(f"{{sub}}`{match['sub']}`") if match["sub"] else "")

    line = " ".join(str(text).split())
    line = _CODE.sub(lambda m: kept(f"`{m[1]}`"), line)
    line = _SYMBOL.sub(symbol, line)
    line = _POWER.sub(lambda m: kept(f"{{sup}}`{m['long'] or m['short']}`"), line)
    for typed, sign in _SIGNS:
        line = line.replace(typed, sign)
    line = plain(_NEGATIVE.sub("−", line))
    return re.sub("\x00(\\d+)\x01", lambda m: roles[int(m[1])], line)


def headline(text: Any) -> str:
    """A title with Greek letters, without roles, which menus do not show."""
    return plain(_SYMBOL.sub(lambda m: m[0] if m["sub"] else _GREEK.get(m[0], m[0]), str(text)))


def number(value: Any) -> str:
    """A table's entry: four digits of a float; nothing for what was not measured."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        numbers = [v for v in value if isinstance(v, (int, float))]
        if len(value) > 4 and len(numbers) == len(value):  # rounds of a measurement
            low, middle, high = min(numbers), statistics.median(numbers), max(numbers)
            return f"{number(middle)} ({number(low)} to {number(high)}, {len(numbers)} rounds)"
        return ", ".join(number(v) for v in value)
    return str(value)


def table(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A pipe table; cells that are already Markdown are given as `Raw`."""

    def line(cells):
        return "| " + " | ".join(c if isinstance(c, Raw) else shown(number(c)) for c in cells) + " |"

    return "\n".join([line(head), "|" + " --- |" * len(head), *(line(row) for row in rows)]) + "\n"


class Raw(str):
    """Markdown that is taken as it stands."""


_COLUMNS = re.compile(r"(\S(?:.*?\S)?) {2,}(\S.*)")


def prose(docstring: str) -> str:
    """A script's docstring as Markdown: paragraphs flow, columns are tables, what is indented stays as typed."""
    parts = []
    for block in re.split(r"\n\s*\n", docstring.strip("\n")):
        lines = block.splitlines()
        if len(lines) > 1 and re.fullmatch(r"[-=]{3,}", lines[1].strip()):
            parts.append(f"**{plain(lines[0])}**")
            lines = lines[2:]
        if not lines:
            continue
        usage = re.match(r"(?:Usage|Run): ?(.*)", lines[0])
        if usage:
            rest = [line.strip() for line in lines[1:]]
            parts.append(fenced("\n".join([usage[1], *(f"    {line}" for line in rest)]), "text"))
        elif lines[0].startswith(" "):
            parts.append(fenced(textwrap.dedent("\n".join(lines))))
        elif _COLUMNS.fullmatch(lines[0]):
            parts.append(_definitions(lines))
        else:
            parts.append(shown(" ".join(lines)))
    return "\n\n".join(parts) + "\n"


def _definitions(lines: list[str]) -> str:
    """Lines of `name    meaning`, whose meaning may go on in indented lines."""
    rows: list[list[str]] = []
    for line in lines:
        columns = _COLUMNS.fullmatch(line)
        if columns and not line.startswith(" "):
            rows.append([columns[1], columns[2]])
        else:
            rows[-1][1] += " " + line.strip()
    return "\n".join(f"{shown(name)}\n: {shown(meaning)}\n" for name, meaning in rows)


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


def claims_table(claims: Sequence[dict[str, Any]], *, source: str = "held against") -> str:
    """Statement, what it is held against and where that comes from, ours, verdict with its reason."""
    return table(
        ("claim", source, "ours", "verdict"),
        ((c["claim"], Raw(shown(c["source"]) + origin_of(c)), c["ours"], verdict_of(c)) for c in claims),
    )


def origin_of(claim: dict[str, Any]) -> str:
    """Where the value comes from, behind it: of a study's own expectation nothing."""
    if claim["origin"] == "expected":
        return ""
    return " " + shown(f"({claim['where'] or claim['origin']})")


def verdict_of(claim: dict[str, Any]) -> Raw:
    """The verdict in its colour, and the reason where a claim does not hold."""
    return coloured(claim["verdict"], claim["holds"], claim["reason"])


def coloured(word: str, good: bool | None, why: str) -> Raw:
    """A verdict in the colour of good or bad, or of neither, and why it is not good."""
    shade = {True: "{.verdict-good}", False: "{.verdict-bad}"}.get(good, "")
    return Raw((f"[{word}]{shade}" if shade else word) + ("" if good else f": {shown(why)}"))


def provenance_text(record: dict[str, Any]) -> str:
    """Versions and machine, one line each."""
    versions = ", ".join(f"{name} {v}" for name, v in (record.get("versions") or {}).items() if v)
    rest = [f"Python {record['python']}"] if record.get("python") else []
    rest += [str(record[k]) for k in ("machine", "system") if record.get(k)]
    if record.get("cores"):
        rest.append(f"{record['cores']} cores")
    return plain(f"{versions}; {', '.join(rest)}" if versions else ", ".join(rest))


_written: set[Path] = set()


def write(path: Path, text: str) -> None:
    """Write a page if it says something new."""
    _written.add(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def forget_old_pages(*folders: Path) -> None:
    """Remove pages of earlier builds, whose figure, experiment or module is gone."""
    for folder in folders:
        for path in [*folder.rglob("*.md"), *folder.rglob("*.rst")]:
            if path not in _written:
                path.unlink()


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
    shown_image = f":img-top: {image}\n:img-alt: {plain(title)}\n" if image else ""
    return (
        f"::::{{grid-item-card}} {title}\n:link: {page}\n:link-type: doc\n{shown_image}\n{shown(text)}\n::::\n"
    )


def grid(cards: Iterable[str]) -> str:
    """Cards, three in a row on a wide page and one on a phone."""
    return ":::::{grid} 1 2 3 3\n:gutter: 3\n\n" + "\n".join(cards) + ":::::\n"


def toctree(pages: Iterable[str], *, hidden: bool = True, depth: int = 1) -> str:
    """The pages below this one."""
    option = ":hidden:\n" if hidden else ""
    return f"```{{toctree}}\n{option}:maxdepth: {depth}\n\n" + "\n".join(pages) + "\n```\n"
