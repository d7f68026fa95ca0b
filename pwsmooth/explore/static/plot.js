// One drawing on a canvas: scales, ticks, zoom, brush, curves, points, rasters. It knows no system and no server.

const GREEK = {
  alpha: "α",
  beta: "β",
  gamma: "γ",
  delta: "δ",
  epsilon: "ε",
  eps: "ε",
  zeta: "ζ",
  eta: "η",
  theta: "θ",
  kappa: "κ",
  lam: "λ",
  lambda: "λ",
  mu: "μ",
  nu: "ν",
  xi: "ξ",
  rho: "ρ",
  sigma: "σ",
  tau: "τ",
  phi: "φ",
  chi: "χ",
  psi: "ψ",
  omega: "ω",
  Omega: "Ω",
  Delta: "Δ",
  Phi: "Φ",
};

// A name as it is written: [letter, subscript].
export function spelled(name) {
  const [head, ...rest] = String(name).split("_");
  const digits = /^([A-Za-z]+)(\d+)$/.exec(head);
  const stem = digits && GREEK[digits[1]] ? digits[1] : head;
  if (stem !== head) rest.unshift(digits[2]);
  return [GREEK[stem] || stem, rest.map((r) => GREEK[r] || r).join(" ")];
}
export const written = (name) => {
  const surface = /^h:(.*)$/.exec(name);
  if (surface) return `h of ${written(surface[1])}`;
  const [head, sub] = spelled(name);
  return sub ? `${head}_${sub}` : head;
};

export function ticks(low, high, most) {
  const span = high - low;
  if (!(span > 0) || !isFinite(span)) return [];
  const raw = span / Math.max(1, most),
    power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((s) => s >= raw * 0.999) || 10 * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) found.push(k * step);
  return found;
}

// A number among others that span so much, to as many digits as tell them apart.
export function shown(value, span) {
  if (Math.abs(value) < 1e-9 * span) return "0";
  const size = Math.abs(value);
  const text =
    size >= 1e5 || size < 1e-3 ? value.toExponential(2) : value.toFixed(Math.max(0, Math.min(8, 2 - Math.floor(Math.log10(span)))));
  return text
    .replace(/(\.\d*?)0+(?=e|$)/, "$1")
    .replace(/\.(?=e|$)/, "")
    .replace("e+", "e")
    .replace(/-/g, "−");
}
// A power of ten that is told once for all ticks of an axis, where these are very small or large.
const power = (axis) => {
  const most = Math.max(Math.abs(axis.low), Math.abs(axis.high));
  return most < 0.02 || most >= 2e4 ? Math.floor(Math.log10(most)) : 0;
};
const times = (k) => (k ? ` ×10${String(k).replace(/[-\d]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)])}` : "");

// The number of a field: short, and the same when it is read again.
export const plain = (value) => (Number.isFinite(value) ? String(+value.toPrecision(6)) : "");

export function mixed(colour, other, part) {
  const rgb = (c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16));
  const a = rgb(colour),
    b = rgb(other);
  return (
    "#" +
    a
      .map((v, k) =>
        Math.round(v + (b[k] - v) * part)
          .toString(16)
          .padStart(2, "0"),
      )
      .join("")
  );
}

class Axis {
  constructor(margin = 0.04) {
    Object.assign(this, { low: 0, high: 1, margin, zoomed: null, fixed: null, used: null });
  }
  // Grows at once, shrinks only where less than 60 % is used: axes must not tremble under a slider.
  cover(low, high) {
    if (!(high >= low) || !isFinite(high - low)) return;
    const pad = (high - low || Math.abs(high) || 1) * this.margin;
    low -= pad;
    high += pad;
    const wide = this.used ? this.used[1] - this.used[0] : 0;
    if (!this.used || high - low < 0.6 * wide) this.used = [low, high];
    else this.used = [Math.min(low, this.used[0]), Math.max(high, this.used[1])];
    this.settle();
  }
  settle() {
    const range = this.zoomed || this.fixed || this.used;
    if (range) [this.low, this.high] = range;
  }
  forget() {
    this.used = null;
  }
  zoom(at, factor, limits) {
    let low = at + (this.low - at) * factor,
      high = at + (this.high - at) * factor;
    if (limits) {
      low = Math.max(low, limits[0]);
      high = Math.min(high, limits[1]);
    }
    if (high - low > 1e-9 * Math.max(1e-9, Math.abs(low), Math.abs(high))) {
      this.zoomed = [low, high];
      this.settle();
    }
  }
  fit() {
    this.zoomed = null;
    this.settle();
  }
}

