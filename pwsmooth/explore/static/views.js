// The views: what each draws of the state, and what a gesture on it changes. All read `app`, whose methods write the state.
import { Plot, gestures, mixed, range, rgb, shown, written } from "./plot.js";

const short = (v) => shown(v, Math.abs(v) || 1);
// The least interval with all of these in it.
const hull = (intervals) => [Math.min(...intervals.map((i) => i[0])), Math.max(...intervals.map((i) => i[1]))];
const named = (names) => names.map((n) => [n, written(n)]);
// A colour as a pixel of ImageData.
const pixel = (colour, alpha = 255) => rgb(colour).reduce((sum, c, k) => sum + c * 256 ** k, alpha * 256 ** 3);

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key === "class") made.className = value;
    else if (key in made && key !== "role") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}
export const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
const small = (text, onclick, more = {}) => button(text, onclick, { class: "small", ...more });
export const choice = (label, options, value, change) =>
  element(
    "select",
    { "aria-label": label, onchange: (e) => change(e.target.value) },
    ...options.map(([v, text]) => element("option", { value: v, selected: v === value }, text)),
  );

class View {
  constructor(app) {
    this.app = app;
    this.key = this.constructor.key;
    this.title = this.constructor.title;
  }
  why() {} // it is not offered
  fill() {}
  gestures() {}
  build() {
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": this.title });
    this.tools = element("span", { class: "tools" });
    this.note = element("p", { class: "note" });
    this.heading = element("h2", {}, this.title);
    this.stage = element("div", { class: "stage" }, this.canvas);
    const head = element("figcaption", {}, this.heading, this.tools);
    this.box = element("figure", { class: `view ${this.key}` }, head, this.stage, this.note);
    this.box.dataset.view = this.key;
    this.plot = new Plot(this.canvas, this.app.theme);
    this.fill();
    const on = this.gestures();
    if (on) gestures(this.plot, on);
    if (on?.zoom || this.zoom) this.tools.append(small("Fit", () => this.fit(), { title: "All of it, at the best scale" }));
    this.stage.addEventListener("keydown", (e) => this.keyed?.(e));
  }
  fit() {
    this.refresh();
    this.draw();
  }
  // Axes that follow the curves again.
  refresh() {
    this.plot.x.forget();
    this.plot.y.forget();
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
  say(text, label) {
    if (this.note.textContent !== text) this.note.textContent = text;
    if (label) this.canvas.setAttribute("aria-label", label);
  }
  get zooming() {
    return (x, y, k) => {
      this.plot.x.zoom(x, k);
      this.plot.y.zoom(y, k);
      this.draw();
    };
  }
}

// Time series: one strip a name, on one axis of time.
class Time extends View {
  static key = "time";
  static title = "Time series";
  fill() {
    const names = this.app.names.slice(0, 40);
    this.boxes = names.map((value) => element("input", { type: "checkbox", value, onchange: () => this.chosen() }));
    const lines = this.boxes.map((box) => element("label", {}, box, ` ${written(box.value)}`));
    this.tools.append(element("details", { class: "menu" }, element("summary", {}, "Curves"), element("div", {}, ...lines)));
    this.strip();
  }
  chosen() {
    const names = this.boxes.filter((box) => box.checked).map((box) => box.value).slice(0, 4);
    this.app.set({ names: names.length ? names : this.app.scene.names });
    this.strip();
  }
  strip() {
    const { app } = this, { names } = app.state, last = names.length - 1;
    for (const box of this.boxes) {
      box.checked = names.includes(box.value);
      box.disabled = !box.checked && last > 2;
    }
    this.strips = names.map((name, k) => {
      const label = `${written(name)} over time`;
      const canvas = element("canvas", { tabIndex: k ? -1 : 0, role: "img", "aria-label": label, class: k === last ? "last" : "" });
      const plot = Object.assign(new Plot(canvas, app.theme), { bottom: k === last ? 30 : 10 });
      plot.labels = [k === last ? written(app.scene.time) : "", app.unit(name)];
      const point = (x) => app.point(x);
      gestures(plot, { press: point, move: point, zoom: (x, y, f) => this.zoom(x, f), fit: () => this.fit() });
      return { name, canvas, plot };
    });
    this.stage.replaceChildren(...this.strips.map((s) => s.canvas));
    ({ plot: this.plot, canvas: this.canvas } = this.strips[0]);
  }
  zoom(at, factor) {
    for (const s of this.strips) s.plot.x.zoom(at, factor, this.app.orbit?.header.asked);
    this.draw();
  }
  refresh() {
    for (const { plot } of this.strips) {
      plot.x.forget();
      plot.y.forget();
    }
  }
  keyed(e) {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (!step || !this.app.orbit) return;
    const { low, high } = this.plot.x;
    this.app.point(this.app.state.cursor + (step * (high - low) * (e.shiftKey ? 10 : 1)) / 500);
    e.preventDefault();
  }
  // Of a run that stopped, what the page itself can do.
  remedies(h) {
    if (this.cured === h.ok) return;
    this.cured = h.ok;
    const { app } = this, [begin] = h.asked;
    const shorter = () => app.write({ t_span: [begin, begin + 0.98 * (app.orbit.header.t_span[1] - begin)] });
    const smoother = app.scene.switches.length && !app.model.view;
    this.cures ||= this.box.appendChild(element("p", { class: "actions" }));
    this.cures.replaceChildren();
    if (h.ok || app.locked) return;
    this.cures.append(small("Shorter span", shorter));
    if (smoother) this.cures.append(small("Smoothed view", () => app.turn({ view: "smoothed" })));
  }
  draw() {
    const { app } = this, { orbit, theme } = app, h = orbit?.header;
    if (!orbit || !this.box.isConnected) return;
    if (this.strips.map((s) => s.name).join() !== app.state.names.join()) this.strip();
    const held = mixed(theme.paper, app.scene.colours.stick, theme.dark ? 0.28 : 0.16);
    for (const { plot, name } of this.strips) {
      const ys = orbit.values.get(name);
      if (!ys || !plot.measure()) continue;
      plot.theme = theme;
      plot.x.fixed = h.asked;
      plot.x.settle();
      const [first, last] = app.between(plot.x.low, plot.x.high), foot = plot.top + plot.inner[1];
      plot.y.cover(...(plot.x.zoomed ? range(ys, first, last) : range(ys)));
      plot.begin();
      for (const [a, b, n] of h.held) plot.band(a, b, held, n > 1);
      plot.horizontal(0, theme.axis);
      plot.curve(orbit.t, ys, theme.curve, 1.6, Math.max(0, first - 1), Math.min(ys.length, last + 1));
      for (const [t] of h.events) plot.line(plot.px(t), foot - 5, plot.px(t), foot, theme.muted);
      for (const [t] of h.ambiguities) plot.diamond(t, app.value(name, t), theme.bad);
      if (h.stopped !== null) plot.vertical(h.stopped, theme.bad, [], 2);
      plot.vertical(app.state.cursor, theme.muted);
      plot.dot(app.state.cursor, app.value(name, app.state.cursor), theme.ink, 4.5);
      plot.end();
    }
    this.remedies(h);
    const [unsure] = h.ambiguities;
    this.say(h.said || (unsure ? `Not unique from t = ${short(unsure[0])} on: ${unsure[1]}` : ""));
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
    const pick = (k) =>
      choice(k ? "vertical axis" : "horizontal axis", named(this.app.names), this.pair[k], (v) => {
        this.refresh();
        this.app.set({ phase: this.pair.with(k, v) });
      });
    this.tools.append(pick(0), pick(1));
  }
  // Whether a start can be chosen in it.
  get free() {
    const [a, b] = this.pair, { states } = this.app.scene;
    return !this.app.locked && states.includes(a) && states.includes(b) && a !== b;
  }
  begin(x, y, ghost) {
    if (this.free) this.app.begin({ [this.pair[0]]: x, [this.pair[1]]: y }, ghost);
  }
  gestures() {
    return {
      zoom: this.zooming,
      press: (x, y, px, py) => {
        const [a, b] = this.pair.map((n) => this.app.state.x0[n]);
        return this.free && Math.hypot(this.plot.px(a) - px, this.plot.py(b) - py) < 18;
      },
      move: (x, y) => this.begin(x, y),
      click: (x, y) => this.begin(x, y, true),
    };
  }
  keyed(e) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (!way || !this.free) return;
    const axes = [this.plot.x, this.plot.y], size = (e.shiftKey ? 50 : 5) / 1000;
    this.begin(...this.pair.map((n, k) => this.app.state.x0[n] + way[k] * size * (axes[k].high - axes[k].low)));
    e.preventDefault();
  }
  scale() {
    const { app, plot } = this, [xs, ys] = this.pair.map((n) => app.orbit?.values.get(n));
    if (!xs || !ys) return;
    plot.x.margin = 0.06;
    plot.x.cover(...range(xs));
    plot.y.cover(...range(ys));
    plot.labels = this.pair.map((n) => app.unit(n));
  }
  paint(plot, app) {
    const { orbit, theme } = app, [a, b] = this.pair, xs = orbit?.values.get(a), ys = orbit?.values.get(b);
    if (!xs || !ys) return;
    if (orbit.phase.join() === this.pair.join()) {
      for (const line of orbit.header.lines) plot.straight(line, theme.muted, [5, 4]);
      plot.ctx.globalAlpha = 0.3;
      for (const [x0, y0, x1, y1] of this.sliding) plot.line(plot.px(x0), plot.py(y0), plot.px(x1), plot.py(y1), app.phases[0], 9);
      plot.ctx.globalAlpha = 1;
    }
    for (const ghost of app.ghosts) if (ghost.has(a) && ghost.has(b)) plot.curve(ghost.get(a), ghost.get(b), theme.ghost, 1);
    const status = app.status(orbit);
    if (status) plot.phases(xs, ys, status, app.phases);
    else plot.curve(xs, ys, theme.curve);
    if (this.free) plot.dot(app.state.x0[a], app.state.x0[b], theme.ink, 6, true);
    if (orbit.header.stopped !== null) plot.dot(xs.at(-1), ys.at(-1), theme.bad, 5);
    plot.dot(app.value(a, app.state.cursor), app.value(b, app.state.cursor), theme.ink, 4.5);
  }
  // Pieces of the surfaces on which it slides at the cursor's time.
  get sliding() {
    const h = this.app.layer?.header;
    return h?.plane?.join() === this.pair.join() ? h.sliding : [];
  }
  after(plot, app) {
    const drag = this.free ? "Drag the ring or click: another start. " : "";
    this.say(
      drag + (this.sliding.length ? "Band: it can stick there now." : ""),
      `Phase plane of ${written(this.pair[0])} and ${written(this.pair[1])}. ${app.sentence}`,
    );
  }
}

