// One drawing on a canvas: scales, ticks, zoom, brush, curves, points, rasters. It knows no system and no server.

// A number among others that span so much, to as many digits as tell them apart.
export function shown(value, span) {
  const size = Math.abs(value);
  if (size < 1e-9 * span) return "0";
  const digits = Math.max(0, Math.min(8, 2 - Math.floor(Math.log10(span))));
  const text = size >= 1e5 || size < 1e-3 ? value.toExponential(2) : value.toFixed(digits);
  return text.replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "").replace("e+", "e").replace(/-/g, "−");
}
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
export const clamp = (v, least, most) => Math.min(Math.max(v, least), most);
export const nearest = (list, v) => list.reduce((a, b) => (Math.abs(b - v) < Math.abs(a - v) ? b : a));
// What lies beyond the canvas by far is cut to just outside: some browsers draw nothing else.
const near = (v) => clamp(v, -1e4, 1e4);
// [least, largest] of some values.
export function range(values, first = 0, last = values.length, step = 1) {
  let low = Infinity, high = -Infinity;
  for (let k = first; k < last; k += step) {
    if (values[k] < low) low = values[k];
    if (values[k] > high) high = values[k];
  }
  return [low, high];
}
// Of rows of `n` values, the one with the number `k`.
export const rowOf = (values, k, n) => values.subarray(k * n, (k + 1) * n);
// The least interval with all of these in it; empty ones are [Infinity, -Infinity].
export const hull = (intervals) => [range(intervals.map((i) => i[0]))[0], range(intervals.map((i) => i[1]))[1]];

// One of the two scales of a plot, from pixel `begin` on, `size` pixels long.
class Axis {
  low = 0;
  high = 1;
  label = "";
  constructor(margin) {
    this.margin = margin;
  }
  px(v) {
    return this.begin + ((v - this.low) / (this.high - this.low)) * this.size;
  }
  at(px) {
    return this.low + ((px - this.begin) / this.size) * (this.high - this.low);
  }
  inside(px) {
    const share = (px - this.begin) / this.size;
    return share >= 0 && share <= 1;
  }
  // Grows at once, shrinks only where less than 60 % is used: axes must not tremble under a slider.
  cover([low, high]) {
    if (!(high >= low) || !isFinite(high - low)) return;
    const pad = (high - low || Math.abs(high) || 1) * this.margin, wide = [low - pad, high + pad], { used } = this;
    this.used = !used || wide[1] - wide[0] < 0.6 * (used[1] - used[0]) ? wide : hull([wide, used]);
    this.settle(this.used);
  }
  settle(interval) {
    [this.low, this.high] = this.zoomed || interval;
  }
  forget() {
    this.used = this.zoomed = null;
  }
  zoom(at, factor, [least, most] = [-Infinity, Infinity]) {
    const low = Math.max(at + (this.low - at) * factor, least), high = Math.min(at + (this.high - at) * factor, most);
    if (high - low > 1e-9 * Math.max(1e-9, Math.abs(low), Math.abs(high))) this.settle((this.zoomed = [low, high]));
  }
  // Ticks with their texts, at most so many, and the power of ten that is told once where they are very small or large.
  ticks(most) {
    const { low, high } = this, span = high - low, found = [];
    const raw = span / most, power = 10 ** Math.floor(Math.log10(raw)), largest = Math.max(Math.abs(low), Math.abs(high));
    const step = power * [1, 2, 2.5, 5, 10].find((k) => k * power >= raw * 0.999);
    const told = largest < 0.02 || largest >= 2e4 ? Math.floor(Math.log10(largest)) : 0, unit = 10 ** told;
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++)
      found.push([k * step, shown((k * step) / unit, span / unit)]);
    const raised = (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)];
    return [found, told ? ` ×10${String(told).replace(/[-\d]/g, raised)}` : ""];
  }
}

