"""The machinery of the figures: whole files, claims with verdicts, names, failures, interruption."""

import doctest
import functools
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

from paper_figures import claims, statements
from paper_figures import making as figures
from paper_figures.claims import ORIGINS, Claim, counted, tally
from paper_figures.making import FiguresError
from pwsmooth import cli


def a_figure(name="7", draw=None):
    def blank(fast):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(1, 1))
        figure.subplots().plot([0, 1])
        drawn = Claim("it is drawn", "yes", "yes", True, origin="identity")
        return figure, [drawn, Claim("1 = 2", "2", "1", False, "arithmetic", "printed", "section 3")]

    module = types.ModuleType(f"paper_figures.figure_{int(name):02d}")
    module.NAME, module.TITLE, module.CAPTION, module.draw = (
        name,
        f"Figure {name}",
        "A\ncaption.",
        draw or blank,
    )
    return module


@pytest.fixture
def only(monkeypatch):
    def use(*modules):
        table = {m.NAME: m for m in modules}
        monkeypatch.setattr(
            figures, "discover", lambda names=(): {n: m for n, m in table.items() if not names or n in names}
        )

    return use


def test_a_claim_that_differs_needs_a_reason():
    with pytest.raises(ValueError, match="`reason` is empty"):
        Claim("x", "1", "2", False)
    differs = Claim.number("x", 1.0, 1.5, 0.4)
    assert not differs.holds and "0.5" in differs.reason and Claim.number("x", 1.0, 1.5, 0.6).holds


def test_a_claim_says_where_its_value_comes_from_and_only_what_is_printed_is_reproduced():
    with pytest.raises(ValueError, match="`origin` is 'seed'; it is one of printed"):
        Claim("x", "1", "1", True, origin="seed")
    with pytest.raises(ValueError, match="`where` is empty"):
        Claim("x", "1", "1", True, origin="printed")
    words = {origin: Claim("x", "1", "1", True, "", origin, "section 3").verdict for origin in ORIGINS}
    assert [origin for origin, word in words.items() if word == "reproduced"] == ["printed"]
    assert len(set(words.values())) == len(ORIGINS)


def test_origins_are_counted_apart():
    def of(origin, holds):
        return Claim("x", "1", "1", holds, "why", origin, "section 3").record()

    claims = [of("printed", True), of("identity", True), of("printed", False), of("independent", True)]
    assert tally(claims) == {"printed": (1, 1), "independent": (1, 0), "identity": (1, 0)}
    assert counted(claims) == "printed 1 of 2, independent 1 of 1, identity 1 of 1"


def test_a_figure_leaves_png_pdf_caption_and_claims(only, tmp_path, capsys):
    only(a_figure())
    assert figures.make(out=tmp_path)
    assert (tmp_path / "figure_07.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "figure_07.pdf").read_bytes().startswith(b"%PDF")
    entry = json.loads((tmp_path / "claims.json").read_text())["7"]
    assert [c["verdict"] for c in entry["claims"]] == ["passes", "differs"]
    assert entry["caption"] == "A caption." and "A caption." in (tmp_path / "captions.md").read_text()
    printed = capsys.readouterr().out
    assert "arithmetic" in printed and "it is drawn" not in printed  # the short table
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "captions.md",
        "claims.json",
        "figure_07.pdf",
        "figure_07.png",
    ]


def test_every_claim_is_printed_where_all_are_asked_for(only, tmp_path, capsys):
    only(a_figure())
    assert figures.make(out=tmp_path, everything=True)
    assert "it is drawn" in capsys.readouterr().out


