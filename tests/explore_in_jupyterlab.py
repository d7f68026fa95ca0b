"""The explorer's widget in a real JupyterLab, in a headless Chromium: it is drawn, a slider moves it, the kernel knows.

    pip install jupyterlab 'pwsmooth[explore-notebook]' playwright
    python tests/explore_in_jupyterlab.py [--shots DIR]

Not in the continuous integration, for what JupyterLab brings with it; tests/explore_in_browser.py looks at the same page
as the server delivers it.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from explore_in_browser import ROOT, Fault, browser, expect, wait

CELLS = (
    "import pwsmooth\nfrom pwsmooth.scenes import friction_oscillator\nfrom pwsmooth.laws.friction import HiddenStatic\n"
    "explored = pwsmooth.explore(friction_oscillator(HiddenStatic()))\nexplored",
    "print('rho is', explored.state['p']['rho'])\nprint('events', len(explored.solution.events))\n"
    "print(explored.code()[-400:])",
)
HASH = """() => [...document.querySelectorAll('.explorer .time canvas, .explorer .phase canvas')].map(c => {
  const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let h = 7;
  for (let k = 0; k < d.length; k++) h = (Math.imul(h, 31) + d[k]) | 0;
  return d.some(v => v) ? h : 0; })"""


def notebook() -> dict[str, Any]:
    """The cells as a file."""
    cells = [
        {
            "cell_type": "code",
            "id": f"c{k}",
            "source": text,
            "metadata": {},
            "outputs": [],
            "execution_count": None,
        }
        for k, text in enumerate(CELLS)
    ]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    return {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}


def children(pid: int) -> int:
    """The two processes of a page, anywhere below this one."""
    told = subprocess.run(["ps", "-eo", "pid=,ppid=,args="], capture_output=True, text=True).stdout
    rows = [line.split(None, 2) for line in told.splitlines()]
    below, found = {str(pid)}, 0
    for _ in range(6):
        below |= {row[0] for row in rows if row[1] in below}
    found = sum(row[0] in below and "explorer.processes" in row[2] for row in rows)
    return found


def look(tab: Any, run: Any, shots: Path | None) -> None:
    """What a user does with the widget."""
    wait(tab, "window.jupyterapp?.shell?.currentWidget?.context?.isReady", 60, "no notebook")
    tab.evaluate("window.jupyterapp.shell.currentWidget.sessionContext.ready")
    wait(
        tab,
        "window.jupyterapp.shell.currentWidget.sessionContext.session?.kernel?.status === 'idle'",
        60,
        "no kernel",
    )
    tab.evaluate("window.jupyterapp.commands.execute('notebook:run-cell-and-select-next')")
    drawn = f"(hashes => hashes.length > 2 && hashes.every(h => h))(({HASH})())"
    wait(tab, drawn, 240, "the widget draws nothing")
    time.sleep(1)
    before = tab.evaluate(HASH)
    tab.evaluate(
        "() => { const s = document.getElementById('c-rho'); s.value = 300; s.dispatchEvent(new Event('input')); }"
    )
    moved = f"(before => ({HASH})().every((h, k) => h && h !== before[k]))({json.dumps(before)})"
    wait(tab, moved, 20, "a slider does not change the pictures")
    asked = tab.evaluate("Number(document.getElementById('c-rho-n').value)")
    expect(children(run.pid) == 2, f"{children(run.pid)} processes instead of two")
    if shots:
        tab.screenshot(path=shots / "widget.png")
    tab.evaluate("window.jupyterapp.commands.execute('notebook:run-cell-and-select-next')")
    said = "[...document.querySelectorAll('.jp-OutputArea-output pre')].map(e => e.textContent).join()"
    wait(tab, f"{said}.includes('events')", 60, "the kernel does not answer")
    told = tab.evaluate(said)
    expect(f"rho is {asked:g}" in told, f"the page shows rho = {asked:g}, the kernel says {told[:200]}")
    expect(f"'rho': {asked:g}" in told, "the script has another value")
    tab.evaluate("window.jupyterapp.shell.currentWidget.sessionContext.shutdown()")
    until = time.monotonic() + 15
    while children(run.pid) and time.monotonic() < until:
        time.sleep(0.1)
    expect(not children(run.pid), "the widget's processes outlive their kernel")


def main() -> None:
    """Command line."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description="Look at the explorer's widget in JupyterLab.")
    parser.add_argument("--shots", type=Path, metavar="DIR", help="write a picture of what is seen")
    options = parser.parse_args()
    if options.shots:
        options.shots.mkdir(parents=True, exist_ok=True)
    with socket.socket() as free, tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        free.bind(("127.0.0.1", 0))
        port, token = free.getsockname()[1], secrets.token_hex(16)
        free.close()
        Path(folder, "a.ipynb").write_text(json.dumps(notebook()))
        environment = os.environ | {"PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT)), "JUPYTER_CONFIG_DIR": folder,
                                    "JUPYTER_DATA_DIR": folder, "IPYTHONDIR": folder}  # fmt: skip
        command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", f"--port={port}", "--ip=127.0.0.1",
                   f"--IdentityProvider.token={token}", "--expose-app-in-browser", f"--ServerApp.root_dir={folder}",
                   "--LabApp.news_url=None"]  # fmt: skip
        run = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            until = time.monotonic() + 60
            while True:
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/api", timeout=5).close()
                    break
                except (urllib.error.URLError, OSError):
                    expect(run.poll() is None and time.monotonic() < until, "JupyterLab does not start")
                    time.sleep(0.3)
            chromium = play.chromium.launch(executable_path=browser(False))
            tab = chromium.new_page(viewport={"width": 1280, "height": 1600})
            errors: list[str] = []
            tab.on("pageerror", lambda e: errors.append(str(e)))
            tab.goto(f"http://127.0.0.1:{port}/lab/tree/a.ipynb?token={token}")
            try:
                look(tab, run, options.shots)
            except Fault:
                if options.shots:
                    tab.screenshot(path=options.shots / "fault.png")
                raise
            ours = [e for e in errors if "explorer" in e or "mount" in e]
            expect(not ours, f"errors: {ours}")
            chromium.close()
            print(f"the widget is drawn, answers, and ends with its kernel; other errors of the page: {errors}")
        finally:
            run.send_signal(signal.SIGTERM)
            run.wait(20)


if __name__ == "__main__":
    main()
