// The views: what each draws of the state, and what a gesture on it changes. All read `app`, whose methods write the state.
import { Plot, gestures, mixed, shown, written } from "./plot.js";

const short = (v) => shown(v, Math.abs(v) || 1);
const unit = (app, name) => (app.scene.units[name] ? `${written(name)} (${app.scene.units[name]})` : written(name));

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key === "class") made.className = value;
    else if (key in made && key !== "list" && key !== "role") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

export function choice(label, options, value, change) {
  const box = element(
    "select",
    { "aria-label": label, onchange: (e) => change(e.target.value) },
    ...options.map(([v, text]) => element("option", { value: v, selected: v === value }, text)),
  );
  return box;
}

class View {
  constructor(app) {
    this.app = app;
    this.key = this.constructor.key;
  }
  get title() {
    return this.constructor.title;
  }
  why() {
    return "";
  } // it is not offered
  build() {
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": this.title });
    this.tools = element("span", { class: "tools" });
    this.note = element("p", { class: "note" });
    this.box = element(
      "figure",
      { class: `view ${this.key}` },
      element("figcaption", {}, (this.heading = element("h2", {}, this.title)), this.tools),
      element("div", { class: "stage" }, this.canvas),
      this.note,
    );
    this.box.dataset.view = this.key;
    this.plot = new Plot(this.canvas, this.app.theme);
    this.fill();
    const on = this.gestures();
    if (on) gestures(this.plot, on);
    if (on?.zoom)
      this.tools.append(
        element("button", { class: "small", type: "button", title: "All of it, at the best scale", onclick: () => this.fit() }, "Fit"),
      );
    this.canvas.addEventListener("keydown", (e) => this.keyed?.(e));
    return this.box;
  }
  fill() {}
  gestures() {
    return null;
  }
  fit() {
    for (const axis of [this.plot.x, this.plot.y]) {
      axis.forget();
      axis.fit();
    }
    this.scale?.();
    this.draw();
  }
  draw() {
    if (!this.box.isConnected || !this.plot.measure()) return;
    this.plot.theme = this.app.theme;
    this.scale?.();
    this.plot.begin();
    this.paint(this.plot, this.app);
    this.plot.end();
    this.after?.(this.plot, this.app);
  }
  say(text) {
    if (this.note.textContent !== text) this.note.textContent = text;
  }
  both() {
    return {
      zoom: (x, y, k) => {
        this.plot.x.zoom(x, k);
        this.plot.y.zoom(y, k);
        this.draw();
      },
    };
  }
}