class Characteristic extends Phase {
  static key = "characteristic";
  static title = "Characteristic";
  why() {
    return this.pair.length ? "" : "no switch, no law";
  }
  get pair() {
    return this.app.scene.characteristic;
  }
  get free() {
    return false;
  }
  get sliding() {
    return [];
  }
  fill() {}
  gestures() {
    return { zoom: this.zooming };
  }
  after(plot, app) {
    this.say("", `${written(this.pair[1])} over ${written(this.pair[0])}. ${app.sentence}`);
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
    const { app } = this, { switches } = app.scene;
    const change = (v) => {
      app.set({ switch: v });
      app.askLayer();
    };
    if (switches.length > 1) this.tools.append(choice("switch", named(switches), app.state.switch, change));
  }
  scale() {
    const { layer, state } = this.app;
    this.plot.x.fixed = [-1.08, 1.08];
    this.plot.x.settle();
    this.plot.labels = [written(state.switch), "dh/dt"];
    if (layer) this.plot.y.cover(...range([0, ...range(layer.g), ...range(layer.slaved || layer.g)]));
  }
  paint(plot, app) {
    const { layer, theme } = app;
    if (!layer) return;
    const { roots, slaved_roots, now } = layer.header, fast = app.tone(app.scene.colours.fast);
    plot.horizontal(0, theme.axis, [], 1.5);
    for (const side of [-1, 1]) plot.vertical(side, theme.axis, [3, 3]);
    if (layer.slaved) {
      plot.curve(layer.lam, layer.slaved, fast, 2);
      for (const [at, attracting] of slaved_roots) plot.dot(at, 0, fast, 5, !attracting);
    }
    plot.curve(layer.lam, layer.g, theme.curve, 1.8);
    for (const [at, attracting] of roots) plot.dot(at, 0, app.phases[0], 5, !attracting);
    plot.dot(now, layer.g[Math.round(((now + 1) / 2) * (layer.g.length - 1))] ?? 0, theme.ink, 4.5);
  }
  after(plot, app) {
    if (!app.layer) return;
    const h = app.layer.header, when = `t = ${short(h.t)}`;
    const where = Math.abs(h.h) < 1e-9 ? "on the surface" : `off the surface, h = ${short(h.h)}`;
    const fast = h.fast?.length ? `; pink: ${h.fast.map(written).join(", ")} at equilibrium` : "";
    this.say(`${when}, ${where}${fast}`, `Layer of ${written(h.switch)} at ${when}: ${h.roots.length} equilibria`);
  }
}

