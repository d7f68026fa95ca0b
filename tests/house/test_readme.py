"""What the README promises: two set-up commands, and an example that runs as it stands."""

import re
from pathlib import Path

import matplotlib
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


def test_every_picture_that_it_shows_is_there():
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert pictures and all((ROOT / picture).is_file() for picture in pictures)


def test_its_example_of_ten_lines_runs_and_sticks():
    matplotlib.use("Agg")
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    sol = names["sol"]
    assert sol.success and "stick (lam sliding)" in sol.itinerary
    # The largest mu is the height of the fold, 16/9, where each stick ends.
    assert abs(np.abs(sol["mu"]).max() - 16 / 9) < 1e-9