const range = (values, first = 0, last = values.length) => {
  let low = Infinity,
    high = -Infinity;
  for (let k = first; k < last; k++) {
    const v = values[k];
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return [low, high];
};

// Time series: one strip a name, on one axis of time.
class Time extends View {
  static key = "time";
  static title = "Time series";
  fill() {
    this.strips = [];
    this.canvas.remove();
    this.stage = this.box.querySelector(".stage");
    const names = [...this.app.scene.states, ...this.app.scene.multipliers, ...this.app.scene.outputs];
    const menu = element(
      "details",
      { class: "menu" },
      element("summary", {}, "Curves"),
      element(
        "div",
        {},
        ...names
          .slice(0, 40)
          .map((n) =>
            element(
              "label",
              {},
              element("input", {
                type: "checkbox",
                value: n,
                checked: this.app.state.names.includes(n),
                onchange: () => this.chosen(menu),
              }),
              ` ${written(n)}`,
            ),
          ),
      ),
    );
    this.tools.append(menu);
    this.menu = menu;
    this.strip();
  }
  chosen(menu) {
    const names = [...menu.querySelectorAll("input:checked")].map((i) => i.value).slice(0, 4);
    this.app.set({ names: names.length ? names : this.app.scene.names });
    this.strip();
  }
  strip() {
    const { names } = this.app.state;
    for (const i of this.menu.querySelectorAll("input")) {
      i.checked = names.includes(i.value);
      i.disabled = !i.checked && names.length > 3;
    }
    this.stage.replaceChildren();
    this.strips = names.map((name, k) => {
      const canvas = element("canvas", { tabIndex: k ? -1 : 0, role: "img", "aria-label": `${written(name)} over time` });
      this.stage.append(canvas);
      const plot = new Plot(canvas, this.app.theme);
      plot.labels = [k === names.length - 1 ? written(this.app.scene.time) : "", unit(this.app, name)];
      plot.bottom = k === names.length - 1 ? 30 : 10;
      canvas.classList.toggle("last", k === names.length - 1);
      gestures(plot, {
        press: (x) => this.app.point(x),
        move: (x) => this.app.point(x),
        zoom: (x, y, f) => this.zoom(x, f),
        fit: () => this.fit(),
      });
      canvas.addEventListener("keydown", (e) => this.keyed(e));
      return { name, canvas, plot };
    });
    this.plot = this.strips[0].plot;
    this.canvas = this.strips[0].canvas;
  }
  gestures() {
    return null;
  }
  build() {
    const box = super.build();
    this.tools.append(element("button", { class: "small", type: "button", onclick: () => this.fit() }, "Fit"));
    return box;
  }
  zoom(at, factor) {
    for (const s of this.strips) s.plot.x.zoom(at, factor, this.app.orbit?.header.asked);
    this.draw();
  }
  fit() {
    for (const s of this.strips) {
      s.plot.x.fit();
      s.plot.y.forget();
      s.plot.y.fit();
    }
    this.draw();
  }
  keyed(e) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (!step || !this.app.orbit) return;
    const [a, b] = [this.plot.x.low, this.plot.x.high];
    this.app.point(this.app.state.cursor + (step * (b - a) * (e.shiftKey ? 10 : 1)) / 500);
    e.preventDefault();
  }
  // Of a run that stopped, what the page itself can do.
  remedies(h) {
    if (this.cured === h.ok) return;
    this.cured = h.ok;
    const { app } = this,
      button = (text, act) => element("button", { class: "small", type: "button", onclick: act }, text);
    this.cures ||= this.box.appendChild(element("p", { class: "actions" }));
    this.cures.replaceChildren(
      ...(h.ok || app.scene.alone
        ? []
        : [
            button("Shorter span", () => {
              app.remember();
              app.write({ t_span: [h.asked[0], h.asked[0] + 0.98 * (app.orbit.header.t_span[1] - h.asked[0])] });
            }),
            ...(app.scene.switches.length && !app.view ? [button("Smoothed view", () => app.turn("smoothed"))] : []),
          ]),
    );
  }
  draw() {
    const { app } = this,
      { orbit } = app;
    if (!orbit || !this.box.isConnected) return;
    if (this.strips.map((s) => s.name).join() !== app.state.names.join()) this.strip();
    for (const { plot, name } of this.strips) {
      const ys = orbit.values.get(name);
      if (!ys || !plot.measure()) continue;
      plot.theme = app.theme;
      plot.x.fixed = orbit.header.asked;
      plot.x.settle();
      const zoomed = plot.x.zoomed,
        t = orbit.t;
      plot.y.cover(...(zoomed ? range(ys, ...app.between(plot.x.low, plot.x.high)) : range(ys)));
      plot.begin();
      const held = mixed(app.theme.paper, app.raw.stick, app.theme.dark ? 0.28 : 0.16);
      for (const [a, b, n] of orbit.header.held) plot.band(a, b, held, n > 1);
      plot.horizontal(0, app.theme.axis);
      const [first, last] = app.between(plot.x.low, plot.x.high);
      plot.curve(t, ys, app.theme.curve, 1.6, Math.max(0, first - 1), Math.min(t.length, last + 1));
      const bottom = plot.top + plot.inner[1];
      for (const [at] of orbit.header.events) {
        const p = plot.px(at);
        plot.line(p, bottom - 5, p, bottom, app.theme.muted, 1);
      }
      for (const [at] of orbit.header.ambiguities) app.diamond(plot, at, app.value(name, at));
      if (orbit.header.stopped !== null) plot.vertical(orbit.header.stopped, app.theme.bad, [], 2);
      plot.vertical(app.state.cursor, app.theme.muted);
      plot.dot(app.state.cursor, app.value(name, app.state.cursor), app.theme.ink, 4.5);
      plot.end();
    }
    const h = orbit.header;
    this.remedies(h);
    this.say(h.said || (h.ambiguities.length ? `Not unique from t = ${short(h.ambiguities[0][0])} on: ${h.ambiguities[0][1]}` : ""));
    this.note.classList.toggle("bad", !h.ok);
  }
}

// Any two names; what a click means depends on whether both are states.
class Phase extends View {
  static key = "phase";
  static title = "Phase plane";
  why() {
    return this.app.scene.phase.length ? "" : "it needs two states";
  }
  get pair() {
    return this.app.state.phase;
  }
  fill() {
    const names = [...this.app.scene.states, ...this.app.scene.multipliers, ...this.app.scene.outputs].map((n) => [n, written(n)]);
    const pick = (k) =>
      choice(k ? "vertical axis" : "horizontal axis", names, this.pair[k], (v) => {
        const pair = [...this.pair];
        pair[k] = v;
        for (const axis of [this.plot.x, this.plot.y]) {
          axis.forget();
          axis.zoomed = null;
        }
        this.app.set({ phase: pair });
      });
    this.tools.append(pick(0), pick(1));
  }
  get states() {
    return !this.app.scene.alone && this.pair.every((n) => this.app.scene.states.includes(n)) && this.pair[0] !== this.pair[1];
  }
  gestures() {
    return {
      ...this.both(),
      press: (x, y, px, py) => {
        const at = this.app.start;
        this.grab = this.states && Math.hypot(this.plot.px(at[this.pair[0]]) - px, this.plot.py(at[this.pair[1]]) - py) < 18;
        return this.grab;
      },
      move: (x, y) => this.app.begin({ [this.pair[0]]: x, [this.pair[1]]: y }),
      click: (x, y) => this.states && this.app.begin({ [this.pair[0]]: x, [this.pair[1]]: y }, true),
    };
  }
  keyed(e) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (!way || !this.states) return;
    const k = e.shiftKey ? 50 : 5,
      { x, y } = this.plot,
      at = this.app.start;
    this.app.begin({
      [this.pair[0]]: at[this.pair[0]] + (way[0] * k * (x.high - x.low)) / 1000,
      [this.pair[1]]: at[this.pair[1]] + (way[1] * k * (y.high - y.low)) / 1000,
    });
    e.preventDefault();
  }
  scale() {
    const { orbit } = this.app,
      [xs, ys] = this.pair.map((n) => orbit?.values.get(n));
    if (!xs || !ys) return;
    this.plot.x.margin = 0.06;
    this.plot.x.cover(...range(xs));
    this.plot.y.cover(...range(ys));
    this.plot.labels = [unit(this.app, this.pair[0]), unit(this.app, this.pair[1])];
  }
  paint(plot, app) {
    const { orbit } = app,
      [a, b] = this.pair,
      xs = orbit?.values.get(a),
      ys = orbit?.values.get(b);
    if (!xs || !ys) return;
    for (const line of orbit.phase.join() === this.pair.join() ? orbit.header.lines : []) plot.straight(line, app.theme.muted, [5, 4]);
    for (const ghost of app.ghosts) if (ghost.has(a) && ghost.has(b)) plot.curve(ghost.get(a), ghost.get(b), app.theme.ghost, 1);
    const status = app.status(orbit);
    if (status) plot.phases(xs, ys, status, app.phases);
    else plot.curve(xs, ys, app.theme.curve);
    if (this.states) plot.dot(app.start[a], app.start[b], app.theme.ink, 6, true);
    if (orbit.header.stopped !== null) plot.dot(xs[xs.length - 1], ys[ys.length - 1], app.theme.bad, 5);
    plot.dot(app.value(a, app.state.cursor), app.value(b, app.state.cursor), app.theme.ink, 4.5);
  }
  after(plot, app) {
    this.say(this.states ? "Drag the ring or click to start elsewhere." : "");
    this.canvas.setAttribute("aria-label", `Phase plane of ${written(this.pair[0])} and ${written(this.pair[1])}. ${app.sentence}`);
  }
}

