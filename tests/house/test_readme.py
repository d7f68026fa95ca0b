"""What the README promises: two set-up commands, an example that runs as it stands, and what was measured."""

import json
import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_there_are_exactly_two_set_up_commands_of_one_line_each():
    commands = re.findall(r"^    (\S.*)$", README, flags=re.MULTILINE)
    assert commands == [
        "pip install -e . && pwsmooth figures",
        "pip install -e '.[test]' && pytest -n 2 --dist worksteal",
    ]
    assert commands[1] in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_its_parts_stand_in_the_order_of_a_first_visit():
    assert re.findall(r"^#+ (.*)$", README, flags=re.MULTILINE) == [
        "pwsmooth", "Install", "Example", "The same equations elsewhere", "What one definition gives",
        "What accuracy costs", "How it is checked", "What it cannot do", "Where to go on",
    ]  # fmt: skip


def test_every_picture_and_page_that_it_names_is_there():
    links = [link for link in re.findall(r"\]\((.*?)\)", README) if "://" not in link]
    assert len(links) > 20 and all((ROOT / link).is_file() for link in links)
    (systems,) = re.findall(r"`docs/gallery/`: (\d+) of them", README)
    assert int(systems) == len([*ROOT.glob("docs/gallery/*/plot_*.py")])


def test_its_short_example_sticks_and_shows_its_picture(monkeypatch):
    matplotlib.use("Agg")
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 11
    names, shown = {}, []
    monkeypatch.setattr(plt, "show", lambda: shown.extend(plt.figure(n) for n in plt.get_fignums()))
    plt.close("all")
    exec(compile(code, "README.md", "exec"), names)
    sol = names["sol"]
    assert sol.success and "stick (lam sliding)" in sol.itinerary
    # The largest mu is the height of the fold, 16/9, where each stick ends.
    assert abs(np.abs(sol["mu"]).max() - 16 / 9) < 1e-9
    (figure,) = shown
    assert [axes.get_ylabel() for axes in figure.axes] == ["y", "v", "mu"]
    plt.close(figure)


def test_what_it_says_of_other_tools_is_what_the_study_found():
    record = json.loads((ROOT / "experiments/results/other_tools.json").read_text(encoding="utf-8"))
    found = record["data"]
    assert all(claim["holds"] for claim in record["claims"])
    rows = [line.strip("| ").split(" | ") for line in README.splitlines() if line.startswith("| ")]
    table = {row[0]: row[1:] for row in rows if len(row) == 3}
    steep = found["tanh, eps 0.0001"]
    for tool, run, said in (
        ("pwsmooth", found["ours"], "all eight sticks"),
        ("SciPy's `solve_ivp`, `sign(v)` as it stands", found["SciPy"], "reports success"),
        ("its stiff methods Radau and BDF", found["SciPy, Radau"], f"t = {found['SciPy, BDF']['ends']:.2f}"),
        ("SciPy with `tanh(v/eps)` for the sign", steep, "here 0.0001"),
        ("nosnoc", found["nosnoc"], "at most 1"),
        ("solve_nivp", found["solve_nivp"], f"t = {found['solve_nivp']['ends']:.2f}"),
    ):
        assert said in table[tool][0]
        assert table[tool][1] == ("–" if run["end"] is None else f"{run['end']:.3f}")
    assert found["ours"]["number"] == 8
