"""One file that needs no Python: the page's module with the pictures of every value of a slider inside.

Numbers are quantised to 16 bits of their range, and points that show no bend are left out; the file asks nothing of any
other, so that it opens from a disk, on a phone and in a documentation.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..door import checks
from .bundle import module, static, style
from .describe import describe
from .frames import pack
from .labels import spelled, written
from .live import Live, state_of
from .maps import diagram as columns_of
from .state import restored
from .subject import VIEWS, Subject

MOST = 5_000_000  # bytes of a file
_POINTS = 1000  # of a picture
_CHORDS = (5e-4, 1e-3, 2e-3, 4e-3, 8e-3)  # of the range, of which the first that leaves so few points is taken
_NARROW = 560  # px: what stands within another page has less room than a screen, and one slider only
_POSES = 250  # of the mechanism
_LAYERS = 32  # instants at which the layer is kept

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy"
  content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>{style}</style>
<div id="explorer" class="explorer alone"></div>
<script type="application/json" id="data">{data}</script>
<script type="module">
{module}
{transport}
</script>
</html>
"""


def standalone(
    subject: Subject, over: Mapping[Any, Any], *, views: Any = None, diagram: bool = False, state: Any = None
) -> str:
    """The text of an HTML file in which one parameter has a slider over these values.

    `views`: which of time, mechanism, phase, characteristic and layer; `diagram`: with the orbit diagram, too.
    ValueError where it would be too large, with the number of values that fits.
    """
    given = checks.mapping(over, "`over`", "one parameter to its values")
    if len(given) != 1:
        raise ValueError(f"`over` has {len(given)} parameters; a file has one slider, give one.")
    ((key, values),) = given.items()
    name = checks.lookup(key, subject.system.parameters, "`over`", "parameter").name
    values = np.unique(checks.numbers(values, f"`over` of {name}"))
    for view in () if views is None else checks.several(views, "`views`"):
        checks.one_of(*VIEWS)(view, "`views`")
    shown = tuple(views or ("time", "mechanism", "phase", "characteristic", "layer")) + ("diagram",) * diagram
    if "mechanism" not in shown:
        subject = replace(subject, sketch=None)
    asked = dict(state or {})
    p, _, _ = state_of(subject, asked)
    live, frames, layers = Live(subject), [], {}
    live.orbit(asked)  # what it compiles takes no time from the runs below, which have little
    known = describe(subject)
    names = list(dict.fromkeys([*known["names"], *known["phase"], *known["characteristic"]]))
    for k, value in enumerate(values.tolist()):
        header, arrays = live.orbit({**asked, "p": {**p, name: value}, "names": names, "phase": known["phase"]})
        if header["kind"] == "refused":
            raise ValueError(f"`over` of {name} has {value:g}, which the system refuses: {header['why']}")
        keep = _thinned(arrays)
        header |= {"to": "orbit", "sentence": live.sentence()[0]["said"]}
        kept = {
            "t": arrays["t"][keep],
            "status": arrays["status"][:, keep],
            "values": arrays["values"][:, keep],
        }
        if "pose" in arrays:
            few = slice(None, None, max(1, len(arrays["pose_t"]) // _POSES))
            kept |= {"pose": arrays["pose"][:, few], "pose_t": arrays["pose_t"][few]}
        frames.append(_text(pack(header, kept, short=True)))
        if "layer" in shown and known["switches"]:
            layers[k] = _layers(live, known["switches"][0], *header["asked"])
    scene = describe(replace(subject, views=shown), live.solution)
    (control,) = [c for c in scene["controls"] if c["name"] == name] or [None]
    scene |= {
        "kind": "scene", "alone": True, "locked": True, "start": {**scene["start"], **asked.get("x0", {})},
        "controls": [{**(control or {"name": name, "unit": "", "meaning": "", "sign": "real"}), "log": False,
                      "min": values[0], "max": values[-1], "value": _nearest(values, p.get(name, _own(subject, name))),
                      "grid": values.tolist(), "span": (values[0], values[-1])}],
        "switches": scene["switches"][:1],
        "map": {"ok": diagram, "parameter": name, "sections": [], "views": {}, "why": ""},
        "labels": {**scene["labels"], name: (*spelled(name), written(name), written(name))}, "menus": {},
    }  # fmt: skip
    scene["state"], _ = restored(scene, {"x0": scene["start"]})
    grown = []
    if diagram:
        request = {**asked, "parameter": name, "range": [values[0], values[-1]], "columns": 400, "keep": 64}
        grown = [_column_frame(known["states"][0], *answer) for answer in columns_of(subject, request)]
    data = {"scene": _text(pack(scene)), "parameter": name, "values": values.tolist(), "frames": frames,
            "layers": [layers.get(k, "") for k in range(len(values))], "diagram": grown}  # fmt: skip
    text = _PAGE.format(
        title=html.escape(subject.name), style=style(_NARROW), module=module(_NARROW),
        transport=static("file.js").decode(), data=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
    )  # fmt: skip
    if len(text) > MOST:
        fits = int(len(values) * (MOST - 2e5) / len(text))
        raise ValueError(
            f"the file would be {len(text) / 1e6:.1f} MB, of {MOST / 1e6:g} MB at the most; {fits} values fit, or "
            "fewer `views`."
        )
    return text


def _column_frame(state: str, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    """A frame of the diagram with one state alone."""
    arrays = dict(arrays)
    if arrays:
        arrays["points"] = arrays["points"][..., [header["names"].index(state)]]
        arrays["last"] = arrays["points"][:, -1]
    said = header["said"].replace("; drag: zoom", "")
    return _text(pack({**header, "names": [state], "job": 0, "said": said}, arrays, short=True))


def _text(frame: bytes) -> str:
    return base64.b64encode(frame).decode()


def _own(subject: Subject, name: str) -> float:
    return next(float(v) for s, v in subject.system.parameters.items() if s.name == name)


def _nearest(values: np.ndarray, value: float) -> float:
    return float(values[np.argmin(np.abs(values - value))])


def _layers(live: Live, switch: str, begin: float, end: float) -> str:
    """The layers at instants of the span in one frame: each array has a row for each."""
    times = np.linspace(begin, end, _LAYERS)
    found = [live.layer({"switch": switch, "t": float(t)}) for t in times]
    header = {key: [_rounded(h[key]) for h, _ in found] for key in found[0][0] if key not in ("kind", "switch")}
    arrays = {name: np.stack([a[name][::4] for _, a in found]) for name in found[0][1] if name != "lam"}
    arrays["lam"] = found[0][1]["lam"][::4]
    same = {key: found[0][0][key] for key in ("kind", "switch")}
    return _text(pack({**same, "rows": header}, arrays, short=True))


def _rounded(item: Any) -> Any:
    if isinstance(item, str):
        return item
    return [_rounded(value) for value in item] if isinstance(item, list) else float(f"{item:.5g}")


def _thinned(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Points that are kept: the ends of statuses, and what bends."""
    t, values = arrays["t"], arrays["values"]
    curves = np.vstack([t, values])
    size = np.ptp(np.where(np.isfinite(curves), curves, 0), axis=1)
    curves = curves / np.where(size > 0, size, 1)[:, None]
    changes = np.flatnonzero(np.any(np.diff(arrays["status"]) != 0, axis=0))
    fixed = np.unique([0, len(t) - 1, *changes, *(changes + 1)]).astype(int)
    for chord in _CHORDS:
        kept = np.concatenate([[0], *(_bends(curves, a, b, chord) for a, b in zip(fixed, fixed[1:]))]).astype(
            int
        )
        if len(kept) <= _POINTS:
            break
    return kept


def _bends(curves: np.ndarray, first: int, last: int, chord: float) -> list[int]:
    """Points after `first`, up to `last`, between which the curves are as near to their chord (Douglas and Peucker)."""
    found, waiting = [], [(first, last)]
    while waiting:
        a, b = waiting.pop()
        if b - a > 1:
            u = np.linspace(0, 1, b - a + 1)[1:-1] if curves[0, b] == curves[0, a] else (
                (curves[0, a + 1 : b] - curves[0, a]) / (curves[0, b] - curves[0, a])
            )  # fmt: skip
            off = np.abs(curves[1:, a + 1 : b] - curves[1:, [a]] - (curves[1:, [b]] - curves[1:, [a]]) * u).max(
                axis=0
            )
            k = int(np.argmax(off))
            if off[k] > chord:
                waiting += [(a, a + 1 + k), (a + 1 + k, b)]
                continue
        found.append(b)
    return sorted(found)