class Characteristic extends Phase {
  static key = "characteristic";
  static title = "Characteristic";
  why() {
    return this.app.scene.characteristic.length ? "" : "no switch, no law";
  }
  get pair() {
    return this.app.scene.characteristic;
  }
  get states() {
    return false;
  }
  fill() {}
  gestures() {
    return this.both();
  }
  after() {
    this.say("");
    this.canvas.setAttribute("aria-label", `${written(this.pair[1])} over ${written(this.pair[0])}. ${this.app.sentence}`);
  }
}

// dh/dt over lambda at the cursor: where it goes, and where it may rest.
class Layer extends View {
  static key = "layer";
  static title = "Layer";
  why() {
    return this.app.scene.switches.length ? "" : "no switch that can slide";
  }
  fill() {
    if (this.app.scene.switches.length > 1)
      this.tools.append(
        choice(
          "switch",
          this.app.scene.switches.map((n) => [n, written(n)]),
          this.app.state.switch,
          (v) => {
            this.app.set({ switch: v });
            this.app.askLayer();
          },
        ),
      );
  }
  scale() {
    const { layer } = this.app;
    this.plot.x.fixed = [-1.08, 1.08];
    this.plot.x.settle();
    this.plot.labels = [written(this.app.state.switch), "dh/dt"];
    if (!layer) return;
    const [a, b] = range(layer.g),
      [c, d] = layer.slaved ? range(layer.slaved) : [a, b];
    this.plot.y.cover(Math.min(a, c, 0), Math.max(b, d, 0));
  }
  paint(plot, app) {
    const { layer } = app;
    if (!layer) return;
    plot.horizontal(0, app.theme.axis, [], 1.5);
    for (const at of [-1, 1]) plot.vertical(at, app.theme.axis, [3, 3]);
    if (layer.slaved) {
      plot.curve(layer.lam, layer.slaved, app.tone(app.scene.colours.fast), 2);
      for (const [at, attracting] of layer.header.slaved_roots) plot.dot(at, 0, app.tone(app.scene.colours.fast), 5, !attracting);
    }
    plot.curve(layer.lam, layer.g, app.theme.curve, 1.8);
    for (const [at, attracting] of layer.header.roots) plot.dot(at, 0, app.phases[0], 5, !attracting);
    const g = layer.g[Math.round(((layer.header.now + 1) / 2) * (layer.g.length - 1))];
    plot.dot(layer.header.now, g ?? 0, app.theme.ink, 4.5);
  }
  after(plot, app) {
    const { layer } = app;
    if (!layer) return;
    const where = Math.abs(layer.header.h) < 1e-9 ? "on the surface" : `off the surface, h = ${short(layer.header.h)}`;
    const fast = layer.header.fast?.length ? `; pink: ${layer.header.fast.map(written).join(", ")} at equilibrium` : "";
    this.say(`t = ${short(layer.header.t)}, ${where}${fast}`);
    this.canvas.setAttribute(
      "aria-label",
      `Layer of ${written(layer.header.switch)} at t = ${short(layer.header.t)}: ${layer.header.roots.length} equilibria`,
    );
  }
}

