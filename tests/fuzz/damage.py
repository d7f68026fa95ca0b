"""Damaged files: stores and compile caches that a disk, a kill or a stranger has spoiled are never believed.

    python -m tests.fuzz.damage --stores 500 --caches 500 [--seed 0] [--first 0]

A case is its number: it draws up to three files and what becomes of each. A store must then give the bits of the
undamaged one, or an error that names the store and a remedy; a cache must give the bits of an undamaged one, without a
signal. A failure prints the case; `--stores 1 --first 17` runs one again.
tests/studies/test_damage.py runs a few of them.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import sympy as sp

from pwsmooth import Strobe, Switch, System, sweep
from pwsmooth.codegen.machine import cache
from pwsmooth.studies import Work, read_store

PAGE = 4096


def _flipped(rng, content, count):
    changed = bytearray(content)
    for place in rng.integers(0, len(content), count) if content else ():
        changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _digit(rng, content):
    """Another digit in a text: what still parses."""
    places = [i for i, c in enumerate(content) if 48 <= c < 58]
    if not places:
        return _flipped(rng, content, 1)
    at = int(rng.choice(places))
    return content[:at] + bytes([48 + (content[at] - 48 + int(rng.integers(1, 10))) % 10]) + content[at + 1 :]


def _overwritten(rng, content):
    at, length = int(rng.integers(len(content) + 1)), int(rng.integers(1, 64))
    return (content[:at] + rng.bytes(length) + content[at + length :])[: max(len(content), 1)]


# What becomes of a content; `other` is that of another file.
CONTENTS = {
    "empty": lambda rng, content, other: b"",
    "half": lambda rng, content, other: content[: len(content) // 2],
    "cut": lambda rng, content, other: content[: int(rng.integers(len(content) + 1))],
    "zeroed": lambda rng, content, other: bytes(len(content)),
    "last page zero": lambda rng, content, other: content[: -PAGE // 2] + bytes(min(PAGE // 2, len(content))),
    "a bit": lambda rng, content, other: _flipped(rng, content, 1),
    "bits": lambda rng, content, other: _flipped(rng, content, int(rng.integers(2, 20))),
    "a digit": lambda rng, content, other: _digit(rng, content),
    "overwritten": lambda rng, content, other: _overwritten(rng, content),
    "longer": lambda rng, content, other: content + rng.bytes(int(rng.integers(1, 64))),
    "another file's": lambda rng, content, other: other,
}


def damage(rng, root: Path) -> list[str]:
    """Damage up to three files below `root`; what was done."""
    done = []
    for _ in range(int(rng.integers(1, 4))):
        files = sorted(p for p in root.rglob("*") if p.is_file())
        texts = [p for p in files if p.suffix == ".json"]
        # Texts say what the rest means, and there are few of them.
        path, other = (Path(rng.choice(texts if texts and rng.random() < 0.3 else files)) for _ in range(2))
        what = str(rng.choice([*CONTENTS, "removed", "folder", "link", "its folder removed"]))
        if what in CONTENTS:
            path.write_bytes(CONTENTS[what](rng, path.read_bytes(), other.read_bytes()))
        elif what == "its folder removed" and path.parent != root:
            shutil.rmtree(path.parent)
        else:
            path.unlink()
            if what == "folder":
                path.mkdir()
            elif what == "link":
                path.symlink_to("nowhere")
        done.append(f"{path.relative_to(root)}: {what}")
        if not any(p.is_file() for p in root.rglob("*")):
            break
    return done


# ---- stores ----


def _run(store=None):
    t, y, v = sp.symbols("t y v", real=True)
    k, sigma = sp.symbols("k sigma", positive=True)
    block = System(
        {y: v, v: -sigma * sp.sin(t) - k * y - v / 10 - Switch("lam", v)}, time=t, parameters={k: 3, sigma: 2}
    )
    return sweep(
        block, {"k": [2.0, 3.0, 4.5], "sigma": [1.2, 1.8, 2.4, 3.1]}, x0={"y": 0.5, "v": 0.3},
        seen=Strobe(2 * sp.pi),
        transient=2, periods=8, work=Work(workers=1, chunk=2, store=store, progress=False),
        measures=["itinerary", "sticks", "period", "amplitude(y)", "points(y)"],
    )  # fmt: skip


def _same(one, other) -> bool:
    return one.identical(other) and all(
        one[name].values.tobytes() == other[name].values.tobytes() for name in one.variables
    )


def _judged(call, store: Path, right) -> str:
    """ "right", "refused", or what is wrong with a call on a damaged store."""
    try:
        found = call(store)
    except (ValueError, OSError) as error:
        told = str(error)
        return "refused" if str(store) in told and ("; " in told or "zarr.json" in told) else f"WORDS: {told}"
    except Exception as error:
        return f"EXCEPTION: {type(error).__name__}: {error}"
    return "right" if right(found) else "WRONG"


def stores(cases, seed: int, work: Path) -> tuple[Counter, list[str]]:
    """Verdicts on damaged stores, and the cases that failed."""
    sound, store = work / "sound.zarr", work / "damaged.zarr"
    whole = _run(sound)

    def part(found):
        """What was read is right, wherever it says that it is there."""
        ran = found["outcome"].values != -128
        for name in whole.variables:
            one, other = found[name], whole[name]
            at = ran if one.dims[:2] == found.outcome.dims else ...
            if (one.dims, one.attrs) != (other.dims, other.attrs):
                return False
            # Text is as wide as the longest word that is there.
            one, other = (v.values[at].astype("U99" if v.dtype.kind == "U" else v.dtype) for v in (one, other))
            if one.tobytes() != other.tobytes():
                return False
        return found.attrs == whole.attrs

    verdicts, failures = Counter(), []
    for case in cases:
        shutil.rmtree(store, ignore_errors=True)
        shutil.copytree(sound, store)
        done = damage(np.random.default_rng([seed, case]), store)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            told = {
                "read": _judged(read_store, store, part),
                "run": _judged(_run, store, lambda d: _same(d, whole)),
            }
        if told["run"] == "right" and any("damaged" in str(w.message) for w in said):
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                again = _judged(_run, store, lambda d: _same(d, whole))
            told["run"] = (
                "mended"
                if again == "right" and not said
                else f"NOT MENDED: {again} {[str(w.message) for w in said]}"
            )
        for name, verdict in told.items():
            verdicts[f"{name}: {verdict.partition(':')[0]}"] += 1
            if verdict not in ("right", "refused", "mended"):
                failures.append(f"store {case}, {name}: {verdict}; {done}")
    return verdicts, failures


# ---- caches ----

PROGRAM = """
import hashlib, sys
import sympy as sp
from pwsmooth import Switch, System, solve
t, x, y = sp.symbols("t x y", real=True)
rubbing = System({x: y, y: sp.sin(t) - x - Switch("v", y) / 2}, time=t)
ends = [solve(s, (0, 20), {x: 1.0, y: 0.5}) for s in (rubbing, rubbing.smoothed(eps=1e-3))]
print(*(f"{s.outcome.name} {hashlib.sha256(s.t.tobytes() + s.x.tobytes()).hexdigest()}" for s in ends))
"""


def _process(**places) -> subprocess.CompletedProcess:
    env = os.environ | {name: str(path) for name, path in places.items()}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=600)


def caches(cases, seed: int, work: Path) -> tuple[Counter, list[str]]:
    """Verdicts on damaged caches, and the cases that failed.

    A second cache, in the temporary folder, holds the kernels: a case costs no compilation of these.
    """
    first = _process()  # with the usual cache, which has the kernels then
    assert first.returncode == 0, first.stderr
    sound, damaged, temporary = work / "sound", work / "damaged", work / "temporary"
    for place in cache.kernels().places:
        for root in (sound, temporary / cache.roots()[-1].name):
            if place.is_dir():
                shutil.copytree(place, root / place.name, dirs_exist_ok=True)
    assert _process(PWSMOOTH_CACHE_DIR=sound, TMPDIR=temporary).stdout == first.stdout
    verdicts, failures = Counter(), []
    for case in cases:
        shutil.rmtree(damaged, ignore_errors=True)
        shutil.copytree(sound, damaged)
        done = damage(np.random.default_rng([seed, case]), damaged)
        ended = _process(PWSMOOTH_CACHE_DIR=damaged, TMPDIR=temporary)
        if ended.returncode:
            verdict = f"SIGNAL {-ended.returncode}" if ended.returncode < 0 else "EXCEPTION"
        else:
            verdict = "right" if ended.stdout == first.stdout else "WRONG"
        verdicts[f"cache: {verdict}"] += 1
        if verdict != "right":
            failures.append(f"cache {case}: {verdict} {ended.stderr[-300:]}; {done}")
    return verdicts, failures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for name, default in (("stores", 0), ("caches", 0), ("seed", 0), ("first", 0)):
        parser.add_argument(f"--{name}", type=int, default=default)
    given = parser.parse_args()
    failed = []
    for what, number in ((stores, given.stores), (caches, given.caches)):
        if number:
            with tempfile.TemporaryDirectory() as work:
                verdicts, failures = what(range(given.first, given.first + number), given.seed, Path(work))
            print(f"{number} {what.__name__}:", json.dumps(dict(sorted(verdicts.items()))))
            failed += failures
    print(*failed, sep="\n")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
