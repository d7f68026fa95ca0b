"""How long from a slider to the picture in `pwsmooth explore`, and what its maps, its memory and its end cost?

A headless Chromium at 1280 x 900, the friction oscillator with all its views, one machine. Clock times depend on what
else runs there, so that each stands beside an empty round trip through the same page, server and process, one after the
other in the same run; the load is written down. Expected: a picture takes no more than 2.5 empty trips (95th percentile)
and 15 ms more than one (median); 2.5 ms of work in the process; an orbit diagram of 800 columns 3 s of processor time.
What a period costs in basins beside `sweep` is measured by bench_refine.py.

Usage: python experiments/bench_explorer.py [--moves 300] [--long 1000] [--out FILE.json]
"""

from __future__ import annotations

import argparse
import gzip
import importlib.resources
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from benchtools import provenance, write_json

from pwsmooth.explorer.bundle import static

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from explore_in_browser import ALONE, IDLE, WIDTHS, browser, served, wait

# Each trip ends at the frame after the drawing. An event every 40 ms or so: a hand on a slider.
TRIPS = """async moves => {
  const frame = () => new Promise(done => requestAnimationFrame(() => done(performance.now())));
  const pause = ms => new Promise(done => setTimeout(done, ms));
  const found = {picture: [], empty: [], work: []}, hear = explorer.hear.bind(explorer), slider = document.getElementById('c-rho');
  let heard = null;
  explorer.hear = (header, arrays) => { hear(header, arrays); heard?.(header); };
  const trip = (begin, wanted) => new Promise(done => {
    const begun = performance.now();
    heard = async header => { if (wanted(header)) { heard = null; const header_ = header; const end = await frame(); done([end - begun, header_]); } };
    begin();
  });
  for (let k = 0; k < moves; k++) {
    await pause(25 + 15 * Math.random());
    const [ms, header] = await trip(() => { slider.value = 250 + (k % 300) * 2; slider.dispatchEvent(new Event('input')); }, h => h.to === 'orbit');
    found.picture.push(ms); found.work.push(header.ms[0] + header.ms[1]);
    await pause(25 + 15 * Math.random());
    found.empty.push((await trip(() => explorer.transport.send({kind: 'ping'}), h => h.kind === 'pong'))[0]);
  }
  explorer.hear = hear;
  return found;
}"""
DRAG = """async moves => {
  const slider = document.getElementById('c-rho');
  for (let k = 0; k < moves; k++) {
    slider.value = 200 + (k * 37) % 700; slider.dispatchEvent(new Event('input'));
    await new Promise(done => setTimeout(done, 12));
  }
}"""
HEAP = "() => { gc(); gc(); return performance.memory.usedJSHeapSize; }"
FIRST = """async key => {
  const view = explorer.of(key), begun = performance.now(), old = view.job;
  view.start();
  while (view.next || view.job === old && old.header) await new Promise(done => setTimeout(done, 1));
  const first = performance.now() - begun, columns = view.columns ? [...view.columns.keys()] : [];
  while (!view.job.header.finished) await new Promise(done => setTimeout(done, 20));
  return {first, all: performance.now() - begun, columns, header: view.job.header};
}"""


def memory(pid: int) -> int:
    """Resident bytes of a process that are its own."""
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) * 1024
    return 0


def processes(pid: int) -> list[int]:
    """A server and its workers."""
    told = subprocess.run(["ps", "-o", "pid=,args=", "--ppid", str(pid)], capture_output=True, text=True).stdout
    return [pid, *(int(line.split()[0]) for line in told.splitlines() if "spawn_main" in line)]


