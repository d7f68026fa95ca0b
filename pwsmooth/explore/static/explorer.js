// The page: one state, which every view reads and every gesture writes; newest wins, one request in flight, one waiting.
import { mixed, plain, spelled, written } from "./plot.js";
import { VIEWS, button, choice, element } from "./views.js";

const TONES = ["paper", "ink", "muted", "grid", "axis", "ghost", "curve", "bad", "brush"]; // of the style sheet
const MAPS = ["diagram", "section", "basins", "noise"];
const KEYS = [
  ["Space", "play or pause"], [", .", "to the event before, after"], ["d", "orbit diagram"], ["b", "basins"],
  ["Esc", "stop a computation"], ["Ctrl Z", "back"],
  ["arrows", "in the phase plane: move the start; with Shift ten times"], ["?", "this list"],
];
const ARRAYS = { f: Float32Array, b: Uint8Array, i: Int32Array, h: Uint16Array };

// A frame: uint32 length, JSON header, arrays padded to 4.
export function unpack(frame) {
  const buffer = frame.buffer || frame, begin = frame.byteOffset || 0, arrays = {};
  const length = new DataView(buffer, begin, 4).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, begin + 4, length)));
  let at = begin + 4 + length;
  for (const { name, type, shape, offset, scale = 1 } of header.arrays) {
    const values = new ARRAYS[type](buffer, at, shape.reduce((a, b) => a * b, 1));
    const number = (v) => (type === "h" && v === 65535 ? NaN : offset + scale * v);
    arrays[name] = offset === undefined ? values : Float64Array.from(values, number);
    at += Math.ceil(values.byteLength / 4) * 4;
  }
  return [header, arrays];
}

export function socketTransport(token) {
  const ended = "The server has ended. The state stays in this page's address: start pwsmooth explore again.";
  let socket;
  return {
    open(hear, lost) {
      socket = new WebSocket(`ws://${location.host}/socket`);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => socket.send(JSON.stringify({ token }));
      socket.onmessage = (e) => hear(e.data);
      socket.onclose = (e) => lost([4403, 4429].includes(e.code) ? `${e.reason}.` : ended);
    },
    send(message) {
      if (socket.readyState === 1) socket.send(JSON.stringify(message));
    },
  };
}

// A file of frames: one slider, whose value has a frame each.
export function fileTransport({ scene, parameter, values, frames, layers, diagram }) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const nearest = (list, v) => list.reduce((best, w, k) => (Math.abs(w - v) < Math.abs(list[best] - v) ? k : best), 0);
  const mapped = (of, pick) => Object.fromEntries(Object.entries(of).map(([key, v]) => [key, pick(v)]));
  let hear, at = 0;
  const answers = {
    orbit(m) {
      at = nearest(values, m.p[parameter]);
      hear(bytes(frames[at]), { seq: m.seq });
    },
    sentence: () => hear(null, { kind: "sentence", said: unpack(bytes(frames[at]))[0].sentence }),
    layer(m) {
      if (!layers[at].length) return;
      const [{ rows, ...same }, { lam, ...arrays }] = unpack(bytes(layers[at])), n = rows.t.length, k = nearest(rows.t, m.t);
      const row = (v) => v.subarray((k * v.length) / n, ((k + 1) * v.length) / n);
      hear(null, { ...same, ...mapped(rows, (v) => v[k]) }, { lam, ...mapped(arrays, row) });
    },
    diagram: (m) => setTimeout(() => diagram.forEach((f) => hear(bytes(f), { job: m.job }))),
  };
  return {
    open(listen) {
      hear = listen;
      queueMicrotask(() => {
        hear(bytes(scene));
        hear(null, { kind: "ready" });
      });
    },
    send: (m) => answers[m.kind]?.(m),
  };
}

const encoded = (state) => {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  return btoa(String.fromCharCode(...bytes)).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
};
const decoded = (text) => {
  const bytes = atob(text.replace(/-/g, "+").replace(/_/g, "/"));
  return JSON.parse(new TextDecoder().decode(Uint8Array.from(bytes, (c) => c.charCodeAt(0))));
};
const isPair = (r) => Array.isArray(r) && r.length === 2 && r.every(Number.isFinite) && r[1] > r[0];

