// A file of frames in the place of a server: one slider, whose value has a frame each.
const { scene, parameter, values, frames, layers, diagram } = JSON.parse(document.getElementById("data").textContent);
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const place = (list, v) => list.indexOf(nearest(list, v));
const mapped = (of, pick) => Object.fromEntries(Object.entries(of).map(([key, v]) => [key, pick(v)]));
let hear, at = 0;
const answers = {
  orbit(m) {
    at = place(values, m.p[parameter]);
    hear(bytes(frames[at]), { seq: m.seq });
  },
  sentence: () => hear(null, { kind: "sentence", said: unpack(bytes(frames[at]))[0].sentence }),
  layer(m) {
    if (!layers[at].length) return;
    const [{ rows, ...same }, { lam, ...arrays }] = unpack(bytes(layers[at])), n = rows.t.length, k = place(rows.t, m.t);
    hear(null, { ...same, ...mapped(rows, (v) => v[k]) }, { lam, ...mapped(arrays, (v) => rowOf(v, k, v.length / n)) });
  },
  diagram: (m) => setTimeout(() => diagram.forEach((f) => hear(bytes(f), { job: m.job }))),
};
globalThis.explorer = mount(document.getElementById("explorer"), {
  open(listen) {
    hear = listen;
    queueMicrotask(() => hear(bytes(scene)));
  },
  send: (m) => answers[m.kind]?.(m),
});