// A map of the maps' process: what it was asked, how far it is, whether the state has moved on.
class Grown extends View {
  why() {
    return this.app.mapped ? "" : this.app.scene.map.why;
  }
  fill() {
    this.job = null;
    this.bar = element("progress", { max: 1, value: 0, "aria-label": "progress" });
    if (this.app.scene.alone) this.tools.hidden = true;
    this.live = element("input", { type: "checkbox", checked: this.constructor.live, onchange: () => this.app.moved() });
    this.options();
    this.tools.append(
      element("label", { class: "small", title: "Computed anew when a parameter has rested" }, this.live, " live"),
      element(
        "button",
        { class: "small again", type: "button", title: "Compute", "aria-label": `compute: ${this.title}`, onclick: () => this.start() },
        "↻",
      ),
    );
    this.box.querySelector(".stage").append(this.bar);
  }
  options() {}
  // What of the state the picture depends on, as text.
  depends() {
    const { p, x0 } = this.app.state;
    return JSON.stringify([p, x0, this.app.view, this.app.state.section]);
  }
  get stale() {
    return !!this.job && (this.next || this.job).of !== this.depends();
  }
  get old() {
    return !!this.next || this.stale;
  }
  start(auto = false) {
    this.auto = auto;
    this.bar.hidden = false;
    this.bar.value = 0;
    this.next = { of: this.depends(), p: { ...this.app.state.p }, header: null };
    this.job ||= this.next;
    this.app.begun(this);
    this.draw();
  }
  heard(header, arrays) {
    if (this.next) {
      this.restart();
      this.job = this.next;
      this.next = null;
    } // the old picture stays until the new one begins
    this.job.header = header;
    if (header.of) this.bar.value = header.done / header.of;
    this.bar.hidden = !!header.finished;
    this.take(header, arrays);
    this.app.redraw(this);
    // What nobody asked for must not take minutes.
    const rest = this.seconds(header);
    if (this.auto && rest > 60) {
      this.app.halt(this);
      this.halted = `↻ computes all of it, in ${Math.ceil(rest / 60)} minutes or so. `;
      this.app.moved();
    }
  }
  refused(why) {
    this.bar.hidden = true;
    this.say(why);
    this.note.classList.add("bad");
  }
  stop() {
    this.bar.hidden = true;
  }
  seconds() {
    return 0;
  }
  restart() {
    this.halted = "";
    this.note.classList.remove("bad");
  }
  mark() {
    const changed = Object.entries(this.job?.p || {}).filter(([n, v]) => this.app.state.p[n] !== v && this.ignored !== n);
    return changed.length
      ? `Of ${changed.map(([n, v]) => `${written(n)} = ${plainly(v)}`).join(", ")}. `
      : this.stale
        ? "Of another start. "
        : "";
  }
  draw() {
    super.draw();
    this.box.classList.toggle("stale", this.old);
  }
}
const plainly = (v) => String(+v.toPrecision(5));

