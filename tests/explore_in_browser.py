"""pwsmooth explore in a real browser: a headless Chromium, at desktop and phone width, with the network blocked.

    python tests/explore_in_browser.py [--shots DIR] [--install] [--only NAME] [--self-test]

Each scene is served by the command itself; what a user does is done, and what the page then shows is looked at: ink and
labels of every view, sliders, drags, keys, links, two tabs, a server that ends. Nothing may reach the console, another
host, or beyond the edge of the screen. Polled by `evaluate`: Playwright's own waiting needs eval, which the page refuses.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.resources
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))
from check_pages import ALONE, WIDTHS, NoBrowser, browser  # noqa: E402

SCENES = (
    "friction_oscillator",
    "block_on_belt",
    "falling_ball",
    "impact_oscillator",
    "slider_crank",
    "incline",
)
VIEWS = {  # that a scene has, at least
    "friction_oscillator": {"time", "phase", "characteristic", "layer", "diagram", "basins"},
    "block_on_belt": {"time", "phase", "characteristic", "layer"},
    "falling_ball": {"time", "phase", "characteristic"},
    "impact_oscillator": {"time", "phase", "diagram", "basins"},
    "slider_crank": {"time", "phase"},
    "incline": {"time", "phase"},
}

LOOK = """() => {
  const page = document.documentElement, seen = [];
  const ink = canvas => {
    const c = canvas.getContext('2d'), {width, height} = canvas;
    if (!width || !height) return 0;
    const data = c.getImageData(0, 0, width, height).data, tones = new Set();
    let drawn = 0;
    for (let k = 0; k < data.length; k += 4) if (data[k + 3] > 60) { drawn++; tones.add((data[k] >> 4) * 256 + (data[k + 1] >> 4) * 16 + (data[k + 2] >> 4)); }
    return tones.size > 3 ? drawn : 0;
  };
  for (const v of explorer.views) if (v.box.isConnected) for (const canvas of v.box.querySelectorAll('canvas'))
    seen.push({view: v.key, ink: ink(canvas), label: canvas.getAttribute('aria-label') || '', title: v.box.querySelector('h2').textContent});
  const named = e => e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim() || e.title;
  const shown = e => { const b = e.getBoundingClientRect(); return b.width > 0 && b.height > 0; };
  return {
    seen, overflow: page.scrollWidth - page.clientWidth,
    unnamed: [...document.querySelectorAll('input, button, select')].filter(e => shown(e) && !named(e)).map(e => e.outerHTML.slice(0, 90)),
    small: innerWidth < 760 ? [...document.querySelectorAll('button, select, input[type=range]')].filter(e => shown(e) && !e.classList.contains('handle') && e.getBoundingClientRect().height < 43.5).map(e => e.outerHTML.slice(0, 90)) : [],
  };
}"""
HASH = """() => [...document.querySelectorAll('.time canvas, .phase canvas, .characteristic canvas')].map(c => {
  const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let h = 7;
  for (let k = 0; k < d.length; k++) h = (Math.imul(h, 31) + d[k]) | 0;
  return h; })"""
# Counts what stays when a part of the page is made anew: listeners of the whole page.
LISTENERS = """window.listeners = 0;
for (const at of [window, document]) { const add = at.addEventListener; at.addEventListener = function (...a) { window.listeners++; return add.apply(this, a); }; }"""
# Nothing is on its way, and what came was drawn.
IDLE = """() => window.explorer && explorer.orbit && explorer.inFlight === null && !explorer.waiting && !explorer.due
  && performance.now() - explorer.drawnAt > 60"""


class Fault(AssertionError):
    """What the page does not do."""


def wait(tab: Any, what: str, seconds: float = 20, told: str = "") -> Any:
    """The value of a JavaScript expression or function once it is true."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if found := tab.evaluate(what):
            return found
        time.sleep(0.03)
    raise Fault(told or f"not within {seconds:g} s: {what}")


def expect(holds: Any, told: str) -> None:
    if not holds:
        raise Fault(told)


