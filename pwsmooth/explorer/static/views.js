// The views: what each draws of the state, and what a gesture on it changes. All read `app`, whose methods write the state.
import { Plot, clamp, gestures, hull, mixed, nearest, range, rgb, rowOf, shown } from "./plot.js";

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
// A colour as a pixel of ImageData.
const pixel = (colour, alpha = 255) => rgb(colour).reduce((sum, c, k) => sum + c * 256 ** k, alpha * 256 ** 3);

// An element of a kind "tag.class", with properties or attributes, and children.
export function element(kind, ...parts) {
  const [tag, ...classes] = kind.split("."), made = document.createElement(tag);
  made.classList.add(...classes);
  for (const part of parts.flat()) {
    if (typeof part === "string" || part instanceof Node) made.append(part);
    else for (const key in part) key in made ? (made[key] = part[key]) : made.setAttribute(key, part[key]);
  }
  return made;
}
export const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
export const number = (label, value, onchange, more = {}) =>
  element("input.number", { type: "text", inputMode: "decimal", "aria-label": label, value, onchange, ...more });
// The number that stands in a field, whose decimal point may be a comma; NaN of other text.
export const typed = ({ value }) => Number(value.trim().replace("−", "-").replace(/^([^.,]*),([^.,]*)$/, "$1.$2") || NaN);
export const choice = (label, options, value, change) =>
  element(
    "select", { "aria-label": label, onchange: (e) => change(e.target.value) },
    options.map(([v, text]) => element("option", { value: v, selected: v === value }, text)),
  );

// A button with a sign.
const tool = (sign, title, onclick) => button(sign, onclick, { title, "aria-label": title });
const picture = (kind, label, tabIndex) => element(kind, { tabIndex, role: "img", "aria-label": label });

// A bitmap, whose pixels `fill` writes.
function raster(width, height, fill) {
  const made = element("canvas", { width, height }), image = new ImageData(width, height);
  fill(new Uint32Array(image.data.buffer));
  made.getContext("2d").putImageData(image, 0, 0);
  return made;
}

class View {
  row = "small"; // of the page, in which it stands
  constructor(app, key, title) {
    Object.assign(this, { app, key, title });
  }
  get scene() {
    return this.app.scene;
  }
  get state() {
    return this.app.state;
  }
  get orbit() {
    return this.app.orbit;
  }
  get theme() {
    return this.app.theme;
  }
  fill() {}
  scale() {}
  after() {}
  gestures() {
    return { zoom: this.zooming, click: (x, y) => this.begin(x, y, true) };
  }
  build() {
    this.canvas = picture("canvas", this.title, 0);
    this.tools = element("span.tools");
    this.note = element("p.note");
    this.heading = element("h2", this.title);
    this.stage = element("div.stage", { onkeydown: (e) => this.keyed(e) }, this.canvas);
    const head = element("figcaption", this.heading, this.tools);
    this.box = element(`figure.${this.key}.${this.row}`, head, this.stage, this.note);
    this.plots = [(this.plot = new Plot(this.canvas))];
    const on = this.gestures();
    if (on) gestures(this.plot, on);
    for (const [label, key, options] of this.scene.menus[this.key] || []) {
      const value = key.reduce((part, k) => part[k], this.state);
      this.tools.append(choice(label, options, value, (v) => this.chosen(key.at(-1), v, this.app)));
    }
    this.fill(this.app);
    if (on) this.tools.append(button("Fit", () => this.fit(), { title: this.scene.words.fit }));
  }
  // `step` by an arrow key, tenfold with Shift, tells false where it does nothing.
  keyed(e) {
    const way = ARROWS[e.key];
    if (way && this.orbit && this.step && this.step(way, e.shiftKey ? 10 : 1) !== false) e.preventDefault();
  }
  fit() {
    this.refresh();
    this.draw();
  }
  // Axes that follow the curves again.
  refresh() {
    for (const { x, y } of this.plots) for (const axis of [x, y]) axis.forget();
  }
  draw() {
    const { app, plot } = this;
    if (!plot.measure()) return;
    [plot.x.label, plot.y.label] = this.pair.map((n) => app.unit(n));
    this.scale(plot, app);
    plot.draw(this.theme, () => this.paint(plot, app));
    this.after(app);
  }
  // The sentence below, and what a screen reader is told of the picture.
  say(text, more = text) {
    const { x, y } = this.plot;
    if (this.note.textContent !== text) this.note.textContent = text;
    this.canvas.setAttribute("aria-label", `${this.title}: ${y.label} over ${x.label}. ${more}`);
  }
  // Axes for these curves.
  spread({ x, y }, [xs, ys]) {
    if (!xs || !ys) return;
    x.margin = y.margin;
    x.cover(range(xs));
    y.cover(range(ys));
  }
  // Where an orbit begins.
  get origin() {
    return this.pair.map((n) => this.state.x0[n]);
  }
  ring(plot) {
    plot.dot(...this.origin, this.theme.ink, 6, true);
  }
  // A place in the plane of two states.
  at(x, y) {
    return { [this.pair[0]]: x, [this.pair[1]]: y };
  }
  // Whether a start can be chosen in it.
  get free() {
    const [a, b] = this.pair, { states } = this.scene;
    return !this.app.locked && states.includes(a) && states.includes(b) && a !== b;
  }
  begin(x, y, ghost) {
    if (this.free) this.app.begin(this.at(x, y), ghost);
  }
  zooming = (x, y, k) => {
    this.plot.x.zoom(x, k);
    this.plot.y.zoom(y, k);
    this.draw();
  };
}