class Diagram extends Grown {
  static key = "diagram";
  static title = "Orbit diagram";
  static live = true;
  options() {
    const { app } = this,
      s = app.scene;
    this.tools.append(
      choice(
        "parameter",
        s.controls.map((c) => [c.name, written(c.name)]),
        app.state.diagram.parameter,
        (v) => app.setDiagram({ parameter: v, range: null }),
      ),
      choice(
        "what is shown",
        s.states.map((n) => [n, written(n)]),
        app.state.diagram.y,
        (v) => {
          app.setDiagram({ y: v }, false);
          this.plot.y.forget();
          this.draw();
        },
      ),
      choice(
        "where each column starts",
        [
          ["0", "same start"],
          ["1", "carried on →"],
          ["-1", "carried on ←"],
        ],
        String(app.state.diagram.carry),
        (v) => app.setDiagram({ carry: +v }),
      ),
    );
  }
  get ignored() {
    return this.app.state.diagram.parameter;
  }
  depends() {
    const { p, x0, diagram } = this.app.state,
      rest = { ...p };
    delete rest[diagram.parameter];
    return JSON.stringify([
      rest,
      this.fromDiagram ? 0 : x0,
      diagram.parameter,
      diagram.range,
      diagram.carry,
      this.app.view,
      this.app.state.section,
    ]);
  }
  asked() {
    const { diagram } = this.app.state;
    return {
      kind: "diagram",
      parameter: diagram.parameter,
      range: this.app.span(diagram),
      carry: diagram.carry,
      columns: this.wanted || Math.min(800, Math.max(200, Math.round((this.plot.inner[0] || 400) * 1.5))),
      keep: 100,
    };
  }
  restart() {
    super.restart();
    this.columns = new Map();
    this.plot.y.forget();
    this.plot.y.zoomed = null;
    this.fromDiagram = false;
  }
  seconds(h) {
    return h.cpu > 1 ? (h.cpu / h.done) * (h.of - h.done) : 0;
  }
  take(header, { column, points, last }) {
    if (!column) return;
    const n = header.names.length,
      m = points.length / column.length / n;
    for (let k = 0; k < column.length; k++)
      this.columns.set(column[k], { points: points.subarray(k * m * n, (k + 1) * m * n), last: last.subarray(k * n, (k + 1) * n) });
  }
  gestures() {
    return {
      press: (x, y, px, py) => {
        this.brush = [px, py, px, py];
        return !this.app.scene.alone;
      },
      move: (x, y, px, py) => {
        this.brush[2] = px;
        this.brush[3] = py;
        this.draw();
      },
      up: () => {
        const [x0, y0, x1, y1] = this.brush;
        this.brush = null;
        const [a, c] = this.plot.at(Math.min(x0, x1), Math.max(y0, y1)),
          [b, d] = this.plot.at(Math.max(x0, x1), Math.min(y0, y1));
        if (Math.abs(x1 - x0) > 6) {
          this.app.setDiagram({ range: [a, b] });
          if (Math.abs(y1 - y0) > 20) {
            this.plot.y.zoomed = [c, d];
            this.plot.y.settle();
          }
        }
        this.draw();
      },
      click: (x) => {
        this.brush = null;
        this.pick(x);
      },
      zoom: (x, y, k) => {
        this.plot.y.zoom(y, k);
        this.draw();
      },
    };
  }
  pick(x) {
    const h = this.job?.header;
    if (!h) return;
    const [low, high] = h.range,
      at = Math.round(((x - low) / (high - low)) * (h.columns - 1));
    let best = null;
    for (const k of this.columns.keys()) if (best === null || Math.abs(k - at) < Math.abs(best - at)) best = k;
    if (best === null) return;
    if (this.app.scene.alone) return this.app.choose(h.parameter, x);
    const start = Object.fromEntries(
      h.names.map((n, k) => [n, this.columns.get(best).last[k]]).filter(([n, v]) => isFinite(v) && this.app.scene.states.includes(n)),
    );
    this.fromDiagram = true;
    this.app.fromDiagram(h.parameter, low + ((high - low) * best) / (h.columns - 1), start);
    this.job.of = this.depends();
  }
  scale() {
    const h = this.job?.header,
      { diagram } = this.app.state;
    this.plot.labels = [unit(this.app, diagram.parameter), unit(this.app, diagram.y)];
    this.plot.x.fixed = this.app.span(diagram);
    this.plot.x.settle();
    if (!h) return;
    const j = h.names.indexOf(diagram.y),
      n = h.names.length;
    let low = Infinity,
      high = -Infinity;
    for (const { points } of this.columns.values())
      for (let k = j; k < points.length; k += n) {
        const v = points[k];
        if (v < low) low = v;
        if (v > high) high = v;
      }
    this.plot.y.cover(low, high);
  }
  paint(plot, app) {
    const h = this.job?.header;
    plot.vertical(app.parameter(app.state.diagram.parameter), app.theme.muted, [4, 3]);
    if (h && h.parameter === app.state.diagram.parameter) this.dots(plot, app, h);
    if (this.brush && Math.abs(this.brush[2] - this.brush[0]) > 4) plot.box(this.brush);
  }
  // Points are counted into pixels: 80 000 of them as rectangles would take 30 ms.
  dots(plot, app, h) {
    const { ratio } = plot,
      [w, t] = plot.inner.map((v) => Math.max(1, Math.round(v * ratio))),
      j = h.names.indexOf(app.state.diagram.y),
      n = h.names.length;
    const [low, high] = h.range,
      wide = Math.max(2, Math.round(1.5 * ratio)),
      image = new ImageData(w, t),
      pixels = new Uint32Array(image.data.buffer);
    const c = parseInt((this.old ? app.theme.ghost : app.theme.curve).slice(1), 16),
      colour = (0xd0 << 24) | ((c & 255) << 16) | (c & 0xff00) | (c >> 16);
    const sx = w / (plot.x.high - plot.x.low),
      sy = t / (plot.y.high - plot.y.low);
    for (const [column, { points }] of this.columns) {
      const x = Math.round((low + ((high - low) * column) / (h.columns - 1) - plot.x.low) * sx - wide / 2);
      for (let k = j; k < points.length; k += n) {
        const y = Math.round((plot.y.high - points[k]) * sy - wide / 2);
        if (!(y >= 0 && y < t)) continue;
        for (let r = y; r < Math.min(t, y + wide); r++)
          for (let q = Math.max(0, x); q < Math.min(w, x + wide); q++) pixels[r * w + q] = colour;
      }
    }
    const drawn = element("canvas", { width: w, height: t });
    drawn.getContext("2d").putImageData(image, 0, 0);
    plot.ctx.drawImage(drawn, plot.left, plot.top, ...plot.inner);
  }
  after(plot, app) {
    const h = this.job?.header;
    if (!h || this.note.classList.contains("bad")) return;
    const mode = h.carry ? `carried on ${h.carry > 0 ? "from left to right" : "from right to left"}` : "each from the same start";
    const rest = h.finished ? "" : ` ${h.done} of ${h.of} columns.`;
    this.say(
      `${this.mark()}${this.halted}${app.strobes}, ${mode}.${rest} Click: orbit there${this.app.scene.alone ? "" : "; drag: zoom"}.`,
    );
    this.canvas.setAttribute(
      "aria-label",
      `Orbit diagram of ${written(app.state.diagram.y)} over ${written(h.parameter)}. ${h.columns} values.`,
    );
  }
}