class App {
  scene = null;
  state = null;
  orbit = null;
  layer = null;
  model = { view: "", law: "", values: {} }; // that was asked for, in place of the scene's own
  views = [];
  ghosts = [];
  past = [];
  inFlight = null;
  waiting = null;
  seq = 0;
  drawnSeq = 0;
  job = 0;
  sentence = "";
  stats = { sent: 0, drawn: 0 };
  starting = true;
  constructor(root, transport, fragment) {
    Object.assign(this, { root, transport });
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.narrow = matchMedia("(max-width: 759px)");
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.frame();
    this.tint();
    try {
      this.given = fragment ? decoded(fragment) : null;
    } catch {
      this.tell("The state in this address cannot be read; the system's own is shown.", true);
    }
    this.dark.addEventListener("change", () => {
      this.tint();
      this.drawAll();
    });
    this.narrow.addEventListener("change", () => this.arrange());
    const hear = (frame, more, given = {}) => {
      const [header, arrays] = frame ? unpack(frame) : [{}, given];
      this.hear({ ...header, ...more }, arrays);
    };
    transport.open(hear, (why) => {
      this.lost = true;
      this.tell(why, true);
    });
  }
  tint() {
    const style = getComputedStyle(this.root);
    this.theme = { dark: this.dark.matches, font: "system-ui, sans-serif" };
    for (const name of TONES) this.theme[name] = style.getPropertyValue(`--${name}`).trim();
    if (!this.scene) return;
    const c = this.scene.colours;
    this.phases = { 1: this.tone(c.right), "-1": this.tone(c.left), 0: this.tone(c.stick) };
    for (const v of this.views) v.tint?.();
  }
  tone(colour) {
    return this.theme.dark ? mixed(colour, "#ffffff", 0.28) : colour;
  }

  frame() {
    this.heading = element("h1", {}, "pwsmooth explore");
    this.sub = element("p", { class: "sub" });
    this.notice = element("p", { class: "notice", role: "status" }, "Starting ...");
    this.said = element("p", { class: "said", "aria-live": "polite" });
    this.playing = button("Play", () => this.play(), { title: "Space" });
    const taking = [["Copy link", () => this.link()], ["Copy as code", () => this.code()], ["Save figure", () => this.save()]];
    const bar = element(
      "div", { class: "actions" }, this.playing, button("Back", () => this.back(), { title: "Ctrl Z" }),
      ...taking.map(([text, act]) => button(text, act)), button("?", () => this.help(), { title: "Keys" }),
    );
    this.sliders = element("div", { class: "sliders" });
    this.handle = button("", () => this.pull(), { class: "handle", "aria-expanded": "false", "aria-label": "all sliders" });
    this.side = element("aside", { "aria-label": "parameters" }, this.handle, this.sliders);
    this.main = element("main");
    this.tabs = element("nav", { class: "tabs", role: "tablist" });
    this.dialog = element("dialog");
    this.root.replaceChildren(
      element("header", {}, element("div", { class: "title" }, this.heading, this.sub), bar),
      this.notice,
      element("div", { class: "work" }, this.side, element("div", { class: "column" }, this.said, this.tabs, this.main)),
      this.dialog,
    );
    (this.transport.inside ? this.root : document).addEventListener("keydown", (e) => this.key(e));
    let later = 0;
    new ResizeObserver(() => {
      cancelAnimationFrame(later);
      later = requestAnimationFrame(() => this.drawAll());
    }).observe(this.root);
  }
  tell(text, bad = false, starting = false) {
    this.starting = starting;
    this.notice.textContent = text;
    this.notice.hidden = !text;
    this.notice.classList.toggle("bad", bad);
  }

