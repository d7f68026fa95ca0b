// The page: one state, which every view reads and every gesture writes; newest wins, one request in flight, one waiting.
import { clamp, mixed, nearest, plain, rowOf } from "./plot.js";
import { VIEWS, button, choice, element, number, typed } from "./views.js";

const TONES = ["paper", "ink", "muted", "grid", "axis", "ghost", "curve", "bad", "brush"]; // of the style sheet
const COMPILING = "A model is compiled once per machine, in up to a minute ...";
const ARRAYS = { f: Float32Array, b: Uint8Array, c: Int8Array, i: Int32Array, h: Uint16Array };

// A frame: uint32 length, JSON header, arrays padded to 4.
function unpack(frame) {
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

const mix = (ys, [k, w]) => ys[k - 1] + w * (ys[k] - ys[k - 1]);
const table = (rows) => rows.flatMap(([key, what]) => [element("dt", key), element("dd", what)]);
const whyOf = (key) => element("p.why", { id: `c-${key}-w`, hidden: true });
const details = (title, ...inside) => element("details", element("summary", title), ...inside);

class App {
  views = [];
  ghosts = [];
  past = [];
  timers = {};
  inFlight = null;
  seq = 0;
  drawnSeq = 0;
  job = 0;
  layerAt = 0;
  sentence = "";
  drawn = 0;
  constructor(root, transport) {
    Object.assign(this, { root, transport });
    this.frame();
    this.on("(prefers-color-scheme: dark)", "dark", () => {
      this.tint();
      this.drawAll();
    });
    this.on("(max-width: 759px)", "narrow", () => this.arrange());
    this.on("(prefers-reduced-motion: reduce)", "calm", () => {});
    this.tint();
    const hear = (frame, more, given) => {
      const [header, arrays] = frame ? unpack(frame) : [{}, given];
      this.hear({ ...header, ...more }, arrays);
    };
    transport.open(hear, (why) => {
      for (const part of [this.bar, this.side, this.main]) part.inert = true;
      this.lost = true;
      this.tell(why, true);
    });
  }
  // What the screen is, now and whenever it changes.
  on(query, name, act) {
    const media = (this[name] = matchMedia(query));
    media.addEventListener("change", act);
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
    this.heading = element("h1", "pwsmooth explore");
    this.sub = element("p.sub");
    this.notice = element("p.notice", { role: "status" });
    this.said = element("p.said", { "aria-live": "polite" });
    this.playing = button("Play", () => this.play(), { title: "Space" });
    this.sliders = element("div.sliders");
    const handle = { className: "handle", "aria-expanded": "false", "aria-label": "all sliders" };
    this.handle = button("━━━", () => this.pull(), handle);
    this.side = element("aside", { "aria-label": "parameters" }, this.handle, this.sliders);
    this.main = element("main");
    this.tabs = element("nav.tabs", { role: "tablist" });
    this.dialog = element("dialog");
    this.bar = element(
      "div.actions", this.playing, button("Undo", () => this.back(), { title: "Ctrl Z" }),
      button("Copy link", () => this.link()), button("Copy as code", () => this.code()),
      button("Save figure", () => this.save()), button("?", () => this.help(), { title: "Keys" }),
    );
    this.root.replaceChildren(
      element("header", element("div.title", this.heading, this.sub), this.bar), this.notice,
      element("div.work", this.side, element("div", this.said, this.tabs, this.main)), this.dialog,
    );
    this.tell(COMPILING, false, true);
    (this.transport.inside ? this.root : document).addEventListener("keydown", (e) => this.key(e));
    new ResizeObserver(() => this.views.forEach((v) => this.redraw(v))).observe(this.root);
  }
  // `passing`: until the next scene comes.
  tell(text, bad = false, passing = false) {
    Object.assign(this, { passing, refused: bad });
    this.later("gone", 15000, () => bad || passing || this.tell(""));
    this.notice.textContent = text;
    this.notice.hidden = !text;
    this.notice.classList.toggle("bad", bad);
  }

  hear(header, arrays) {
    const { kind, to, why } = header, refused = kind === "refused";
    if (to === "figure") return this.saving?.replaceChildren(why);
    if (header.job !== undefined) {
      const view = this.views.find((v) => v.id === header.job);
      if (!view) return; // of a job that has been cancelled
      if (refused || header.finished) view.id = 0;
      if (refused) return view.refused(why);
      view.heard(header, arrays);
      if (header.finished && view.key === "diagram") this.moved();
    } else if (to === "orbit") {
      this.inFlight = null;
      if (this.waiting) this.send(); // the next solve runs while this one is drawn
      if (header.seq < this.drawnSeq) return;
      this.drawnSeq = header.seq;
      this.refuse(header);
      if (!refused) this.arrive(header, arrays);
    } else if (refused) {
      this.tell(why, true);
      if (to === "view") this.controls();
    } else if (kind === "scene") this.open(header);
    else if (kind === "killed") {
      this.inFlight = null;
      this.kept = header.again ? null : this.state;
      this.tell(why);
    } else if (kind === "figure") this.file(header, arrays.file);
    else if (kind === "code") this.tellCode("As code", header.text);
    else if (kind === "layer") {
      this.layer = { header, ...arrays };
      this.redraw(this.of("layer"));
      if (header.plane) this.redraw(this.of("phase"));
    } else if (kind === "sentence") {
      this.sentence = this.said.textContent = header.said;
      for (const v of this.views) v.after(this);
    }
  }
  arrive(header, { t, status, values, pose, pose_t }) {
    const { names } = header, rows = new Map(names.map((n, k) => [n, rowOf(values, k, t.length)]));
    this.arrived = { header, t, names, values: rows, raw: status, phase: this.asked?.phase || [] };
    if (header.pose) {
      // Rows of the pose: numbers that stay, or the next values at the times of the pose.
      let moving = 0;
      const shapes = header.pose.map((still) => still ?? rowOf(pose, moving++, pose_t.length));
      this.arrived.pose = shapes;
      this.arrived.poseAt = (t) => {
        const place = this.place(t, pose_t);
        return (k) => (typeof shapes[k] === "number" ? shapes[k] : mix(shapes[k], place));
      };
    }
    this.paint();
  }
  // Draw when the frame has come, at most once a displayed frame.
  paint() {
    this.due = this.framed;
    if (this.framed) return;
    this.framed = true;
    requestAnimationFrame(() => {
      this.framed = false;
      if (this.due) this.paint();
    });
    this.orbit = this.arrived;
    const [begin, end] = this.orbit.header.t_span;
    if (this.state.cursor < begin || this.state.cursor > end) this.state.cursor = end;
    for (const v of this.views) if (v.key !== "diagram") v.draw();
    this.drawn++;
    this.drawnAt = performance.now();
    this.numbers();
    this.askLayer();
    this.later("rest", 400, () => {
      this.transport.send({ kind: "sentence" });
      this.of("diagram")?.draw();
      this.moved();
    });
  }
  // Acts so many ms later, unless it is told anew meanwhile.
  later(what, ms, act) {
    clearTimeout(this.timers[what]);
    this.timers[what] = setTimeout(act, ms);
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

  // A scene has come: the first one, or one in another view or with another law, with the state to begin with.
  open(scene) {
    this.scene = scene;
    // What was shown when a process ended is kept, but not under another law.
    const { kept: k } = this, { state: s } = scene;
    this.state = k?.law === s.law && k.view === s.view ? k : s;
    this.kept = null;
    this.ghosts = [];
    this.locked = scene.locked; // what the page looks at, and does not change
    document.title = `${scene.title} · pwsmooth explore`;
    this.heading.textContent = scene.heading;
    this.sub.textContent = this.sub.title = scene.note;
    if (scene.told || this.passing) this.tell(scene.told || "");
    this.root.classList.toggle("alone", !!scene.alone);
    this.tint();
    this.controls();
    this.build();
    this.ask();
  }
  build() {
    const { map, views } = this.scene;
    // Whether there are strobes: of a period, or by a section that was chosen.
    this.mapped = map.ok || (!!this.state.section && !!map.sections.length);
    const keys = Object.entries({ ...views, ...(this.mapped && map.views) });
    this.views = keys.map(([key, title]) => new VIEWS[key](this, key, title));
    for (const v of this.views) v.build();
    this.arrange();
  }
  // A name as it is written, and with its unit.
  written(name) {
    return this.scene.labels[name]?.[2] ?? name;
  }
  unit(name) {
    return this.scene.labels[name]?.[3] ?? name;
  }

  // ---- sliders
  slider(c, group) {
    const { name, meaning = "", grid } = c, own = group === "p", key = own ? name : `x0.${name}`, id = `c-${key}`;
    const [min, max] = (own && this.state.ranges[name]) || [c.min, c.max], log = c.log && min > 0;
    const share = (v) => (log ? Math.log(Math.max(v, min) / min) / Math.log(max / min) : (v - min) / (max - min));
    const value = (s) => (log ? min * (max / min) ** s : min + s * (max - min));
    const set = (v, from) => {
      if (from !== field) field.odd = false;
      if (from !== field && document.activeElement !== field) field.value = plain(v);
      if (from !== line) line.value = Math.round(1000 * share(v));
      line.setAttribute("aria-valuetext", plain(v));
    };
    const go = (asked, from) => {
      field.odd = !Number.isFinite(asked);
      if (field.odd) return this.mark(this.fields[key], this.scene.words.number);
      const v = grid ? nearest(grid, asked) : asked;
      this.remember();
      this.state[group][name] = v;
      set(v, from);
      this.last(row);
      this.ask();
    };
    const slide = () => go(+value(line.value / 1000).toPrecision(5), line);
    const field = number(`${name}, value`, "", () => go(typed(field), field), { id: `${id}-n` });
    const line = element("input.line", {
      type: "range", min: 0, max: 1000, step: 1, id, title: meaning, oninput: slide,
    });
    const said = whyOf(key), [head, sub] = this.scene.labels[name];
    const label = element("label", { htmlFor: id, title: meaning }, element("i", head));
    if (sub) label.append(element("sub", sub));
    if (c.tail) label.append(element("span.unit", ` ${c.tail}`));
    const row = element("div.slider", label, field, line, said);
    if (own) {
      const reach = (r) => {
        this.state.ranges[name] = r;
        this.controls();
        this.of("diagram")?.draw();
      };
      row.append(this.ends("ends", [min, max], `slider of ${name}`, reach, said));
    }
    this.fields[key] = { row, said, number: field, set };
    set(this.state[group][name]);
    return row;
  }
  // Two fields of an interval.
  ends(kind, pair, what, change, said) {
    const write = (k) => {
      const next = fields.map(typed), number = fields[k];
      number.odd = !(next.every(isFinite) && next[0] < next[1]);
      if (number.odd) return this.mark({ said, number }, this.scene.words.pair);
      fields.forEach((number) => this.mark({ said, number }));
      change(next);
    };
    const fields = pair.map((v, k) => number(`${what}, ${k ? "to" : "from"}`, plain(v), () => write(k)));
    const show = (given) => fields.forEach((field, k) => Object.assign(field, { value: plain(given[k]), odd: false }));
    return Object.assign(element(`span.${kind}`, fields), { show, said, number: fields[1], set() {} });
  }
  controls() {
    const { scene, state } = this, menu = (text, ...what) => element("div.span", element("span", text), ...what);
    this.fields = {};
    const rows = scene.controls.map((c) => this.slider(c, "p")), starts = scene.starts.map((c) => this.slider(c, "x0"));
    const span = (t_span) => this.set({ t_span });
    this.spanned = this.fields.t_span = this.ends("pair", state.t_span, "span", span, whyOf("t_span"));
    const menus = scene.models.map((m) => menu(m.text, this.model(m)));
    this.table = element("dl");
    const more = rows.splice(12);
    if (more.length) rows.push(details(`${more.length} more`, ...more));
    this.sliders.replaceChildren(
      element("h2", "Parameters"), ...rows, element("h2", "Start"), ...starts, menu("Span", this.spanned), this.spanned.said, ...menus,
      element("div.actions", button("Reset", () => this.reset())), details("Numbers", this.table),
    );
    this.sliders.inert = scene.read_only;
    this.last(this.fields[scene.map.parameter]?.row || rows[0] || starts[0]);
  }
  // A law or view by its name, or a number or word that shapes the law: the model is made again.
  model({ label, name, value, options, part, shape }) {
    const write = (v) => {
      const chosen = { [name]: v };
      this.turn({ ...part, ...(shape ? { values: { ...this.state.values, ...chosen } } : chosen) });
    };
    if (options.length) return choice(label, options, value, write);
    const read = ({ target }) => (isFinite(typed(target)) ? write(typed(target)) : this.tell(this.scene.words.number, true));
    return number(label, value, read, { title: label });
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
    this.transport.send({ ...this.state, ...part, kind: "view", turned: "law" in part ? "law" : "view" });
    this.tell(COMPILING, false, true);
  }
  reset() {
    this.remember();
    this.write(structuredClone(this.scene.own));
  }
  numbers() {
    if (!this.table?.parentElement.open) return;
    const { cursor } = this.state, rows = this.orbit.names.map((n) => [this.written(n), plain(this.value(n, cursor))]);
    this.table.replaceChildren(...table([["t", plain(cursor)], ...rows]));
  }
  // Buttons for parts of the state that help.
  remedies(given) {
    const act = (part) => ("view" in part ? this.turn(part) : this.write(part));
    return this.locked ? [] : given.map(([text, part]) => button(text, () => act(part)));
  }
  // A value that the system refuses stays in its field, red, with the system's own sentence.
  refuse({ why, field, remedies }) {
    for (const of of Object.values(this.fields)) if (!of.number.odd) this.mark(of);
    const of = this.fields[field];
    if (why && !of) return this.tell(why, true);
    if (this.refused) this.tell("");
    if (why) this.mark(of, why, ...this.remedies(remedies));
  }
  // What is wrong with a field, or nothing.
  mark({ said, number }, ...why) {
    said.replaceChildren(...why);
    said.hidden = !why.length;
    number.setAttribute("aria-invalid", !said.hidden);
    number.setAttribute("aria-describedby", said.id);
    if (!said.hidden) said.scrollIntoView({ block: "nearest" });
  }

  // ---- where views stand
  arrange() {
    const row = (name) => this.views.filter((v) => v.row === name), narrow = this.narrow.matches, { why } = this.scene.map;
    const top = row("top"), maps = this.swapped(row("maps")), tabbed = this.views.filter((v) => v.row !== "top");
    const one = tabbed.filter((v) => v.key === this.tab).concat(tabbed)[0];
    const tab = (v) => button(v.title, () => this.show(v.key), { role: "tab", "aria-selected": String(v === one) });
    const wide = [...top, ...row("small"), ...maps, ...row("noise")];
    const shown = narrow ? [...top.reverse(), ...tabbed.filter((v) => v === one)] : wide;
    this.tab = one?.key;
    this.tabs.replaceChildren(...tabbed.map(tab));
    this.main.replaceChildren(...shown.map((v) => v.box));
    if (narrow) one?.box.before(this.tabs);
    if (why && !this.mapped) this.main.append(element("p.missing", why, this.sections()));
    this.tabs.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest", inline: "center" });
    for (const name of ["top", "small", "maps"]) this.main.dataset[name] = shown.filter((v) => v.row === name).length;
    for (const v of this.views)
      if (v.id && !v.box.isConnected) {
        v.halt();
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
    const choose = (v) => {
      const [n, d] = v.split(" ");
      this.set({ section: [n, +d] });
      this.build();
    };
    return choice("section", [["", "choose a section"], ...sections], "", choose);
  }
  show(key) {
    this.tab = key;
    this.arrange();
  }
  // Two of three maps stand side by side; the menu in a caption puts another one there.
  swapped(maps) {
    if (maps.length < 3) return maps;
    this.slots ||= ["diagram", "basins"];
    const options = maps.map((m) => [m.key, m.title]);
    for (const v of maps) {
      const put = (key) => {
        this.slots = this.slots.map((k) => (k === v.key ? key : k === key ? v.key : k));
        this.arrange();
      };
      v.heading.replaceChildren(choice("which view stands here", options, v.key, put));
    }
    return this.slots.map((key) => maps.find((v) => v.key === key));
  }

  // ---- the state
  // Of the parameter in the diagram.
  span() {
    const { parameter, range } = this.state.diagram;
    return range || this.state.ranges[parameter] || this.scene.controls.find((c) => c.name === parameter).span;
  }
  // One entry a gesture: of what follows within 700 ms none is kept, unless it is one `apart`.
  remember(apart = false) {
    const now = performance.now(), along = now - (this.remembered ?? -1e9) < 700;
    this.remembered = now;
    if (!along || apart) this.past = [...this.past.slice(-99), JSON.stringify(this.state)];
  }
  back() {
    const last = this.past.pop(), maps = () => JSON.stringify([this.state.diagram, this.state.basins]), before = maps();
    if (!last) return;
    this.state = JSON.parse(last);
    this.remembered = -1e9;
    this.write({});
    if (before !== maps()) this.moved(true);
  }
  write(part) {
    Object.assign(this.state, part);
    const { p, x0, t_span } = this.state;
    for (const [key, { set }] of Object.entries(this.fields)) set(p[key] ?? x0[key.replace("x0.", "")]);
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
    number.onchange();
  }
  point(t) {
    if (!this.orbit) return;
    this.state.cursor = clamp(t, ...this.orbit.header.t_span);
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
    this.tell(`${this.scene.words.picked} ${this.written(name)} = ${plain(value)}.`);
  }

  // ---- requests
  ask() {
    if (!this.state || this.lost) return;
    this.waiting = { ...structuredClone(this.state), kind: "orbit" };
    this.note();
    if (this.inFlight === null) this.send();
  }
  send() {
    this.inFlight = ++this.seq;
    this.asked = { ...this.waiting, seq: this.seq };
    this.waiting = null;
    this.transport.send(this.asked);
  }
  // 30 a second at most.
  askLayer() {
    const plane = this.of("phase"), axes = plane ? [plane.plot.x, plane.plot.y] : [];
    if (!this.scene.switches.length || !(plane || this.of("layer"))) return;
    this.later("layer", 33 - (performance.now() - this.layerAt), () => {
      const { switch: name, cursor, phase } = this.state;
      this.layerAt = performance.now();
      this.transport.send({ kind: "layer", switch: name, t: cursor, phase, box: axes.map((a) => [a.low, a.high]) });
    });
  }
  note() {
    this.later("note", 300, () => this.transport.keep?.(this.hash()));
  }
  // The state for a link: base64url of its JSON.
  hash() {
    const bytes = new TextEncoder().encode(JSON.stringify(this.state));
    return btoa(String.fromCharCode(...bytes)).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
  }

  // The state has come to rest: maps that are live follow it.
  moved(anew = false) {
    if (!this.orbit || this.lost) return;
    for (const v of this.views) {
      if (anew) v.refresh();
      if (!v.live || !v.box.isConnected || (v.key === "basins" && !v.job && !this.quick(v))) continue;
      if (!v.job || (v.stale && (anew || v.live.checked))) v.start(true);
      else v.draw();
    }
  }
  // Basins begin by themselves where they will not take long, as the other maps have shown.
  quick(view) {
    if (this.narrow.matches) return true;
    const diagram = this.of("diagram"), foretold = diagram?.id ? undefined : diagram?.job?.header?.basins;
    if (foretold) view.say(foretold);
    return foretold === "";
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
  // (k, w): t lies at the share w between the times k - 1 and k.
  place(t, times) {
    const k = clamp(this.before(t, times), 1, times.length - 1), d = times[k] - times[k - 1];
    return [k, d > 0 ? clamp((t - times[k - 1]) / d, 0, 1) : 1];
  }
  value(name, t) {
    const ys = this.orbit?.values.get(name);
    return ys ? mix(ys, this.place(t, this.orbit.t)) : NaN;
  }
  // Of a multiplier, at all points; null where it has none.
  status(name) {
    const { raw, t } = this.orbit, found = rowOf(raw, Math.max(0, this.scene.multipliers.indexOf(name)), t.length);
    return found.length ? found : null;
  }
  // At the cursor.
  statusOf(name) {
    const rows = this.scene.multipliers.includes(name) && this.status(name);
    return rows ? rows[Math.min(this.before(this.state.cursor), rows.length - 1)] : null;
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
    if (this.lost) return;
    const { target, key } = e, meta = e.ctrlKey || e.metaKey, { open } = this.dialog, text = target.matches("input, select");
    const acts = {
      " ": () => this.play(), ",": () => this.event(-1), ".": () => this.event(1),
      d: () => this.go("diagram"), b: () => this.go("basins"), "?": () => this.help(),
    };
    if (key === "Escape" && !open) return this.views.forEach((v) => v.halt?.());
    if (meta && key === "z" && !text) this.back();
    else {
      if (meta || e.altKey || open || (text && target.type !== "range") || !acts[key]) return;
      if (key === " " && target.matches("button, summary")) return; // pressed by the space bar itself
      acts[key]();
    }
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

  // ---- dialogs
  link() {
    const hash = this.hash();
    this.tellCode("Link", `${location.origin}/#s=${hash}`, this.scene.command + hash);
  }
  // What a script or a figure is asked for.
  take(kind, view, format) {
    const drawn = this.views.find((v) => v.key === view);
    this.transport.send({ ...this.state, ...drawn.asked?.(), kind, for: view, format });
  }
  pick(then, names) {
    const views = this.views.filter((v) => !["section", "mechanism", "noise"].includes(v.key)).map((v) => [v.key, v.title]);
    let view = "time";
    const buttons = names.map((name) => button(name, () => then(view, name.toLowerCase())));
    return element("div.actions", choice("view", views, view, (v) => (view = v)), buttons);
  }
  code() {
    this.openDialog("As code", this.pick((view) => this.take("code", view), ["Write"]));
    this.take("code", "time");
  }
  save() {
    this.saving = element("p.note", this.scene.words.figure);
    const draw = (view, format) => {
      this.saving.textContent = "Drawing ...";
      this.take("figure", view, format);
    };
    this.openDialog("Save figure", this.pick(draw, ["PNG", "PDF", "SVG"]), this.saving);
  }
  file({ type, name }, bytes) {
    const href = URL.createObjectURL(new Blob([bytes], { type }));
    const a = element("a", { href, download: name }, name);
    this.saving?.replaceChildren("Saved: ", a);
    a.click();
    setTimeout(() => URL.revokeObjectURL(href), 60000);
  }
  openDialog(title, ...inside) {
    const form = element("form", { method: "dialog" }, element("h2", title), element("button", "Close"));
    this.output = element("div");
    this.dialog.replaceChildren(form, ...inside, this.output);
    if (!this.dialog.open) this.dialog.showModal();
  }
  tellCode(title, text, more = "") {
    if (!this.dialog.open) this.openDialog(title);
    const block = element("pre", { tabIndex: 0 }, text);
    const copied = () => (copy.textContent = "Copied"), by_hand = () => getSelection().selectAllChildren(block);
    const copy = button("Copy", () => navigator.clipboard.writeText(text).then(copied, by_hand));
    this.output.replaceChildren(block, element("div.actions", copy));
    if (more) this.output.append(element("pre", more));
  }
  help() {
    this.openDialog("Keys", element("dl", table(this.scene.words.keys)));
  }
}
export const mount = (root, transport) => new App(root, transport);