// A map of the maps' process: what it was asked, how far it is, whether the state has moved on.
class Grown extends View {
  job = null;
  why() {
    return this.app.mapped ? "" : this.app.scene.map.why;
  }
  fill() {
    this.bar = element("progress", { max: 1, value: 0, "aria-label": "progress" });
    this.stage.append(this.bar);
    this.tools.hidden = !!this.app.scene.alone;
    this.live = element("input", { type: "checkbox", checked: this.constructor.live, onchange: () => this.app.moved() });
    this.options?.();
    const follows = { class: "small", title: "Computed anew when a parameter has rested" };
    const anew = { class: "small again", title: "Compute", "aria-label": `compute: ${this.title}` };
    this.tools.append(element("label", follows, this.live, " live"), small("↻", () => this.start(), anew));
  }
  // What of the state the picture depends on, as text.
  depends() {
    const { state, model } = this.app;
    return JSON.stringify([state.p, state.x0, model, state.section]);
  }
  get stale() {
    return !!this.job && (this.next || this.job).of !== this.depends();
  }
  // Whether the picture is of another state than the page's.
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
      // The old picture stays until the new one begins.
      this.restart();
      this.job = this.next;
      this.next = null;
    }
    this.job.header = header;
    this.bar.value = header.done / header.of || 0;
    this.bar.hidden = !!header.finished;
    this.take(header, arrays);
    this.app.redraw(this);
    // What nobody asked for must not take minutes.
    const rest = header.cpu > 1 ? (header.cpu / header.done) * (header.of - header.done) : 0;
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
  restart() {
    this.halted = "";
    this.note.classList.remove("bad");
  }
  mark() {
    const changed = Object.entries(this.job?.p || {}).filter(([n, v]) => this.app.state.p[n] !== v && this.ignored !== n);
    if (changed.length) return `Of ${changed.map(([n, v]) => `${written(n)} = ${+v.toPrecision(5)}`).join(", ")}. `;
    return this.stale ? "Of another state. " : "";
  }
  draw() {
    super.draw();
    this.box.classList.toggle("stale", this.old);
  }
  // The last header, where there is a picture and nothing else is said.
  get told() {
    return this.note.classList.contains("bad") ? null : this.job?.header;
  }
}