def test_the_same_figure_is_written_as_the_same_bytes(only, tmp_path):
    only(a_figure())
    figures.make(out=tmp_path / "a")
    figures.make(out=tmp_path / "b")
    for name in ("figure_07.png", "figure_07.pdf", "claims.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert b"/CreationDate" not in (tmp_path / "a" / "figure_07.pdf").read_bytes()


def test_claims_of_other_figures_stay_when_one_is_made_again(only, tmp_path):
    only(a_figure("10"), a_figure("7"))
    figures.make(out=tmp_path)
    figures.make(["7"], out=tmp_path)
    assert list(json.loads((tmp_path / "claims.json").read_text())) == ["7", "10"]


def test_a_figure_that_fails_is_reported_and_the_others_are_made(only, tmp_path, capsys):
    def broken(fast):
        raise ArithmeticError("no such orbit")

    only(a_figure("1", broken), a_figure("7"))
    assert not figures.make(out=tmp_path)
    assert (tmp_path / "figure_07.png").exists() and not (tmp_path / "figure_01.png").exists()
    printed = capsys.readouterr().out
    assert "no such orbit" in printed and "FAILED: figures 1" in printed


def test_an_interruption_while_writing_leaves_the_old_file_and_no_leftover(monkeypatch, tmp_path):
    target = tmp_path / "claims.json"
    figures.write_whole(target, b"old")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        figures.write_whole(target, b"new")
    assert target.read_bytes() == b"old" and list(tmp_path.iterdir()) == [target]


def test_leftovers_of_a_killed_run_are_removed(only, tmp_path):
    (tmp_path / ".partial-xyz.png").write_bytes(b"half")
    only(a_figure())
    figures.make(out=tmp_path)
    assert not list(tmp_path.glob(".partial-*"))


def test_ctrl_c_between_figures_keeps_the_complete_ones(only, tmp_path):
    def interrupted(fast):
        raise KeyboardInterrupt

    only(a_figure("7"), a_figure("8", interrupted))
    with pytest.raises(KeyboardInterrupt):
        figures.make(out=tmp_path)
    assert list(json.loads((tmp_path / "claims.json").read_text())) == ["7"]
    assert not list(tmp_path.glob("figure_08*"))


def test_names_are_taken_in_every_spelling_and_unknown_ones_refused():
    for spelling in ("4", "04", "figure_04", "figure 4", "figure_04.py"):
        assert list(figures.discover([spelling])) == ["4"]
    with pytest.raises(FiguresError, match="no figure is named 99; there are .*4"):
        figures.discover(["99"])


def test_every_figure_of_the_checkout_says_what_it_is():
    for name, module in figures.discover().items():
        first, _, second = name.partition(".")  # 4 is figure_04, 4.8 is figure_4_08, a word stands for itself
        stem = f"{first}_{int(second):02d}" if second else f"{int(first):02d}" if first.isdigit() else first
        assert module.__name__.endswith(f"figure_{stem}")
        assert module.TITLE and len(module.CAPTION.split()) > 15 and callable(module.draw)


def test_an_installed_package_alone_says_that_figures_need_the_source_archive(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "site-packages" / "pwsmooth" / "cli.py"))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        cli.app(["figures", "--list"])
    assert ended.value.code == 2 and "source archive" in capsys.readouterr().err


def test_an_output_place_that_cannot_be_written_is_named(only, tmp_path):
    only(a_figure())
    (tmp_path / "file").write_text("")
    with pytest.raises(FiguresError, match="`--out` .*file"):
        figures.make(out=tmp_path / "file")


def test_no_legend_is_below_six_points_in_one_column(only, tmp_path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3))
    left, right = figure.subplots(1, 2)
    for ax in (left, right):
        ax.plot([0, 1], label="line")
    left.legend(fontsize=7)
    figure.legend(fontsize=14)
    only(a_figure(draw=lambda fast: (figure, [])))
    figures.make(out=tmp_path, jobs=1)
    # 6 pt in a picture that is printed at half its width.
    assert [legend.get_texts()[0].get_fontsize() for legend in (left.get_legend(), *figure.legends)] == [12, 14]