@contextlib.contextmanager
def served(*arguments: str) -> Iterator[tuple[str, Any]]:
    """Address and process of `pwsmooth explore`."""
    command = [sys.executable, "-u", "-m", "pwsmooth", "explore", "--no-browser", *arguments]
    environment = os.environ | {"PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT))}
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert run.stdout is not None
        line = run.stdout.readline()
        expect("http://" in line, f"the command says {line!r}")
        yield re.search(r"http://\S+", line)[0], run  # type: ignore[index]
    finally:
        run.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.wait(5)
        run.kill()


class Browser:
    """Tabs of a Chromium, whose errors are collected."""

    def __init__(self, chromium: Any) -> None:
        self.chromium = chromium
        self.said: list[str] = []

    @contextlib.contextmanager
    def tab(self, url: str, width: str = "desktop", **more: Any) -> Iterator[Any]:
        size = dict(zip(("width", "height"), WIDTHS[width]))
        context = self.chromium.new_context(viewport=size, has_touch=width == "phone", **more)
        context.add_init_script(LISTENERS)
        tab = context.new_page()
        tab.on("console", lambda m: self.said.append(f"console: {m.text}") if m.type == "error" else None)
        tab.on("pageerror", lambda e: self.said.append(f"script error: {e}"))
        tab.on(
            "request",
            lambda r: (
                None
                if r.url.startswith((url.split("#")[0], "data:", "blob:"))
                else self.said.append(f"another host: {r.url}")
            ),
        )
        tab.goto(url)
        wait(tab, IDLE, 120, "no orbit was drawn")
        try:
            yield tab
        finally:
            context.close()


def views(b: Browser, shots: Path | None) -> None:
    """Every view of six scenes has ink, its label, and room; nothing is cut off, unnamed or too small for a finger."""
    with contextlib.ExitStack() as stack:
        servers = {scene: stack.enter_context(served(scene))[0] for scene in SCENES}
        for scene, url in servers.items():
            for width in WIDTHS:
                with b.tab(url, width) as tab:
                    keys = tab.evaluate("explorer.views.map(v => v.key)")
                    expect(VIEWS[scene] <= set(keys), f"{scene}: no {VIEWS[scene] - set(keys)}")
                    # All tabs of one scene, of the others the first one.
                    tabs = ["", *(keys if scene == SCENES[0] and width == "phone" else ())]
                    for key in tabs:
                        if key and tab.evaluate(f"!explorer.of('{key}')"):
                            tab.evaluate(f"explorer.tab = '{key}', explorer.arrange()")
                        one_view(tab, f"{scene}, {width}", maps=scene == SCENES[0])
                        if shots:
                            name = f"{scene}{key and '.' + key}.{width}.png"
                            tab.screenshot(path=shots / name, full_page=width == "desktop")


def one_view(tab: Any, where: str, maps: bool) -> None:
    """What is on the screen: ink, labels, room. `maps` begin by themselves where that is quick, one after the other."""
    for name in ("diagram", "section", "basins") if maps else ():
        begun = f"(v => !v || v.columns?.size || v.shade || v.points?.length)(explorer.of('{name}'))"
        wait(tab, begun, 60, f"{where}: {name} does not begin")
    wait(tab, "!explorer.of('layer') || explorer.layer", told=f"{where}: no layer")
    time.sleep(0.1)
    seen = tab.evaluate(LOOK)
    for v in seen["seen"]:
        if maps or v["view"] not in ("diagram", "basins", "section"):
            expect(v["ink"] > 300, f"{where}: {v['view']} has no ink")
        expect(v["label"] and v["title"], f"{where}: {v['view']} has no label")
    expect(seen["overflow"] <= 0, f"{where}: {seen['overflow']} px wider than the screen")
    expect(not seen["unnamed"], f"{where}: without a name: {seen['unnamed']}")
    expect(not seen["small"], f"{where}: too small for a finger: {seen['small']}")


def sliders(b: Browser, shots: Path | None) -> None:
    """A slider changes what is sent and what is seen, by mouse and keys; a refused value stays, with its sentence."""
    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:
        before = tab.evaluate(HASH)
        tab.evaluate(
            "() => { const s = document.getElementById('c-rho'); s.value = 300; s.dispatchEvent(new Event('input')); }"
        )
        wait(tab, IDLE)
        expect(tab.evaluate("explorer.asked.p.rho") != 3, "the slider does not change what is sent")
        expect(
            all(x != y for x, y in zip(before, tab.evaluate(HASH))), "the slider does not change the pictures"
        )
        tab.focus("#c-rho")
        value = tab.evaluate("explorer.state.p.rho")
        tab.keyboard.press("ArrowRight")
        wait(tab, f"explorer.asked.p.rho > {value}")
        tab.fill("#c-beta-n", "0")
        tab.press("#c-beta-n", "Enter")
        wait(tab, "!document.getElementById('c-beta-w').hidden", told="a refused value has no sentence")
        expect(
            tab.get_attribute("#c-beta-n", "aria-invalid") and tab.input_value("#c-beta-n") == "0",
            "it is not marked",
        )
        tab.fill("#c-beta-n", "0.2")
        tab.press("#c-beta-n", "Enter")
        wait(tab, "document.getElementById('c-beta-w').hidden")
        sent = tab.evaluate("explorer.seq")
        for k in range(60):
            tab.evaluate(
                f"() => {{ const s = document.getElementById('c-rho'); s.value = {300 + 8 * k}; s.dispatchEvent(new Event('input')); }}"
            )
        wait(tab, IDLE)
        expect(tab.evaluate("explorer.seq") - sent < 60, "every event was sent, and not the newest")
        last = tab.evaluate(
            "[explorer.orbit.header.seq, explorer.seq, explorer.state.p.rho, explorer.asked.p.rho]"
        )
        expect(last[0] == last[1] and last[2] == last[3], f"the last answer is not drawn: {last}")
        seq = tab.evaluate(
            "() => { const late = {...explorer.orbit.header, pose: undefined, seq: 1, to: 'orbit'}; const h = explorer.orbit.header.seq; explorer.hear(late, {t: explorer.orbit.t, status: explorer.orbit.raw, values: new Float32Array(explorer.orbit.t.length * late.names.length)}); return [h, explorer.arrived.header.seq]; }"
        )
        expect(seq[0] == seq[1], "an answer that is late is drawn over a newer one")
        listeners = tab.evaluate("listeners")
        tab.evaluate("for (let k = 0; k < 20; k++) { explorer.controls(); explorer.arrange(); }")
        expect(tab.evaluate("listeners") == listeners, "listeners of the page grow as its parts are made anew")


def fields(b: Browser, shots: Path | None) -> None:
    """What is typed is read or has a word; a press meets its button; nothing moves under the hand; words leave again."""
    middle = "e => { const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2, b.width]; }"
    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:

        def typed(field: str, text: str) -> None:
            tab.fill(field, text)
            tab.press(field, "Enter")
            time.sleep(0.1)
            wait(tab, IDLE)

        # A decimal comma, letters, nothing.
        typed("#c-spring-n", "1,5")
        expect(tab.evaluate("explorer.asked.p.spring") == 1.5, "1,5 is not one and a half")
        for text in ("abc", "", "1,5,2"):
            typed("#c-spring-n", text)
            expect(
                tab.inner_text("#c-spring-w") == tab.evaluate("explorer.scene.words.number"),
                f"no word of {text!r}",
            )
        typed("#c-rho-n", "2.5")
        expect(
            tab.input_value("#c-spring-n") == "1,5,2" and tab.is_visible("#c-spring-w"),
            "the word leaves too early",
        )
        typed("#c-spring-n", "2")
        expect(tab.is_hidden("#c-spring-w"), "the word stays")
        # A span: refused by the page, by the system, and taken.
        first, last = (f".pair input >> nth={k}" for k in (0, 1))
        for text in ("-5", "abc"):
            typed(last, text)
            expect(
                tab.input_value(last) == text and tab.is_visible("#c-t_span-w"),
                f"{text} is changed without a word",
            )
        typed(last, "1e9")
        expect("t_span" in tab.inner_text("#c-t_span-w"), "a span that is too long has no sentence")
        typed(last, "50")
        expect(tab.is_hidden("#c-t_span-w") and tab.is_hidden(".notice"), "the sentence of the span stays")
        expect(tab.evaluate("explorer.asked.t_span") == [0, 50], "the span is not taken")
        # A refusal that is of no field leaves with the next answer.
        tab.evaluate("explorer.set({names: ['nothing']})")
        wait(tab, "document.querySelector('.notice.bad')?.textContent.includes('nothing')")
        tab.evaluate("explorer.set({names: ['y', 'v']})")
        wait(tab, "document.querySelector('.notice').hidden", told="the notice stays")
        wait(tab, IDLE)
        # Reset at three places of the button, each after a slider was dragged.
        for share in (0.2, 0.5, 0.8):
            tab.evaluate("document.getElementById('c-omega').scrollIntoView({block: 'center'})")
            x, y, wide = tab.eval_on_selector("#c-omega", middle)
            tab.mouse.move(x, y)
            tab.mouse.down()
            tab.mouse.move(x + 0.2 * wide, y, steps=3)
            tab.mouse.up()
            wait(tab, IDLE)
            expect(tab.evaluate("explorer.state.p.omega") != 1, "the drag moves nothing")
            reset = tab.get_by_text("Reset", exact=True)
            reset.scroll_into_view_if_needed()
            box = reset.bounding_box()
            tab.mouse.move(box["x"] + share * box["width"], box["y"] + share * box["height"])
            tab.mouse.down()
            tab.mouse.up()
            wait(tab, IDLE)
            expect(tab.evaluate("explorer.state.p.omega") == 1, f"the click on Reset is lost at {share} of it")
        # The mouse passes over the sliders.
        places = "[...document.querySelectorAll('.slider')].map(e => e.getBoundingClientRect().top)"
        tab.evaluate("document.querySelector('aside').scrollTop = 0, document.activeElement.blur()")
        tab.mouse.move(600, 5)
        before = tab.evaluate(places)
        for name in ("mass", "spring"):
            tab.hover(f"#c-{name}")
            expect(tab.evaluate(places) == before, f"the sliders move under the mouse, over {name}")
        # The mechanism fills its place again after a start far away.
        size = tab.evaluate("explorer.of('mechanism').reach")
        for far in ("50", "1e300"):
            typed("#c-x0\\.y-n", far)
            typed("#c-x0\\.y-n", "0.5")
        now = tab.evaluate("explorer.of('mechanism').reach")
        expect(now[1] - now[0] < 3.1 * (size[1] - size[0]), f"the mechanism stays a speck: {now}")
        # What is computed by a button says so.
        empty = "((key, text) => (e => !e.hidden && e.textContent === text)(document.querySelector(`.${key} .empty`)))"
        tab.evaluate("(v => { v.halt(); v.job = v.next = null; v.draw(); })(explorer.of('basins'))")
        expect(tab.evaluate(f"{empty}('basins', 'Compute basins')"), "an empty card has no button")
    with served("friction_oscillator", "--law", "Dahl") as (url, _), b.tab(url) as tab:
        expect(tab.evaluate("explorer.orbit.header.ok"), "a stiff law stops")
        wait(tab, f"{empty}('diagram', 'Computing ...')", 30, "the diagram is empty without a word")
        wait(tab, "document.querySelector('.diagram .empty').hidden", 120, "no column of a stiff law")
        if shots:
            tab.screenshot(path=shots / "dahl.desktop.png", full_page=True)


def gestures(b: Browser, shots: Path | None) -> None:
    """Drag and click in the phase plane, time cursor, diagram, basins, keys, history."""
    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:
        place = "(k, x, y) => { const v = explorer.of(k), b = v.canvas.getBoundingClientRect(); return [b.left + v.plot.px(x), b.top + v.plot.py(y)]; }"
        x0 = tab.evaluate("explorer.state.x0")
        box = tab.evaluate(f"({place})('phase', {x0['y']}, {x0['v']})")
        tab.mouse.move(*box)
        tab.mouse.down()
        tab.mouse.move(box[0] + 30, box[1] + 20, steps=5)
        tab.mouse.up()
        wait(tab, IDLE)
        moved = tab.evaluate("explorer.state.x0")
        expect(moved["y"] > x0["y"] and moved["v"] < x0["v"], "the drag does not move the start")
        far = tab.evaluate(
            "(() => { const v = explorer.of('phase'), b = v.canvas.getBoundingClientRect(); return [b.left + v.plot.left + 12, b.top + v.plot.top + 20]; })()"
        )
        tab.mouse.click(*far)
        wait(tab, "explorer.ghosts.length === 1", told="a click leaves no grey orbit")
        wait(tab, IDLE)
        expect(tab.evaluate("explorer.state.x0.y") < -0.5, "the click is no start")
        tab.focus(".phase canvas")
        y = tab.evaluate("explorer.state.x0.y")
        tab.keyboard.press("ArrowRight")
        wait(tab, f"explorer.state.x0.y > {y}", told="arrows do not move the start")
        tab.evaluate("document.activeElement.blur()")
        wait(tab, IDLE)
        cursor = tab.evaluate("explorer.state.cursor")
        tab.keyboard.press(".")
        expect(
            tab.evaluate("explorer.orbit.header.events.some(e => e[0] === explorer.state.cursor)"),
            "no step to an event",
        )
        tab.keyboard.press("Space")
        time.sleep(0.2)
        tab.keyboard.press("Space")
        expect(tab.evaluate("explorer.state.cursor") != cursor, "nothing plays")
        tab.keyboard.press("?")
        expect(tab.evaluate("document.querySelector('dialog').open"), "no list of keys")
        tab.keyboard.press("Escape")
        tab.keyboard.press("d")
        wait(tab, "explorer.of('diagram').job.header?.finished", 60)
        columns = tab.evaluate(
            "[explorer.of('diagram').columns.size, explorer.of('diagram').job.header.columns, explorer.of('diagram').columns.has(explorer.of('diagram').job.header.columns - 1)]"
        )
        expect(columns[0] == columns[1] and columns[2], f"columns are missing: {columns}")
        span = tab.evaluate("explorer.of('diagram').job.header.range")
        tab.evaluate("explorer.of('diagram').box.scrollIntoView({block: 'center'})")
        at = tab.evaluate(
            f"({place})('diagram', {span[0] + 0.25 * (span[1] - span[0])}, explorer.of('diagram').plot.y.low * .5 + explorer.of('diagram').plot.y.high * .5)"
        )
        tab.mouse.click(*at)
        wait(
            tab,
            f"Math.abs(explorer.state.p.rho - {span[0] + 0.25 * (span[1] - span[0])}) < 0.1",
            told="a click in the diagram does not set the parameter",
        )
        tab.mouse.move(*at)
        tab.mouse.down()
        tab.mouse.move(at[0] + 80, at[1] + 40, steps=4)
        tab.mouse.up()
        wait(
            tab,
            f"(explorer.of('diagram').job.header || {{range: [0, 99]}}).range[1] < {span[1]}",
            told="a drag does not compute the part anew",
        )
        expect(
            tab.evaluate("explorer.of('diagram').plot.y.zoomed"), "the part is not shown as high as its box was"
        )
        tab.keyboard.press("Control+z")
        wait(
            tab,
            f"(explorer.of('diagram').job.header || {{range: [0, 0]}}).range[1] === {span[1]}",
            told="back does not restore the diagram",
        )
        expect(tab.evaluate("!explorer.of('diagram').plot.y.zoomed"), "back does not restore its height")
        tab.keyboard.press("b")
        wait(tab, "explorer.of('basins').job.header?.cycles?.length", 60)
        job = tab.evaluate("explorer.of('basins').id")
        tab.keyboard.press("Escape")
        expect(job and tab.evaluate("explorer.views.every(v => !v.id)"), "Esc does not stop a job")
        tab.keyboard.press("b")
        wait(tab, "explorer.of('basins').id && explorer.of('basins').job.header?.done", 60)
        tab.evaluate(
            f"explorer.hear({{kind: 'basins', job: {job}, done: 1e9, cells: 2, axes: ['y', 'v'], cycles: []}}, {{}})"
        )
        done = tab.evaluate("explorer.of('basins').job.header.done")
        expect(done < 1e9, "frames of a job that was stopped are drawn")
        tab.keyboard.press("Escape")
        # Rows of the basins stand where the attractors' own dots are.
        tab.evaluate("explorer.of('basins').wanted = 75")
        tab.keyboard.press("b")
        wait(tab, "explorer.of('basins').job.header?.cycles?.length > 1", 60)
        place = """(() => { const v = explorer.of('basins'), h = v.job.header, n = h.cells, at = explorer.state.basins.axes.map(a => explorer.scene.states.indexOf(a));
          return h.cycles.map((c, k) => ((row, column) => {
            const near = [0, 1, -1].flatMap(r => [0, 1, -1].map(q => v.shade[(row + r) * n + column + q])); // one row on: its basin may be thin
            return near.includes(k + 3); })(
              Math.round((c.x[at[1]] - h.ranges[1][0]) / (h.ranges[1][1] - h.ranges[1][0]) * (n - 1)), Math.round((c.x[at[0]] - h.ranges[0][0]) / (h.ranges[0][1] - h.ranges[0][0]) * (n - 1)))); })()"""
        wait(tab, "explorer.of('basins').job.header.finished", 60)
        where = tab.evaluate(place)
        expect(all(where), f"an attractor does not lie in its own basin: {where}")
        side = tab.evaluate("""(() => { const v = explorer.of('basins'), n = v.job.header.cells; v.tint();
          const shade = v.shade[(n - 1) * n], data = v.bitmap.getContext('2d').getImageData(0, 0, 1, 1).data, low = v.bitmap.getContext('2d').getImageData(0, n - 1, 1, 1).data;
          const c = explorer.tone(explorer.scene.colours.basins[(shade - 3) % 7]), rgb = [1, 3, 5].map(k => parseInt(c.slice(k, k + 2), 16));
          return shade < 3 || rgb.every((x, k) => Math.abs(x - data[k]) < 3); })()""")
        expect(side, "the picture of the basins is upside down")


def colours(b: Browser, shots: Path | None) -> None:
    """Slip to the right has the package's blue, slip to the left its orange; shaded is what sticks."""
    from pwsmooth.plotting import COLOUR

    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:
        told = tab.evaluate("[explorer.phases[1], explorer.phases[-1], explorer.phases[0]]")
        expect(told == [COLOUR["right"], COLOUR["left"], COLOUR["stick"]], f"the colours are {told}")
        # A pixel of the curve where it slips to the right.
        found = tab.evaluate("""(() => { const v = explorer.of('phase'), o = explorer.orbit, xs = o.values.get('y'), ys = o.values.get('v'), s = explorer.status(explorer.state.switch), found = {};
          for (let k = 0; k < xs.length; k += 7) { if (Math.abs(ys[k]) < 0.4) continue;
            const x = Math.round(v.plot.px(xs[k]) * v.plot.ratio), y = Math.round(v.plot.py(ys[k]) * v.plot.ratio), d = v.canvas.getContext('2d').getImageData(x, y, 1, 1).data;
            const key = (ys[k] > 0 ? 'up' : 'down'); found[key] = found[key] || [0, 0]; if (d[2] > d[0] + 40) found[key][0]++; if (d[0] > d[2] + 40) found[key][1]++; }
          return found; })()""")
        expect(
            found["up"][0] > 5 * found["up"][1] and found["down"][1] > 5 * found["down"][0],
            f"exchanged: {found}",
        )
        wrong = tab.evaluate("""(() => { const o = explorer.orbit, ys = o.values.get('v'); let off = 0, held = 0;
          for (const [a, b] of o.header.held) for (let k = 0; k < o.t.length; k++) if (o.t[k] > a + 1e-4 && o.t[k] < b - 1e-4) { held++; if (Math.abs(ys[k]) > 1e-6) off++; }
          return [off, held]; })()""")
        expect(wrong[1] > 0 and wrong[0] == 0, f"shaded though it slips: {wrong}")


def style(b: Browser, shots: Path | None) -> None:
    """A browser reads the rules of the style sheet as they are written, not those of a file that was cut too short."""
    source = (
        importlib.resources.files("pwsmooth.explorer")
        .joinpath("static", "style.css")
        .read_text(encoding="utf-8")
    )
    rules = """source => {
      const written = new CSSStyleSheet(), told = sheet => [...sheet.cssRules].map(rule => rule.cssText).join('\\n').replace(/, /g, ',');
      written.replaceSync(source);
      const [a, b] = [written, document.styleSheets[0]].map(sheet => told(sheet).split('\\n'));
      return [a.length, a.map((line, k) => [line, b[k]]).filter(([x, y]) => x !== y)];
    }"""
    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:
        count, other = tab.evaluate(rules, source)
        expect(count > 100 and not other, f"of {count} lines of rules {len(other)} are others: {other[:3]}")


def links(b: Browser, shots: Path | None) -> None:
    """A link gives the same picture in a fresh browser; two tabs keep their own; what is unknown is dropped with a note."""
    with served("--preset", "figure-8") as (url, _):
        with b.tab(url) as tab, b.tab(url) as other:
            tab.evaluate(
                "() => { const s = document.getElementById('c-rho'); s.value = 640; s.dispatchEvent(new Event('input')); explorer.set({names: ['y', 'friction']}); explorer.point(20); }"
            )
            wait(tab, IDLE)
            wait(tab, "location.hash.startsWith('#s=')", told="the address does not follow the state")
            time.sleep(0.7)
            kept, picture = tab.evaluate("location.hash"), tab.evaluate(HASH)
            expect("t=" not in kept.replace("#s=", ""), "the token stays in the address")
            expect(other.evaluate("explorer.state.p.rho") == 3, "one tab changes another")
        with b.tab(f"{url}&{kept[1:]}") as fresh:
            fresh.evaluate("explorer.point(20)")
            time.sleep(0.3)
            expect(fresh.evaluate(HASH) == picture, "the link shows another picture")
        with b.tab(f"{url}&s=eyJwIjp7InJobyI6IngiLCJuIjoxfSwicSI6MX0") as odd:  # {"p":{"rho":"x","n":1},"q":1}
            said = odd.inner_text(".notice")
            expect(
                "rho" in said and "q" in said and odd.evaluate("explorer.state.p.rho") == 3,
                f"not dropped: {said}",
            )


def taking(b: Browser, shots: Path | None) -> None:
    """Copy as code shows a script; Save figure gives a file; the layered view is a button away."""
    with served("--preset", "figure-8") as (url, _), b.tab(url) as tab:
        tab.get_by_text("Copy as code").click()
        wait(
            tab, "document.querySelector('dialog pre')?.textContent.includes('scene.solve(')", told="no script"
        )
        tab.keyboard.press("Escape")
        tab.get_by_text("Save figure").click()
        with tab.expect_download(timeout=60_000) as saved:
            tab.get_by_text("PNG").click()
        expect(Path(saved.value.path()).read_bytes().startswith(b"\x89PNG"), "no picture was saved")
        tab.keyboard.press("Escape")
        tab.evaluate("explorer.turn({view: 'layered'})")
        wait(
            tab,
            "explorer.scene.view && explorer.orbit?.header.seq === explorer.seq && !explorer.scene.states.includes('z')",
            60,
            "no layered view",
        )
        if shots:
            time.sleep(1)
            tab.screenshot(path=shots / "layered.desktop.png", full_page=True)


def models(b: Browser, shots: Path | None) -> None:
    """Another law takes the place of the one there is, and a link keeps it; a page that only looks changes nothing."""
    now = "explorer.orbit?.header.seq === explorer.seq && explorer.inFlight === null"
    with served("--preset", "figure-8") as (url, _):
        with b.tab(url) as tab:
            tab.fill("#c-spring-n", "3.3")
            tab.press("#c-spring-n", "Enter")
            wait(tab, IDLE)
            tab.select_option("select[aria-label=law]", "LuGre")
            wait(tab, f"explorer.scene.law.name === 'LuGre' && {now}", 60, "no other law")
            state = tab.evaluate("explorer.state")
            expect(state["p"]["spring"] == 3.3 and "sigma0" in state["p"], f"parameters are {state['p']}")
            expect(state["x0"] == {"y": 0.5, "v": 0.3, "z": 0}, f"the start is {state['x0']}")
            wait(tab, "location.hash.startsWith('#s=')")
            time.sleep(0.5)
            kept = tab.evaluate("location.hash")
        with b.tab(f"{url}&{kept[1:]}") as fresh:
            wait(fresh, f"explorer.scene.law.name === 'LuGre' && {now}", 60, "the link loses the law")
            expect(fresh.evaluate("explorer.state.p.spring") == 3.3, "the link loses a parameter")
    with served("--preset", "figure-8", "--read-only") as (url, _), b.tab(url) as tab:
        first = tab.evaluate(HASH)
        tab.evaluate("explorer.state.p.rho = 1, explorer.ask()")
        wait(tab, IDLE)
        expect(tab.evaluate(HASH) == first, "a page that only looks changes the system")
        expect(tab.evaluate("explorer.sliders.inert"), "its sliders are not shut")
    with served("--preset", "figure-13") as (url, _), b.tab(url) as tab:
        wait(tab, "explorer.of('noise').job?.header?.done === 20", 60, "no paths under noise")
        expect(tab.evaluate(LOOK)["seen"][-1]["ink"] > 300, "paths under noise have no ink")


def sections(b: Browser, shots: Path | None) -> None:
    """An autonomous system has its maps once a section is chosen."""
    with served("--preset", "stribeck") as (url, _), b.tab(url) as tab:
        expect(tab.evaluate("!explorer.of('diagram')"), "a diagram without strobes")
        tab.select_option(".missing select", "v -1")
        wait(tab, "explorer.of('diagram')?.columns?.size > 20", 30, "no diagram by a section")
        expect(
            "Returns to v = 0, falling" in tab.inner_text(".diagram .note"), "it does not say by which section"
        )
        with b.tab(url, "phone") as small:
            small.select_option(".missing select", "v -1")
            wait(
                small,
                "explorer.views.some(v => v.key === 'diagram')",
                told="no section can be chosen on a phone",
            )
            if shots:
                small.screenshot(path=shots / "section.phone.png")


def ending(b: Browser, shots: Path | None) -> None:
    """A closed tab ends its processes; a server that ends is told of, and the state stays."""

    def children(run: Any) -> int:
        found = subprocess.run(
            ["ps", "-o", "args=", "--ppid", str(run.pid)], capture_output=True, text=True
        ).stdout
        return found.count("explorer.processes")

    with served("--preset", "figure-8") as (url, run):
        tab = b.chromium.new_page()
        tab.goto(url.split("#")[0])
        wait(
            tab,
            "document.querySelector('.notice').textContent.includes('open the address')",
            10,
            "no word on the token",
        )
        tab.close()
        with b.tab(url) as tab:
            expect(children(run) >= 1, "no process of the page")
        until = time.monotonic() + 5
        while children(run) and time.monotonic() < until:
            time.sleep(0.05)
        expect(not children(run), "the processes of a closed tab go on")
        with b.tab(url) as tab:
            tab.evaluate("explorer.set({p: {...explorer.state.p, rho: 2.5, beta: 0}})")
            wait(tab, IDLE)
            expect(tab.evaluate("!document.getElementById('c-beta-w').hidden"), "beta = 0 is not refused")
            run.send_signal(signal.SIGINT)
            wait(
                tab,
                "document.querySelector('.notice').textContent.includes('ended')",
                told="the page does not say that its server has ended",
            )
            expect(tab.evaluate("explorer.state.p.rho") == 2.5, "the state is lost")
            live = tab.evaluate(
                "[...document.querySelectorAll('header .actions, aside, main')].filter(e => !e.inert).length"
            )
            grey = tab.evaluate("getComputedStyle(document.querySelector('main')).opacity < 0.7")
            expect(not live and grey, "what no server answers looks alive")
            if shots:
                tab.screenshot(path=shots / "ended.desktop.png")
        expect(run.wait(5) == 0, "Ctrl-C gives another code than 0")


def phone(b: Browser, shots: Path | None) -> None:
    """At the width of a phone: tabs, a sheet of sliders at the bottom, scrolling by finger, a long press to move."""
    with served("--preset", "figure-8") as (url, _), b.tab(url, "phone") as tab:
        expect(tab.evaluate("document.querySelectorAll('.tabs [role=tab]').length") >= 5, "no tabs")
        low = tab.evaluate("document.querySelector('aside').getBoundingClientRect().height")
        tab.click(".handle")
        high = tab.evaluate("document.querySelector('aside').getBoundingClientRect().height")
        expect(low < 0.2 * 844 and low < high <= 0.46 * 844, f"the sheet is {low} and {high} px high")
        if shots:
            tab.screenshot(path=shots / "sheet.phone.png")
        tab.click(".handle")
        before = tab.evaluate("JSON.stringify(explorer.state.x0)")
        press = """([x, y, wait]) => new Promise(done => { const c = document.querySelector('.phase canvas');
          const at = (t, dx) => c.dispatchEvent(new PointerEvent(t, {pointerId: 5, pointerType: 'touch', clientX: x + dx, clientY: y, bubbles: true}));
          at('pointerdown', 0); setTimeout(() => { for (let k = 0; k < 30; k += 6) at('pointermove', k); at('pointerup', 30); done(); }, wait); })"""
        tab.evaluate("document.querySelector('.phase').scrollIntoView()")
        at = tab.evaluate(
            "(() => { const v = explorer.of('phase'), b = v.canvas.getBoundingClientRect(); return [b.left + v.plot.px(explorer.state.x0.y), b.top + v.plot.py(explorer.state.x0.v)]; })()"
        )
        tab.evaluate(press, [*at, 20])
        expect(
            tab.evaluate("JSON.stringify(explorer.state.x0)") == before, "a finger that scrolls moves the start"
        )
        tab.evaluate(press, [*at, 500])
        expect(
            tab.evaluate("JSON.stringify(explorer.state.x0)") != before, "a long press does not move the start"
        )


CHECKS: tuple[Callable[[Browser, Path | None], None], ...] = (
    sliders, fields, gestures, colours, style, links, taking, models, sections, ending, phone, views,
)  # fmt: skip


def check(executable: str, only: str = "", shots: Path | None = None) -> list[str]:
    """Faults of the page."""
    from playwright.sync_api import sync_playwright

    faults = []
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=executable, args=ALONE)
        for look in CHECKS:
            if only and look.__name__ not in only.split(","):
                continue
            begun, tabs = time.perf_counter(), Browser(chromium)
            try:
                look(tabs, shots)
            except Exception as error:  # one fault must not hide the next
                faults.append(f"{look.__name__}: {error}")
            ended = look is ending
            faults += [
                f"{look.__name__}: {s}" for s in dict.fromkeys(tabs.said) if not (ended and "WebSocket" in s)
            ]
            print(f"{look.__name__}: {time.perf_counter() - begun:.1f} s", flush=True)
        chromium.close()
    return faults