// Time series: one strip a name, on one axis of time.
class Time extends View {
  row = "top";
  fill() {
    const onchange = () => this.chosen(), box = (value) => element("input", { type: "checkbox", value, onchange });
    const lines = this.scene.curves.map(([name, text]) => element("label", box(name), ` ${text}`));
    this.boxes = lines.map((label) => label.firstChild);
    this.tools.append(element("details.menu", element("summary", "Curves"), element("div", lines)));
    this.cures = this.box.appendChild(element("p.actions"));
    this.strip();
  }
  chosen() {
    const names = this.boxes.filter((box) => box.checked).map((box) => box.value).slice(0, 4);
    this.app.set({ names: names.length ? names : this.scene.names });
    this.strip();
  }
  strip() {
    const { app } = this, { names } = this.state, last = names.length - 1;
    for (const box of this.boxes) {
      box.checked = names.includes(box.value);
      box.disabled = !box.checked && last > 2;
    }
    this.plots = names.map((name, k) => {
      const label = `${app.written(name)} over time`, kind = k === last ? "canvas.last" : "canvas";
      const plot = new Plot(picture(kind, label, k ? -1 : 0));
      if (k < last) plot.bottom = 10;
      plot.x.label = k < last ? "" : app.written(this.scene.time);
      plot.y.label = app.unit(name);
      const point = (x) => app.point(x);
      gestures(plot, { press: point, move: point, zoom: this.zooming, fit: () => this.fit() });
      return Object.assign(plot, { name });
    });
    this.stage.replaceChildren(...this.plots.map((p) => p.canvas));
    this.plot = this.plots[0];
    this.canvas = this.plot.canvas;
  }
  zooming = (at, y, factor) => {
    for (const { x } of this.plots) x.zoom(at, factor, this.orbit?.header.asked);
    this.draw();
  };
  step([way], size) {
    const { low, high } = this.plot.x;
    if (way) this.app.point(this.state.cursor + (way * (high - low) * size) / 500);
    return !!way;
  }
  draw() {
    const { app, orbit, theme } = this, { names, cursor } = this.state, h = orbit?.header;
    if (!orbit) return;
    if (this.plots.map((p) => p.name).join() !== names.join()) this.strip();
    const held = mixed(theme.paper, this.scene.colours.stick, theme.dark ? 0.28 : 0.16);
    for (const plot of this.plots) {
      const ys = orbit.values.get(plot.name), { x, y } = plot;
      if (!ys || !plot.measure()) continue;
      x.settle(h.asked);
      const first = app.before(x.low), last = app.before(x.high);
      y.cover(x.zoomed ? range(ys, first, last) : range(ys));
      plot.draw(theme, () => {
        const foot = plot.top + plot.inner[1];
        for (const [a, b, n] of h.held) plot.band(a, b, held, n > 1);
        plot.horizontal(0, theme.axis);
        plot.curve(orbit.t, ys, theme.curve, 1.6, Math.max(0, first - 1), Math.min(ys.length, last + 1));
        for (const [t] of h.events) plot.line(plot.px(t), foot - 5, plot.px(t), foot, theme.muted);
        for (const [t] of h.ambiguities) plot.diamond(t, app.value(plot.name, t), theme.bad);
        if (h.stopped !== null) plot.vertical(h.stopped, theme.bad, [], 2);
        plot.vertical(cursor, theme.muted);
        plot.dot(cursor, app.value(plot.name, cursor), theme.ink, 4.5);
      });
    }
    // Of a run that stopped, what the page itself can do.
    if (this.cured !== h.ok) this.cures.replaceChildren(...app.remedies(h.remedies));
    this.cured = h.ok;
    this.note.textContent = h.said;
    this.note.classList.toggle("bad", !h.ok);
  }
}

