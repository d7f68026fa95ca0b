"""Opens every built page in a headless Chromium, at desktop and at phone width, with the network blocked.

    python docs/check_pages.py [DIR] [--shots DIR] [--install] [--self-test]

A page is wrong if it has an error in the console, a file that is missing or asked from another host, a link or
anchor that leads nowhere, a picture that is not there or not visible, an internal name of a figure or an object in
its place, a formula that is not set, text wider than the screen or cut off at its edge, or no heading. `--install`
brings Chromium where it is missing (Debian's package; as root). `--self-test` looks at pages with one such fault
each and fails if a fault is overlooked.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import os
import posixpath
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

WIDTHS = {"desktop": (1280, 900), "phone": (390, 844)}
LEFT = (
    "net::ERR_ABORTED"  # the next page was opened before the icon came; what is not there has a status instead
)
# No other host is found: what asks for one shows as not loaded. (Looking at each request instead turns caches off.)
ALONE = ["--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")

# Folded parts are opened and lazy pictures loaded, so that nothing escapes; then mathematics and pictures are awaited.
READY = """async () => {
  document.querySelectorAll('details:not([open])').forEach(d => { d.open = true; d.dataset.folded = 'yes'; });
  document.querySelectorAll('img').forEach(i => { i.loading = 'eager'; });
  if (document.querySelector('.math') && window.MathJax?.startup?.promise) await window.MathJax.startup.promise;
  await document.fonts.ready;
  await Promise.all([...document.images].filter(i => !i.complete).map(
    i => new Promise(done => { i.onload = i.onerror = done; })));
}"""
FOLD = """() => {
  document.querySelectorAll('details[data-folded]').forEach(d => { d.open = false; });
  window.scrollTo(0, 0);
}"""
LOOK = """() => {
  const tell = e => (e.id ? '#' + e.id : e.className || e.tagName) + ' ' + (e.textContent || '').trim().slice(0, 50);
  const seen = e => { const b = e.getBoundingClientRect(); return b.width > 0 && b.height > 0; };
  const wanted = [...document.images].filter(i => getComputedStyle(i).display !== 'none');
  const page = document.documentElement;
  const inside = e => { // a box of its own that scrolls
    for (let p = e.parentElement; p && p !== document.body; p = p.parentElement)
      if (getComputedStyle(p).overflowX !== 'visible') return true;
    return false;
  };
  const text = e => [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
  const clippers = new Map(); // what cuts off the children of an element: a box, or nothing, or they scroll
  const clipper = e => {
    if (!e || e === page) return null;
    if (!clippers.has(e)) {
      const how = getComputedStyle(e).overflowX;
      clippers.set(e, /auto|scroll/.test(how) ? null : /hidden|clip/.test(how) ? e : clipper(e.parentElement));
    }
    return clippers.get(e);
  };
  const cut = e => {
    const box = clipper(e.parentElement);
    if (box && box.getBoundingClientRect().right < e.getBoundingClientRect().right - 1) return true;
    // A long word that leaves its own box: prose does not scroll, whatever is around it.
    return e.matches('h1, h2, h3, h4, p, dt') && !e.closest('table, .cell_output, .xr-wrap')
      && e.getBoundingClientRect().left + e.scrollWidth > page.clientWidth + 1;
  };
  const main = document.querySelector('.bd-main') || document.body;
  const wide = page.scrollWidth <= page.clientWidth ? [] :
    [...document.body.querySelectorAll('*')].filter(
      e => e.getBoundingClientRect().right > page.clientWidth + 1 && seen(e) && !inside(e)).slice(-3).map(tell);
  return {
    heading: !!document.querySelector('h1')?.textContent.trim(),
    broken: wanted.filter(i => !i.naturalWidth).map(i => i.src),
    unseen: wanted.filter(i => i.naturalWidth && !seen(i)).map(i => i.src),
    unset: [...document.querySelectorAll('.math')].filter(
      m => ![...m.querySelectorAll('mjx-container')].some(seen)).map(tell),
    badmath: [...document.querySelectorAll('mjx-merror, [data-mjx-error]')].map(tell),
    overflow: page.scrollWidth - page.clientWidth,
    cut: [...main.querySelectorAll('*')].filter(
      e => text(e) && !e.closest('pre, mjx-container') && seen(e) && cut(e)).map(tell),
    marks: [...main.querySelectorAll('pre')].filter(
      e => /<Figure size \\d|!! processed by|object at 0x/.test(e.textContent)).map(tell),
    wide,
    formulas: document.querySelectorAll('mjx-container').length,
    images: wanted.length,
    ids: [...document.querySelectorAll('[id], a[name]')].map(e => e.id || e.name),
    links: [...document.querySelectorAll('a[href]')].map(a => a.getAttribute('href')),
  };
}"""


@dataclass
class Report:
    """What was wrong, and how much was looked at."""

    faults: list[str] = field(default_factory=list)
    pages: int = 0
    images: int = 0
    formulas: int = 0
    links: int = 0


class NoBrowser(Exception):
    """There is no Chromium; the text says what to do."""


def browser(install: bool) -> str:
    """Path of a Chromium, which is installed if it is missing and wanted.

    Raises
    ------
    NoBrowser
        There is none and none could be installed.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found:
        return found
    advice = "install Chromium (Debian: `apt-get install chromium`) and run this again"
    if not install:
        raise NoBrowser(f"no Chromium is on the path; {advice}, or give --install")
    if not shutil.which("apt-get"):
        raise NoBrowser(f"no Chromium is on the path, and there is no apt-get to install it; {advice}")
    if os.geteuid() != 0:
        raise NoBrowser(f"no Chromium is on the path, and only root can install it; {advice}")
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for command in (
        ["apt-get", "update", "-qq"],
        ["apt-get", "install", "-y", "-qq", "--no-install-recommends", "chromium", "fonts-dejavu-core"],
    ):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            last = " ".join((done.stderr or done.stdout).split())[-300:]
            raise NoBrowser(f"`{' '.join(command)}` failed: {last}")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if not found:
        raise NoBrowser(f"apt-get installed chromium, but none of {', '.join(BROWSERS)} is on the path")
    return found


@contextlib.contextmanager
def served(root: Path) -> Iterator[str]:
    """A server of the pages on this machine's own address."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            """The checks say what matters."""

    class Patient(ThreadingHTTPServer):
        def handle_error(self, *_):
            """A tab that leaves a page closes its connections; what is missing shows in the tab."""

    server = Patient(("127.0.0.1", 0), functools.partial(Quiet, directory=str(root)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()


def check(root: Path, executable: str, shots: Path | None = None) -> Report:
    """Open every page below `root`, each width in a browser of its own beside the other."""
    pages = sorted(p.relative_to(root).as_posix() for p in root.rglob("*.html") if "_static" not in p.parts)
    with served(root) as address, ThreadPoolExecutor(len(WIDTHS)) as pool:
        looks = dict(zip(WIDTHS, pool.map(lambda w: looked_at(address, pages, w, executable, shots), WIDTHS)))
    report = Report(pages=len(pages))
    for page in pages:
        for width, look in looks.items():
            report.faults += [f"{page} ({width}): {fault}" for fault in look[page]["faults"]]
    desktop = looks["desktop"]
    report.images = sum(seen["images"] for seen in desktop.values())
    report.formulas = sum(seen["formulas"] for seen in desktop.values())
    report.links = sum(len(seen["links"]) for seen in desktop.values())
    report.faults += broken_links(root, desktop)
    return report


def looked_at(
    address: str, pages: list[str], width: str, executable: str, shots: Path | None
) -> dict[str, dict]:
    """What each page shows at this width, with its faults."""
    from playwright.sync_api import sync_playwright

    found: dict[str, dict] = {}
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=executable, args=ALONE)
        context = chromium.new_context(viewport=dict(zip(("width", "height"), WIDTHS[width])))
        tab = context.new_page()
        said: list[str] = []
        tab.on("console", lambda m: said.append(f"console: {m.text}") if m.type == "error" else None)
        tab.on("pageerror", lambda e: said.append(f"script error: {e}"))
        tab.on(
            "requestfailed",
            lambda r: said.append(f"not loaded: {r.url} ({r.failure})") if r.failure != LEFT else None,
        )
        tab.on("response", lambda r: said.append(f"missing: {r.url} ({r.status})") if r.status >= 400 else None)
        for page in pages:
            said.clear()
            tab.goto(f"{address}/{page}", wait_until="load")
            tab.evaluate(READY)
            found[page] = tab.evaluate(LOOK)
            found[page]["faults"] = [*said, *faults_of(found[page])]
            if shots:
                shots.mkdir(parents=True, exist_ok=True)
                tab.evaluate(FOLD)
                tab.screenshot(path=shots / f"{page.replace('/', '_')}.{width}.png", full_page=True)
        chromium.close()
    return found


def faults_of(seen: dict) -> list[str]:
    """What a look at a page has found."""
    found = [] if seen["heading"] else ["no heading"]
    found += [f"picture is not there: {src}" for src in seen["broken"]]
    found += [f"picture is not visible: {src}" for src in seen["unseen"]]
    found += [f"formula is not set: {text}" for text in seen["unset"]]
    found += [f"formula with an error: {text}" for text in seen["badmath"]]
    if seen["overflow"] > 0:
        found.append(f"{seen['overflow']} px wider than the screen: {'; '.join(seen['wide'])}")
    found += [f"cut off at the edge: {text}" for text in seen["cut"]]
    found += [f"not for readers: {text}" for text in seen["marks"]]
    return found


def broken_links(root: Path, looks: dict[str, dict]) -> list[str]:
    """Links to files or anchors that are not there. Those to other hosts are not followed."""
    anchors = {page: set(seen["ids"]) for page, seen in looks.items()}
    faults = []
    for page, targets in ((page, seen["links"]) for page, seen in looks.items()):
        for target in dict.fromkeys(targets):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            path, anchor = unquote(parts.path), unquote(parts.fragment)
            inside = posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page
            if (root / inside).is_dir():
                inside = posixpath.join(inside, "index.html")
            if not (root / inside).is_file():
                faults.append(f"{page}: link to {target}, which is not there")
            elif anchor and inside in anchors and anchor not in anchors[inside]:
                faults.append(f"{page}: link to {target}, where there is no such anchor")
    return faults


# One fault a page: what the check has to say of it.
FAULTY = {
    "no heading": "<p>text</p>",
    "console": "<h1>a</h1><script>console.error('x')</script>",
    "script error": "<h1>a</h1><script>undefined_name()</script>",
    "missing": "<h1>a</h1><link rel='stylesheet' href='no.css'>",
    "not loaded": "<h1>a</h1><script src='http://192.0.2.1/cdn.js'></script>",
    "picture is not there": "<h1>a</h1><img src='no.png'>",
    "picture is not visible": "<h1>a</h1><div style='height:0;width:0'><img style='width:0' src='dot.gif'></div>",
    "formula is not set": "<h1>a</h1><span class='math'>\\(x\\)</span>",
    "formula with an error": "<h1>a</h1><mjx-container>x<mjx-merror>e</mjx-merror></mjx-container>",
    "wider than the screen": "<h1>a</h1><div style='width:3000px'>long</div>",
    "cut off at the edge": "<h1>a</h1><div style='overflow:hidden'><p style='width:3000px'>long</p></div>",
    "cut off at the edge: H1": "<div style='overflow-x:auto'><h1>" + 99 * "a" + "</h1></div>",
    "not for readers": "<h1>a</h1><pre>&lt;Figure size 720x300 with 1 Axes&gt;</pre>",
    "link to no.html": "<h1>a</h1><a href='no.html'>x</a>",
    "no such anchor": "<h1 id='a'>a</h1><a href='#b'>x</a>",
}
# A picture of one point.
DOT = bytes.fromhex("47494638396101000100800000ffffff0000002c00000000010001000002024401003b")


def self_test(executable: str) -> list[str]:
    """Faults that the check overlooks, and a good page that it finds fault with."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "dot.gif").write_bytes(DOT)
        head = "<!doctype html><link rel='icon' href='dot.gif'>"
        for i, body in enumerate(FAULTY.values()):
            (root / f"fault{i}.html").write_text(head + body, encoding="utf-8")
        good = (
            "<h1 id='a'>a</h1><img src='dot.gif' width=5 height=5><a href='#a'>x</a><a href='fault1.html'>y</a>"
        )
        (root / "good.html").write_text(head + good, encoding="utf-8")
        found = check(root, executable).faults
    overlooked = [
        name
        for i, name in enumerate(FAULTY)
        if not any(f.startswith(f"fault{i}.") and name in f for f in found)
    ]
    return [f"overlooked: {name}" for name in overlooked] + [f for f in found if f.startswith("good")]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Open every page of the documentation in a browser.")
    built = Path(__file__).resolve().parent / "_build" / "html"
    parser.add_argument("pages", type=Path, nargs="?", default=built, help="directory of the pages")
    parser.add_argument("--shots", type=Path, metavar="DIR", help="write a picture of every page")
    parser.add_argument("--install", action="store_true", help="install Chromium where it is missing")
    parser.add_argument("--self-test", action="store_true", help="first see that every kind of fault is found")
    options = parser.parse_args()
    if not (options.pages / "index.html").is_file():
        sys.exit(f"docs/check_pages.py: {options.pages} holds no pages; `python docs/build.py` makes them")
    try:
        executable = browser(options.install)
    except NoBrowser as error:
        sys.exit(f"docs/check_pages.py: {error}")
    begun = time.perf_counter()
    if options.self_test:
        overlooked = self_test(executable)
        if overlooked:
            sys.exit("docs/check_pages.py: the check itself is wrong\n  " + "\n  ".join(overlooked))
    report = check(options.pages, executable, options.shots)
    for fault in report.faults:
        print(fault)
    print(
        f"{report.pages} pages at {len(WIDTHS)} widths, {report.images} pictures, {report.formulas} formulas, "
        f"{report.links} links, {time.perf_counter() - begun:.0f} s: {len(report.faults)} faults"
    )
    sys.exit(bool(report.faults))


if __name__ == "__main__":
    main()
