// The page: one state, which every view reads and every gesture writes; newest wins, one request in flight, one waiting.
import { plain, mixed, spelled, written } from "./plot.js";
import { VIEWS, choice, element } from "./views.js";

const LIGHT = {
  paper: "#ffffff",
  ink: "#1c2024",
  muted: "#6a7178",
  grid: "#eceef0",
  axis: "#c3c8cd",
  ghost: "#c9cdd2",
  curve: "#2b3137",
  bad: "#c62828",
  brush: "rgba(0,0,0,.06)",
  dark: false,
};
const DARK = {
  paper: "#17191c",
  ink: "#eceef0",
  muted: "#9aa1a8",
  grid: "#24282c",
  axis: "#474d53",
  ghost: "#4b5157",
  curve: "#d7dbdf",
  bad: "#ff7b72",
  brush: "rgba(255,255,255,.08)",
  dark: true,
};
const KEYS = [
  ["Space", "play or pause"],
  [", .", "to the event before, after"],
  ["d", "orbit diagram"],
  ["b", "basins"],
  ["Esc", "stop a computation"],
  ["Ctrl Z", "back"],
  ["arrows", "in the phase plane: move the start; with Shift ten times"],
  ["?", "this list"],
];

// A frame: uint32 length, JSON header, arrays padded to 4.
export function unpack(buffer) {
  const view = buffer instanceof ArrayBuffer ? { buffer, byteOffset: 0 } : buffer;
  const length = new DataView(view.buffer, view.byteOffset, 4).getUint32(0, true),
    arrays = {};
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + 4, length)));
  let at = view.byteOffset + 4 + length;
  for (const { name, type, shape, offset, scale = 1 } of header.arrays) {
    const kind = { f: Float32Array, b: Uint8Array, i: Int32Array, h: Uint16Array }[type];
    const values = new kind(
      view.buffer,
      at,
      shape.reduce((a, b) => a * b, 1),
    );
    arrays[name] =
      offset === undefined ? values : Float64Array.from(values, (v) => (type === "h" && v === 65535 ? NaN : offset + scale * v));
    at += Math.ceil(values.byteLength / 4) * 4;
  }
  return [header, arrays];
}

export function socketTransport(token) {
  let socket;
  return {
    open(hear, lost) {
      socket = new WebSocket(`ws://${location.host}/socket`);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => socket.send(JSON.stringify({ token }));
      socket.onmessage = (e) => hear(e.data);
      socket.onclose = (e) =>
        lost(
          e.code === 4403 || e.code === 4429
            ? `${e.reason}.`
            : "The server has ended. The state stays in this page's address: start pwsmooth explore again.",
        );
    },
    send(message) {
      if (socket.readyState === 1) socket.send(JSON.stringify(message));
    },
    close() {
      socket?.close();
    },
  };
}

// A file of frames: one slider, whose value has a frame each.
export function fileTransport({ scene, parameter, values, frames, layers, diagram }) {
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  let hear,
    at = 0;
  return {
    open(listen) {
      hear = listen;
      queueMicrotask(() => {
        hear(bytes(scene));
        hear(null, { kind: "ready" });
      });
    },
    send(m) {
      if (m.kind === "orbit") {
        at = values.reduce((best, v, k) => (Math.abs(v - m.p[parameter]) < Math.abs(values[best] - m.p[parameter]) ? k : best), 0);
        hear(bytes(frames[at]), { seq: m.seq });
      } else if (m.kind === "sentence") hear(null, { kind: "sentence", said: unpack(bytes(frames[at]))[0].sentence });
      else if (m.kind === "layer" && layers[at].length) {
        const [{ rows, ...same }, arrays] = unpack(bytes(layers[at])),
          n = rows.t.length,
          k = rows.t.reduce((best, t, k) => (Math.abs(t - m.t) < Math.abs(rows.t[best] - m.t) ? k : best), 0);
        const row = (of, pick) => Object.fromEntries(Object.entries(of).map(([key, v]) => [key, pick(v)]));
        hear(
          null,
          { ...same, ...row(rows, (v) => v[k]) },
          { ...row(arrays, (v) => v.subarray((k * v.length) / n, ((k + 1) * v.length) / n)), lam: arrays.lam },
        );
      } else if (m.kind === "diagram") setTimeout(() => diagram.forEach((f) => hear(bytes(f), { job: m.job })));
    },
  };
}