// Any two names, over each other.
class Characteristic extends View {
  get pair() {
    return this.scene.characteristic;
  }
  get curves() {
    return this.pair.map((n) => this.orbit?.values.get(n));
  }
  scale(plot) {
    this.spread(plot, this.curves);
  }
  paint(plot, app) {
    const { orbit, theme, pair } = this, [xs, ys] = this.curves;
    if (!xs || !ys) return;
    const ghosts = app.ghosts.map((ghost) => pair.map((n) => ghost.get(n)));
    for (const [xs, ys] of ghosts) if (xs && ys) plot.curve(xs, ys, theme.ghost, 1);
    const status = app.status(this.state.switch);
    if (status) plot.phases(xs, ys, status, app.phases);
    else plot.curve(xs, ys, theme.curve);
    if (this.free) this.ring(plot);
    if (orbit.header.stopped !== null) plot.dot(xs.at(-1), ys.at(-1), theme.bad, 5);
    plot.dot(...pair.map((n) => app.value(n, this.state.cursor)), theme.ink, 4.5);
  }
  after(app) {
    this.say("", app.sentence);
  }
}

// What a click means depends on whether both names are states.
class Phase extends Characteristic {
  get pair() {
    return this.state.phase;
  }
  chosen(k, name, app) {
    this.refresh();
    app.set({ phase: this.pair.with(k, name) });
  }
  gestures() {
    return {
      ...super.gestures(),
      press: (x, y, px, py) => {
        const [a, b] = this.origin;
        return this.free && Math.hypot(this.plot.px(a) - px, this.plot.py(b) - py) < 18;
      },
      move: (x, y) => this.begin(x, y),
    };
  }
  step(way, size) {
    const axes = [this.plot.x, this.plot.y];
    this.begin(...this.origin.map((v, k) => v + (way[k] * size * (axes[k].high - axes[k].low)) / 200));
    return this.free;
  }
  // Below the orbit surfaces, and the pieces of them on which it slides at the cursor's time.
  paint(plot, app) {
    const { orbit, theme } = this, drawn = orbit?.phase.join() === this.pair.join();
    for (const line of drawn ? orbit.header.lines : []) plot.straight(line, theme.muted, [5, 4]);
    plot.ctx.globalAlpha = 0.3;
    for (const [x0, y0, x1, y1] of this.sliding) plot.curve([x0, x1], [y0, y1], app.phases[0], 9);
    plot.ctx.globalAlpha = 1;
    super.paint(plot, app);
  }
  get sliding() {
    const h = this.app.layer?.header;
    return h?.plane?.join() === this.pair.join() ? h.sliding : [];
  }
  after(app) {
    const { start, band } = this.scene.words;
    this.say((this.free ? start : "") + (this.sliding.length ? band : ""), app.sentence);
  }
}

