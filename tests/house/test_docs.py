"""The documentation's own machinery: text that shows as it stands, tables from data, links, missing figures."""

import ast
import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest

from paper_figures.claims import Claim

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def load(path):
    """A module of docs/, which is no package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def page():
    return load(DOCS / "_ext" / "page.py")


@pytest.fixture(scope="module")
def study_pages(page):
    return load(DOCS / "_ext" / "study_pages.py")


def rendered(markdown):
    """What a reader of the Markdown sees: escapes gone."""
    return re.sub(r"\\([^A-Za-z0-9\s])", r"\1", markdown)


def test_plain_text_shows_as_it_stands(page):
    text = "a_b*c <= |x|^2 [1](2) $y$ `z` #1"
    assert rendered(page.plain(text)) == text
    assert not re.search(r"(?<!\\)[*_|$`\[<#]", page.plain(text))


def test_symbols_are_set_and_names_of_code_are_not(page):
    assert page.shown("lam_s = eps/beta") == "λ{sub}`s` = ε/β"
    assert page.shown("(1 + rho)^(3/2)") == r"\(1 \+ ρ\){sup}`3/2`"
    for code in ("t_span", "solve.beta", "--eps", "experiments/beta.py", "sigma0", "log_beta"):
        assert rendered(page.shown(code)) == code


def test_a_cell_of_a_table_cannot_break_it(page):
    lines = page.table(("a", "b"), [("x | y", "two\nlines")]).splitlines()
    assert [len(re.findall(r"(?<!\\)\|", line)) for line in lines] == [3, 3, 3]


def test_a_claim_that_differs_shows_its_reason(page):
    claim = Claim("1 = 2", "2", "1", False, "arithmetic", "printed", "section 3").record()
    good = claim | {"verdict": "reproduced", "holds": True}
    differs, reproduced = page.claims_table([claim, good]).splitlines()[-2:]
    assert "differs" in differs and "arithmetic" in differs
    assert "reproduced" in reproduced and "arithmetic" not in reproduced
    assert "(section 3)" in rendered(differs)


def test_columns_of_a_docstring_become_definitions_and_paragraphs_flow(page):
    text = page.prose(
        "One\ntwo.\n\npwsmooth   solve() as a\n           user calls it\nscipy      DOP853\n\n    y' = v\n"
    )
    assert "One two" in text
    assert re.search(r"^pwsmooth\n: solve\\\(\\\) as a user calls it$", text, flags=re.MULTILINE)
    assert re.search(r"^scipy\n: DOP853$", text, flags=re.MULTILINE)
    assert "code-block" in text and "y' = v" in text


def test_every_number_of_a_benchmark_is_in_its_tables(study_pages):
    record = {
        "options": {"rounds": 3},
        "results": {"sigma 2.4": {"ours": {"us": 1.25, "events": 7}, "theirs": {"us": 8.5, "events": 7}}, "ratio": 6.8},
        "rows": [{"goal": 1e-4, "tol": 1e-6}, {"goal": 1e-8, "tol": None}],
        "all rounds": {"ours": [1.0, 1.1]},
        "provenance": {"python": "3"},
    }  # fmt: skip
    text = rendered("\n".join(study_pages.result_tables(record)))
    for number in ("1.25", "8.5", "6.8", "0.0001", "1e−06", "1e−08"):
        assert re.search(rf"(?<![\d.]){number}(?!\d)", text.replace("1e-", "1e−")), number
    assert "1.1" not in text  # raw rounds stay in the file


def test_a_study_shows_all_its_pictures_and_none_of_a_study_with_a_longer_name(
    study_pages, tmp_path, monkeypatch
):
    for script in ("maps.py", "maps_layered.py"):
        (tmp_path / script).touch()
    for chart in ("maps", "maps_2", "maps_layered", "mapsize"):
        (tmp_path / f"{chart}.png").touch()
    monkeypatch.setattr(study_pages, "SCRIPTS", tmp_path)
    monkeypatch.setattr(study_pages, "RESULTS", tmp_path)
    shown = {
        name: [p.stem for p in study_pages._charts(tmp_path / f"{name}.py")]
        for name in ("maps", "maps_layered")
    }
    assert shown == {"maps": ["maps", "maps_2"], "maps_layered": ["maps_layered"]}


def test_figures_that_are_missing_or_only_fast_are_drawn(tmp_path, monkeypatch):
    from paper_figures import making as figures

    build = load(DOCS / "build.py")
    monkeypatch.setattr(figures, "discover", lambda names=(): {"1": None, "2": None, "3": None})
    (tmp_path / "claims.json").write_text(json.dumps({"1": {"fast": True}, "2": {"fast": False}}))
    assert build.missing_figures(tmp_path, fast=True) == ["3"]
    assert build.missing_figures(tmp_path, fast=False) == ["1", "3"]
    assert build.missing_figures(tmp_path / "none", fast=True) == ["1", "2", "3"]


def test_links_that_lead_nowhere_are_found(tmp_path):
    check_pages = load(DOCS / "check_pages.py")
    for name in ("a.html", "sub/b.html"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    links = ["sub/b.html#there", "#here", "sub/b.html#gone", "no.html", "https://example.org/x", "#nowhere"]
    looks = {
        "a.html": {"ids": ["here"], "links": links},
        "sub/b.html": {"ids": ["there"], "links": ["../a.html#here", "a.html"]},
    }
    faults = check_pages.broken_links(tmp_path, looks)
    assert [fault.split("link to ")[1].split(",")[0] for fault in faults] == [
        "sub/b.html#gone", "no.html", "#nowhere", "a.html",
    ]  # fmt: skip


@pytest.mark.parametrize("path", sorted(p for p in DOCS.glob("*.md")), ids=lambda p: p.stem)
def test_the_code_of_a_page_runs_as_it_stands(path):
    """Blocks that only show code; cells are executed when the page is built."""
    blocks = re.findall(
        r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    names = {}
    for block in blocks:
        exec(compile(block, str(path), "exec"), names)


def test_code_in_a_docstring_is_set_as_code(page):
    assert page.shown("`lam_s` and ``x <= 1``") == "`lam_s` and `x <= 1`"
    shown = page.shown("`a | b`")
    assert shown.count("`") == shown.count("\\`")  # would end the cell of a table


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.md")), ids=lambda path: path.stem)
def test_links_of_a_page_lead_to_files_where_it_is_read_as_it_is(path):
    if not {"auto", "_build", "jupyter_execute"} & set(path.relative_to(DOCS).parts):
        links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
        files = [link for link in links if "://" not in link and not link.startswith("auto/")]
        assert [link for link in files if not (path.parent / link).is_file()] == []


def test_the_tests_that_hold_the_event_contract_are_there():
    text = (DOCS / "event_contract.md").read_text(encoding="utf-8")
    named = re.findall(r"^- `(\w+\.py)::(\w+)`$", text, flags=re.MULTILINE)
    assert len(named) == text.count("\n- ") == text.count("::test_")
    for file in {file for file, _ in named}:
        (path,) = (ROOT / "tests").rglob(file)
        tree = ast.parse(path.read_text(encoding="utf-8"))
        there = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert {name for where, name in named if where == file} <= there
    # Every statement has one.
    for statement in re.split(r"\n\n(?=\*\*)", text)[1:]:
        assert "\n- `" in statement.split("\n## ")[0], statement


@pytest.mark.parametrize(
    "page_of", ["CONTRIBUTING.md", "docs/architecture.md", "docs/event_contract.md", "docs/extending.md"]
)
def test_files_and_folders_that_a_page_names_are_there(page_of):
    named = re.findall(
        r"`((?:pwsmooth|tests|docs|experiments)/[\w./]*)`", (ROOT / page_of).read_text(encoding="utf-8")
    )
    assert [name for name in named if not (ROOT / name).exists() and "NAME" not in name] == []