def test_the_figures_that_need_no_solver_are_drawn_with_their_claims(tmp_path):
    made = figures.make(["2", "4"], out=tmp_path, fast=True)
    claims = {n: e["claims"] for n, e in json.loads((tmp_path / "claims.json").read_text()).items()}
    assert made and list(claims) == ["2", "4"]
    verdicts = {c["claim"]: c for entry in claims.values() for c in entry}
    height = next(c for text, c in verdicts.items() if text.startswith("height of the peak"))
    assert (height["source"], height["ours"], height["verdict"]) == ("1.63073", "1.48587", "differs")
    assert next(c for text, c in verdicts.items() if text.startswith("peak lies at"))["verdict"] == "reproduced"


def test_all_figures_are_drawn_and_the_equations_bear_out_what_they_did(tmp_path):
    """Every claim that differs is one that is known to; the reasons stand in the figures.

    Those that `pwsmooth figures` has just made in the folder PWSMOOTH_DRAWN are taken, as in .ci/run.
    """
    folder = Path(os.environ.get("PWSMOOTH_DRAWN", tmp_path))
    assert folder != tmp_path or figures.make(out=tmp_path, fast=True)
    entries = json.loads((folder / "claims.json").read_text())
    assert len(list(folder.glob("figure_*.png"))) == len(list(folder.glob("figure_*.pdf"))) == len(entries)
    differ = {name: sum(not c["holds"] for c in entry["claims"]) for name, entry in entries.items()}
    known = {
        "1": 1,
        "2": 5,
        "3": 0,
        "4": 2,
        "5": 0,
        "6": 0,
        "7": 2,
        "8": 3,
        "9": 1,
        "10": 1,
        "11": 0,
        "12": 2,
        "13": 1,
    }
    known |= {"4.8": 1, "4.9": 0, "4.10": 0, "4.11": 0, "laws": 0, "lugre": 0}
    known |= {"5.1": 0, "c1": 1, "c2": 0, "c3": 3, "c4": 0, "c5": 0}
    assert differ == known
    last = entries["6"]["claims"][-1]
    assert last["ours"].startswith("leaves at |k y - q''| = 1.777777778, lam = 0.666667")
    assert all(c["origin"] != "printed" or c["where"] for entry in entries.values() for c in entry["claims"])
    # The counts on the pages of the statements and of the replication.
    assert statements.overall(statements.records(entries)) == {
        "reproduced": 81,
        "differs": 38,
        "shown": 13,
        "not shown": 1,
        "plain from the formula": 6,
        "not tested": 17,
    }
    told = counted(claim for entry in entries.values() for claim in entry["claims"])
    assert told == (
        "printed 42 of 63, derived 9 of 9, independent 43 of 43, reconstruction 7 of 7, expected 16 of 18, "
        "identity 14 of 14"
    )


def test_several_at_a_time_leave_the_same_files(tmp_path, capsys):
    for jobs in (1, 2):
        assert figures.make(["2", "4"], out=tmp_path / str(jobs), fast=True, jobs=jobs)
    one, two = (sorted((tmp_path / str(jobs)).iterdir()) for jobs in (1, 2))
    assert [path.name for path in one] == [path.name for path in two]
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]
    printed = [line.split()[:2] for line in capsys.readouterr().out.splitlines() if line.startswith("figure  ")]
    assert printed == 2 * [["figure", "2"], ["figure", "4"]]


def test_less_than_one_at_a_time_is_refused(tmp_path):
    with pytest.raises(FiguresError, match="`jobs` is 0"):
        figures.make(["4"], out=tmp_path, jobs=0)


A_SCRIPT = """
import os, signal, time
from matplotlib.figure import Figure
from paper_figures.claims import Claim
NAME, TITLE, CAPTION, SHARES = "{name}", "Figure {name}", "A caption.", "{shares}"
def draw(fast):
    {first}
    return Figure(figsize=(1, 1)), [Claim("it is drawn", "yes", "yes", True)]
"""