# One fault each: file, what stands there, what takes its place, and the test (Python) or look (browser) that must find it.
JS = "explorer/static/explorer.js"
FAULTS: dict[str, tuple[str, str, str, str]] = {
    "a late answer is drawn": (JS, "if (header.seq < this.drawnSeq) return;", "", "sliders"),
    "frames of a job that was stopped are drawn": (
        JS, "this.views.find((v) => v.id === header.job)", "this.of(kind)", "gestures",
    ),
    "sticking is shaded late": (
        "explorer/live.py", "[s.start, s.end, int(n)]", "[s.start + 0.05, s.end, int(n)]", "test_what_is_drawn",
    ),
    "left and right exchange colours": (JS, "this.tone(c.right), \"-1\": this.tone(c.left)",
                                        "this.tone(c.left), \"-1\": this.tone(c.right)", "colours"),
    "Origin is not looked at": (
        "explorer/server.py", 'if origin == [f"http://{host[0]}"]:', "if True:", "test_the_server_answers",
    ),
    "a part of the token is enough": (
        "explorer/server.py", "token.encode(), self.token.encode())", "token.encode(), self.token.encode()[: len(token)])", "test_another_token",
    ),
    "a script of another host": (
        "explorer/static/index.html", "<div", "<script src='https://cdn.invalid/x.js'></script><div", "sliders",
    ),
    "the script lacks a parameter": (
        "explorer/code.py", "if v != _own(subject, n)}", "if v != _own(subject, n) and n != 'spring'}", "test_the_script",
    ),
    "the sampler cuts degrees": (
        "results/records.py", "    return (coefficients * ends", "    coefficients = coefficients[..., :8]\n"
        "    powers = np.arange(coefficients.shape[2])\n    return (coefficients * ends", "test_what_is_drawn",
    ),
    "the last column is never computed": (
        "explorer/maps.py", "spread(plan.shape).tolist()", ""
        "np.setdiff1d(spread(plan.shape), [plan.size - 1])", "test_a_finished_diagram",
    ),
    "rows of the basins are mirrored": (
        "explorer/maps.py", '"cell": (row * n + column)', '"cell": ((n - 1 - row) * n + column)', "test_finished_basins",
    ),
    "a run that failed is shown as a success": (
        "explorer/live.py", '"ok": solution.success', '"ok": True', "test_a_run_that_stops",
    ),
    "a listener for each rebuild": (
        JS, "    this.fields = {};\n", '    this.fields = {};\n    document.addEventListener("keyup", () => this.fields);\n',
        "sliders",
    ),
    "processes outlive their tab": (
        "explorer/processes.py", "        self.over = True\n        for process in (self.live, self.maps):",
        "        self.over = True\n        for process in ():", "ending",
    ),
    "wider than a phone": (
        "explorer/static/style.css", ".work { display: block; }", ".work { display: block; width: 500px; }", "views",
    ),
    "a rule is read as another": ("explorer/static/style.css", "  .ends *:first", "  .ends :first", "style"),
    "another law loses the mechanism's numbers": (JS, "{ ...this.state, ...part, kind:", "{ ...part, kind:", "models"),
    "a comma is left out": (
        "explorer/static/views.js", '.replace(/^([^.,]*),([^.,]*)$/, "$1.$2")', '.replace(",", "")', "fields",
    ),
    "letters have no word": (JS, "if (field.odd) return this.mark(this.fields[key], this.scene.words.number);",
                             "if (field.odd) return;", "fields"),
    "a refused span snaps back": (JS, "if (number.odd) return this.mark({ said, number }, this.scene.words.pair);",
                                  "if (number.odd) return (number.value = plain(pair[k]));", "fields"),
    "notices stay": (JS, 'if (this.refused) this.tell("");', "", "fields"),
    "the ends of sliders come and go": (
        "explorer/static/style.css", ".ends { display: flex; visibility: hidden; }\n  .slider:is(:hover, :focus-within) "
        ".ends { visibility: visible; }", ".ends { display: none; }\n  .slider:is(:hover, :focus-within) .ends { display: "
        "flex; }", "fields",
    ),
    "the mechanism stays a speck": ("explorer/static/views.js", "> 3 * wide(reach)", "> Infinity * wide(reach)", "fields"),
    "an empty diagram has no word": (
        "explorer/static/views.js", "first.hidden = !!(job?.header || scene.alone)", "first.hidden = true", "fields",
    ),
    "a dead page looks alive": (JS, "part.inert = true", "part", "ending"),
    "the script runs again": ("explorer/processes.py", "if any(argument", "if True or any(argument", "test_a_script_without"),
    "a page that only looks is heard": ("explorer/processes.py", "if self.subject.read_only:", "if False:", "models"),
}  # fmt: skip