class Basins extends Grown {
  static key = "basins";
  static title = "Basins";
  static live = false;
  why() {
    return super.why() || (this.app.scene.map.basins ? "" : "it needs two states");
  }
  options() {
    const names = this.app.scene.states.map((n) => [n, written(n)]);
    const pick = (k) =>
      choice(k ? "vertical axis of the basins" : "horizontal axis of the basins", names, this.app.state.basins.axes[k], (v) => {
        const axes = [...this.app.state.basins.axes];
        axes[k] = v;
        if (axes[0] === axes[1]) axes[1 - k] = this.app.scene.states.find((n) => n !== v);
        this.app.setBasins({ axes, ranges: axes.map((n) => this.app.scene.axes[n]) });
      });
    this.tools.append(pick(0), pick(1));
  }
  depends() {
    const { p, x0, basins } = this.app.state,
      rest = { ...x0 };
    for (const n of basins.axes) delete rest[n];
    return JSON.stringify([p, rest, basins, this.app.view, this.app.state.section]);
  }
  asked() {
    const { axes, ranges } = this.app.state.basins;
    return { kind: "basins", axes, ranges, cells: this.wanted || 300 };
  }
  restart() {
    super.restart();
    this.shade = null;
  }
  take(header, { cell, label, step }) {
    const n = header.cells;
    if (!this.shade) {
      this.shade = new Uint8Array(n * n);
      this.side = new Uint8Array(n * n).fill(255);
      this.bitmap = element("canvas", { width: n, height: n });
      this.pixels = new ImageData(n, n);
    }
    if (!cell) return;
    for (let k = 0; k < cell.length; k++) {
      const c = cell[k],
        s = step[k] || 1,
        row = (c / n) | 0,
        column = c % n;
      for (let r = row; r < Math.min(n, row + s); r++)
        for (let q = column; q < Math.min(n, column + s); q++) {
          const at = r * n + q;
          if (this.side[at] >= s) {
            this.side[at] = s;
            this.shade[at] = label[k];
          }
        }
    }
    this.tint();
  }
  tint() {
    const { app } = this,
      h = this.job?.header;
    if (!h || !this.shade) return;
    const n = h.cells,
      data = this.pixels.data,
      rgb = (c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16));
    const colours = [null, rgb(app.theme.paper), rgb(app.theme.ghost), ...app.scene.colours.basins.map((c) => rgb(app.tone(c)))];
    for (let at = 0; at < n * n; at++) {
      const shade = this.shade[at],
        c = shade < 3 ? colours[shade] : colours[3 + ((shade - 3) % app.scene.colours.basins.length)];
      const to = ((n - 1 - ((at / n) | 0)) * n + (at % n)) * 4;
      if (!c) {
        data[to + 3] = 0;
        continue;
      }
      const failed = shade === 1 && ((at / n) | 0) % 6 === 3 && at % 6 === 3;
      data[to] = failed ? 128 : c[0];
      data[to + 1] = failed ? 128 : c[1];
      data[to + 2] = failed ? 128 : c[2];
      data[to + 3] = 255;
    }
    this.bitmap.getContext("2d").putImageData(this.pixels, 0, 0);
  }
  gestures() {
    const go = (x, y) => this.app.begin({ [this.app.state.basins.axes[0]]: x, [this.app.state.basins.axes[1]]: y });
    return {
      press: go,
      move: go,
      zoom: (x, y, k) => {
        for (const [axis, at] of [
          [this.plot.x, x],
          [this.plot.y, y],
        ])
          axis.zoom(at, k);
        clearTimeout(this.later);
        this.later = setTimeout(
          () =>
            this.app.setBasins({
              ranges: [
                [this.plot.x.low, this.plot.x.high],
                [this.plot.y.low, this.plot.y.high],
              ],
            }),
          500,
        );
        this.draw();
      },
    };
  }
  fit() {
    const { axes } = this.app.state.basins;
    this.app.setBasins({ ranges: axes.map((n) => this.app.scene.axes[n]) });
  }
  scale() {
    const { basins } = this.app.state,
      k = this.later ? 1 : 0;
    this.plot.labels = basins.axes.map((n) => unit(this.app, n));
    if (!this.same || this.same !== JSON.stringify(basins)) {
      this.same = JSON.stringify(basins);
      [this.plot.x, this.plot.y].forEach((axis, k) => {
        axis.zoomed = null;
        axis.fixed = basins.ranges[k];
        axis.settle();
      });
    }
    return k;
  }
  paint(plot, app) {
    const h = this.job?.header,
      { axes } = app.state.basins,
      { ctx } = plot;
    if (h && this.shade && h.axes.join() === axes.join()) {
      ctx.globalAlpha = this.old ? 0.35 : 1;
      plot.image(this.bitmap, h.ranges[0][0], h.ranges[1][0], h.ranges[0][1], h.ranges[1][1]);
      ctx.globalAlpha = 1;
      const at = axes.map((n) => app.scene.states.indexOf(n));
      h.cycles.forEach((c) => {
        plot.dot(c.x[at[0]], c.x[at[1]], app.theme.ink, 4.5);
      });
    }
    const [xs, ys] = axes.map((n) => app.strobed(n));
    if (xs && ys) {
      for (let k = 1; k < xs.length; k++)
        plot.line(plot.px(xs[k - 1]), plot.py(ys[k - 1]), plot.px(xs[k]), plot.py(ys[k]), app.theme.muted, 0.7);
      xs.forEach((x, k) => plot.dot(x, ys[k], app.theme.ink, 2.2));
    }
    plot.dot(app.start[axes[0]], app.start[axes[1]], app.theme.ink, 6, true);
  }
  after(plot, app) {
    const h = this.job?.header;
    if (this.note.classList.contains("bad")) return;
    if (!h) return this.say("↻ shows which orbit each start leads to; click or drag to follow one.");
    const names = h.cycles.map(
      (c, k) => `${k + 1}: period ${c.period}, |multiplier| ${Math.hypot(...(c.multipliers[0] || [0, 0])).toFixed(3)}`,
    );
    const counts = [
      h.unsettled ? `${h.unsettled} unsettled` : "",
      h.failed ? `${h.failed} failed` : "",
      h.finished ? "" : `${Math.floor((100 * h.done) / h.of)} %`,
    ].filter(Boolean);
    this.say(`${this.mark()}${[...names, ...counts].join("; ")}`);
    this.canvas.setAttribute("aria-label", `Basins over ${axesOf(h)}: ${names.join("; ")}`);
  }
}
const axesOf = (h) => h.axes.map(written).join(" and ");