export class Plot {
  constructor(canvas, theme) {
    Object.assign(this, { canvas, theme, x: new Axis(0), y: new Axis(0.06), ctx: canvas.getContext("2d"), labels: ["", ""] });
    this.width = this.height = 0;
    this.left = 46;
    this.bottom = 30;
    this.top = 8;
    this.right = 10;
    this.y2 = null;
  }
  measure() {
    const box = this.canvas.getBoundingClientRect(),
      ratio = globalThis.devicePixelRatio || 1;
    const w = Math.round(box.width * ratio),
      h = Math.round(box.height * ratio);
    if (w !== this.canvas.width || h !== this.canvas.height) {
      this.canvas.width = w;
      this.canvas.height = h;
    }
    this.width = box.width;
    this.height = box.height;
    this.ratio = ratio;
    return this.width > 20 && this.height > 20;
  }
  get inner() {
    return [this.width - this.left - this.right, this.height - this.top - this.bottom];
  }
  px(x) {
    return this.left + ((x - this.x.low) / (this.x.high - this.x.low)) * this.inner[0];
  }
  py(y) {
    return this.top + (1 - (y - this.y.low) / (this.y.high - this.y.low)) * this.inner[1];
  }
  at(px, py) {
    const [w, h] = this.inner;
    return [
      this.x.low + ((px - this.left) / w) * (this.x.high - this.x.low),
      this.y.low + (1 - (py - this.top) / h) * (this.y.high - this.y.low),
    ];
  }
  inside(px, py) {
    return px >= this.left && px <= this.width - this.right && py >= this.top && py <= this.height - this.bottom;
  }
  begin() {
    const { ctx } = this;
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.clearRect(0, 0, this.width, this.height);
    ctx.lineJoin = ctx.lineCap = "round";
    this.grid();
    ctx.save();
    ctx.beginPath();
    ctx.rect(this.left, this.top, ...this.inner);
    ctx.clip();
  }
  end() {
    const { ctx } = this;
    ctx.restore();
    this.axes();
  }
  grid() {
    const { ctx } = this,
      [w, h] = this.inner;
    ctx.strokeStyle = this.theme.grid;
    ctx.lineWidth = 1;
    ctx.beginPath();
    for (const t of this.xticks()) {
      const p = Math.round(this.px(t)) + 0.5;
      ctx.moveTo(p, this.top);
      ctx.lineTo(p, this.top + h);
    }
    for (const t of this.yticks()) {
      const p = Math.round(this.py(t)) + 0.5;
      ctx.moveTo(this.left, p);
      ctx.lineTo(this.left + w, p);
    }
    ctx.stroke();
  }
  xticks() {
    return ticks(this.x.low, this.x.high, Math.max(2, this.inner[0] / 75));
  }
  yticks() {
    return ticks(this.y.low, this.y.high, Math.max(4, this.inner[1] / 38));
  }
  axes() {
    const { ctx, theme } = this,
      [w, h] = this.inner;
    ctx.font = `11px ${theme.font}`;
    ctx.fillStyle = theme.muted;
    ctx.lineWidth = 1;
    ctx.textAlign = "center";
    ctx.textBaseline = "top";
    const xs = this.x.high - this.x.low,
      ys = this.y.high - this.y.low,
      label = this.width - this.right;
    const kx = power(this.x),
      ky = power(this.y),
      [across, up] = [this.labels[0] && this.labels[0] + times(kx), this.labels[1] + times(ky)];
    ctx.font = `italic 12px ${theme.font}`;
    const wide = ctx.measureText(across).width;
    ctx.font = `11px ${theme.font}`;
    if (this.bottom > 20)
      for (const t of this.xticks()) {
        const text = shown(t / 10 ** kx, xs / 10 ** kx),
          half = ctx.measureText(text).width / 2,
          p = this.px(t);
        if (p + half < label - wide - 6 && p - half > 2) ctx.fillText(text, p, this.top + h + 6);
      }
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    for (const t of this.yticks())
      if (this.py(t) > this.top + 14) ctx.fillText(shown(t / 10 ** ky, ys / 10 ** ky), this.left - 6, this.py(t));
    ctx.strokeStyle = theme.axis;
    ctx.beginPath();
    ctx.moveTo(this.left + 0.5, this.top);
    ctx.lineTo(this.left + 0.5, this.top + h + 0.5);
    ctx.lineTo(this.left + w, this.top + h + 0.5);
    ctx.stroke();
    ctx.font = `italic 12px ${theme.font}`;
    ctx.fillStyle = theme.ink;
    ctx.textAlign = "right";
    ctx.textBaseline = "top";
    ctx.fillText(across, label, this.top + h + 5);
    ctx.textAlign = "left";
    this.halo(up, this.left + 6, this.top + 1);
  }
  halo(text, x, y, colour = this.theme.ink) {
    const { ctx } = this;
    ctx.lineWidth = 3;
    ctx.strokeStyle = this.theme.paper;
    ctx.strokeText(text, x, y);
    ctx.fillStyle = colour;
    ctx.fillText(text, x, y);
  }
  // What lies beyond the canvas by far is cut to just outside: some browsers draw nothing else.
  clipped(v) {
    return v < -1e4 ? -1e4 : v > 1e4 ? 1e4 : v;
  }
  curve(xs, ys, colour, width = 1.5, first = 0, last = xs.length) {
    const { ctx } = this;
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.beginPath();
    const [w, h] = this.inner,
      kx = w / (this.x.high - this.x.low),
      ky = h / (this.y.high - this.y.low);
    const ox = this.left - this.x.low * kx,
      oy = this.top + h + this.y.low * ky;
    let px = NaN,
      py = NaN,
      pen = false;
    for (let k = first; k < last; k++) {
      const x = ox + xs[k] * kx,
        y = oy - ys[k] * ky;
      if (!(x === x && y === y)) {
        pen = false;
        continue;
      }
      // Points within 0.3 px of the last one drawn add nothing.
      if (pen && k < last - 1 && Math.abs(x - px) + Math.abs(y - py) < 0.3) continue;
      if (pen) ctx.lineTo(this.clipped(x), this.clipped(y));
      else {
        ctx.moveTo(this.clipped(x), this.clipped(y));
        pen = true;
      }
      px = x;
      py = y;
    }
    ctx.stroke();
  }
  // In pieces of equal status; the held ones are thicker, so that nothing is told by colour alone.
  phases(xs, ys, status, colours, width = 1.6) {
    let first = 0;
    for (let k = 1; k <= xs.length; k++) {
      if (k < xs.length && status[k] === status[first]) continue;
      const s = status[first];
      this.curve(xs, ys, colours[s], s === 0 ? 1.9 * width : width, first, Math.min(k + 1, xs.length));
      first = k;
    }
  }
  band(from, to, colour, hatched) {
    const { ctx } = this,
      a = this.px(from),
      b = this.px(to),
      h = this.inner[1];
    if (b < this.left || a > this.width - this.right) return;
    ctx.fillStyle = colour;
    ctx.fillRect(a, this.top, Math.max(b - a, 0.7), h);
    if (!hatched) return;
    ctx.strokeStyle = this.theme.grid;
    ctx.lineWidth = 1;
    ctx.save();
    ctx.beginPath();
    ctx.rect(a, this.top, b - a, h);
    ctx.clip();
    ctx.beginPath();
    for (let x = a - h; x < b; x += 7) {
      ctx.moveTo(x, this.top + h);
      ctx.lineTo(x + h, this.top);
    }
    ctx.stroke();
    ctx.restore();
  }
  dot(x, y, colour, radius = 5, open = false) {
    const { ctx } = this;
    ctx.beginPath();
    ctx.arc(this.clipped(this.px(x)), this.clipped(this.py(y)), radius, 0, 7);
    ctx.fillStyle = open ? this.theme.paper : colour;
    ctx.fill();
    ctx.lineWidth = open ? 2 : 1.5;
    ctx.strokeStyle = open ? colour : this.theme.paper;
    ctx.stroke();
  }
  line(x0, y0, x1, y1, colour, width = 1, dash = []) {
    const { ctx } = this;
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.setLineDash(dash);
    ctx.beginPath();
    ctx.moveTo(this.clipped(x0), this.clipped(y0));
    ctx.lineTo(this.clipped(x1), this.clipped(y1));
    ctx.stroke();
    ctx.setLineDash([]);
  }
  vertical(x, colour, dash = [], width = 1) {
    const p = this.px(x);
    this.line(p, this.top, p, this.top + this.inner[1], colour, width, dash);
  }
  horizontal(y, colour, dash = [], width = 1) {
    const p = this.py(y);
    this.line(this.left, p, this.left + this.inner[0], p, colour, width, dash);
  }
  // The straight line a x + b y + c = 0.
  straight([a, b, c], colour, dash) {
    if (Math.abs(b) < 1e-12 * Math.abs(a)) return this.vertical(-c / a, colour, dash);
    const y = (x) => -(a * x + c) / b;
    this.line(this.px(this.x.low), this.py(y(this.x.low)), this.px(this.x.high), this.py(y(this.x.high)), colour, 1, dash);
  }
  image(bitmap, x0, y0, x1, y1) {
    const { ctx } = this;
    ctx.imageSmoothingEnabled = false;
    ctx.drawImage(bitmap, this.px(x0), this.py(y1), this.px(x1) - this.px(x0), this.py(y0) - this.py(y1));
  }
  box([x0, y0, x1, y1]) {
    const { ctx } = this,
      [a, b] = [Math.min(x0, x1), Math.min(y0, y1)];
    ctx.fillStyle = this.theme.brush;
    ctx.fillRect(a, b, Math.abs(x1 - x0), Math.abs(y1 - y0));
    ctx.strokeStyle = this.theme.ink;
    ctx.lineWidth = 1;
    ctx.strokeRect(a + 0.5, b + 0.5, Math.abs(x1 - x0), Math.abs(y1 - y0));
  }
}

