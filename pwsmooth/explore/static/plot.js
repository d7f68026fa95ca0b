// One drawing on a canvas: scales, ticks, zoom, brush, curves, points, rasters. It knows no system and no server.

const GREEK = Object.fromEntries(
  ("alpha α beta β gamma γ delta δ epsilon ε eps ε zeta ζ eta η theta θ kappa κ lam λ lambda λ mu μ nu ν xi ξ rho ρ " +
    "sigma σ tau τ phi φ chi χ psi ψ omega ω Omega Ω Delta Δ Phi Φ").match(/\S+ \S+/g).map((pair) => pair.split(" ")),
);

// A name as it is written: [letter, subscript].
export function spelled(name) {
  const [head, ...rest] = String(name).split("_");
  const [, stem, digits] = /^([A-Za-z]+?)(\d*)$/.exec(head) || [0, head, ""];
  if (GREEK[stem] && digits) rest.unshift(digits);
  return [GREEK[stem] || head, rest.map((r) => GREEK[r] || r).join(" ")];
}
export function written(name) {
  const surface = /^h:(\w+$)?/.exec(name); // of a switch by its name, if that is a short one
  if (surface) return surface[1] ? `h of ${written(surface[1])}` : "h";
  const [head, sub] = spelled(name);
  return sub ? `${head}_${sub}` : head;
}

export function ticks(low, high, most) {
  const span = high - low;
  if (!(span > 0) || !isFinite(span)) return [];
  const raw = span / Math.max(1, most), power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 2.5, 5, 10].find((k) => k * power >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) found.push(k * step);
  return found;
}

// A number among others that span so much, to as many digits as tell them apart.
export function shown(value, span) {
  const size = Math.abs(value);
  if (size < 1e-9 * span) return "0";
  const digits = Math.max(0, Math.min(8, 2 - Math.floor(Math.log10(span))));
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(2) : value.toFixed(digits);
  return text.replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "").replace("e+", "e").replace(/-/g, "−");
}
// A power of ten that is told once for all ticks of an axis, where these are very small or large.
const power = ({ low, high }) => {
  const most = Math.max(Math.abs(low), Math.abs(high));
  return most < 0.02 || most >= 2e4 ? Math.floor(Math.log10(most)) : 0;
};
const times = (k) => (k ? ` ×10${String(k).replace(/[-\d]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)])}` : "");

// The number of a field: short, and the same when it is read again.
export const plain = (value) => {
  if (!Number.isFinite(value)) return "";
  const short = +value.toPrecision(6);
  return Math.abs(short) < 1e7 ? String(short) : value.toExponential(3).replace("+", "");
};

export const rgb = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
export function mixed(colour, other, part) {
  const b = rgb(other);
  return `#${rgb(colour).map((v, k) => Math.round(v + (b[k] - v) * part).toString(16).padStart(2, "0")).join("")}`;
}
// [least, largest] of some values.
export function range(values, first = 0, last = values.length, step = 1) {
  let low = Infinity, high = -Infinity;
  for (let k = first; k < last; k += step) {
    if (values[k] < low) low = values[k];
    if (values[k] > high) high = values[k];
  }
  return [low, high];
}

class Axis {
  zoomed = null;
  fixed = null;
  used = null;
  constructor(margin) {
    Object.assign(this, { low: 0, high: 1, margin });
  }
  // Grows at once, shrinks only where less than 60 % is used: axes must not tremble under a slider.
  cover(low, high) {
    if (!(high >= low) || !isFinite(high - low)) return;
    const pad = (high - low || Math.abs(high) || 1) * this.margin, [a, b] = this.used || [0, 0];
    low -= pad;
    high += pad;
    this.used = high - low < 0.6 * (b - a) || !this.used ? [low, high] : [Math.min(low, a), Math.max(high, b)];
    this.settle();
  }
  settle() {
    [this.low, this.high] = this.zoomed || this.fixed || this.used || [this.low, this.high];
  }
  forget() {
    this.used = this.zoomed = null;
  }
  zoom(at, factor, [least, most] = [-Infinity, Infinity]) {
    const low = Math.max(at + (this.low - at) * factor, least), high = Math.min(at + (this.high - at) * factor, most);
    if (high - low <= 1e-9 * Math.max(1e-9, Math.abs(low), Math.abs(high))) return;
    this.zoomed = [low, high];
    this.settle();
  }
}

