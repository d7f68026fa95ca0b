"""Which cases are `thorough`, and how long cases took: `pytest --record FILE`.

The short command leaves the cases of thorough.toml to `pytest -m thorough`; each stands there with its reason. Those
that take a minute and more have this mark where they stand; .ci/run does without them and runs the table, `-m moved`.
"""

import gc
import json
import os
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest

# Matrices are small here. A second thread of BLAS waits for the first one, spinning, on the core of the other worker:
# scipy's exponential of a 2 x 2 matrix takes 10 ms then. Read when BLAS is loaded: the workers of xdist inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")

HERE = Path(__file__).parent
ALL, MOVED = pytest.StashKey[int](), pytest.StashKey[int]()


def read_table():
    """Reason of each case, or of all cases of a function, by its name from tests/ on."""
    groups = tomllib.loads((HERE / "thorough.toml").read_text(encoding="utf-8"))["moved"]
    return {name: group["why"] for group in groups for name in group["cases"]}


def pytest_addoption(parser):
    parser.addoption("--record", metavar="FILE", help="write how long files and slow cases took")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    table = read_table()
    used, files, moved = set(), set(), 0
    for item in items:
        name = item.nodeid.removeprefix("tests/")
        files.add(name.partition("::")[0])
        found = {name, name.partition("[")[0]} & table.keys()
        if found:
            used |= found
            moved += 1
            item.add_marker(pytest.mark.thorough)
            item.add_marker(pytest.mark.moved)
    config.stash[ALL], config.stash[MOVED] = len(items), moved
    if not any("::" in str(argument) for argument in config.args):
        lost = sorted(name for name in table.keys() - used if name.partition("::")[0] in files)
        if lost:
            raise pytest.UsageError(f"tests/thorough.toml names what is no test: {', '.join(lost)}")


class Recorder:
    """Seconds of each case, its fixtures included; in the process that hears of all of them."""

    def __init__(self, path):
        self.path, self.seconds = Path(path), defaultdict(float)

    def pytest_runtest_logreport(self, report):
        self.seconds[report.nodeid.removeprefix("tests/")] += report.duration

    def pytest_sessionfinish(self):
        files = defaultdict(float)
        for name, seconds in self.seconds.items():
            files[name.partition("::")[0]] += seconds
        slow = sorted(((s, name) for name, s in self.seconds.items() if s > 1), reverse=True)
        found = {
            "seconds": round(sum(self.seconds.values())),
            "cases": len(self.seconds),
            "slow cases": {name: round(s, 1) for s, name in slow},
            "files": {name: round(s, 1) for name, s in sorted(files.items())},
        }
        self.path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def pytest_configure(config):
    # sympy and numba make millions of objects and few circles of them: to look for these as often as Python does by
    # default takes a twelfth of the time.
    gc.set_threshold(100_000, 20, 100)
    if hasattr(config, "workerinput"):
        return
    if path := config.getoption("--record"):
        config.pluginmanager.register(Recorder(path))
    if config.getoption("numprocesses", None) and config.args == config.getini("testpaths"):
        # All parts of the core at once. Workers that ask for one part after the other would wait for each other, and
        # compile twice what parts have in common.
        from pwsmooth.codegen.machine import units

        units.unit_addresses(units.ALL)


def pytest_unconfigure():
    # pytest looks for circles at the end, among millions of objects: seconds in each worker.
    gc.freeze()