// Pointer, wheel, pinch and long press on a plot, told as: press(x, y, px, py) -> true to take the drag, move, up, click, zoom, fit.
export function gestures(plot, on) {
  const { canvas } = plot,
    down = new Map();
  let drag = null,
    timer = 0,
    moved = 0,
    spread = 0;
  const place = (e) => {
    const b = canvas.getBoundingClientRect();
    return [e.clientX - b.left, e.clientY - b.top];
  };
  const start = (px, py) => {
    const [x, y] = plot.at(px, py);
    drag = { px, py, taken: !on.press || on.press(x, y, px, py) !== false };
    if (drag.taken) canvas.classList.add("dragged");
  };
  const stop = () => {
    clearTimeout(timer);
    canvas.classList.remove("dragged");
    drag = null;
  };
  canvas.addEventListener("pointerdown", (e) => {
    if (e.button) return;
    const [px, py] = place(e);
    if (!plot.inside(px, py)) return;
    down.set(e.pointerId, [px, py]);
    moved = 0;
    if (down.size === 2) {
      stop();
      spread = gap(down);
      return;
    }
    // A finger scrolls the page unless it rests first.
    if (e.pointerType === "touch") {
      timer = setTimeout(() => {
        canvas.classList.add("held");
        start(px, py);
        on.move?.(...plot.at(px, py), px, py);
      }, 350);
      drag = { px, py, waiting: true };
    } else {
      canvas.setPointerCapture(e.pointerId);
      start(px, py);
    }
  });
  canvas.addEventListener("pointermove", (e) => {
    const [px, py] = place(e);
    if (down.has(e.pointerId)) down.set(e.pointerId, [px, py]);
    if (down.size === 2) {
      const now = gap(down),
        [[ax, ay], [bx, by]] = [...down.values()];
      if (spread > 0 && now > 0) on.zoom?.(...plot.at((ax + bx) / 2, (ay + by) / 2), spread / now);
      spread = now;
      return;
    }
    if (!drag) return on.hover?.(...plot.at(px, py), px, py);
    moved = Math.max(moved, Math.hypot(px - drag.px, py - drag.py));
    if (drag.waiting) {
      if (moved > 8) stop();
      return;
    }
    if (drag.taken && moved > 2) on.move?.(...plot.at(px, py), px, py);
  });
  const up = (e) => {
    const had = drag,
      [px, py] = place(e);
    down.delete(e.pointerId);
    canvas.classList.remove("held");
    if (had && e.type === "pointerup") {
      if (moved <= 4) on.click?.(...plot.at(px, py), px, py);
      else if (!had.waiting && had.taken) on.up?.(...plot.at(px, py), px, py);
    }
    stop();
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener(
    "touchmove",
    (e) => {
      if ((drag && !drag.waiting) || e.touches.length > 1) e.preventDefault();
    },
    { passive: false },
  );
  canvas.addEventListener("contextmenu", (e) => {
    if (canvas.classList.contains("held")) e.preventDefault();
  });
  canvas.addEventListener(
    "wheel",
    (e) => {
      const [px, py] = place(e);
      if (!on.zoom || !plot.inside(px, py)) return;
      e.preventDefault();
      on.zoom(...plot.at(px, py), Math.exp(Math.max(-60, Math.min(60, e.deltaY)) * 0.004));
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => on.fit?.());
}
const gap = (down) => {
  const [[ax, ay], [bx, by]] = [...down.values()];
  return Math.hypot(ax - bx, ay - by);
};
