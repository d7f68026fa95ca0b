"""What a page shows, as data: the state of a subject, with what a link or another law or view brings."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from typing import Any

UNREAD = "The state in this address cannot be read; the system's own is shown."


def decoded(text: str) -> dict[str, Any]:
    """The state of a link; ValueError where it is none."""
    asked = json.loads(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
    if not isinstance(asked, dict):
        raise ValueError("it is no mapping")
    return asked


def first_state(known: Mapping[str, Any], model: Mapping[str, Any]) -> dict[str, Any]:
    """The state that a described subject has by itself; `model` is the law and view that were asked for."""
    (begin, end), states = known["t_span"], known["states"]
    return {
        "v": 1, "view": "", "law": "", "values": {}, **model,
        "p": {c["name"]: c["value"] for c in known["controls"]}, "x0": known["start"], "t_span": known["t_span"],
        "cursor": begin + 0.62 * (end - begin), "names": known["names"], "phase": known["phase"],
        "switch": next(iter(known["switches"]), ""), "section": None, "ranges": {},
        "diagram": {"parameter": known["map"]["parameter"] or "", "range": None, "y": states[0], "carry": 0},
        "basins": {"axes": states[:2], "ranges": [known["axes"][n] for n in states[:2]]},
        "noise": {"name": next(iter(known["names"]), ""), "seed": 0},
    }  # fmt: skip


def restored(known: Mapping[str, Any], asked: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The state with what of `asked` this subject knows, and the names of the rest."""
    state = first_state(known, {k: asked[k] for k in ("view", "law", "values") if k in asked})
    left = [key for key in asked if key not in state and key not in ("kind", "turned")]
    for group in ("p", "x0"):
        given = _mapping(asked.get(group))
        taken = {n: v for n, v in given.items() if n in state[group] and _is_number(v)}
        left += [n for n in given if n not in taken]
        state[group] = {**state[group], **taken}
    for key, holds in _holding(known, state["p"]).items():
        try:
            if holds(asked[key]):
                state[key] = asked[key]
        except (KeyError, TypeError, AttributeError, IndexError):  # not given, or of another kind altogether
            continue
    ranges = _mapping(asked.get("ranges"))
    state["ranges"] = {n: r for n, r in ranges.items() if n in state["p"] and _is_pair(r)}
    return state, left


def _holding(known: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """What each part of a state must be to be taken."""
    names, states = {*known["states"], *known["multipliers"], *known["outputs"]}, known["states"]

    def several(given: Any, least: int, most: int) -> bool:
        return isinstance(given, list) and least <= len(given) <= most and set(given) <= names

    return {
        "t_span": _is_pair,
        "cursor": _is_number,
        "names": lambda s: several(s, 1, 4),
        "phase": lambda s: several(s, 2, 2),
        "switch": lambda s: s in known["switches"],
        "section": lambda s: len(s) == 2 and s[0] in states and s[1] in (1, -1),
        "basins": lambda b: several(b["axes"], 2, 2) and set(b["axes"]) <= set(states)
        and len(b["ranges"]) == 2 and all(map(_is_pair, b["ranges"])),
        "noise": lambda n: n["name"] in names and type(n["seed"]) is int and n["seed"] >= 0,
        "diagram": lambda d: d["parameter"] in p and d["y"] in states and d["carry"] in (0, 1, -1)
        and (d["range"] is None or _is_pair(d["range"])),
    }  # fmt: skip


def _mapping(given: Any) -> Mapping[str, Any]:
    return given if isinstance(given, dict) else {}


def _is_number(given: Any) -> bool:
    return type(given) in (int, float) and math.isfinite(given)


def _is_pair(given: Any) -> bool:
    return isinstance(given, list) and len(given) == 2 and all(map(_is_number, given)) and given[0] < given[1]