  hear(header, arrays) {
    const { kind } = header, refused = kind === "refused";
    if (kind === "scene") return this.open(header);
    if (kind === "ready") {
      if (this.starting) this.tell("");
      this.ready = true;
      return this.ask();
    }
    if (kind === "killed") {
      this.inFlight = null;
      this.ready = false;
      this.given = this.state && { ...this.state, ...this.model, quiet: true };
      this.model = { view: "", law: "", values: {} };
      return this.tell(header.why, true);
    }
    if (kind === "figure") return this.file(header, arrays.file);
    if (header.to === "figure") return this.saving?.replaceChildren(header.why);
    if (header.job !== undefined) {
      const view = this.views.find((v) => v.id === header.job);
      if (!view) return; // of a job that has been cancelled
      if (refused || header.finished) view.id = 0;
      if (refused) return view.refused(header.why);
      view.heard(header, arrays);
      return header.finished && view.key === "diagram" && this.moved();
    }
    if (kind === "code") return this.tellCode("As code", header.text);
    if (header.to === "orbit") {
      this.inFlight = null;
      if (this.waiting) this.send(); // the next solve runs while this one is drawn
      if (header.seq < this.drawnSeq) return;
      this.drawnSeq = header.seq;
      this.refuse(refused ? header : null);
      return refused || this.arrive(header, arrays);
    }
    if (kind === "layer") {
      this.layer = { header, ...arrays };
      this.redraw(this.of("layer"));
      if (header.plane) this.redraw(this.of("phase"));
    }
    if (kind === "sentence") {
      this.sentence = this.said.textContent = header.said;
      for (const v of this.views) v.after?.(v.plot, this);
    }
    if (refused) this.tell(header.why, true);
    if (refused && header.to === "view") this.open(this.scene, true);
  }
  arrive(header, { t, status, values, pose, pose_t }) {
    const { names } = header, m = t.length, phase = this.asked?.phase || [];
    const rows = new Map(names.map((n, k) => [n, values.subarray(k * m, (k + 1) * m)]));
    this.arrived = { header, t, names, values: rows, raw: status, width: status.length / m, phase };
    if (header.pose) this.posed(this.arrived, pose, pose_t);
    this.paint();
  }
  // Rows of the pose: numbers that stay, or values at the times of the pose.
  posed(orbit, pose, times) {
    const n = times.length;
    orbit.pose = orbit.header.pose.map((r) => (r.at === undefined ? r.is : pose.subarray(r.at * n, (r.at + 1) * n)));
    orbit.poseAt = (t) => {
      const [k, w] = this.place(t, times);
      return (row) => {
        const r = orbit.pose[row];
        return typeof r === "number" ? r : r[k - 1] + w * (r[k] - r[k - 1]);
      };
    };
  }
  // Draw when the frame has come, at most once a displayed frame.
  paint() {
    if (this.framed) {
      this.due = true;
      return;
    }
    this.framed = true;
    this.due = false;
    requestAnimationFrame(() => {
      this.framed = false;
      if (this.due) this.paint();
    });
    this.orbit = this.arrived;
    this.rows = new Map();
    const [begin, end] = this.orbit.header.t_span;
    if (this.state.cursor < begin || this.state.cursor > end) this.state.cursor = end;
    for (const v of this.views) if (v.key !== "diagram") v.draw();
    this.stats.drawn++;
    this.drawnAt = performance.now();
    this.numbers();
    this.askLayer();
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.transport.send({ kind: "sentence" });
      this.of("diagram")?.draw();
      this.moved();
    }, 400);
  }
  drawAll() {
    for (const v of this.views) v.draw();
  }
  redraw(view) {
    if (!view || view.drawing) return;
    view.drawing = requestAnimationFrame(() => {
      view.drawing = 0;
      view.draw();
    });
  }
  of(key) {
    return this.views.find((v) => v.key === key && v.box.isConnected);
  }

  // A scene has come: the first one, or one in another view or with another law. `again`: another one was refused.
  open(scene, again = false) {
    if (this.turning && !again) this.model = this.turning;
    this.turning = null;
    this.scene = scene;
    const { view = "", law = "", values = {} } = this.given || {}, wanted = { view, law, values };
    if (!again && this.given && JSON.stringify(wanted) !== JSON.stringify(this.model)) return this.change(wanted);
    this.state = this.restored();
    this.given = null;
    document.title = `${scene.title} · pwsmooth explore`;
    this.heading.textContent = (scene.title[0].toUpperCase() + scene.title.slice(1)).replace(/, /g, " · ");
    this.sub.textContent = this.sub.title = scene.note;
    this.tint();
    this.controls();
    this.build();
    if (this.ready && this.starting) this.tell("");
    if (this.ready) this.ask();
    else if (this.notice.hidden || this.starting) this.tell("Compiling, up to a minute, once per machine ...", false, true);
  }
  // What the page looks at, and does not change.
  get locked() {
    return !!(this.scene.alone || this.scene.read_only);
  }
  get names() {
    return [...this.scene.states, ...this.scene.multipliers, ...this.scene.outputs];
  }
  unit(name) {
    const unit = this.scene.units[name];
    return unit ? `${written(name)} (${unit})` : written(name);
  }
  // Whether there are strobes: of a period, or by a section that was chosen.
  get mapped() {
    return this.scene.map.ok || (!!this.state.section && !!this.scene.map.sections.length);
  }
  get strobes() {
    const { section } = this.state;
    return section ? `Returns to ${written(section[0])} = 0, ${section[1] > 0 ? "rising" : "falling"}` : "Strobes";
  }
  build() {
    const { scene } = this, all = VIEWS.map((V) => new V(this));
    const wanted = all.filter((v) => !scene.views.length || scene.views.includes(v.key));
    this.missing = wanted.filter((v) => v.why());
    this.views = wanted.filter((v) => !v.why());
    for (const v of this.views) v.build();
    this.root.classList.toggle("alone", !!scene.alone);
    this.arrange();
  }
  // The scene's own state, with what the address or another view or law brings; the rest is dropped, with a note.
  restored() {
    const { scene, given } = this, { states, axes, t_span } = scene, two = states.slice(0, 2);
    const own = Object.fromEntries(scene.controls.map((c) => [c.name, c.value]));
    const fresh = {
      v: 1, ...this.model, p: own, x0: { ...scene.start }, t_span: [...t_span],
      cursor: t_span[0] + 0.62 * (t_span[1] - t_span[0]), names: [...scene.names], phase: [...scene.phase],
      switch: scene.switches[0] || "", diagram: { parameter: scene.map.parameter || "", range: null, y: states[0], carry: 0 },
      basins: { axes: two, ranges: two.map((n) => axes[n]) }, section: null, noise: { name: scene.names[0], seed: 0 }, ranges: {},
    };
    if (!given) return fresh;
    const dropped = Object.keys(given).filter((key) => !(key in fresh) && key !== "quiet");
    const state = { ...fresh }, all = this.names, turns = [1, -1];
    for (const group of ["p", "x0"]) {
      state[group] = { ...fresh[group] };
      for (const [n, v] of Object.entries(given[group] || {}))
        if (n in fresh[group] && Number.isFinite(v)) state[group][n] = v;
        else dropped.push(n);
    }
    const known = (list, least, most) => list.length >= least && list.length <= most && list.every((n) => all.includes(n));
    const take = (key, holds) => {
      try {
        if (holds(given[key])) state[key] = given[key];
      } catch {} // of another kind altogether
    };
    take("t_span", isPair);
    take("cursor", Number.isFinite);
    take("names", (list) => known(list, 1, 4));
    take("phase", (list) => known(list, 2, 2));
    take("switch", (name) => scene.switches.includes(name));
    take("section", (s) => states.includes(s[0]) && turns.includes(s[1]));
    take("basins", (b) => known(b.axes, 2, 2) && b.axes.every((n) => states.includes(n)) && b.ranges.every(isPair));
    take("noise", (n) => all.includes(n.name) && Number.isInteger(n.seed) && n.seed >= 0);
    take("diagram", (d) => d.parameter in own && states.includes(d.y) && (!d.range || isPair(d.range)) && [0, ...turns].includes(d.carry));
    state.ranges = Object.fromEntries(Object.entries(given.ranges || {}).filter(([n, r]) => n in own && isPair(r)));
    if (dropped.length && !given.quiet) this.tell(`Not of this system, and left out: ${dropped.join(", ")}.`);
    return state;
  }

  // ---- sliders
  slider(c, group) {
    const { state } = this, key = c.key || c.name, id = `c-${key}`, [min, max] = state.ranges[c.name] || [c.min, c.max];
    const log = c.log && min > 0, near = (v) => c.grid.reduce((best, g) => (Math.abs(g - v) < Math.abs(best - v) ? g : best));
    const share = (v) => (log ? Math.log(Math.max(v, min) / min) / Math.log(max / min) : (v - min) / (max - min));
    const value = (s) => (log ? min * (max / min) ** (s / 1000) : min + (s / 1000) * (max - min));
    const set = (v, from) => {
      if (from !== number && document.activeElement !== number) number.value = plain(v);
      if (from !== line) line.value = Math.round(1000 * share(v));
      line.setAttribute("aria-valuetext", plain(v));
    };
    const go = (asked, from) => {
      if (!Number.isFinite(asked)) return;
      const v = c.grid ? near(asked) : asked;
      this.remember();
      this.state[group][c.name] = v;
      set(v, from);
      this.last(row);
      this.ask();
    };
    const slide = () => go(+value(+line.value).toPrecision(5), line);
    const number = element("input", {
      type: "number", step: "any", id: `${id}-n`, "aria-label": `${c.name}, value`,
      onchange: () => go(number.valueAsNumber, number),
    });
    const line = element("input", { type: "range", min: 0, max: 1000, step: 1, id, title: c.meaning || "", oninput: slide });
    if (c.meaning) line.setAttribute("aria-description", c.meaning);
    line.addEventListener("keydown", (e) => {
      // arrows 1/1000, pages 1/20
      const step = { PageUp: 50, PageDown: -50 }[e.key];
      if (!step) return;
      line.value = +line.value + step;
      slide();
      e.preventDefault();
    });
    const said = element("p", { class: "why", id: `${id}-w`, hidden: true });
    const [head, sub] = spelled(c.name), tail = `${c.unit ? ` ${c.unit}` : ""}${c.each ? ` each of ${c.each}` : ""}`;
    const label = element("label", { htmlFor: id, title: c.meaning || "" }, element("i", {}, head));
    if (sub) label.append(element("sub", {}, sub));
    if (tail) label.append(element("span", { class: "unit" }, tail));
    const row = element("div", { class: "slider" }, label, number, line, said);
    if (!c.key) {
      const reach = (r) => {
        this.state.ranges[c.name] = r;
        this.controls();
        this.of("diagram")?.draw();
      };
      row.append(this.ends([min, max], (k) => `${k ? "largest" : "smallest"} ${c.name} of the slider`, reach, "ends"));
    }
    this.fields[key] = { row, said, number, set };
    set(state[group][c.name]);
    return row;
  }
  // Two fields of an interval.
  ends(pair, label, change, kind) {
    const fields = [0, 1].map((k) =>
      element("input", {
        type: "number", step: "any", value: plain(pair[k]), "aria-label": label(k),
        onchange: (e) => {
          const next = pair.with(k, e.target.valueAsNumber);
          if (isPair(next)) change((pair = next));
          else e.target.value = plain(pair[k]);
        },
      }),
    );
    return Object.assign(element("span", { class: kind }, ...fields), {
      show: (given) => fields.forEach((field, k) => (field.value = plain((pair = given)[k]))),
    });
  }
  controls() {
    const { scene, state } = this, { law } = scene;
    this.fields = {};
    const rows = scene.controls.map((c) => this.slider(c, "p"));
    const starts = scene.states.slice(0, 12).map((name) => {
      const [min, max] = scene.axes[name];
      return this.slider({ name, key: `x0.${name}`, min, max, unit: scene.units[name] || "" }, "x0");
    });
    const begin = (k) => (k ? "end of the span" : "begin of the span");
    this.spanned = this.ends(state.t_span, begin, (t_span) => this.set({ t_span }), "pair");
    const line = (text, ...what) => element("div", { class: "span" }, element("span", {}, text), ...what);
    const views = [["", "as defined"], ["smoothed", `smoothed, ε = ${scene.eps}`]];
    if (scene.hidden || this.model.view) views.splice(1, 0, ["layered", "layered: fast states in the layer"]);
    const menus = [];
    if (law.all?.length > 1) menus.push(line("Law", choice("law", law.all.map((n) => [n, n]), law.name, (v) => this.turn({ law: v, values: {}, view: "" }))));
    for (const f of law.shape || []) menus.push(line(written(f.name), this.shaping(f)));
    if (scene.switches.length || this.model.view)
      menus.push(line("View", choice("view of the system", views, this.model.view, (view) => this.turn({ view }))));
    this.table = element("dl");
    const more = rows.splice(12), details = (text, ...what) => element("details", {}, element("summary", {}, text), ...what);
    if (more.length) rows.push(details(`${more.length} more`, ...more));
    this.sliders.replaceChildren(
      element("h2", {}, "Parameters"), ...rows, element("h2", {}, "Start"), ...starts, line("Span", this.spanned), ...menus,
      element("div", { class: "actions" }, button("Reset", () => this.reset())), details("Numbers", this.table),
    );
    this.sliders.inert = !!scene.read_only;
    this.last(this.fields[scene.map.parameter]?.row || rows[0] || starts[0]);
  }
  // A number or word that shapes the law: the model is made again.
  shaping({ name, value, meaning, choices }) {
    const write = (v) => this.turn({ law: this.scene.law.name, values: { ...this.model.values, [name]: v } });
    if (choices.length) return choice(meaning, choices.map((c) => [c, c]), value, write);
    const number = (e) => Number.isFinite(e.target.valueAsNumber) && write(e.target.valueAsNumber);
    return element("input", { type: "number", step: "any", value, title: meaning, "aria-label": meaning, onchange: number });
  }
  last(row) {
    this.lastRow?.classList.remove("last");
    row?.classList.add("last");
    this.lastRow = row;
  }
  pull() {
    this.handle.setAttribute("aria-expanded", String(this.side.classList.toggle("open")));
  }
  // Another view or law of the system; what both know keeps its value.
  turn(part) {
    if (this.locked) return;
    const { p, x0, ...rest } = this.state, { law } = this.scene, next = { ...this.model, ...part };
    const kept = Object.entries(x0).filter(([n]) => !part.law || law.moving.includes(n));
    this.given = { ...rest, p, x0: Object.fromEntries(kept), ...next, quiet: true };
    this.ghosts = [];
    this.change(next);
  }
  change(model) {
    this.turning = model;
    this.transport.send({ kind: "view", ...model });
    this.tell("Deriving, compiling ...", false, true);
  }
  reset() {
    const { controls, start, t_span } = this.scene;
    this.remember();
    this.write({ p: Object.fromEntries(controls.map((c) => [c.name, c.value])), x0: { ...start }, t_span: [...t_span] });
  }
  numbers() {
    if (!this.table?.parentElement.open) return;
    const rows = [["t", this.state.cursor], ...this.orbit.names.map((n) => [n, this.value(n, this.state.cursor)])];
    this.table.replaceChildren(...rows.flatMap(([n, v]) => [element("dt", {}, written(n)), element("dd", {}, plain(v))]));
  }
  // A value that the system refuses stays in its field, red, with the system's own sentence.
  refuse(header) {
    for (const { said, number } of Object.values(this.fields)) {
      said.hidden = true;
      number.removeAttribute("aria-invalid");
    }
    if (!header) return;
    const { why } = header, meant = (n) => why.includes(`'${n.replace("x0.", "")}'`) || why.includes(`of ${n} `);
    const field = this.fields[Object.keys(this.fields).find(meant)];
    if (!field) return this.tell(why, true);
    field.said.replaceChildren(why);
    if (this.scene.hidden && !this.model.view) field.said.append(button("Take the layered view", () => this.turn({ view: "layered" })));
    field.said.hidden = false;
    field.number.setAttribute("aria-invalid", "true");
    field.number.setAttribute("aria-describedby", field.said.id);
  }

  // ---- where views stand
  arrange() {
    const narrow = this.narrow.matches, group = (...keys) => this.views.filter((v) => keys.includes(v.key));
    const top = group("time", "mechanism"), small = group("phase", "characteristic", "layer"), noise = group("noise");
    const maps = this.swapped(group("diagram", "basins", "section")), tabbed = this.views.filter((v) => !top.includes(v));
    if (!tabbed.some((v) => v.key === this.tab)) this.tab = tabbed[0]?.key;
    const one = tabbed.filter((v) => v.key === this.tab), shown = [...top, ...(narrow ? one : [...small, ...maps, ...noise])];
    const tab = (v) => button(v.title, () => this.show(v.key), { role: "tab", "aria-selected": String(one.includes(v)) });
    this.tabs.replaceChildren(...tabbed.map(tab));
    const why = this.missing.find((v) => v.key === "diagram")?.why(), box = (v) => v.box;
    if (narrow) this.main.replaceChildren(...top.reverse().map(box), this.tabs, ...one.map(box));
    else this.main.replaceChildren(...shown.map(box));
    if (why && !narrow)
      this.main.append(element("p", { class: "missing" }, `No diagram, basins or section: ${why}. `, ...this.sections()));
    this.tabs.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest", inline: "center" });
    const count = (views) => views.filter((v) => shown.includes(v)).length;
    Object.assign(this.main.dataset, { mechanism: count(top) > 1, maps: count(maps), small: count(small) });
    for (const v of this.views)
      if (v.id && !v.box.isConnected) {
        this.halt(v);
        v.job = null;
      }
    this.drawAll();
    this.moved();
    if (this.orbit && !this.layer) this.askLayer();
  }
  // A section of an autonomous system: a state's zero, chosen by hand.
  sections() {
    const { sections } = this.scene.map;
    if (!sections.length || this.locked) return [];
    const ways = (n) => [[`${n} 1`, `${written(n)} = 0, rising`], [`${n} -1`, `${written(n)} = 0, falling`]];
    const choose = (v) => {
      const [n, d] = v.split(" ");
      this.remember();
      this.state.section = n ? [n, +d] : null;
      this.build();
      this.ask();
    };
    return [choice("section", [["", "choose a section"], ...sections.slice(0, 20).flatMap(ways)], "", choose)];
  }
  show(key) {
    this.tab = key;
    this.arrange();
  }
  // Two of three maps stand side by side; the menu in a caption puts another one there.
  swapped(maps) {
    if (maps.length < 3) return maps;
    this.slots ||= ["diagram", "basins"];
    for (const v of maps) {
      const put = (key) => {
        const here = this.slots.indexOf(v.key), other = this.slots.indexOf(key);
        if (other >= 0) this.slots[other] = v.key;
        this.slots[here] = key;
        this.arrange();
      };
      v.heading.replaceChildren(choice("which view stands here", maps.map((m) => [m.key, m.title]), v.key, put));
    }
    return this.slots.map((key) => maps.find((v) => v.key === key));
  }

  // ---- the state
  // Of the parameter in the diagram.
  span() {
    const { parameter, range } = this.state.diagram, c = this.scene.controls.find((x) => x.name === parameter);
    const own = c.log ? [Math.max(c.min, c.value / 10), Math.min(c.max, 5 * c.value)] : [c.min || 1e-3 * c.max, c.max];
    return range || this.state.ranges[parameter] || own;
  }
  // One entry a gesture: of what follows within 700 ms none is kept, unless it is one `apart`.
  remember(apart = false) {
    const now = performance.now(), along = now - (this.remembered ?? -1e9) < 700;
    this.remembered = now;
    if (along && !apart) return;
    this.past.push(JSON.stringify(this.state));
    if (this.past.length > 100) this.past.shift();
  }
  back() {
    const last = this.past.pop(), maps = () => JSON.stringify([this.state.diagram, this.state.basins]);
    if (!last) return;
    const before = maps();
    this.state = JSON.parse(last);
    this.remembered = -1e9;
    this.write({});
    if (before !== maps()) this.moved(true);
  }
  write(part) {
    Object.assign(this.state, part);
    const { p, x0, t_span } = this.state;
    for (const [n, v] of Object.entries(p)) this.fields[n]?.set(v);
    for (const [n, v] of Object.entries(x0)) this.fields[`x0.${n}`]?.set(v);
    this.spanned.show(t_span);
    this.ask();
  }
  set(part) {
    this.remember();
    Object.assign(this.state, part);
    this.ask();
  }
  begin(x0, ghost = false) {
    if (ghost && this.orbit) this.ghosts = [...this.ghosts.slice(-7), this.orbit.values];
    this.remember();
    const rounded = Object.entries(x0).map(([n, v]) => [n, +v.toPrecision(6)]);
    this.write({ x0: { ...this.state.x0, ...Object.fromEntries(rounded) } });
    this.of("basins")?.draw();
  }
  choose(name, value) {
    const { number } = this.fields[name];
    number.value = value;
    number.dispatchEvent(new Event("change"));
  }
  point(t) {
    if (!this.orbit) return;
    const [a, b] = this.orbit.header.t_span;
    this.state.cursor = Math.min(Math.max(t, a), b);
    for (const key of ["time", "phase", "characteristic", "mechanism"]) this.redraw(this.of(key));
    this.numbers();
    this.askLayer();
    this.note();
  }
  // What a map is asked for.
  setMap(key, part, anew = true) {
    this.remember(true);
    this.state[key] = { ...this.state[key], ...part };
    this.ask();
    if (anew) this.of(key)?.start();
  }
  fromDiagram(name, value, x0) {
    if (this.locked) return;
    this.remember(true);
    this.state.p[name] = value;
    this.begin(x0);
    this.tell(`Start from the diagram, at ${written(name)} = ${plain(value)}. Back restores the old one.`);
    clearTimeout(this.gone);
    this.gone = setTimeout(() => this.tell(""), 5000);
  }

  // ---- requests
  ask() {
    if (!this.state || this.lost) return;
    const { state: s, scene } = this, noise = scene.noise ? [s.noise.name] : [];
    const names = new Set([...s.names, ...s.phase, ...scene.characteristic, ...(this.mapped ? s.basins.axes : []), ...noise]);
    const { t_span, phase } = s;
    this.waiting = { kind: "orbit", ...this.model, p: { ...s.p }, x0: { ...s.x0 }, t_span, phase, names: [...names] };
    this.note();
    if (this.inFlight === null && this.ready) this.send();
  }
  send() {
    this.asked = { ...this.waiting, seq: ++this.seq };
    this.waiting = null;
    this.inFlight = this.asked.seq;
    this.stats.sent++;
    this.transport.send(this.asked);
  }
  askLayer() {
    // 30 a second at most
    const plane = this.of("phase");
    if (!this.scene.switches.length || !(plane || this.of("layer"))) return;
    const wait = 33 - (performance.now() - (this.layerAt || 0));
    clearTimeout(this.layerLater);
    const go = () => {
      const { switch: name, cursor, phase } = this.state, axes = plane ? [plane.plot.x, plane.plot.y] : [];
      this.layerAt = performance.now();
      this.transport.send({ kind: "layer", switch: name, t: cursor, phase, box: axes.map((a) => [a.low, a.high]) });
    };
    if (wait <= 0) go();
    else this.layerLater = setTimeout(go, wait);
  }
  note() {
    clearTimeout(this.noted);
    this.noted = setTimeout(() => this.transport.keep?.(this.hash()), 300);
  }
  hash() {
    return encoded({ ...this.state, ...this.model });
  }

  // Maps: each view has a job of its own; a newer one takes its place.
  begun(view) {
    const { p, x0, section } = this.state;
    view.id = ++this.job;
    this.transport.send({ ...view.asked(), job: view.id, p, x0, section });
  }
  halt(only = null) {
    for (const v of this.views) {
      if (!v.id || (only && v !== only)) continue;
      this.transport.send({ kind: "stop", what: v.key });
      v.id = 0;
      v.bar.hidden = true;
    }
  }
  // The state has come to rest: maps that are live follow it.
  moved(anew = false) {
    if (!this.ready || !this.orbit || this.lost) return;
    for (const key of MAPS) {
      const v = this.of(key);
      if (!v || (key === "basins" && !v.job && !this.quick(v))) continue;
      if (!v.job || (v.live.checked && v.stale) || (anew && v.stale)) v.start(true);
      else v.draw();
    }
  }
  // Basins begin by themselves where they will not take long, as the other maps have shown.
  quick(view) {
    if (this.narrow.matches) return true;
    const diagram = this.of("diagram"), h = diagram?.job?.header;
    if (!h || diagram.id) return false;
    const seconds = (h.cpu / h.done) * 9000; // 90 000 starts of eight periods, where a column has eighty
    const told = seconds > 90 ? `${Math.round(seconds / 60)} minutes` : "a minute";
    if (seconds > 40) view.say(`↻ shows which orbit each start leads to, in ${told} or so.`);
    return seconds <= 40;
  }

  // ---- what views ask of an orbit
  // How many of the times are before t.
  before(t, times = this.orbit.t) {
    let low = 0, high = times.length;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (times[mid] < t) low = mid + 1;
      else high = mid;
    }
    return low;
  }
  between(a, b) {
    return [this.before(a), this.before(b)];
  }
  // (k, w): t lies at the share w between the times k - 1 and k.
  place(t, times) {
    const k = Math.min(Math.max(this.before(t, times), 1), times.length - 1), d = times[k] - times[k - 1];
    return [k, d > 0 ? Math.min(Math.max((t - times[k - 1]) / d, 0), 1) : 1];
  }
  value(name, t) {
    const ys = this.orbit?.values.get(name);
    if (!ys) return NaN;
    const [k, w] = this.place(t, this.orbit.t);
    return ys[k - 1] + w * (ys[k] - ys[k - 1]);
  }
  // Of a multiplier, at the point k.
  held(j, k, { raw, width } = this.orbit) {
    return (raw[k * width + j] << 24) >> 24;
  }
  statusAt(name, t) {
    const j = this.scene.multipliers.indexOf(name), k = Math.min(this.before(t), this.orbit.t.length - 1);
    return j < 0 || j >= this.orbit.width ? null : this.held(j, k);
  }
  // Of the chosen switch, at all points.
  status(orbit) {
    const j = Math.max(0, this.scene.multipliers.indexOf(this.state.switch));
    if (j >= orbit.width) return null;
    if (!this.rows.has(j)) this.rows.set(j, Int8Array.from(orbit.t, (_, k) => this.held(j, k, orbit)));
    return this.rows.get(j);
  }
  strobed(name) {
    const h = this.orbit?.header, found = [];
    if (!h?.period || !this.orbit.values.has(name)) return found;
    for (let t = h.t_span[0]; t <= h.t_span[1] && found.length < 200; t += h.period) found.push(this.value(name, t));
    return found;
  }

  // ---- actions
  play() {
    if (this.clock) {
      this.clock = 0;
      this.playing.textContent = "Play";
      return this.redraw(this.of("mechanism"));
    }
    if (this.calm.matches) return this.event(1);
    const [a, b] = this.orbit?.header.t_span || [0, 1];
    const speed = this.scene.period ? this.scene.period / 2.5 : (b - a) / 20, mine = (this.clock = performance.now());
    let last = mine;
    this.playing.textContent = "Pause";
    if (this.state.cursor >= b) this.state.cursor = a;
    const tick = (now) => {
      if (this.clock !== mine) return;
      const t = this.state.cursor + ((now - last) / 1000) * speed, [begin, end] = this.orbit.header.t_span;
      last = now;
      this.point(t > end ? begin : t);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  event(way) {
    const times = this.orbit?.header.events.map((e) => e[0]) || [], c = this.state.cursor, tiny = 1e-9 * (1 + Math.abs(c));
    const found = way > 0 ? times.find((t) => t > c + tiny) : times.findLast((t) => t < c - tiny);
    if (found !== undefined) this.point(found);
  }
  key(e) {
    const { tagName, type } = e.target, text = /^(INPUT|SELECT|TEXTAREA)$/.test(tagName), meta = e.ctrlKey || e.metaKey;
    if (meta && e.key === "z" && !text) {
      this.back();
      return e.preventDefault();
    }
    if (e.key === "Escape" && !this.dialog.open) return this.halt();
    if (meta || e.altKey || this.dialog.open || (text && type !== "range")) return;
    const pressed = /^(BUTTON|SUMMARY)$/.test(tagName); // by the space bar itself
    const acts = { " ": "play", ",": "event", ".": "event", d: "go", b: "go", "?": "help" };
    if (!acts[e.key] || (e.key === " " && pressed)) return;
    this[acts[e.key]]({ ",": -1, ".": 1, d: "diagram", b: "basins" }[e.key]);
    e.preventDefault();
  }
  go(key) {
    if (this.narrow.matches) this.show(key);
    const v = this.of(key);
    if (!v) return;
    v.start();
    v.box.scrollIntoView({ block: "nearest" });
    v.canvas.focus({ preventScroll: true });
  }
  request() {
    const { diagram, basins, ...state } = this.state, { characteristic } = this.scene;
    return { ...state, characteristic, ...basins, ...this.of("diagram")?.asked(), cells: 300 };
  }

  // ---- dialogs
  link() {
    const hash = this.hash();
    this.tellCode("Link", `${location.origin}/#s=${hash}`, `On another machine:\n${this.scene.command} --state ${hash}`);
  }
  pick(then, names) {
    const views = this.views.filter((v) => !["section", "mechanism", "noise"].includes(v.key)).map((v) => [v.key, v.title]);
    let view = "time";
    const buttons = names.map((name) => button(name, () => then(view, name.toLowerCase())));
    return element("div", { class: "actions" }, choice("view", views, view, (v) => (view = v)), ...buttons);
  }
  code() {
    const write = (view) => this.transport.send({ ...this.request(), kind: "code", for: view });
    this.openDialog("As code", this.pick(write, ["Write"]));
    write("time");
  }
  save() {
    const note = "Drawn by matplotlib in the package's style, with the script that makes it inside.";
    const draw = (view, format) => {
      this.saving.textContent = "Drawing ...";
      this.transport.send({ ...this.request(), kind: "figure", for: view, format });
    };
    this.saving = element("p", { class: "note" }, note);
    this.openDialog("Save figure", this.pick(draw, ["PNG", "PDF", "SVG"]), this.saving);
  }
  file({ format }, bytes) {
    const type = { png: "image/png", pdf: "application/pdf", svg: "image/svg+xml" }[format], name = `explore.${format}`;
    const href = URL.createObjectURL(new Blob([bytes], { type })), a = element("a", { href, download: name }, name);
    this.saving?.replaceChildren("Saved: ", a);
    a.click();
    setTimeout(() => URL.revokeObjectURL(href), 60000);
  }
  openDialog(title, ...inside) {
    const close = element("button", { class: "small", "aria-label": "close" }, "Close");
    this.output = element("div");
    this.dialog.replaceChildren(element("form", { method: "dialog" }, element("h2", {}, title), close), ...inside, this.output);
    if (!this.dialog.open) this.dialog.showModal();
  }
  tellCode(title, text, more = "") {
    if (!this.dialog.open) this.openDialog(title);
    const block = element("pre", { tabIndex: 0 }, text);
    const copied = () => (copy.textContent = "Copied"), by_hand = () => getSelection().selectAllChildren(block);
    const copy = button("Copy", () => navigator.clipboard.writeText(text).then(copied, by_hand));
    this.output.replaceChildren(block, element("div", { class: "actions" }, copy));
    if (more) this.output.append(element("pre", {}, more));
  }
  help() {
    const rows = KEYS.flatMap(([key, what]) => [element("dt", {}, key), element("dd", {}, what)]);
    this.openDialog("Keys", element("dl", {}, ...rows));
  }
}
export const mount = (root, transport, fragment = "") => new App(root, transport, fragment);