class Section extends Grown {
  static key = "section";
  static title = "Poincaré section";
  static live = true;
  why() {
    return super.why() || (this.app.scene.phase.length && this.app.scene.states.length > 1 ? "" : "it needs two states");
  }
  get pair() {
    const { phase } = this.app.state,
      { states } = this.app.scene;
    return phase.every((n) => states.includes(n)) ? phase : states.slice(0, 2);
  }
  asked() {
    return { kind: "section" };
  }
  restart() {
    super.restart();
    this.points = [];
    this.plot.x.forget();
    this.plot.y.forget();
  }
  take(header, { points }) {
    if (points) this.points.push(points);
  }
  gestures() {
    return { ...this.both(), click: (x, y) => this.app.begin({ [this.pair[0]]: x, [this.pair[1]]: y }, true) };
  }
  *each() {
    const h = this.job?.header;
    if (!h) return;
    const [a, b] = this.pair.map((n) => h.names.indexOf(n)),
      n = h.names.length;
    for (const some of this.points) for (let k = 0; k < some.length; k += n) yield [some[k + a], some[k + b]];
  }
  scale() {
    this.plot.labels = this.pair.map((n) => unit(this.app, n));
    this.plot.x.margin = 0.08;
    let box = [Infinity, -Infinity, Infinity, -Infinity];
    for (const [x, y] of this.each()) box = [Math.min(box[0], x), Math.max(box[1], x), Math.min(box[2], y), Math.max(box[3], y)];
    this.plot.x.cover(box[0], box[1]);
    this.plot.y.cover(box[2], box[3]);
  }
  paint(plot, app) {
    const { ctx } = plot;
    ctx.fillStyle = this.old ? app.theme.ghost : app.theme.curve;
    let k = 0;
    for (const [x, y] of this.each()) {
      const r = k++ < 50 ? 1.2 : 1.8;
      ctx.fillRect(plot.px(x) - r, plot.py(y) - r, 2 * r, 2 * r);
    }
  }
  after() {
    const h = this.job?.header;
    if (h && !this.note.classList.contains("bad"))
      this.say(
        `${this.mark()}${h.done} ${this.app.state.section ? "returns" : "periods"}${h.repeats ? ", repeating" : ""}. Click: start there.`,
      );
  }
}