export class Plot {
  left = 46;
  right = 10;
  top = 8;
  bottom = 30;
  x = new Axis(0);
  y = new Axis(0.06);
  constructor(canvas) {
    this.canvas = canvas;
    this.ctx = canvas.getContext("2d");
  }
  // Whether there is room for a picture.
  measure() {
    const { width, height } = this.canvas.getBoundingClientRect(), ratio = globalThis.devicePixelRatio || 1;
    if (width < 20 || height < 20) return false;
    const size = { width: Math.round(width * ratio), height: Math.round(height * ratio) };
    if (size.width !== this.canvas.width || size.height !== this.canvas.height) Object.assign(this.canvas, size);
    const w = width - this.left - this.right, h = height - this.top - this.bottom;
    Object.assign(this, { width, height, ratio, inner: [w, h] });
    Object.assign(this.x, { begin: this.left, size: w });
    Object.assign(this.y, { begin: this.top + h, size: -h });
    return true;
  }
  px(x) {
    return this.x.px(x);
  }
  py(y) {
    return this.y.px(y);
  }
  at(px, py) {
    return [this.x.at(px), this.y.at(py)];
  }
  clear() {
    this.ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.ctx.clearRect(0, 0, this.width, this.height);
    this.ctx.lineJoin = this.ctx.lineCap = "round";
  }
  // Runs `paint` between grid and axes, in the frame of these.
  draw(theme, paint) {
    const { ctx, left, top } = this, [w, h] = this.inner;
    this.theme = theme;
    this.clear();
    const [across, across_power] = this.x.ticks(Math.max(2, w / 75)), [up, up_power] = this.y.ticks(Math.max(4, h / 38));
    for (const [t] of across) this.vertical(t, theme.grid);
    for (const [t] of up) this.horizontal(t, theme.grid);
    this.within(left, w, paint);
    const foot = top + h, right = left + w, label = `italic 12px ${theme.font}`;
    this.path([[left + 0.5, top], [left + 0.5, foot + 0.5], [right, foot + 0.5]], theme.axis);
    ctx.font = label;
    const name = this.x.label && this.x.label + across_power, wide = ctx.measureText(name).width;
    this.write(name, right, foot + 5, "right", "top", theme.ink);
    ctx.font = `11px ${theme.font}`;
    for (const [t, text] of this.bottom > 20 ? across : []) {
      const p = this.px(t), half = ctx.measureText(text).width / 2;
      if (p + half < right - wide - 6 && p - half > 2) this.write(text, p, foot + 6, "center", "top");
    }
    for (const [t, text] of up) if (this.py(t) > top + 14) this.write(text, left - 6, this.py(t), "right", "middle");
    ctx.font = label;
    this.write(this.y.label + up_power, left + 6, top + 1, "left", "top", theme.ink, theme.paper);
  }
  // What `paint` draws is cut to the frame, from `left` on as wide.
  within(left, width, paint) {
    const { ctx } = this;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, this.top, width, this.inner[1]);
    ctx.clip();
    paint();
    ctx.restore();
  }
  // `halo`: curves pass behind the text.
  write(text, x, y, textAlign, textBaseline, fillStyle = this.theme.muted, halo = "") {
    Object.assign(this.ctx, { textAlign, textBaseline, fillStyle, strokeStyle: halo, lineWidth: 5 });
    if (halo) this.ctx.strokeText(text, x, y);
    this.ctx.fillText(text, x, y);
  }
  // What `trace` adds to a path, filled, and drawn as a line.
  shape(trace, fill, stroke, width = 1, dash = []) {
    const { ctx } = this;
    Object.assign(ctx, { fillStyle: fill, strokeStyle: stroke, lineWidth: width });
    ctx.setLineDash(dash);
    ctx.beginPath();
    trace(ctx);
    if (fill) ctx.fill();
    if (stroke) ctx.stroke();
    ctx.setLineDash([]);
  }
  curve(xs, ys, colour, width = 1.5, first = 0, last = xs.length) {
    const { x: across, y: up } = this, kx = across.size / (across.high - across.low), ky = up.size / (up.high - up.low);
    const ox = across.px(0), oy = up.px(0);
    let px = NaN, py = NaN, pen = false;
    const trace = (ctx) => {
      for (let k = first; k < last; k++) {
        const x = ox + xs[k] * kx, y = oy + ys[k] * ky, drawn = x === x && y === y;
        // Points within 0.3 px of the last one drawn add nothing.
        if (pen && drawn && k < last - 1 && Math.abs(x - px) + Math.abs(y - py) < 0.3) continue;
        if (drawn) ctx[pen ? "lineTo" : "moveTo"](near(x), near(y));
        [px, py, pen] = [x, y, drawn];
      }
    };
    this.shape(trace, "", colour, width);
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
    const { ctx, top } = this, h = this.inner[1], a = this.px(from), b = this.px(to);
    if (b < this.left || a > this.width - this.right) return;
    ctx.fillStyle = colour;
    ctx.fillRect(a, top, Math.max(b - a, 0.7), h);
    if (!hatched) return;
    this.within(a, b - a, () => {
      for (let x = a - h; x < b; x += 7) this.line(x, top + h, x + h, top, this.theme.grid);
    });
  }
  dot(x, y, colour, radius = 5, open = false) {
    const { paper } = this.theme, circle = (ctx) => ctx.arc(near(this.px(x)), near(this.py(y)), radius, 0, 7);
    this.shape(circle, open ? paper : colour, open ? colour : paper, open ? 2 : 1.5);
  }
  diamond(x, y, colour) {
    const corners = [[0, -6], [6, 0], [0, 6], [-6, 0]].map(([a, b]) => [this.px(x) + a, this.py(y) + b]);
    this.path(corners, "", 0, [], colour);
  }
  line(x0, y0, x1, y1, colour, width, dash) {
    this.path([[x0, y0], [x1, y1]], colour, width, dash);
  }
  path(points, colour, width, dash, fill = "") {
    this.shape((ctx) => points.forEach(([x, y]) => ctx.lineTo(near(x), near(y))), fill, colour, width, dash);
  }
  vertical(x, colour, dash, width) {
    const p = Math.round(this.px(x)) + 0.5;
    this.line(p, this.top, p, this.top + this.inner[1], colour, width, dash);
  }
  horizontal(y, colour, dash, width) {
    const p = Math.round(this.py(y)) + 0.5;
    this.line(this.left, p, this.left + this.inner[0], p, colour, width, dash);
  }
  // The straight line a x + b y + c = 0.
  straight([a, b, c], colour, dash) {
    if (Math.abs(b) < 1e-12 * Math.abs(a)) return this.vertical(-c / a, colour, dash);
    const end = (x) => [this.px(x), this.py(-(a * x + c) / b)];
    this.path([end(this.x.low), end(this.x.high)], colour, 1, dash);
  }
  image(bitmap, x0, y0, x1, y1) {
    const a = this.px(x0), b = this.py(y1);
    this.ctx.imageSmoothingEnabled = false;
    this.ctx.drawImage(bitmap, a, b, this.px(x1) - a, this.py(y0) - b);
  }
}