// dh/dt over lambda at the cursor: where it goes, and where it may rest.
class Layer extends View {
  get pair() {
    return [this.state.switch, "dh/dt"];
  }
  chosen(key, name, app) {
    app.set({ switch: name });
    app.askLayer();
  }
  gestures() {}
  scale({ x, y }, { layer }) {
    x.settle([-1.08, 1.08]);
    if (layer) y.cover(hull([[0, 0], range(layer.g), range(layer.slaved || layer.g)]));
  }
  paint(plot, app) {
    const { layer } = app, { theme } = this;
    if (!layer) return;
    const { roots, slaved_roots, now } = layer.header, { lam, g, slaved } = layer, fast = app.tone(this.scene.colours.fast);
    const curve = (values, zeros, colour, width, dots) => {
      plot.curve(lam, values, colour, width);
      for (const [at, attracting] of zeros) plot.dot(at, 0, dots, 5, !attracting);
    };
    plot.horizontal(0, theme.axis, [], 1.5);
    for (const side of [-1, 1]) plot.vertical(side, theme.axis, [3, 3]);
    if (slaved) curve(slaved, slaved_roots, fast, 2, fast);
    curve(g, roots, theme.curve, 1.8, app.phases[0]);
    plot.dot(...now, theme.ink, 4.5);
  }
  after({ layer }) {
    if (layer) this.say(layer.header.said);
  }
}

// A map of the maps' process: what it was asked, how far it is, whether the state has moved on.
class Grown extends View {
  row = "maps";
  asked() {}
  fill(app) {
    this.bar = element("progress", { max: 1, value: 0, "aria-label": "progress" });
    this.first = button("", () => this.start(), { className: "empty" });
    this.stage.append(this.bar, this.first);
    this.tools.hidden = !!this.scene.alone;
    this.live = element("input", { type: "checkbox", checked: this.key !== "basins", onchange: () => app.moved() });
    const anew = tool("↻", `Compute: ${this.title}`, () => this.start());
    this.tools.append(element("label", { title: this.scene.words.live }, this.live, " live"), anew);
    this.restart();
  }
  // What of the state the picture depends on, as text.
  depends(more) {
    const { p, x0, view, law, values, section } = this.state;
    return JSON.stringify({ p, x0, view, law, values, section, ...more });
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
    this.progress(0);
    this.next = { of: this.depends(), p: { ...this.state.p }, header: null };
    this.job ||= this.next;
    this.id = ++this.app.job; // a newer one takes its place
    this.app.transport.send({ ...this.state, ...this.asked(), kind: this.key, job: this.id });
    this.draw();
  }
  halt() {
    if (!this.id) return;
    this.app.transport.send({ kind: "stop", what: this.key });
    this.id = 0;
    this.progress(1);
  }
  progress(share) {
    this.bar.hidden = share >= 1;
    this.bar.value = share;
  }
  heard(header, arrays) {
    if (this.next) {
      // The old picture stays until the new one begins.
      this.restart();
      this.job = this.next;
      this.next = null;
    }
    this.job.header = header;
    this.progress(header.finished ? 1 : header.done / header.of || 0);
    this.take(arrays, header);
    this.app.redraw(this);
    // What nobody asked for must not take minutes.
    if (this.auto && header.long) {
      this.halt();
      this.halted = header.long;
      this.app.moved();
    }
  }
  refused(why) {
    this.progress(1);
    this.say(why);
    this.note.classList.add("bad");
  }
  restart() {
    this.halted = "";
    this.note.classList.remove("bad");
  }
  draw() {
    super.draw();
    this.box.classList.toggle("stale", this.old);
  }
  after(app) {
    const { first, id, job, scene } = this;
    first.hidden = !!(job?.header || scene.alone);
    first.disabled = !!id;
    first.textContent = id ? scene.words.computing : `Compute ${this.title.toLowerCase()}`;
    if (!job?.header || this.note.classList.contains("bad")) return;
    const { p, header } = job, changed = Object.keys(p).filter((n) => this.state.p[n] !== p[n] && this.ignored !== n);
    const values = changed.map((n) => `${app.written(n)} = ${+p[n].toPrecision(5)}`).join(", ");
    const mark = values ? `Of ${values}. ` : this.stale ? "Of another state. " : "";
    this.say(mark + this.halted + header.said);
  }
}