def begun(folder, *begins, shares=()):
    """`pwsmooth figures ... --jobs 2` in a checkout whose figures begin their drawing so."""
    root, scripts = Path(figures.__file__).parent.parent, folder / "paper_figures"
    shutil.copytree(root / "pwsmooth", folder / "pwsmooth")
    (folder / "pyproject.toml").touch()
    scripts.mkdir()
    for name in ("__init__.py", "claims.py", "making.py"):
        shutil.copy(root / "paper_figures" / name, scripts)
    for name, first in enumerate(begins, 1):
        path = scripts / f"figure_{name:02d}.py"
        path.write_text(A_SCRIPT.format(name=name, first=first, shares=name not in shares and name))
    names = [str(name) for name, _ in enumerate(begins, 1)]
    return subprocess.Popen(
        [sys.executable, "-m", "pwsmooth", "figures", *names, "--jobs", "2", "--out", "made"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder, start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(folder)},
    )  # fmt: skip


@pytest.fixture
def start(tmp_path):
    # A shell's background job begins deaf to Ctrl-C, and so would what it starts.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield functools.partial(begun, tmp_path)
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    """(folder, exit code, what is printed) where the second of three fails, and the others keep runs for each other."""
    folder = tmp_path_factory.mktemp("three")
    noted = "open(NAME, 'w').write(str(os.getpid())); "
    fails = noted + "raise ArithmeticError('no such orbit')"
    process = begun(folder, noted + "time.sleep(1)", fails, noted + "time.sleep(0.5)", shares=(1, 3))
    printed, _ = process.communicate()
    return folder, process.returncode, printed


def test_of_several_at_a_time_one_that_fails_costs_no_other_and_the_order_is_kept(three):
    folder, code, printed = three
    assert code == 1 and "no such orbit" in printed and "FAILED: figures 2" in printed
    assert [line[:9] for line in printed.splitlines() if line.startswith("figure")][:3] == [
        "figure  1", "figure 2 ", "figure  3",
    ]  # fmt: skip
    assert list(json.loads((folder / "made" / "claims.json").read_text())) == ["1", "3"]


def test_figures_that_keep_runs_for_each_other_are_made_in_one_process(three):
    one, two, three = ((three[0] / name).read_text() for name in "123")
    assert one == three != two


def test_a_process_that_is_killed_is_reported_and_the_command_ends(start):
    process = start("os.kill(os.getpid(), signal.SIGKILL)", "time.sleep(60)")
    printed, _ = process.communicate(timeout=50)
    assert process.returncode == 1 and "FAILED: figures 1, 2" in printed and "terminated abruptly" in printed


def test_ctrl_c_ends_all_processes_and_keeps_what_is_complete(start, tmp_path):
    process = start("pass", "open('begun', 'w').close(); time.sleep(60)", "time.sleep(60)")
    made = tmp_path / "made" / "claims.json"
    while not ((tmp_path / "begun").exists() and made.exists()):
        time.sleep(0.05)
        assert process.poll() is None
    os.killpg(process.pid, signal.SIGINT)
    printed, _ = process.communicate(timeout=30)  # until all that hold the pipe have ended
    assert process.returncode == 130 and "interrupted; the figures listed above are complete" in printed
    assert "Traceback" not in printed
    assert sorted(path.name for path in made.parent.iterdir()) == [
        "captions.md", "claims.json", "figure_01.pdf", "figure_01.png",
    ]  # fmt: skip


@pytest.mark.parametrize("module", [claims, figures])
def test_the_examples_of_the_docstrings_run(module):
    outcome = doctest.testmod(module)
    assert outcome.attempted > 0 and outcome.failed == 0


def test_drawing_needs_no_display_and_no_pyplot():
    code = (
        "import sys, paper_figures.making as f\n"
        "f.discover(['4'])['4'].draw(True)\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    environment = {**os.environ, "MPLBACKEND": "TkAgg", "DISPLAY": ""}
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
    )
    assert result.stdout.strip() == "False"