def self_test(only: str) -> list[str]:
    """Faults that nothing finds: each is planted in a copy of the package."""
    overlooked = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "pwsmooth"
        shutil.copytree(ROOT / "pwsmooth", copy, ignore=shutil.ignore_patterns("__pycache__"))
        paths = [folder, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep)), str(ROOT)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
        for name, (file, old, new, test) in FAULTS.items():
            if only and only not in name:
                continue
            path = copy / file
            text = path.read_text(encoding="utf-8")
            expect(text.count(old) == 1, f"{file} has {text.count(old)} of {old!r}")
            path.write_text(text.replace(old, new), encoding="utf-8")
            if test.startswith("test_"):
                command = [sys.executable, "-m", "pytest", "-q", "-x", "-o", "pythonpath=", "-p", "no:cacheprovider",
                           str(ROOT / "tests" / "explore" / "test_explore.py"), "-k", test]  # fmt: skip
            else:
                command = [sys.executable, __file__, "--only", test]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=folder)
            path.write_text(text, encoding="utf-8")
            said = [line for line in done.stdout.splitlines() if line.startswith((f"{test}:", "FAILED", "E  "))]
            found = done.returncode == 1 and any(" s" != line[-2:] for line in said)
            print(
                f"{'found     ' if found else 'OVERLOOKED'} {name}: {said[-1][:150] if said else done.stdout[-300:]}",
                flush=True,
            )
            overlooked += [] if found else [name]
    return overlooked


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Look at pwsmooth explore in a browser.")
    parser.add_argument("--shots", type=Path, metavar="DIR", help="write pictures of what is seen")
    parser.add_argument("--install", action="store_true", help="install Chromium where it is missing")
    parser.add_argument("--only", default="", help="names of checks, with commas")
    parser.add_argument("--self-test", action="store_true", help="plant faults, and see that each is found")
    options = parser.parse_args()
    if options.self_test:
        if overlooked := self_test(options.only):
            sys.exit("overlooked: " + ", ".join(overlooked))
        return
    try:
        executable = browser(options.install)
    except NoBrowser as error:
        sys.exit(f"tests/explore_in_browser.py: {error}")
    if options.shots:
        options.shots.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    faults = check(executable, options.only, options.shots)
    for fault in faults:
        print(fault)
    print(f"{len(CHECKS)} looks, {time.perf_counter() - begun:.0f} s: {len(faults)} faults")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