class Diagram extends Grown {
  get pair() {
    return [this.ignored, this.state.diagram.y];
  }
  chosen(key, value, app) {
    this.refresh();
    if (key !== "y") return app.setMap("diagram", key === "carry" ? { carry: +value } : { parameter: value, range: null });
    app.setMap("diagram", { y: value }, false);
    this.draw();
  }
  get ignored() {
    return this.state.diagram.parameter;
  }
  depends() {
    const { p, x0, diagram } = this.state;
    return super.depends({ p: { ...p, [this.ignored]: 0 }, x0: this.picked ? 0 : x0, diagram: { ...diagram, y: 0 } });
  }
  asked() {
    const columns = this.wanted || clamp(Math.round(1.5 * (this.plot.inner?.[0] || 400)), 200, 800);
    return { ...this.state.diagram, range: this.app.span(), columns, keep: 100 };
  }
  restart() {
    super.restart();
    this.columns = new Map();
    this.plot.y.used = null; // a zoom into a box stays
    this.picked = false;
  }
  take({ column = [], points, last }, { names: { length: n } }) {
    const m = points && points.length / column.length;
    column.forEach((c, k) => this.columns.set(c, { points: rowOf(points, k, m), last: rowOf(last, k, n) }));
  }
  gestures() {
    return {
      press: (x, y, px, py) => {
        this.brush = [[px, px], [py, py]];
        return !this.scene.alone;
      },
      move: (x, y, px, py) => {
        this.brush = this.brush.map(([from], k) => [from, k ? py : px]);
        this.draw();
      },
      up: () => {
        const { x, y } = this.plot, [across, along] = this.brush, reach = ([a, b]) => Math.abs(b - a);
        this.brush = null;
        if (reach(across) > 6) {
          this.app.setMap("diagram", { range: range(across.map((v) => x.at(v))) });
          if (reach(along) > 20) y.zoomed = range(along.map((v) => y.at(v)));
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
  // The value of the parameter in a column.
  value(column, { range: [low, high], columns }) {
    return low + ((high - low) * column) / (columns - 1);
  }
  pick(x) {
    const h = this.job?.header, { app } = this;
    if (!h || !this.columns.size) return;
    if (this.scene.alone) return app.choose(h.parameter, x);
    const [low, high] = h.range, best = nearest([...this.columns.keys()], ((x - low) / (high - low)) * (h.columns - 1));
    const { last } = this.columns.get(best);
    const start = h.names.map((n, k) => [n, last[k]]).filter(([n, v]) => isFinite(v) && this.scene.states.includes(n));
    this.picked = true;
    app.fromDiagram(h.parameter, this.value(best, h), Object.fromEntries(start));
    this.job.of = this.depends();
  }
  scale({ x, y }, app) {
    const h = this.job?.header;
    x.settle(app.span());
    if (!h) return;
    const j = h.names.indexOf(this.state.diagram.y), columns = [...this.columns.values()];
    const [a, b] = hull(columns.map(({ points }) => range(points, j, points.length, h.names.length)));
    const least = 1e-3 * Math.max(-a, b); // a fixed point is one line, and not its roundings
    y.cover([a - least, b + least]);
  }
  paint(plot, { state, theme }) {
    const h = this.job?.header, [across, along] = this.brush || [[0, 0]];
    plot.vertical(state.p[this.ignored], theme.muted, [4, 3]);
    if (h?.parameter === this.ignored) this.dots(plot, h);
    const box = (ctx) => ctx.rect(across[0], along[0], across[1] - across[0], along[1] - along[0]);
    if (Math.abs(across[1] - across[0]) > 4) plot.shape(box, theme.brush, theme.ink);
  }
  // Points are counted into pixels: 80 000 of them as rectangles would take 30 ms.
  dots(plot, h) {
    const { ratio } = plot, [w, t] = plot.inner.map((v) => Math.max(1, Math.round(v * ratio)));
    const n = h.names.length, j = h.names.indexOf(this.state.diagram.y), wide = Math.max(2, Math.round(1.5 * ratio));
    const colour = pixel(this.old ? this.theme.ghost : this.theme.curve, 208);
    const sx = w / (plot.x.high - plot.x.low), sy = t / (plot.y.high - plot.y.low);
    const drawn = raster(w, t, (pixels) => {
      for (const [column, { points }] of this.columns) {
        const x = Math.round((this.value(column, h) - plot.x.low) * sx - wide / 2);
        const ends = [x, x + wide].map((v) => clamp(v, 0, w));
        for (let k = j; k < points.length; k += n) {
          const y = Math.round((plot.y.high - points[k]) * sy - wide / 2);
          if (!(y >= 0 && y < t)) continue;
          for (let r = y; r < Math.min(t, y + wide); r++) pixels.fill(colour, r * w + ends[0], r * w + ends[1]);
        }
      }
    });
    plot.ctx.drawImage(drawn, plot.left, plot.top, ...plot.inner);
  }
}

class Basins extends Grown {
  get pair() {
    return this.state.basins.axes;
  }
  chosen(k, name) {
    const axes = this.pair.with(k, name);
    if (axes[0] === axes[1]) axes[1 - k] = this.scene.states.find((n) => n !== name);
    this.over(axes);
  }
  over(axes) {
    this.app.setMap("basins", { axes, ranges: axes.map((n) => this.scene.axes[n]) });
  }
  depends() {
    const { x0, basins } = this.state;
    return super.depends({ x0: { ...x0, ...this.at(0, 0) }, basins });
  }
  asked() {
    return { ...this.state.basins, cells: this.wanted || 300 };
  }
  restart() {
    super.restart();
    this.shade = null;
  }
  // A start stands for the square beyond it until there are finer ones; `known` marks those that were computed.
  take({ cell = [], label, step }, { cells: n }) {
    if (!this.shade) [this.shade, this.known, this.side] = [0, 0, 255].map((v) => new Uint8Array(n * n).fill(v));
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
    const { app, theme, shade } = this, n = this.job?.header?.cells, colours = this.scene.colours.basins;
    if (!n || !shade) return;
    const kinds = [theme.paper, theme.paper, theme.ghost, ...colours.map((c) => app.tone(c))], mark = pixel("#808080");
    const [foreseen, sure] = [153, 255].map((alpha) => kinds.map((c, k) => (k ? pixel(c, alpha) : 0)));
    const colour = (s, at) => {
      const failed = s === 1 && Math.floor(at / n) % 6 === 3 && (at % n) % 6 === 3;
      return failed ? mark : (this.known[at] ? sure : foreseen)[s < 3 ? s : 3 + ((s - 3) % colours.length)];
    };
    // Rows of a bitmap go down.
    const place = (at) => at + n * (n - 1 - 2 * Math.floor(at / n));
    this.bitmap = raster(n, n, (pixels) => shade.forEach((s, at) => (pixels[place(at)] = colour(s, at))));
  }
  gestures() {
    const { x, y } = this.plot, go = (x, y) => this.begin(x, y);
    const zoom = (...by) => {
      this.zooming(...by);
      this.app.later("zoom", 500, () => this.app.setMap("basins", { ranges: [[x.low, x.high], [y.low, y.high]] }));
    };
    return { press: go, move: go, zoom };
  }
  fit() {
    this.over(this.pair);
  }
  scale({ x, y }) {
    const { basins } = this.state, now = JSON.stringify(basins);
    if (this.same === now) return;
    this.same = now;
    [x, y].forEach((axis, k) => {
      axis.forget();
      axis.settle(basins.ranges[k]);
    });
  }
  paint(plot, app) {
    const h = this.job?.header, { pair } = this, { ctx } = plot, { ink, muted } = this.theme;
    if (h && this.shade && h.axes.join() === pair.join()) {
      const [[left, right], [low, high]] = h.ranges, axes = pair.map((n) => this.scene.states.indexOf(n));
      ctx.globalAlpha = this.old ? 0.35 : 1;
      plot.image(this.bitmap, left, low, right, high);
      ctx.globalAlpha = 1;
      for (const c of h.cycles) plot.dot(...axes.map((k) => c.x[k]), ink, 4.5);
    }
    const [xs, ys] = pair.map((n) => app.strobed(n));
    plot.curve(xs, ys, muted, 0.7);
    xs.forEach((x, k) => plot.dot(x, ys[k], ink, 2.2));
    this.ring(plot);
  }
  after(app) {
    super.after(app);
    if (!this.job) this.say(this.scene.words.basins);
  }
}

class Section extends Grown {
  get pair() {
    const { phase } = this.state, { states } = this.scene;
    return phase.every((n) => states.includes(n)) ? phase : states.slice(0, 2);
  }
  restart() {
    super.restart();
    this.points = [];
    this.refresh();
  }
  take({ points }) {
    if (points) this.points.push(points);
  }
  // The values of one state.
  series(name) {
    const names = this.job?.header?.names || [], j = names.indexOf(name);
    return this.points.flatMap((some) => [...some].filter((_, k) => k % names.length === j));
  }
  scale(plot) {
    this.rows = this.pair.map((n) => this.series(n));
    this.spread(plot, this.rows);
  }
  paint(plot) {
    const [xs, ys] = this.rows;
    plot.ctx.fillStyle = this.old ? this.theme.ghost : this.theme.curve;
    xs.forEach((x, k) => {
      const r = k < 50 ? 1.2 : 1.8;
      plot.ctx.fillRect(plot.px(x) - r, plot.py(ys[k]) - r, 2 * r, 2 * r);
    });
  }
}

// Paths under noise, their mean, and the orbit without it.
class Noise extends Grown {
  row = "noise";
  get pair() {
    return [this.scene.time, this.state.noise.name];
  }
  chosen(key, name, app) {
    app.setMap("noise", { name });
  }
  fill(app) {
    const { seed } = this.state.noise, oninput = (e) => app.setMap("noise", { seed: +e.target.value });
    const line = element("input", { type: "range", min: 0, max: 99, value: seed, "aria-label": "seed", oninput });
    this.tools.append(element("label", "seed ", line));
    super.fill(app);
  }
  depends() {
    const { t_span, noise } = this.state;
    return super.depends({ t_span, noise });
  }
  asked() {
    const { name, seed } = this.state.noise;
    return { names: [name], seed };
  }
  restart() {
    super.restart();
    this.paths = [];
    this.refresh();
  }
  take({ t, values, mean }) {
    Object.assign(this, { times: t, mean });
    this.paths.push(values);
  }
  scale({ x, y }) {
    x.settle(this.state.t_span);
    y.cover(hull(this.paths.map((path) => range(path))));
  }
  paint(plot, app) {
    const { theme, orbit, paths } = this, free = orbit?.values.get(this.state.noise.name);
    for (const path of paths) plot.curve(this.times, path, theme.ghost, 1);
    if (free) plot.curve(orbit.t, free, app.phases[1], 1.4);
    if (paths.length) plot.curve(this.times, this.mean, theme.curve, 1.8);
  }
}

// The mechanism at the cursor: shapes whose places are rows of the pose.
class Mechanism extends View {
  row = "top";
  fill(app) {
    const before = tool("◂", "event before", () => app.event(-1)), next = tool("▸", "next event", () => app.event(1));
    this.tools.append(before, next);
    Object.assign(this.plot, { left: 0, right: 0, top: 0, bottom: 0 });
  }
  gestures() {}
  draw() {
    const { app, plot, orbit, theme } = this, { x, y, ctx } = plot;
    const { shapes, note } = this.scene.sketch, { cursor } = this.state;
    if (!orbit?.pose || !plot.measure()) return;
    // The room that the motion needs does not shrink, unless it is three times too large; one scale for both axes.
    const { reach } = orbit.header, wide = ([l, r, b, u]) => Math.max(r - l, u - b);
    if (wide(this.reach || reach) > 3 * wide(reach)) this.reach = null;
    this.reach = reach.map((v, k) => (k % 2 ? Math.max : Math.min)(v, this.reach?.[k] ?? v));
    const [l, r, b, u] = this.reach, k = Math.min(plot.width / (r - l), plot.height / (u - b));
    const fit = (axis, middle) => axis.settle([-1, 1].map((side) => middle + (side * Math.abs(axis.size)) / k / 2));
    fit(x, (l + r) / 2);
    fit(y, (b + u) / 2);
    const at = orbit.poseAt(cursor), tint = (part) => mixed(theme.paper, theme.ink, part);
    this.tones = { fill: tint(theme.dark ? 0.3 : 0.12), steel: tint(0.55), force: app.tone(this.scene.colours.fast) };
    plot.clear();
    let row = 0;
    for (const s of shapes) {
      // Each is drawn in its own frame: from its place, along the line to its other end, or as it is turned.
      const p = Object.fromEntries(s.places.map((name) => [name, at(row++)])), { x_1 = p.x, y_1 = p.y } = p;
      const { x_2 = x_1 + p.dx, y_2 = y_1 + p.dy } = p, dx = x.px(x_2) - x.px(x_1), dy = y.px(y_2) - y.px(y_1);
      ctx.save();
      ctx.translate(x.px(x_1), y.px(y_1));
      ctx.rotate(dx === dx ? Math.atan2(dy, dx) : -(p.angle || 0));
      this.shape(s, k, Math.hypot(dx, dy) || 1, p.travel, dx < 0);
      ctx.restore();
    }
    this.note.textContent = `t = ${shown(cursor, Math.abs(cursor) || 1)}${note}`;
  }
  shape({ kind, width, height, radius, mark, phase }, k, d, travel, back) {
    const { plot, app, theme: { ink, axis, paper }, tones: { fill, steel, force } } = this;
    // Points by how far they are along, and across; a number is one on the line.
    const line = (points, colour, wide) => plot.path(points.map((p) => [p, 0].flat()), colour, wide);
    // What stands at one point is thick where its contact sticks.
    const body = (inside, trace) => {
      const status = app.statusOf(phase);
      plot.shape(trace, inside, app.phases[status] || ink, status === 0 ? 3 : 1.8);
    };
    const disc = (ctx) => ctx.arc(0, 0, Math.max(2, radius * k), 0, 7);
    const kinds = {
      spring() {
        const w = Math.min((width * k) / 2, 14), turn = (_, i) => [d * (0.125 + 0.05 * i), i % 2 ? w : -w];
        const turns = Array.from({ length: 16 }, turn);
        line([0, 0.08 * d, ...turns, 0.92 * d, d], steel, 1.4);
      },
      bar() {
        line([0, d], ink, Math.max(3, width * k));
        line([0, d], fill, Math.max(1.5, width * k - 2.4));
      },
      belt() {
        const h = 12, gap = Math.max(mark * k, 8), first = (((travel * k) % gap) + gap) % gap;
        plot.shape((ctx) => ctx.roundRect(-h, back ? -2 * h : 0, d + 2 * h, 2 * h, h), fill, ink, 1.4);
        for (let q = first; q < d; q += gap) line([q, [q, 5]], ink, 1.4);
      },
      arrow() {
        if (d < 2) return;
        line([0, d], force, 2);
        line([[d - 7, 4], d, [d - 7, -4]], force, 2);
      },
      ground() {
        line([0, d], ink, 1.6);
        for (let q = 6; q < d; q += 9) line([q, [q - 6, 7]], axis);
      },
      block: () => body(fill, (ctx) => ctx.roundRect((-width * k) / 2, (-height * k) / 2, width * k, height * k, 4)),
      clearance: () => body("", disc),
      joint: () => body(paper, disc),
      ball() {
        body(fill, disc);
        line([0, radius * k], app.phases[app.statusOf(phase)] || ink);
      },
    };
    kinds[kind]();
  }
}

export const VIEWS = {
  time: Time, mechanism: Mechanism, phase: Phase, characteristic: Characteristic, layer: Layer, diagram: Diagram,
  basins: Basins, section: Section, noise: Noise,
};