const encoded = (state) =>
  btoa(String.fromCharCode(...new TextEncoder().encode(JSON.stringify(state))))
    .replace(/\+/g, "-")
    .replace(/\//g, "_")
    .replace(/=+$/, "");
const decoded = (text) =>
  JSON.parse(new TextDecoder().decode(Uint8Array.from(atob(text.replace(/-/g, "+").replace(/_/g, "/")), (c) => c.charCodeAt(0))));

class App {
  constructor(root, transport, fragment) {
    Object.assign(this, {
      root,
      transport,
      fragment,
      scene: null,
      state: null,
      orbit: null,
      layer: null,
      ghosts: [],
      past: [],
      views: [],
      inFlight: null,
      waiting: null,
      seq: 0,
      drawnSeq: 0,
      job: 0,
      jobs: [],
      sentence: "",
      view: "",
      stats: { sent: 0, drawn: 0 },
    });
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.narrow = matchMedia("(max-width: 759px)");
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.tint();
    this.dark.addEventListener("change", () => {
      this.tint();
      this.drawAll();
    });
    this.narrow.addEventListener("change", () => this.arrange());
    this.frame();
    this.starting = true;
    transport.open(
      (frame, more, given = {}) => {
        const [header, arrays] = frame ? unpack(frame) : [{}, given];
        this.hear({ ...header, ...more }, arrays);
      },
      (why) => {
        this.lost = true;
        this.tell(why, true);
      },
    );
  }
  tint() {
    this.theme = { ...(this.dark.matches ? DARK : LIGHT), font: "system-ui, sans-serif" };
    if (!this.scene) return;
    const c = this.scene.colours;
    this.raw = c;
    this.phases = { 1: this.tone(c.right), "-1": this.tone(c.left), 0: this.tone(c.stick) };
    for (const v of this.views) v.tint?.();
  }
  tone(colour) {
    return this.theme.dark ? mixed(colour, "#ffffff", 0.28) : colour;
  }

  frame() {
    const button = (text, act, title = "") => element("button", { type: "button", title, onclick: act }, text);
    this.heading = element("h1", {}, "pwsmooth explore");
    this.sub = element("p", { class: "sub" });
    this.notice = element("p", { class: "notice", role: "status", hidden: false }, "Starting ...");
    this.said = element("p", { class: "said", "aria-live": "polite" });
    this.playing = button("Play", () => this.play(), "Space");
    this.backButton = button("Back", () => this.back(), "Ctrl Z");
    this.bar = element(
      "div",
      { class: "actions" },
      this.playing,
      this.backButton,
      button("Copy link", () => this.link()),
      button("Copy as code", () => this.code()),
      button("Save figure", () => this.save()),
      button("?", () => this.help(), "Keys"),
    );
    this.sliders = element("div", { class: "sliders" });
    this.handle = element("button", {
      type: "button",
      class: "handle",
      "aria-expanded": "false",
      "aria-label": "all sliders",
      onclick: () => this.pull(),
    });
    this.side = element("aside", { "aria-label": "parameters" }, this.handle, this.sliders);
    this.main = element("main");
    this.tabs = element("nav", { class: "tabs", role: "tablist" });
    this.dialog = element("dialog");
    this.root.replaceChildren(
      element("header", {}, element("div", { class: "title" }, this.heading, this.sub), this.bar),
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
    const { kind } = header;
    if (kind === "scene") return this.open(header);
    if (kind === "ready") {
      if (this.starting) this.tell("");
      this.ready = true;
      return this.ask();
    }
    if (kind === "killed") {
      this.inFlight = null;
      this.ready = false;
      return this.tell(header.why, true);
    }
    if (kind === "figure" || header.to === "figure") {
      return kind === "figure" ? this.file(header, arrays.file) : this.saving?.replaceChildren(header.why);
    }
    if (header.job !== undefined) {
      const view = this.views.find((v) => v.id === header.job);
      if (!view) return; // of a job that has been cancelled
      if (kind === "refused" || header.finished) view.id = 0;
      if (kind === "refused") return view.refused(header.why);
      view.heard(header, arrays);
      if (header.finished && view.key === "diagram") this.moved();
      return;
    }
    if (kind === "code") return this.show("As code", header.text);
    if (header.to === "orbit") {
      this.inFlight = null;
      if (this.waiting) this.send(); // the next solve runs while this one is drawn
      if (header.seq < this.drawnSeq) return;
      this.drawnSeq = header.seq;
      if (kind === "refused") return this.refuse(header);
      this.refuse(null);
      const { t, status, values } = arrays,
        m = t.length;
      this.arrived = {
        header,
        t,
        names: header.names,
        values: new Map(header.names.map((n, k) => [n, values.subarray(k * m, (k + 1) * m)])),
        raw: status,
        width: status.length / m,
        phase: this.asked?.phase || [],
      };
      if (header.pose) this.posed(this.arrived, arrays);
      return this.paint();
    }
    if (kind === "layer") {
      this.layer = { header, ...arrays };
      return this.redraw(this.of("layer"));
    }
    if (kind === "sentence") {
      this.sentence = header.said;
      this.said.textContent = header.said;
      for (const v of this.views) v.after?.(v.plot, this);
    }
    if (kind === "refused") this.tell(header.why, true);
  }
  // Rows of the pose: numbers that stay, or values at the times of the pose.
  posed(orbit, { pose, pose_t: times }) {
    const n = times.length;
    orbit.pose = orbit.header.pose.map((r) => (r.at === undefined ? r.is : pose.subarray(r.at * n, (r.at + 1) * n)));
    orbit.poseAt = (t) => {
      let k = 1;
      while (k < n - 1 && times[k] < t) k++;
      const w = times[k] > times[k - 1] ? Math.min(1, Math.max(0, (t - times[k - 1]) / (times[k] - times[k - 1]))) : 1;
      return (row) => {
        const r = orbit.pose[row];
        return typeof r === "number" ? r : r[k - 1] + w * (r[k] - r[k - 1]);
      };
    };
  }
  statusAt(name, t) {
    const j = this.scene.multipliers.indexOf(name),
      k = Math.min(this.between(t, t)[0], this.orbit.t.length - 1);
    return j < 0 || j >= this.orbit.width ? null : (this.orbit.raw[k * this.orbit.width + j] << 24) >> 24;
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
    if (this.state.cursor < this.orbit.header.t_span[0] || this.state.cursor > this.orbit.header.t_span[1])
      this.state.cursor = this.orbit.header.t_span[1];
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
    if (!view || view.later2) return;
    view.later2 = requestAnimationFrame(() => {
      view.later2 = 0;
      view.draw();
    });
  }
  of(key) {
    return this.views.find((v) => v.key === key && v.box.isConnected);
  }

  open(scene) {
    this.scene = scene;
    const own = Object.fromEntries(scene.controls.map((c) => [c.name, c.value]));
    const fresh = {
      v: 1,
      view: this.view,
      p: own,
      x0: { ...scene.start },
      t_span: [...scene.t_span],
      cursor: scene.t_span[0] + 0.62 * (scene.t_span[1] - scene.t_span[0]),
      names: [...scene.names],
      phase: [...scene.phase],
      switch: scene.switches[0] || "",
      diagram: { parameter: scene.map.parameter || "", range: null, y: scene.states[0], carry: 0 },
      basins: { axes: scene.states.slice(0, 2), ranges: scene.states.slice(0, 2).map((n) => scene.axes[n]) },
      section: null,
      ranges: {},
    };
    this.state = this.restored(fresh);
    if (this.fragmentView && this.fragmentView !== this.view) {
      this.view = this.fragmentView;
      return this.transport.send({ kind: "view", view: this.view });
    }
    document.title = `${scene.title} · pwsmooth explore`;
    this.heading.textContent = (scene.title[0].toUpperCase() + scene.title.slice(1)).replace(/, /g, " · ");
    this.sub.textContent = this.sub.title = scene.note;
    this.tint();
    this.controls();
    this.build();
    if (!this.ready) {
      if (this.notice.hidden || this.starting) this.tell("Compiling, up to a minute, once per machine ...", false, true);
    } else this.ask();
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
    const { scene } = this;
    this.views = VIEWS.map((V) => new V(this)).filter((v) => !scene.views.length || scene.views.includes(v.key));
    this.missing = this.views.filter((v) => v.why());
    this.views = this.views.filter((v) => !v.why());
    for (const v of this.views) v.build();
    this.root.classList.toggle("alone", !!scene.alone);
    this.arrange();
  }
  // What the address says of the state; unknown keys and what is no number is dropped, with a note.
  restored(fresh) {
    if (!this.fragment) return fresh;
    const dropped = [],
      numbers = (from, known) =>
        Object.fromEntries(
          Object.keys(known).map((n) => {
            const v = from?.[n];
            if (v !== undefined && !Number.isFinite(v)) dropped.push(n);
            return [n, Number.isFinite(v) ? v : known[n]];
          }),
        );
    let given;
    setTimeout(() => {
      this.turned = false;
    });
    try {
      given = decoded(this.fragment);
    } catch {
      this.fragment = "";
      this.tell("The state in this address cannot be read; the system's own is shown.", true);
      return fresh;
    }
    this.fragment = "";
    const names = new Set([...this.scene.states, ...this.scene.multipliers, ...this.scene.outputs]),
      known = (list, n) => Array.isArray(list) && list.length && list.length <= n && list.every((x) => names.has(x));
    const pair = (r) => Array.isArray(r) && r.length === 2 && r.every(Number.isFinite) && r[1] > r[0];
    for (const group of ["p", "x0"]) for (const n of Object.keys(given[group] || {})) if (!(n in fresh[group])) dropped.push(n);
    for (const key of Object.keys(given)) if (!(key in fresh)) dropped.push(key);
    const d = given.diagram || {},
      b = given.basins || {};
    if (typeof given.view === "string" && ["", "layered", "smoothed"].includes(given.view)) this.fragmentView = given.view;
    const state = {
      ...fresh,
      p: numbers(given.p, fresh.p),
      x0: numbers(given.x0, fresh.x0),
      t_span: pair(given.t_span) ? given.t_span : fresh.t_span,
      cursor: Number.isFinite(given.cursor) ? given.cursor : fresh.cursor,
      names: known(given.names, 4) ? given.names : fresh.names,
      phase: known(given.phase, 2) && given.phase.length === 2 ? given.phase : fresh.phase,
      switch: this.scene.switches.includes(given.switch) ? given.switch : fresh.switch,
      diagram: {
        parameter: d.parameter in fresh.p ? d.parameter : fresh.diagram.parameter,
        range: pair(d.range) ? d.range : null,
        y: this.scene.states.includes(d.y) ? d.y : fresh.diagram.y,
        carry: [1, -1].includes(d.carry) ? d.carry : 0,
      },
      basins:
        Array.isArray(b.axes) &&
        b.axes.length === 2 &&
        b.axes.every((n) => this.scene.states.includes(n)) &&
        Array.isArray(b.ranges) &&
        b.ranges.every(pair)
          ? { axes: b.axes, ranges: b.ranges }
          : fresh.basins,
      section:
        Array.isArray(given.section) && this.scene.states.includes(given.section[0]) && [1, -1].includes(given.section[1])
          ? given.section.slice(0, 2)
          : null,
      ranges: Object.fromEntries(Object.entries(given.ranges || {}).filter(([n, r]) => n in fresh.p && pair(r))),
    };
    if (dropped.length && !this.turned) this.tell(`Not of this system, and left out: ${dropped.join(", ")}.`);
    return state;
  }

  controls() {
    const { scene, state } = this;
    this.fields = {};
    const pretty = (name) => {
      const [head, sub] = spelled(name);
      return sub ? [element("i", {}, head), element("sub", {}, sub)] : [element("i", {}, head)];
    };
    const slider = (c, read, write) => {
      const [min, max] = state.ranges[c.name] || [c.min, c.max],
        log = c.log && min > 0;
      const id = `c-${c.key || c.name}`;
      const place = (v) =>
        String(Math.round(1000 * (log ? Math.log(Math.max(v, min) / min) / Math.log(max / min) : (v - min) / (max - min))));
      const near = (v) => c.grid.reduce((best, g) => (Math.abs(g - v) < Math.abs(best - v) ? g : best));
      const value = (s) => {
        const u = s / 1000,
          v = log ? min * (max / min) ** u : min + u * (max - min);
        return c.grid ? near(v) : +v.toPrecision(5);
      };
      const number = element("input", {
        type: "number",
        step: "any",
        value: plain(read()),
        id: `${id}-n`,
        "aria-label": `${c.name}, value`,
        onchange: (e) => go(e.target.valueAsNumber),
      });
      const line = element("input", { type: "range", min: 0, max: 1000, step: 1, value: place(read()), id });
      line.setAttribute("aria-valuetext", plain(read()));
      if (c.meaning) {
        line.setAttribute("aria-description", c.meaning);
        line.title = c.meaning;
      }
      line.addEventListener("input", () => go(value(+line.value), line));
      line.addEventListener("keydown", (e) => {
        // arrows 1/1000, pages 1/20
        const k = { PageUp: 50, PageDown: -50 }[e.key];
        if (k) {
          line.value = +line.value + k;
          go(value(+line.value), line);
          e.preventDefault();
        }
      });
      const said = element("p", { class: "why", id: `${id}-w`, hidden: true });
      const row = element(
        "div",
        { class: "slider" },
        element(
          "label",
          { htmlFor: id, title: c.meaning || "" },
          ...pretty(c.label || c.name),
          c.unit ? element("span", { class: "unit" }, ` ${c.unit}`) : "",
          c.each ? element("span", { class: "unit" }, ` each of ${c.each}`) : "",
        ),
        number,
        line,
        said,
      );
      const go = (v, from) => {
        if (!Number.isFinite(v)) return;
        if (c.grid) v = near(v);
        write(v);
        row.classList.add("moved");
        if (from !== line) line.value = place(v);
        if (from) number.value = plain(v);
        line.setAttribute("aria-valuetext", plain(v));
        this.last(row);
        this.ask();
      };
      this.fields[c.key || c.name] = {
        row,
        said,
        number,
        set: (v) => {
          if (document.activeElement !== number) number.value = plain(v);
          line.value = place(v);
          line.setAttribute("aria-valuetext", plain(v));
        },
      };
      if (!c.key)
        row.append(
          element(
            "span",
            { class: "ends" },
            ...[0, 1].map((k) =>
              element("input", {
                type: "number",
                step: "any",
                value: plain([min, max][k]),
                "aria-label": `${k ? "largest" : "smallest"} ${c.name} of the slider`,
                onchange: (e) => {
                  const r = [min, max];
                  r[k] = e.target.valueAsNumber;
                  if (r[1] > r[0]) {
                    state.ranges[c.name] = r;
                    this.controls();
                    this.of("diagram")?.draw();
                  } else e.target.value = plain([min, max][k]);
                },
              }),
            ),
          ),
        );
      return row;
    };
    const rows = scene.controls.map((c) =>
      slider(
        c,
        () => state.p[c.name],
        (v) => {
          this.remember();
          state.p[c.name] = v;
        },
      ),
    );
    const starts = scene.states.slice(0, 12).map((n) => {
      const [min, max] = scene.axes[n];
      return slider(
        { name: n, key: `x0.${n}`, label: n, min, max, unit: scene.units[n] || "" },
        () => state.x0[n],
        (v) => {
          this.remember();
          state.x0[n] = v;
        },
      );
    });
    const ends = [0, 1].map((k) =>
      element("input", {
        type: "number",
        step: "any",
        value: plain(state.t_span[k]),
        "aria-label": k ? "end of the span" : "begin of the span",
        onchange: (e) => {
          const s = [...state.t_span];
          s[k] = e.target.valueAsNumber;
          if (s[1] > s[0]) {
            this.remember();
            state.t_span = s;
            this.ask();
          } else e.target.value = plain(state.t_span[k]);
        },
      }),
    );
    this.fields.span = { ends };
    const views = [
      ["", "as defined"],
      ...(scene.hidden || this.view ? [["layered", "layered: fast states in the layer"]] : []),
      ["smoothed", "smoothed, ε = 0.01"],
    ];
    this.table = element("dl");
    this.sliders.replaceChildren(
      element("h2", {}, "Parameters"),
      ...rows.slice(0, 12),
      ...(rows.length > 12 ? [element("details", {}, element("summary", {}, `${rows.length - 12} more`), ...rows.slice(12))] : []),
      element("h2", {}, "Start"),
      ...starts,
      element("div", { class: "span" }, element("span", {}, "Span"), ends[0], element("span", {}, "to"), ends[1]),
      scene.switches.length || this.view
        ? element(
            "div",
            { class: "span" },
            element("span", {}, "View"),
            choice("view of the system", views, this.view, (v) => this.turn(v)),
          )
        : "",
      element("div", { class: "actions" }, element("button", { type: "button", onclick: () => this.reset() }, "Reset")),
      element("details", {}, element("summary", {}, "Numbers"), this.table),
    );
    this.last(this.fields[scene.map.parameter]?.row || rows[0] || starts[0]);
  }
  last(row) {
    if (this.lastRow !== row) {
      this.lastRow?.classList.remove("last");
      row?.classList.add("last");
      this.lastRow = row;
    }
  }
  pull() {
    const open = this.side.classList.toggle("open");
    this.handle.setAttribute("aria-expanded", String(open));
  }
  turn(view) {
    this.view = view;
    this.turned = true;
    this.ghosts = [];
    this.fragment = encoded({ ...this.state, view });
    this.fragmentView = view;
    this.transport.send({ kind: "view", view });
    this.tell("Deriving ...");
  }
  reset() {
    this.remember();
    const s = this.scene;
    this.write({ p: Object.fromEntries(s.controls.map((c) => [c.name, c.value])), x0: { ...s.start }, t_span: [...s.t_span] });
  }
  numbers() {
    if (!this.table?.parentElement.open) return;
    const rows = [["t", this.state.cursor], ...this.orbit.names.map((n) => [n, this.value(n, this.state.cursor)])];
    this.table.replaceChildren(...rows.flatMap(([n, v]) => [element("dt", {}, written(n)), element("dd", {}, plain(v))]));
  }
  refuse(header) {
    for (const f of Object.values(this.fields))
      if (f.said) {
        f.said.hidden = true;
        f.number.removeAttribute("aria-invalid");
      }
    if (!header) return;
    const name = Object.keys(this.fields).find((n) => header.why.includes(`'${n.replace("x0.", "")}'`) || header.why.includes(`of ${n} `));
    const field = this.fields[name];
    if (!field?.said) return this.tell(header.why, true);
    field.said.replaceChildren(
      header.why,
      ...(this.scene.hidden && !this.view
        ? [element("button", { type: "button", onclick: () => this.turn("layered") }, "Take the layered view")]
        : []),
    );
    field.said.hidden = false;
    field.number.setAttribute("aria-invalid", "true");
    field.number.setAttribute("aria-describedby", field.said.id);
  }

  arrange() {
    const narrow = this.narrow.matches,
      order = ["time", "mechanism", "phase", "characteristic", "layer", "diagram", "basins", "section", "noise"];
    this.views.sort((a, b) => order.indexOf(a.key) - order.indexOf(b.key));
    const tabbed = this.views.filter((v) => v.key !== "time" && v.key !== "mechanism");
    this.tabs.hidden = !narrow || !tabbed.length;
    if (narrow && !tabbed.some((v) => v.key === this.tab)) this.tab = tabbed[0]?.key;
    this.tabs.replaceChildren(
      ...tabbed.map((v) =>
        element(
          "button",
          {
            type: "button",
            role: "tab",
            "aria-selected": String(v.key === this.tab),
            onclick: () => {
              this.tab = v.key;
              this.arrange();
            },
          },
          v.title,
        ),
      ),
    );
    if (!narrow) this.swap(tabbed);
    const place = (v) => this.slots.indexOf(v.key),
      shownViews = narrow
        ? this.views.filter((v) => !tabbed.includes(v) || v.key === this.tab)
        : this.views.filter((v) => !this.hiddenMaps.includes(v.key)).sort((a, b) => place(a) - place(b));
    const order2 = narrow
      ? [
          ...shownViews.filter((v) => v.key === "mechanism"),
          ...shownViews.filter((v) => v.key === "time"),
          this.tabs,
          ...shownViews.filter((v) => tabbed.includes(v)),
        ].map((v) => v.box || v)
      : shownViews.map((v) => v.box);
    this.main.replaceChildren(
      ...order2,
      ...(narrow
        ? []
        : this.missing
            .filter((v) => v.key === "diagram")
            .map((v) => element("p", { class: "missing" }, `No diagram, basins or section: ${v.why()}. `, ...this.sections()))),
    );
    this.tabs.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest", inline: "center" });
    this.main.dataset.mechanism = shownViews.some((v) => v.key === "mechanism");
    this.main.dataset.maps = shownViews.filter((v) => v.asked).length;
    this.main.dataset.small = shownViews.filter((v) => ["phase", "characteristic", "layer"].includes(v.key)).length;
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
    if (!sections.length || this.scene.alone) return [];
    const options = [
      ["", "choose a section"],
      ...sections.slice(0, 20).flatMap((n) => [
        [`${n} 1`, `${written(n)} = 0, rising`],
        [`${n} -1`, `${written(n)} = 0, falling`],
      ]),
    ];
    return [
      choice("section", options, "", (v) => {
        const [n, d] = v.split(" ");
        this.remember();
        this.state.section = n ? [n, +d] : null;
        this.build();
        this.ask();
      }),
    ];
  }
  // Two of the maps stand side by side; the menu in a caption puts another one there.
  swap(views) {
    const maps = views.filter((v) => ["diagram", "basins", "section"].includes(v.key));
    this.slots = (this.slots || ["diagram", "basins"]).filter((k) => maps.some((v) => v.key === k));
    for (const v of maps) if (this.slots.length < 2 && !this.slots.includes(v.key)) this.slots.push(v.key);
    for (const v of maps) {
      if (maps.length < 3) continue;
      const pick = choice(
        "which view stands here",
        maps.map((m) => [m.key, m.title]),
        v.key,
        (key) => {
          const here = this.slots.indexOf(v.key),
            other = this.slots.indexOf(key);
          if (other >= 0) this.slots[other] = v.key;
          this.slots[here] = key;
          this.arrange();
        },
      );
      v.heading.replaceChildren(pick);
    }
    this.hiddenMaps = maps.filter((v) => !this.slots.includes(v.key)).map((v) => v.key);
  }

  // ---- the state
  get start() {
    return this.state.x0;
  }
  parameter(name) {
    return this.state.p[name];
  }
  span(diagram) {
    const c = this.scene.controls.find((x) => x.name === diagram.parameter);
    return (
      diagram.range ||
      this.state.ranges[diagram.parameter] || [
        c.log ? Math.max(c.min, c.value / 10) : c.min || 1e-3 * c.max,
        c.log ? Math.min(c.max, 5 * c.value) : c.max,
      ]
    );
  }
  remember() {
    // at most one entry a second of dragging
    const now = performance.now();
    if (now - (this.remembered || -1e9) < 700) {
      this.remembered = now;
      return;
    }
    this.remembered = now;
    this.past.push(JSON.stringify(this.state));
    if (this.past.length > 100) this.past.shift();
  }
  back() {
    const last = this.past.pop();
    if (!last) return;
    const before = JSON.stringify([this.state.diagram, this.state.basins]);
    this.state = JSON.parse(last);
    this.remembered = -1e9;
    this.show2();
    if (before !== JSON.stringify([this.state.diagram, this.state.basins])) this.moved(true);
  }
  write(part) {
    Object.assign(this.state, part);
    this.show2();
  }
  show2() {
    const s = this.state;
    for (const [n, v] of Object.entries(s.p)) this.fields[n]?.set(v);
    for (const [n, v] of Object.entries(s.x0)) this.fields[`x0.${n}`]?.set(v);
    this.fields.span.ends.forEach((e, k) => {
      e.value = plain(s.t_span[k]);
    });
    this.ask();
  }
  set(part) {
    this.remember();
    Object.assign(this.state, part);
    this.ask();
  }
  begin(x0, ghost = false) {
    if (ghost && this.orbit) {
      this.ghosts.push(new Map([...this.orbit.values].map(([n, v]) => [n, v.slice()])));
      if (this.ghosts.length > 8) this.ghosts.shift();
    }
    this.remember();
    for (const [n, v] of Object.entries(x0)) {
      const r = +v.toPrecision(6);
      this.state.x0[n] = r;
      this.fields[`x0.${n}`]?.set(r);
    }
    this.ask();
    for (const key of ["basins"]) this.of(key)?.draw();
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
    for (const v of this.views) if (["time", "phase", "characteristic", "mechanism"].includes(v.key)) this.redraw(v);
    this.numbers();
    this.askLayer();
    this.note();
  }
  setDiagram(part, anew = true) {
    this.remembered = -1e9;
    this.remember();
    this.state.diagram = { ...this.state.diagram, ...part };
    this.note();
    if (anew) this.of("diagram")?.start();
  }
  setBasins(part) {
    this.remembered = -1e9;
    this.remember();
    this.state.basins = { ...this.state.basins, ...part };
    this.note();
    this.of("basins")?.start();
  }
  fromDiagram(name, value, x0) {
    this.remembered = -1e9;
    this.remember();
    this.state.p[name] = value;
    this.fields[name]?.set(value);
    this.begin(x0);
    this.tell(`Start from the diagram, at ${written(name)} = ${plain(value)}. Back restores the old one.`);
    clearTimeout(this.gone);
    this.gone = setTimeout(() => this.tell(""), 5000);
  }

  // ---- requests
  ask() {
    if (!this.scene || this.lost) return;
    const { state: s, scene } = this,
      names = [...new Set([...s.names, ...s.phase, ...scene.characteristic, ...(this.mapped ? s.basins.axes : [])])];
    this.waiting = { kind: "orbit", p: { ...s.p }, x0: { ...s.x0 }, t_span: s.t_span, names, phase: s.phase };
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
    if (!this.of("layer")) return;
    const wait = 33 - (performance.now() - (this.layerAt || 0));
    clearTimeout(this.layerLater);
    const go = () => {
      this.layerAt = performance.now();
      this.transport.send({ kind: "layer", switch: this.state.switch, t: this.state.cursor });
    };
    if (wait <= 0) go();
    else this.layerLater = setTimeout(go, wait);
  }
  note() {
    clearTimeout(this.noted);
    this.noted = setTimeout(() => {
      this.transport.keep?.(this.hash());
    }, 300);
  }
  hash() {
    return encoded({ ...this.state, view: this.view });
  }

  // Maps: each view has a job of its own; a newer one takes its place.
  begun(view) {
    view.id = ++this.job;
    const { p, x0 } = this.state;
    this.transport.send({ ...view.asked(), job: view.id, p, x0, section: this.state.section });
  }
  halt(only = null) {
    for (const v of this.views) {
      if (!v.id || (only && v !== only)) continue;
      this.transport.send({ kind: "stop", what: v.key });
      v.id = 0;
      v.stop();
    }
  }
  moved(anew = false) {
    // the state has come to rest: maps that are live follow it
    if (!this.ready || !this.orbit || this.lost) return;
    for (const key of ["diagram", "section", "basins"]) {
      const v = this.of(key);
      if (!v?.asked) continue;
      if (key === "basins" && !v.job && !this.quick(v)) continue;
      if (!v.job || (v.live.checked && v.stale) || (anew && v.stale)) v.start(true);
      else v.draw();
    }
  }

  // Basins begin by themselves where they will not take long, as the other maps have shown.
  quick(view) {
    if (this.narrow.matches) return true;
    const h = this.views.find((v) => v.key === "diagram")?.job?.header;
    if (!h || this.of("diagram")?.id) return false;
    const seconds = (h.cpu / h.done) * 9000; // 90 000 starts of eight periods, where a column has eighty
    if (seconds > 40)
      view.say(`↻ shows which orbit each start leads to, in ${seconds > 90 ? `${Math.round(seconds / 60)} minutes` : "a minute"} or so.`);
    return seconds <= 40;
  }

  // ---- what views ask of an orbit
  between(a, b) {
    const { t } = this.orbit,
      find = (x) => {
        let lo = 0,
          hi = t.length;
        while (lo < hi) {
          const mid = (lo + hi) >> 1;
          if (t[mid] < x) lo = mid + 1;
          else hi = mid;
        }
        return lo;
      };
    return [find(a), find(b)];
  }
  value(name, at) {
    const ys = this.orbit?.values.get(name);
    if (!ys) return NaN;
    const { t } = this.orbit,
      k = Math.min(Math.max(this.between(at, at)[0], 1), t.length - 1),
      w = t[k] > t[k - 1] ? (at - t[k - 1]) / (t[k] - t[k - 1]) : 1;
    return ys[k - 1] + Math.min(Math.max(w, 0), 1) * (ys[k] - ys[k - 1]);
  }
  status(orbit) {
    // of the chosen switch
    if (!orbit.width) return null;
    const j = Math.max(0, this.scene.multipliers.indexOf(this.state.switch));
    if (j >= orbit.width) return null;
    if (!this.rows.has(j))
      this.rows.set(
        j,
        Int8Array.from(orbit.t, (_, k) => (orbit.raw[k * orbit.width + j] << 24) >> 24),
      );
    return this.rows.get(j);
  }
  strobed(name) {
    const h = this.orbit?.header;
    if (!h?.period || !this.orbit.values.has(name)) return null;
    const found = [];
    for (let t = h.t_span[0]; t <= h.t_span[1] && found.length < 200; t += h.period) found.push(this.value(name, t));
    return found;
  }
  diamond(plot, x, y) {
    const { ctx } = plot,
      a = plot.px(x),
      b = plot.py(y);
    ctx.fillStyle = this.theme.bad;
    ctx.beginPath();
    ctx.moveTo(a, b - 6);
    ctx.lineTo(a + 6, b);
    ctx.lineTo(a, b + 6);
    ctx.lineTo(a - 6, b);
    ctx.fill();
  }

  // ---- actions
  play() {
    if (this.clock) {
      this.clock = 0;
      this.playing.textContent = "Play";
      return this.redraw(this.of("mechanism"));
    }
    if (this.calm.matches) return this.event(1);
    const [a, b] = this.orbit?.header.t_span || [0, 1],
      speed = this.scene.period ? this.scene.period / 2.5 : (b - a) / 20;
    let last = performance.now();
    const mine = (this.clock = last);
    this.playing.textContent = "Pause";
    if (this.state.cursor >= b) this.state.cursor = a;
    const tick = (now) => {
      if (this.clock !== mine) return;
      const t = this.state.cursor + ((now - last) / 1000) * speed;
      last = now;
      this.point(t > this.orbit.header.t_span[1] ? this.orbit.header.t_span[0] : t);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  event(way) {
    const times = this.orbit?.header.events.map((e) => e[0]) || [],
      c = this.state.cursor,
      tiny = 1e-9 * (1 + Math.abs(c));
    const found = way > 0 ? times.find((t) => t > c + tiny) : times.filter((t) => t < c - tiny).pop();
    if (found !== undefined) this.point(found);
  }
  key(e) {
    if ((e.ctrlKey || e.metaKey) && e.key === "z" && !/^(INPUT|TEXTAREA)$/.test(e.target.tagName)) {
      this.back();
      return e.preventDefault();
    }
    if (e.key === "Escape" && !this.dialog.open) return this.halt();
    if (
      e.ctrlKey ||
      e.metaKey ||
      e.altKey ||
      this.dialog.open ||
      (/^(INPUT|SELECT|TEXTAREA)$/.test(e.target.tagName) && e.target.type !== "range")
    )
      return;
    const act = {
      " ": () => (/^(BUTTON|SUMMARY)$/.test(e.target.tagName) ? false : this.play()),
      ",": () => this.event(-1),
      ".": () => this.event(1),
      d: () => this.go("diagram"),
      b: () => this.go("basins"),
      "?": () => this.help(),
    }[e.key];
    if (act && act() !== false) e.preventDefault();
  }
  go(key) {
    if (this.narrow.matches && this.views.some((v) => v.key === key)) {
      this.tab = key;
      this.arrange();
    }
    const v = this.of(key);
    if (!v) return;
    v.start();
    v.box.scrollIntoView({ block: "nearest" });
    v.canvas.focus({ preventScroll: true });
  }
  request() {
    const s = this.state,
      d = this.of("diagram")?.asked?.() || {},
      { axes, ranges } = s.basins;
    return {
      p: s.p,
      x0: s.x0,
      t_span: s.t_span,
      names: s.names,
      phase: s.phase,
      characteristic: this.scene.characteristic,
      switch: s.switch,
      cursor: s.cursor,
      section: s.section,
      parameter: d.parameter,
      range: d.range,
      columns: d.columns,
      axes,
      ranges,
      cells: 300,
    };
  }
  link() {
    this.show("Link", `${location.origin}/#s=${this.hash()}`, `On another machine:\n${this.scene.command} --state ${this.hash()}`);
  }
  pick(then, more = []) {
    const views = this.views.filter((v) => !["section", "mechanism", "noise"].includes(v.key)).map((v) => [v.key, v.title]);
    let view = this.focused || "time";
    return element(
      "div",
      { class: "actions" },
      choice("view", views, view, (v) => {
        view = v;
      }),
      ...more.map(([text, f]) => element("button", { type: "button", onclick: () => then(view, f) }, text)),
    );
  }
  code() {
    this.open2(
      "As code",
      this.pick((view) => this.transport.send({ kind: "code", for: view, ...this.request() }), [["Write", ""]]),
    );
    this.transport.send({ kind: "code", for: "time", ...this.request() });
  }
  save() {
    this.open2(
      "Save figure",
      this.pick(
        (view, format) => {
          this.saving.textContent = "Drawing ...";
          this.transport.send({ kind: "figure", for: view, format, ...this.request() });
        },
        ["png", "pdf", "svg"].map((f) => [f.toUpperCase(), f]),
      ),
      (this.saving = element("p", { class: "note" }, "Drawn by matplotlib in the package's style, with the script that makes it inside.")),
    );
  }
  file(header, bytes) {
    const type = { png: "image/png", pdf: "application/pdf", svg: "image/svg+xml" }[header.format],
      url = URL.createObjectURL(new Blob([bytes], { type }));
    const a = element("a", { href: url, download: `explore.${header.format}` }, `explore.${header.format}`);
    this.saving?.replaceChildren("Saved: ", a);
    a.click();
    setTimeout(() => URL.revokeObjectURL(url), 60000);
  }
  open2(title, ...inside) {
    this.dialog.replaceChildren(
      element(
        "form",
        { method: "dialog" },
        element("h2", {}, title),
        element("button", { class: "small", "aria-label": "close" }, "Close"),
      ),
      ...inside,
      (this.output = element("div")),
    );
    if (!this.dialog.open) this.dialog.showModal();
  }
  show(title, text, more = "") {
    if (!this.dialog.open) this.open2(title);
    const copy = element(
      "button",
      {
        type: "button",
        onclick: async () => {
          try {
            await navigator.clipboard.writeText(text);
            copy.textContent = "Copied";
          } catch {
            getSelection().selectAllChildren(block);
          }
        },
      },
      "Copy",
    );
    const block = element("pre", { tabIndex: 0 }, text);
    this.output.replaceChildren(block, element("div", { class: "actions" }, copy), ...(more ? [element("pre", {}, more)] : []));
  }
  help() {
    this.open2("Keys", element("dl", {}, ...KEYS.flatMap(([k, w]) => [element("dt", {}, k), element("dd", {}, w)])));
  }
}

export function mount(root, transport, fragment = "") {
  return new App(root, transport, fragment);
}