// Pointer, wheel, pinch and long press on a plot, told as press(x, y, px, py) -> whether it takes the drag, move, up,
// click, zoom, fit.
export function gestures(plot, on) {
  const { canvas } = plot, down = new Map();
  let drag = null, timer = 0, moved = 0, spread = 0;
  const place = (e) => {
    const b = canvas.getBoundingClientRect();
    return [e.clientX - b.left, e.clientY - b.top];
  };
  const inside = ([px, py]) => plot.x.inside(px) && plot.y.inside(py);
  const tell = (what, place) => on[what]?.(...plot.at(...place), ...place);
  const start = (from) => {
    drag = { from, taken: tell("press", from) !== false };
    canvas.classList.toggle("dragged", drag.taken);
  };
  const stop = () => {
    clearTimeout(timer);
    canvas.classList.remove("dragged", "held");
    drag = null;
  };
  const up = (e) => {
    const had = drag;
    down.delete(e.pointerId);
    stop();
    if (!had || e.type !== "pointerup") return;
    if (moved <= 4) tell("click", place(e));
    else if (had.taken) tell("up", place(e));
  };
  const listeners = {
    pointerdown(e) {
      const from = place(e);
      if (e.button || !inside(from)) return;
      down.set(e.pointerId, from);
      moved = spread = 0;
      if (down.size > 1) return stop();
      if (e.pointerType === "touch") {
        // A finger scrolls the page unless it rests first.
        drag = { from, waiting: true };
        timer = setTimeout(() => {
          canvas.classList.add("held");
          start(from);
          tell("move", from);
        }, 350);
      } else {
        canvas.setPointerCapture(e.pointerId);
        start(from);
      }
    },
    pointermove(e) {
      const to = place(e);
      if (down.has(e.pointerId)) down.set(e.pointerId, to);
      if (down.size === 2) {
        const [[ax, ay], [bx, by]] = [...down.values()], gap = Math.hypot(ax - bx, ay - by);
        if (spread > 0 && gap > 0) on.zoom?.(...plot.at((ax + bx) / 2, (ay + by) / 2), spread / gap);
        spread = gap;
      } else if (drag) {
        moved = Math.max(moved, Math.hypot(to[0] - drag.from[0], to[1] - drag.from[1]));
        if (drag.waiting && moved > 8) stop();
        else if (drag.taken && moved > 2) tell("move", to);
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
      if (!on.zoom || !inside(place(e))) return;
      e.preventDefault();
      on.zoom(...plot.at(...place(e)), Math.exp(clamp(e.deltaY, -60, 60) * 0.004));
    },
    dblclick: () => on.fit?.(),
  };
  for (const [name, act] of Object.entries(listeners)) canvas.addEventListener(name, act, { passive: false });
}