// The mechanism at the cursor: shapes whose places are rows of the pose.
class Mechanism extends View {
  static key = "mechanism";
  static title = "Mechanism";
  why() {
    return this.app.scene.sketch ? "" : "this system has no sketch";
  }
  fill() {
    const button = (text, title, act) =>
      element("button", { class: "small", type: "button", title, "aria-label": title, onclick: act }, text);
    this.tools.append(
      button("◂", "event before", () => this.app.event(-1)),
      (this.toggle = button("▶", "play or pause", () => this.app.play())),
      button("▸", "next event", () => this.app.event(1)),
    );
  }
  gestures() {
    return null;
  }
  // Left, right, bottom, top: as given, or as the motion needs them; they do not shrink.
  box4(orbit) {
    const { bounds, shapes } = this.app.scene.sketch;
    if (bounds) return bounds;
    let b = this.reach || [Infinity, -Infinity, Infinity, -Infinity],
      row = 0;
    for (const s of shapes) {
      const half = [(s.width || 2 * (s.radius || 0)) / 2, (s.height || 2 * (s.radius || 0) || s.width || 0) / 2];
      s.places.forEach((place) => {
        const r = orbit.pose[row++],
          k = /^d?x/.test(place) ? 0 : /^d?y/.test(place) ? 1 : 2;
        if (k === 2 || /^d/.test(place)) return;
        const [low, high] = typeof r === "number" ? [r, r] : range(r);
        b = k
          ? [b[0], b[1], Math.min(b[2], low - half[1]), Math.max(b[3], high + half[1])]
          : [Math.min(b[0], low - half[0]), Math.max(b[1], high + half[0]), b[2], b[3]];
      });
    }
    this.reach = b;
    const pad = 0.06 * (b[1] - b[0]);
    return [b[0] - pad, b[1] + pad, b[2] - 2 * pad, b[3] + pad];
  }
  draw() {
    const { app, plot } = this,
      { orbit } = app;
    if (!orbit?.pose || !this.box.isConnected || !plot.measure()) return;
    const { ctx, ratio, width, height } = plot,
      t = app.theme,
      [l, r, b, u] = this.box4(orbit);
    const k = Math.min(width / (r - l), height / (u - b)),
      at = orbit.poseAt(app.state.cursor);
    const X = (x) => width / 2 + (x - (l + r) / 2) * k,
      Y = (y) => height / 2 - (y - (b + u) / 2) * k;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    ctx.lineCap = ctx.lineJoin = "round";
    const line = (points, colour, w) => {
      ctx.strokeStyle = colour;
      ctx.lineWidth = w;
      ctx.beginPath();
      points.forEach(([x, y], i) => (i ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
      ctx.stroke();
    };
    const fill = mixed(t.paper, t.ink, t.dark ? 0.3 : 0.12),
      steel = mixed(t.paper, t.ink, 0.55);
    let row = 0;
    for (const s of app.scene.sketch.shapes) {
      const p = Object.fromEntries(s.places.map((name) => [name, at(row++)]));
      const status = s.phase ? app.statusAt(s.phase, app.state.cursor) : null,
        edge = status === null ? t.ink : app.phases[status];
      if ("x_1" in p) {
        const [x1, y1, x2, y2] = [X(p.x_1), Y(p.y_1), X(p.x_2), Y(p.y_2)],
          d = Math.hypot(x2 - x1, y2 - y1) || 1,
          ux = (x2 - x1) / d,
          uy = (y2 - y1) / d;
        if (s.kind === "spring") {
          const w = Math.min((s.width * k) / 2, 14),
            n = 16,
            points = [
              [x1, y1],
              [x1 + ux * d * 0.08, y1 + uy * d * 0.08],
            ];
          for (let i = 0; i < n; i++) {
            const q = 0.1 + (0.8 * (i + 0.5)) / n,
              o = i % 2 ? w : -w;
            points.push([x1 + ux * d * q - uy * o, y1 + uy * d * q + ux * o]);
          }
          line([...points, [x1 + ux * d * 0.92, y1 + uy * d * 0.92], [x2, y2]], steel, 1.4);
        } else if (s.kind === "bar") {
          line(
            [
              [x1, y1],
              [x2, y2],
            ],
            t.ink,
            Math.max(3, s.width * k),
          );
          line(
            [
              [x1, y1],
              [x2, y2],
            ],
            fill,
            Math.max(1.5, s.width * k - 2.4),
          );
        } else if (s.kind === "belt") {
          const h = 12,
            gap = Math.max(s.mark * k, 8);
          ctx.fillStyle = fill;
          ctx.strokeStyle = t.ink;
          ctx.lineWidth = 1.4;
          ctx.beginPath();
          ctx.roundRect(Math.min(x1, x2) - h, y1, Math.abs(x2 - x1) + 2 * h, 2 * h, h);
          ctx.fill();
          ctx.stroke();
          for (let q = (((p.travel * k) % gap) + gap) % gap; q < d; q += gap)
            line(
              [
                [x1 + ux * q, y1],
                [x1 + ux * q, y1 + 5],
              ],
              t.ink,
              1.4,
            );
        } else {
          line(
            [
              [x1, y1],
              [x2, y2],
            ],
            t.ink,
            1.6,
          );
          for (let q = 6; q < d; q += 9)
            line(
              [
                [x1 + ux * q, y1 + uy * q],
                [x1 + ux * (q - 6) - uy * 7, y1 + uy * (q - 6) + ux * 7],
              ],
              t.axis,
              1,
            );
        }
      } else if (s.kind === "arrow") {
        const [x1, y1, x2, y2] = [X(p.x), Y(p.y), X(p.x + p.dx), Y(p.y + p.dy)],
          d = Math.hypot(x2 - x1, y2 - y1),
          colour = app.tone(app.scene.colours.fast);
        if (d < 2) continue;
        const ux = (x2 - x1) / d,
          uy = (y2 - y1) / d;
        line(
          [
            [x1, y1],
            [x2, y2],
          ],
          colour,
          2,
        );
        line(
          [
            [x2 - 7 * ux - 4 * uy, y2 - 7 * uy + 4 * ux],
            [x2, y2],
            [x2 - 7 * ux + 4 * uy, y2 - 7 * uy - 4 * ux],
          ],
          colour,
          2,
        );
      } else {
        ctx.save();
        ctx.translate(X(p.x), Y(p.y));
        ctx.rotate(-(p.angle || 0));
        ctx.strokeStyle = edge;
        ctx.lineWidth = status === 0 ? 3 : 1.8;
        ctx.fillStyle = s.kind === "clearance" ? "transparent" : s.kind === "joint" ? t.paper : fill;
        ctx.beginPath();
        if (s.kind === "block") ctx.roundRect((-s.width * k) / 2, (-s.height * k) / 2, s.width * k, s.height * k, 4);
        else ctx.arc(0, 0, Math.max(2, s.radius * k), 0, 7);
        ctx.fill();
        ctx.stroke();
        if (s.kind === "ball") {
          ctx.beginPath();
          ctx.moveTo(0, 0);
          ctx.lineTo(s.radius * k, 0);
          ctx.lineWidth = 1;
          ctx.stroke();
        }
        ctx.restore();
      }
    }
    this.toggle.textContent = app.clock ? "❚❚" : "▶";
    this.say(`t = ${short(app.state.cursor)}${app.scene.sketch.note ? `; ${app.scene.sketch.note}` : ""}`);
  }
}

export const VIEWS = [Mechanism, Time, Phase, Characteristic, Layer, Diagram, Basins, Section];