class Diagram extends Grown {
  static key = "diagram";
  static title = "Orbit diagram";
  static live = true;
  columns = new Map();
  options() {
    const { app } = this, { controls, states } = app.scene, { diagram } = app.state;
    const parameters = named(controls.map((c) => c.name));
    const ways = [["0", "same start"], ["1", "carried on →"], ["-1", "carried on ←"]];
    const up = (y) => {
      app.setMap("diagram", { y }, false);
      this.plot.y.forget();
      this.draw();
    };
    this.tools.append(
      choice("parameter", parameters, diagram.parameter, (v) => app.setMap("diagram", { parameter: v, range: null })),
      choice("what is shown", named(states), diagram.y, up),
      choice("where each column starts", ways, String(diagram.carry), (v) => app.setMap("diagram", { carry: +v })),
    );
  }
  get ignored() {
    return this.app.state.diagram.parameter;
  }
  depends() {
    const { p, x0, diagram, section } = this.app.state, { y, ...asked } = diagram;
    return JSON.stringify([{ ...p, [this.ignored]: 0 }, this.picked ? 0 : x0, asked, this.app.model, section]);
  }
  asked() {
    const { parameter, carry } = this.app.state.diagram, [wide] = this.plot.inner;
    const columns = this.wanted || Math.min(800, Math.max(200, Math.round((wide || 400) * 1.5)));
    return { kind: "diagram", parameter, range: this.app.span(), carry, columns, keep: 100 };
  }
  restart() {
    super.restart();
    this.columns = new Map();
    this.plot.y.forget();
    this.picked = false;
  }
  take(header, { column = [], points, last }) {
    const n = header.names.length, m = points && points.length / column.length;
    column.forEach((c, k) => {
      this.columns.set(c, { points: points.subarray(k * m, (k + 1) * m), last: last.subarray(k * n, (k + 1) * n) });
    });
  }
  gestures() {
    return {
      press: (x, y, px, py) => {
        this.brush = [px, py, px, py];
        return !this.app.scene.alone;
      },
      move: (x, y, px, py) => {
        this.brush.splice(2, 2, px, py);
        this.draw();
      },
      up: () => {
        const [x0, y0, x1, y1] = this.brush;
        this.brush = null;
        const [a, c] = this.plot.at(Math.min(x0, x1), Math.max(y0, y1));
        const [b, d] = this.plot.at(Math.max(x0, x1), Math.min(y0, y1));
        if (Math.abs(x1 - x0) > 6) {
          this.app.setMap("diagram", { range: [a, b] });
          if (Math.abs(y1 - y0) > 20) this.plot.y.zoomed = [c, d];
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
    const h = this.job?.header, { app } = this;
    if (!h || !this.columns.size) return;
    const [low, high] = h.range, at = ((x - low) / (high - low)) * (h.columns - 1);
    if (app.scene.alone) return app.choose(h.parameter, x);
    const best = [...this.columns.keys()].reduce((a, b) => (Math.abs(b - at) < Math.abs(a - at) ? b : a));
    const last = h.names.map((n, k) => [n, this.columns.get(best).last[k]]);
    this.picked = true;
    const start = last.filter(([n, v]) => isFinite(v) && app.scene.states.includes(n));
    app.fromDiagram(h.parameter, low + ((high - low) * best) / (h.columns - 1), Object.fromEntries(start));
    this.job.of = this.depends();
  }
  scale() {
    const h = this.job?.header, { diagram } = this.app.state, j = h?.names.indexOf(diagram.y), { plot } = this;
    plot.labels = [this.app.unit(diagram.parameter), this.app.unit(diagram.y)];
    plot.x.fixed = this.app.span();
    plot.x.settle();
    if (!h) return;
    const ends = [...this.columns.values()].map(({ points }) => range(points, j, points.length, h.names.length));
    plot.y.cover(...hull(ends));
  }
  paint(plot, app) {
    const h = this.job?.header, { parameter } = app.state.diagram;
    plot.vertical(app.state.p[parameter], app.theme.muted, [4, 3]);
    if (h?.parameter === parameter) this.dots(plot, app, h);
    if (this.brush && Math.abs(this.brush[2] - this.brush[0]) > 4) plot.box(this.brush);
  }
  // Points are counted into pixels: 80 000 of them as rectangles would take 30 ms.
  dots(plot, app, h) {
    const { ratio } = plot, [w, t] = plot.inner.map((v) => Math.max(1, Math.round(v * ratio)));
    const n = h.names.length, j = h.names.indexOf(app.state.diagram.y), [low, high] = h.range;
    const wide = Math.max(2, Math.round(1.5 * ratio)), image = new ImageData(w, t), pixels = new Uint32Array(image.data.buffer);
    const colour = pixel(this.old ? app.theme.ghost : app.theme.curve, 208);
    const sx = w / (plot.x.high - plot.x.low), sy = t / (plot.y.high - plot.y.low);
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
    const h = this.told;
    if (!h) return;
    const way = h.carry > 0 ? "carried on from left to right" : "carried on from right to left";
    const rest = h.finished ? "" : ` ${h.done} of ${h.of} columns.`, drag = app.scene.alone ? "" : "; drag: zoom";
    this.say(
      `${this.mark()}${this.halted}${app.strobes}, ${h.carry ? way : "each from the same start"}.${rest} Click: orbit there${drag}.`,
      `Orbit diagram of ${written(app.state.diagram.y)} over ${written(h.parameter)}. ${h.columns} values.`,
    );
  }
}

class Basins extends Grown {
  static key = "basins";
  static title = "Basins";
  why() {
    return super.why() || (this.app.scene.map.basins ? "" : "it needs two states");
  }
  options() {
    const { app } = this, { states } = app.scene;
    const pick = (k) =>
      choice(`${k ? "vertical" : "horizontal"} axis of the basins`, named(states), app.state.basins.axes[k], (v) => {
        const axes = app.state.basins.axes.with(k, v);
        if (axes[0] === axes[1]) axes[1 - k] = states.find((n) => n !== v);
        this.over(axes);
      });
    this.tools.append(pick(0), pick(1));
  }
  over(axes) {
    this.app.setMap("basins", { axes, ranges: axes.map((n) => this.app.scene.axes[n]) });
  }
  depends() {
    const { p, x0, basins, section } = this.app.state, [a, b] = basins.axes;
    return JSON.stringify([p, { ...x0, [a]: 0, [b]: 0 }, basins, this.app.model, section]);
  }
  asked() {
    return { kind: "basins", ...this.app.state.basins, cells: this.wanted || 300 };
  }
  restart() {
    super.restart();
    this.shade = null;
  }
  // A start stands for the square beyond it until there are finer ones; `known` marks those that were computed.
  take({ cells: n }, { cell = [], label, step }) {
    if (!this.shade) {
      [this.shade, this.known, this.side] = [0, 0, 255].map((v) => new Uint8Array(n * n).fill(v));
      this.bitmap = element("canvas", { width: n, height: n });
    }
    cell.forEach((c, k) => {
      const s = step[k] || 1, row = Math.floor(c / n), column = c % n;
      this.known[c] = 1;
      for (let r = row; r < Math.min(n, row + s); r++)
        for (let at = r * n + column; at < Math.min(r * n + column + s, (r + 1) * n); at++)
          if (this.side[at] >= s) {
            this.side[at] = s;
            this.shade[at] = label[k];
          }
    });
    this.tint();
  }
  tint() {
    const { app } = this, n = this.job?.header?.cells, { theme } = app;
    if (!n || !this.shade) return;
    const image = new ImageData(n, n), pixels = new Uint32Array(image.data.buffer), mark = pixel("#808080");
    const kinds = [theme.paper, theme.paper, theme.ghost, ...app.scene.colours.basins.map((c) => app.tone(c))];
    const [sure, foreseen] = [255, 153].map((alpha) => kinds.map((c, k) => (k ? pixel(c, alpha) : 0)));
    this.shade.forEach((shade, at) => {
      const row = Math.floor(at / n), column = at % n, failed = shade === 1 && row % 6 === 3 && column % 6 === 3;
      const kind = shade < 3 ? shade : 3 + ((shade - 3) % app.scene.colours.basins.length);
      pixels[(n - 1 - row) * n + column] = failed ? mark : (this.known[at] ? sure : foreseen)[kind];
    });
    this.bitmap.getContext("2d").putImageData(image, 0, 0);
  }
  gestures() {
    const { app } = this, { x: across, y: up } = this.plot;
    const go = (x, y) => {
      const [a, b] = app.state.basins.axes;
      if (!app.locked) app.begin({ [a]: x, [b]: y });
    };
    const zoomed = () => app.setMap("basins", { ranges: [across, up].map((axis) => [axis.low, axis.high]) });
    const zoom = (x, y, k) => {
      this.zooming(x, y, k);
      clearTimeout(this.later);
      this.later = setTimeout(zoomed, 500);
    };
    return { press: go, move: go, zoom };
  }
  fit() {
    this.over(this.app.state.basins.axes);
  }
  scale() {
    const { basins } = this.app.state, now = JSON.stringify(basins), { x, y } = this.plot;
    this.plot.labels = basins.axes.map((n) => this.app.unit(n));
    if (this.same === now) return;
    this.same = now;
    [x, y].forEach((axis, k) => {
      Object.assign(axis, { zoomed: null, fixed: basins.ranges[k] });
      axis.settle();
    });
  }
  paint(plot, app) {
    const h = this.job?.header, { axes } = app.state.basins, { ctx } = plot, { ink, muted } = app.theme;
    if (h && this.shade && h.axes.join() === axes.join()) {
      const [[left, right], [low, high]] = h.ranges, [a, b] = axes.map((n) => app.scene.states.indexOf(n));
      ctx.globalAlpha = this.old ? 0.35 : 1;
      plot.image(this.bitmap, left, low, right, high);
      ctx.globalAlpha = 1;
      for (const c of h.cycles) plot.dot(c.x[a], c.x[b], ink, 4.5);
    }
    const [xs, ys] = axes.map((n) => app.strobed(n));
    plot.path(xs.map((x, k) => [plot.px(x), plot.py(ys[k])]), muted, 0.7);
    xs.forEach((x, k) => plot.dot(x, ys[k], ink, 2.2));
    plot.dot(app.state.x0[axes[0]], app.state.x0[axes[1]], ink, 6, true);
  }
  after() {
    const h = this.told;
    if (!h) return this.job || this.say("↻ shows which orbit each start leads to; click or drag to follow one.");
    const size = ({ multipliers: [first = [0, 0]] }) => Math.hypot(...first).toFixed(3);
    const names = h.cycles.map((c, k) => `${k + 1}: period ${c.period}, |multiplier| ${size(c)}`);
    const counts = [];
    if (h.unsettled) counts.push(`${h.unsettled} unsettled`);
    if (h.failed) counts.push(`${h.failed} failed`);
    if (!h.finished) counts.push(`${Math.floor((100 * h.done) / h.of)} %, paler: foreseen`);
    this.say(this.mark() + this.halted + [...names, ...counts].join("; "), `Basins over ${named(h.axes).map((n) => n[1]).join(" and ")}: ${names.join("; ")}`);
  }
}

class Section extends Grown {
  static key = "section";
  static title = "Poincaré section";
  static live = true;
  points = [];
  why() {
    const { phase, states } = this.app.scene;
    return super.why() || (phase.length && states.length > 1 ? "" : "it needs two states");
  }
  get pair() {
    const { phase } = this.app.state, { states } = this.app.scene;
    return phase.every((n) => states.includes(n)) ? phase : states.slice(0, 2);
  }
  asked() {
    return { kind: "section" };
  }
  restart() {
    super.restart();
    this.points = [];
    this.refresh();
  }
  take(header, { points }) {
    if (points) this.points.push(points);
  }
  gestures() {
    const [a, b] = this.pair;
    return { zoom: this.zooming, click: (x, y) => !this.app.locked && this.app.begin({ [a]: x, [b]: y }, true) };
  }
  // The values of one state.
  row(name) {
    const { names } = this.job.header, found = [];
    for (const some of this.points) for (let k = names.indexOf(name); k < some.length; k += names.length) found.push(some[k]);
    return found;
  }
  scale() {
    this.plot.labels = this.pair.map((n) => this.app.unit(n));
    this.plot.x.margin = 0.08;
    this.rows = this.job?.header ? this.pair.map((n) => this.row(n)) : [[], []];
    this.plot.x.cover(...range(this.rows[0]));
    this.plot.y.cover(...range(this.rows[1]));
  }
  paint(plot, app) {
    const [xs, ys] = this.rows;
    plot.ctx.fillStyle = this.old ? app.theme.ghost : app.theme.curve;
    xs.forEach((x, k) => {
      const r = k < 50 ? 1.2 : 1.8;
      plot.ctx.fillRect(plot.px(x) - r, plot.py(ys[k]) - r, 2 * r, 2 * r);
    });
  }
  after(plot, app) {
    const h = this.told, click = app.locked ? "" : " Click: start there.";
    if (h) this.say(`${this.mark()}${h.done} ${app.state.section ? "returns" : "periods"}${h.repeats ? ", repeating" : ""}.${click}`);
  }
}

// Paths under noise, their mean, and the orbit without it.
class Noise extends Grown {
  static key = "noise";
  static title = "Under noise";
  static live = true;
  paths = [];
  why() {
    return this.app.scene.noise ? "" : "no noise was given";
  }
  options() {
    const { app } = this, { seed } = app.state.noise, write = (part) => app.setMap("noise", part);
    const line = { type: "range", min: 0, max: 99, value: seed, "aria-label": "seed", oninput: (e) => write({ seed: +e.target.value }) };
    this.tools.append(
      choice("what is shown", named([...app.scene.states, ...app.scene.outputs]), app.state.noise.name, (name) => write({ name })),
      element("label", { class: "small" }, "seed ", element("input", line)),
    );
  }
  depends() {
    return JSON.stringify([super.depends(), this.app.state.t_span, this.app.state.noise]);
  }
  asked() {
    const { name, seed } = this.app.state.noise;
    return { kind: "noise", names: [name], seed, t_span: this.app.state.t_span };
  }
  restart() {
    super.restart();
    this.paths = [];
    this.refresh();
  }
  take(header, { t, values }) {
    this.times = t;
    this.paths.push(values);
  }
  gestures() {
    return { zoom: this.zooming };
  }
  scale() {
    const { app, plot } = this;
    plot.labels = [written(app.scene.time), app.unit(app.state.noise.name)];
    plot.x.fixed = app.state.t_span;
    plot.x.settle();
    plot.y.cover(...hull(this.paths.map((path) => range(path))));
  }
  paint(plot, app) {
    const { theme, orbit } = app, { name } = app.state.noise, free = orbit?.values.get(name), { paths } = this;
    for (const path of paths) plot.curve(this.times, path, theme.ghost, 1);
    if (free) plot.curve(orbit.t, free, app.phases[1], 1.4);
    if (!paths.length) return;
    const mean = paths[0].map((_, k) => paths.reduce((sum, path) => sum + path[k], 0) / paths.length);
    plot.curve(this.times, mean, theme.curve, 1.8);
  }
  after(plot, app) {
    const h = this.told, free = app.orbit?.values.has(app.state.noise.name) ? "; blue: without noise" : "";
    if (h) this.say(`${this.mark()}${h.done} paths of ${app.scene.noise.replace(/, seed.*/, "")}, and their mean${free}.`, `${h.done} paths of ${written(h.names[0])} under noise`);
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
    const tool = (text, title, act) => small(text, act, { title, "aria-label": title });
    this.toggle = tool("▶", "play or pause", () => this.app.play());
    this.tools.append(
      tool("◂", "event before", () => this.app.event(-1)), this.toggle, tool("▸", "next event", () => this.app.event(1)),
    );
  }
  // Left, right, bottom, top: as given, or as the motion needs them; they do not shrink.
  edges(orbit) {
    const { bounds, shapes } = this.app.scene.sketch;
    if (bounds) return bounds;
    let [l, r, b, u] = this.reach || [Infinity, -Infinity, Infinity, -Infinity], row = 0;
    for (const s of shapes) {
      const wide = s.width || 2 * (s.radius || 0), high = s.height || 2 * (s.radius || 0) || wide;
      for (const place of s.places) {
        const at = orbit.pose[row++], [low, most] = typeof at === "number" ? [at, at] : range(at);
        if (place.startsWith("x")) [l, r] = [Math.min(l, low - wide / 2), Math.max(r, most + wide / 2)];
        if (place.startsWith("y")) [b, u] = [Math.min(b, low - high / 2), Math.max(u, most + high / 2)];
      }
    }
    this.reach = [l, r, b, u];
    const pad = 0.06 * (r - l);
    return [l - pad, r + pad, b - 2 * pad, u + pad];
  }
  draw() {
    const { app, plot } = this, { orbit, theme } = app;
    if (!orbit?.pose || !this.box.isConnected || !plot.measure()) return;
    const { width, height } = plot, [l, r, b, u] = this.edges(orbit), k = Math.min(width / (r - l), height / (u - b));
    const at = orbit.poseAt(app.state.cursor), { shapes, note } = app.scene.sketch;
    const X = (x) => width / 2 + (x - (l + r) / 2) * k, Y = (y) => height / 2 - (y - (b + u) / 2) * k;
    this.tones = { fill: mixed(theme.paper, theme.ink, theme.dark ? 0.3 : 0.12), steel: mixed(theme.paper, theme.ink, 0.55) };
    plot.clear();
    let row = 0;
    for (const s of shapes) {
      const p = Object.fromEntries(s.places.map((name) => [name, at(row++)]));
      if ("x_1" in p) this.long(s, X(p.x_1), Y(p.y_1), X(p.x_2), Y(p.y_2), k, p.travel);
      else if ("dx" in p) this.long(s, X(p.x), Y(p.y), X(p.x + p.dx), Y(p.y + p.dy), k);
      else this.body(s, X(p.x), Y(p.y), p.angle || 0, k);
    }
    this.toggle.textContent = app.clock ? "❚❚" : "▶";
    this.say(`t = ${short(app.state.cursor)}${note ? `; ${note}` : ""}`);
  }
  // What lies between two points: spring, bar, belt, ground, arrow.
  long(s, x1, y1, x2, y2, k, travel) {
    const { plot, tones, app } = this, { ctx } = plot, { theme } = app, d = Math.hypot(x2 - x1, y2 - y1) || 1;
    const [ux, uy] = [(x2 - x1) / d, (y2 - y1) / d];
    const on = (along, across = 0) => [x1 + ux * along - uy * across, y1 + uy * along + ux * across];
    const line = (points, colour, wide) => plot.path(points, colour, wide);
    if (s.kind === "spring") {
      const w = Math.min((s.width * k) / 2, 14), turns = Array.from({ length: 16 }, (_, i) => on(d * (0.125 + 0.05 * i), i % 2 ? w : -w));
      line([on(0), on(0.08 * d), ...turns, on(0.92 * d), on(d)], tones.steel, 1.4);
    } else if (s.kind === "bar") {
      line([on(0), on(d)], theme.ink, Math.max(3, s.width * k));
      line([on(0), on(d)], tones.fill, Math.max(1.5, s.width * k - 2.4));
    } else if (s.kind === "belt") {
      const h = 12, gap = Math.max(s.mark * k, 8), first = (((travel * k) % gap) + gap) % gap;
      Object.assign(ctx, { fillStyle: tones.fill, strokeStyle: theme.ink, lineWidth: 1.4 });
      ctx.beginPath();
      ctx.roundRect(Math.min(x1, x2) - h, y1, Math.abs(x2 - x1) + 2 * h, 2 * h, h);
      ctx.fill();
      ctx.stroke();
      for (let q = first; q < d; q += gap) line([on(q), on(q, 5)], theme.ink, 1.4);
    } else if (s.kind === "arrow") {
      const colour = app.tone(app.scene.colours.fast);
      if (d < 2) return;
      line([on(0), on(d)], colour, 2);
      line([on(d - 7, 4), on(d), on(d - 7, -4)], colour, 2);
    } else {
      line([on(0), on(d)], theme.ink, 1.6);
      for (let q = 6; q < d; q += 9) line([on(q), on(q - 6, 7)], theme.axis);
    }
  }
  // What stands at one point: block, ball, joint, clearance; thick where its contact sticks.
  body(s, x, y, angle, k) {
    const { plot, tones, app } = this, { ctx } = plot, { theme } = app;
    const status = s.phase ? app.statusAt(s.phase, app.state.cursor) : null;
    ctx.save();
    ctx.translate(x, y);
    ctx.rotate(-angle);
    ctx.strokeStyle = status === null ? theme.ink : app.phases[status];
    ctx.lineWidth = status === 0 ? 3 : 1.8;
    ctx.fillStyle = { clearance: "transparent", joint: theme.paper }[s.kind] || tones.fill;
    ctx.beginPath();
    if (s.kind === "block") ctx.roundRect((-s.width * k) / 2, (-s.height * k) / 2, s.width * k, s.height * k, 4);
    else ctx.arc(0, 0, Math.max(2, s.radius * k), 0, 7);
    ctx.fill();
    ctx.stroke();
    if (s.kind === "ball") plot.line(0, 0, s.radius * k, 0, ctx.strokeStyle);
    ctx.restore();
  }
}

// In the order in which they stand on the page.
export const VIEWS = [Time, Mechanism, Phase, Characteristic, Layer, Diagram, Basins, Section, Noise];