def measured(moves: int, many: int) -> dict[str, Any]:
    """All of the table."""
    from playwright.sync_api import sync_playwright

    found: dict[str, Any] = {"load before": os.getloadavg()[0]}
    with sync_playwright() as play, served("--preset", "figure-8") as (url, run):
        flags = [*ALONE, "--js-flags=--expose-gc", "--enable-precise-memory-info"]
        chromium = play.chromium.launch(executable_path=browser(False), args=flags)
        tab = chromium.new_page(viewport=dict(zip(("width", "height"), WIDTHS["desktop"])))
        tab.goto(url)
        wait(tab, IDLE, 120)
        wait(tab, "explorer.of('diagram').job?.header?.finished", 60)
        tab.keyboard.press("Escape")
        tab.evaluate("for (const v of explorer.views) if (v.live) v.live.checked = false")
        found["views"] = tab.evaluate("explorer.views.filter(v => v.box.isConnected).length")
        trips = tab.evaluate(TRIPS, moves)
        for name, times in trips.items():
            found[name] = {f"p{q}": float(np.percentile(times, q)) for q in (50, 95)}
        found["picture/empty p95"] = found["picture"]["p95"] / found["empty"]["p95"]
        found["picture - empty p50"] = found["picture"]["p50"] - found["empty"]["p50"]
        tab.evaluate("explorer.reset()")
        wait(tab, IDLE)
        tab.evaluate("explorer.of('diagram').wanted = 800")
        diagram = tab.evaluate(FIRST, "diagram")
        shown = np.array(sorted(diagram["columns"])) / (diagram["header"]["columns"] - 1)
        found["diagram"] = {
            "first ms": diagram["first"], "all s": diagram["all"] / 1e3, "columns": diagram["header"]["columns"],
            "cpu s": diagram["header"]["cpu"],
            "widest gap of the first picture": float(np.diff([0.0, *shown, 1.0]).max()),
        }  # fmt: skip
        basins = tab.evaluate(FIRST, "basins")
        found["basins"] = {
            "first ms": basins["first"], "all s": basins["all"] / 1e3, "cpu s": basins["header"]["cpu"],
            "attractors": len(basins["header"]["cycles"]), "unsettled": basins["header"]["unsettled"],
            "failed": basins["header"]["failed"],
        }  # fmt: skip
        tab.evaluate(DRAG, 200)
        wait(tab, IDLE)
        heap, kept = tab.evaluate(HEAP), {p: memory(p) for p in processes(run.pid)}
        before = tab.evaluate("explorer.drawn")
        tab.evaluate(DRAG, many)
        wait(tab, IDLE)
        found["after many moves"] = {
            "moves": many, "pictures": tab.evaluate("explorer.drawn") - before,
            "growth of the heap, MiB": (tab.evaluate(HEAP) - heap) / 2**20,
            "largest growth of a process, MiB": max((memory(p) - kept[p]) / 2**20 for p in kept),
        }  # fmt: skip
        chromium.close()
        begun = time.perf_counter()
        run.send_signal(signal.SIGINT)
        code = run.wait(10)
        left = [p for p in kept if Path(f"/proc/{p}").exists()]
        found["Ctrl-C"] = {"s": time.perf_counter() - begun, "code": code, "processes left": len(left)}
    # file.js takes the place of main.js in a file without Python; a page has the others.
    folder = importlib.resources.files("pwsmooth.explorer").joinpath("static")
    names = sorted(f.name for f in folder.iterdir() if f.name.endswith((".js", ".css")) and f.name != "file.js")
    found["module and style, kB"] = {
        "source": sum(len(folder.joinpath(name).read_bytes()) for name in names) / 1e3,
        "delivered": sum(len(static(name)) for name in names) / 1e3,
        "delivered, packed": len(gzip.compress(b"".join(map(static, names)))) / 1e3,
        "file.js, source": len(folder.joinpath("file.js").read_bytes()) / 1e3,
    }
    found["load after"] = os.getloadavg()[0]
    return found


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])  # type: ignore[union-attr]
    parser.add_argument("--moves", type=int, default=300)
    parser.add_argument("--long", type=int, default=1000)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found = measured(options.moves, options.long)
    for name, value in found.items():
        print(f"{name}: {value}")
    if options.out:
        write_json(options.out, {"results": found, "provenance": provenance()})


if __name__ == "__main__":
    main()