export class Plot {
  left = 46;
  right = 10;
  top = 8;
  bottom = 30;
  labels = ["", ""];
  constructor(canvas, theme) {
    Object.assign(this, { canvas, theme, x: new Axis(0), y: new Axis(0.06), ctx: canvas.getContext("2d") });
  }
  // Whether there is room for a picture.
  measure() {
    const { width, height } = this.canvas.getBoundingClientRect(), ratio = globalThis.devicePixelRatio || 1;
    const w = Math.round(width * ratio), h = Math.round(height * ratio);
    if (w !== this.canvas.width || h !== this.canvas.height) Object.assign(this.canvas, { width: w, height: h });
    Object.assign(this, { width, height, ratio });
    return width > 20 && height > 20;
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
    const [w, h] = this.inner, { x, y } = this;
    return [x.low + ((px - this.left) / w) * (x.high - x.low), y.low + (1 - (py - this.top) / h) * (y.high - y.low)];
  }
  inside(px, py) {
    const [w, h] = this.inner;
    return px >= this.left && px <= this.left + w && py >= this.top && py <= this.top + h;
  }
  clear() {
    this.ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.ctx.clearRect(0, 0, this.width, this.height);
    this.ctx.lineJoin = this.ctx.lineCap = "round";
  }
  begin() {
    this.clear();
    for (const t of this.xticks()) this.vertical(t, this.theme.grid);
    for (const t of this.yticks()) this.horizontal(t, this.theme.grid);
    this.ctx.save();
    this.ctx.beginPath();
    this.ctx.rect(this.left, this.top, ...this.inner);
    this.ctx.clip();
  }
  end() {
    this.ctx.restore();
    this.axes();
  }
  xticks() {
    return ticks(this.x.low, this.x.high, Math.max(2, this.inner[0] / 75));
  }
  yticks() {
    return ticks(this.y.low, this.y.high, Math.max(4, this.inner[1] / 38));
  }
  write(text, x, y, align, baseline, colour = this.theme.muted) {
    Object.assign(this.ctx, { textAlign: align, textBaseline: baseline, fillStyle: colour });
    this.ctx.fillText(text, x, y);
  }
  axes() {
    const { ctx, theme, left, top } = this, [w, h] = this.inner, foot = top + h, [across, up] = this.labels;
    const kx = power(this.x), ky = power(this.y), label = `italic 12px ${theme.font}`, right = left + w;
    this.line(left + 0.5, top, left + 0.5, foot + 0.5, theme.axis);
    this.line(left, foot + 0.5, right, foot + 0.5, theme.axis);
    ctx.font = label;
    const name = across && across + times(kx), wide = ctx.measureText(name).width;
    this.write(name, right, foot + 5, "right", "top", theme.ink);
    ctx.font = `11px ${theme.font}`;
    for (const t of this.bottom > 20 ? this.xticks() : []) {
      const text = shown(t / 10 ** kx, (this.x.high - this.x.low) / 10 ** kx), half = ctx.measureText(text).width / 2;
      const p = this.px(t);
      if (p + half < right - wide - 6 && p - half > 2) this.write(text, p, foot + 6, "center", "top");
    }
    for (const t of this.yticks()) {
      const text = shown(t / 10 ** ky, (this.y.high - this.y.low) / 10 ** ky);
      if (this.py(t) > top + 14) this.write(text, left - 6, this.py(t), "right", "middle");
    }
    ctx.font = label;
    Object.assign(ctx, { textAlign: "left", textBaseline: "top", lineWidth: 3, strokeStyle: theme.paper });
    ctx.strokeText(up + times(ky), left + 6, top + 1); // a halo: curves pass behind it
    this.write(up + times(ky), left + 6, top + 1, "left", "top", theme.ink);
  }
  curve(xs, ys, colour, width = 1.5, first = 0, last = xs.length) {
    const { ctx } = this, [w, h] = this.inner;
    const kx = w / (this.x.high - this.x.low), ky = h / (this.y.high - this.y.low);
    const ox = this.left - this.x.low * kx, oy = this.top + h + this.y.low * ky;
    let px = NaN, py = NaN, pen = false;
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.beginPath();
    for (let k = first; k < last; k++) {
      const x = ox + xs[k] * kx, y = oy - ys[k] * ky;
      if (x !== x || y !== y) {
        pen = false;
        continue;
      }
      // Points within 0.3 px of the last one drawn add nothing.
      if (pen && k < last - 1 && Math.abs(x - px) + Math.abs(y - py) < 0.3) continue;
      if (pen) ctx.lineTo(near(x), near(y));
      else ctx.moveTo(near(x), near(y));
      pen = true;
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
    const { ctx } = this, h = this.inner[1], a = this.px(from), b = this.px(to);
    if (b < this.left || a > this.width - this.right) return;
    ctx.fillStyle = colour;
    ctx.fillRect(a, this.top, Math.max(b - a, 0.7), h);
    if (!hatched) return;
    ctx.save();
    ctx.beginPath();
    ctx.rect(a, this.top, b - a, h);
    ctx.clip();
    for (let x = a - h; x < b; x += 7) this.line(x, this.top + h, x + h, this.top, this.theme.grid);
    ctx.restore();
  }
  dot(x, y, colour, radius = 5, open = false) {
    const { ctx, theme } = this;
    ctx.beginPath();
    ctx.arc(near(this.px(x)), near(this.py(y)), radius, 0, 7);
    Object.assign(ctx, {
      fillStyle: open ? theme.paper : colour, strokeStyle: open ? colour : theme.paper, lineWidth: open ? 2 : 1.5,
    });
    ctx.fill();
    ctx.stroke();
  }
  diamond(x, y, colour) {
    const { ctx } = this, a = this.px(x), b = this.py(y);
    ctx.fillStyle = colour;
    ctx.beginPath();
    for (const [p, q] of [[0, -6], [6, 0], [0, 6], [-6, 0]]) ctx.lineTo(a + p, b + q);
    ctx.fill();
  }
  line(x0, y0, x1, y1, colour, width = 1, dash = []) {
    this.path([[x0, y0], [x1, y1]], colour, width, dash);
  }
  path(points, colour, width = 1, dash = []) {
    const { ctx } = this;
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.setLineDash(dash);
    ctx.beginPath();
    for (const [x, y] of points) ctx.lineTo(near(x), near(y));
    ctx.stroke();
    ctx.setLineDash([]);
  }
  vertical(x, colour, dash = [], width = 1) {
    const p = Math.round(this.px(x)) + 0.5;
    this.line(p, this.top, p, this.top + this.inner[1], colour, width, dash);
  }
  horizontal(y, colour, dash = [], width = 1) {
    const p = Math.round(this.py(y)) + 0.5;
    this.line(this.left, p, this.left + this.inner[0], p, colour, width, dash);
  }
  // The straight line a x + b y + c = 0.
  straight([a, b, c], colour, dash) {
    if (Math.abs(b) < 1e-12 * Math.abs(a)) return this.vertical(-c / a, colour, dash);
    const { low, high } = this.x, y = (x) => this.py(-(a * x + c) / b);
    this.line(this.px(low), y(low), this.px(high), y(high), colour, 1, dash);
  }
  image(bitmap, x0, y0, x1, y1) {
    const [a, b] = [this.px(x0), this.py(y1)];
    this.ctx.imageSmoothingEnabled = false;
    this.ctx.drawImage(bitmap, a, b, this.px(x1) - a, this.py(y0) - b);
  }
  box([x0, y0, x1, y1]) {
    const { ctx } = this, where = [Math.min(x0, x1), Math.min(y0, y1), Math.abs(x1 - x0), Math.abs(y1 - y0)];
    Object.assign(ctx, { fillStyle: this.theme.brush, strokeStyle: this.theme.ink, lineWidth: 1 });
    ctx.fillRect(...where);
    ctx.strokeRect(...where);
  }
}
// What lies beyond the canvas by far is cut to just outside: some browsers draw nothing else.
const near = (v) => Math.max(-1e4, Math.min(1e4, v));

// Pointer, wheel, pinch and long press on a plot, told as press(x, y, px, py) -> whether it takes the drag, move, up,
// click, zoom, fit.
export function gestures(plot, on) {
  const { canvas } = plot, down = new Map();
  let drag = null, timer = 0, moved = 0, spread = 0;
  const place = (e) => {
    const b = canvas.getBoundingClientRect();
    return [e.clientX - b.left, e.clientY - b.top];
  };
  const told = (px, py) => [...plot.at(px, py), px, py];
  const start = (px, py) => {
    drag = { px, py, taken: !on.press || on.press(...told(px, py)) !== false };
    if (drag.taken) canvas.classList.add("dragged");
  };
  const stop = () => {
    clearTimeout(timer);
    canvas.classList.remove("dragged", "held");
    drag = null;
  };
  const two = () => {
    const [[ax, ay], [bx, by]] = [...down.values()];
    return { gap: Math.hypot(ax - bx, ay - by), middle: plot.at((ax + bx) / 2, (ay + by) / 2) };
  };
  const up = (e) => {
    const had = drag, at = told(...place(e));
    down.delete(e.pointerId);
    stop();
    if (!had || e.type !== "pointerup") return;
    if (moved <= 4) on.click?.(...at);
    else if (had.taken) on.up?.(...at);
  };
  const listeners = {
    pointerdown(e) {
      const [px, py] = place(e);
      if (e.button || !plot.inside(px, py)) return;
      down.set(e.pointerId, [px, py]);
      moved = 0;
      if (down.size === 2) {
        stop();
        spread = two().gap;
      } else if (e.pointerType === "touch") {
        // A finger scrolls the page unless it rests first.
        drag = { px, py, waiting: true };
        timer = setTimeout(() => {
          canvas.classList.add("held");
          start(px, py);
          on.move?.(...told(px, py));
        }, 350);
      } else {
        canvas.setPointerCapture(e.pointerId);
        start(px, py);
      }
    },
    pointermove(e) {
      const [px, py] = place(e);
      if (down.has(e.pointerId)) down.set(e.pointerId, [px, py]);
      if (down.size === 2) {
        const { gap, middle } = two();
        if (spread > 0 && gap > 0) on.zoom?.(...middle, spread / gap);
        spread = gap;
      } else if (drag) {
        moved = Math.max(moved, Math.hypot(px - drag.px, py - drag.py));
        if (drag.waiting && moved > 8) stop();
        else if (drag.taken && moved > 2) on.move?.(...told(px, py));
      }
    },
    pointerup: up,
    pointercancel: up,
    touchmove(e) {
      if ((drag && !drag.waiting) || e.touches.length > 1) e.preventDefault();
    },
    contextmenu(e) {
      if (canvas.classList.contains("held")) e.preventDefault();
    },
    wheel(e) {
      const [px, py] = place(e);
      if (!on.zoom || !plot.inside(px, py)) return;
      e.preventDefault();
      on.zoom(...plot.at(px, py), Math.exp(Math.max(-60, Math.min(60, e.deltaY)) * 0.004));
    },
    dblclick: () => on.fit?.(),
  };
  for (const [name, act] of Object.entries(listeners)) canvas.addEventListener(name, act, { passive: false });
}
