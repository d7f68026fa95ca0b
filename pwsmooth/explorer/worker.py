"""The two processes of a page: one answers its sliders, one its maps. Each reads a pipe of JSON and writes frames.

Newest wins: the first drains its pipe and answers the last of each kind; the second looks at its pipe between two
pieces of its jobs, and a newer job of a kind takes the place of the older one. Both end with their pipe.
"""

from __future__ import annotations

import contextlib
import json
import math
import signal
import time
import traceback
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..door import checks
from ..paths.stiffness import passes_only
from .describe import LIMITS, describe
from .frames import pack
from .state import first_state, restored
from .subject import Subject


def live(pipe: Any, subject: Subject, asked: Mapping[str, Any], told: str = "") -> None:
    """Answers "orbit", "layer", "sentence", "code" and "view"; begins with the state `asked` for, and what is told."""
    from .code import script

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server says when it is over
    try:
        current = _opened(subject, asked, pipe, told)
    except (ValueError, TypeError, KeyError) as error:  # no such law or view
        own = {"view": "", "law": "", "values": {}}
        current = _opened(subject, {**asked, **own}, pipe, str(error.args[0] if error.args else error))
    pipe.send_bytes(pack({"kind": "ready"}))
    for message in _newest(pipe):
        kind = message.get("kind")
        try:
            if kind == "orbit":
                header, arrays = current.orbit(message)
            elif kind == "layer":
                header, arrays = current.layer(message)
            elif kind == "sentence":
                header, arrays = current.sentence()
            elif kind == "code":
                header, arrays = {"kind": "code", "text": script(current.subject, message)}, {}
            elif kind == "view":
                pipe.send_bytes(pack({"kind": "opening"}))
                current = _opened(subject, message, pipe)
                continue
            else:
                header, arrays = {"kind": "pong"}, {}
        except (ValueError, TypeError, KeyError) as error:
            header, arrays = {"kind": "refused", "why": str(error.args[0] if error.args else error)}, {}
        except Exception as error:  # one state must not end what answers all others
            traceback.print_exc()
            said = f"{type(error).__name__}: {error}. This is a fault of pwsmooth; the terminal shows where."
            header, arrays = {"kind": "refused", "why": said}, {}
        with contextlib.suppress(BrokenPipeError):  # the page has gone: the next look at the pipe tells it
            pipe.send_bytes(pack({**header, "seq": message.get("seq", 0), "to": kind}, arrays))


def _opened(subject: Subject, asked: Mapping[str, Any], pipe: Any, told: str = "") -> Any:
    """Live of a subject with the law and in the view `asked` for, compiled; the page is told its scene and state."""
    from .live import Live
    from .presets import as_asked

    subject = as_asked(subject, asked)
    current, known = Live(subject), describe(subject)
    names = [*known["states"][:8], *known["outputs"][:8], *known["characteristic"]]
    current.orbit({"names": names, "phase": known["phase"]})  # compiles, or loads what was compiled
    for name in known["switches"][:1]:
        current.layer({"switch": name, "t": subject.t_span[0]})
    known = describe(subject, current.solution, asked.get("view"))
    own = first_state(known, {})
    known["own"] = {key: own[key] for key in ("p", "x0", "t_span")}
    if asked.get("turned") == "law":  # what moves is the same, what is of the law begins anew
        x0 = checks.mapping(asked.get("x0", {}), "`x0`")
        asked = {**asked, "x0": {n: v for n, v in x0.items() if n in subject.moving}}
    known["state"], left = restored(known, asked)
    if left and not asked.get("turned"):
        told = f"Not of this system, and left out: {', '.join(left)}."
    pipe.send_bytes(pack({"kind": "scene", **known, "told": told}))
    return current


def maps(pipe: Any, subject: Subject) -> None:
    """Runs "diagram", "basins", "section" and "noise" side by side, a piece of each in turn; all else at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    jobs = _Jobs(pipe, subject)
    try:
        jobs.warm()
        while True:
            while pipe.poll(None if not jobs.running else 0):
                jobs.hear(json.loads(pipe.recv_bytes()))
            for kind in list(jobs.running):
                jobs.advance(kind)
    except (EOFError, OSError):
        return


class _Jobs:
    """The maps on their way; of each kind the newest."""

    def __init__(self, pipe: Any, subject: Subject) -> None:
        self.pipe, self.own, self.subject = pipe, subject, subject
        self.running: dict[
            str, tuple[Any, Any, float]
        ] = {}  # kind -> its generator, its number, its end in time

    def warm(self) -> None:
        """Compile what the first maps need, before they are asked for."""
        from .maps import JOBS

        subject, taken = self.own, math.inf
        names = [s.name for s in subject.system.states][:2]
        around = [[subject.start[n] - 1e-3, subject.start[n] + 1e-3] for n in names]
        with contextlib.suppress(ValueError, TypeError, KeyError, RuntimeError):  # told when it is asked for
            for parameter, value in list(subject.system.parameters.items())[:1]:
                for _ in range(2):  # once to compile
                    begun, span = time.perf_counter(), [value, value * (1 + 1e-9)]
                    next(JOBS["diagram"](subject, {"parameter": parameter.name, "range": span, "columns": 2}))
                    taken = time.perf_counter() - begun
            if taken < 0.1:  # Newton's method, too; where orbits are slow, this would take minutes
                next(JOBS["basins"](subject, {"axes": names, "ranges": around, "cells": 2}))
            if passes_only(subject.system.model):  # a slider may make it so stiff that implicit steps are taken
                subject.solve(subject.t_span, subject.start, {}, method="stiff", max_steps=1)

    def hear(self, message: dict[str, Any]) -> None:
        """Begin what is asked for, in the place of what ran of its kind."""
        from .code import TYPES, figure
        from .maps import JOBS
        from .presets import as_asked

        kind, job = str(message.get("kind")), message.get("job", 0)
        try:
            if kind == "stop":
                for ended in [str(message["what"])] if "what" in message else list(self.running):
                    self.end(ended)
            elif kind == "view":
                self.subject = as_asked(self.own, message)
            elif kind == "figure":
                ending, picture = (
                    message.get("format", "png"),
                    np.frombuffer(figure(self.subject, message), np.uint8),
                )
                self.pipe.send_bytes(
                    pack({"kind": kind, "name": f"explore.{ending}", "type": TYPES[ending]}, {"file": picture})
                )
            elif kind in JOBS:
                self.end(kind)
                self.running[kind] = JOBS[kind](self.subject, message), job, time.monotonic() + LIMITS["job"]
        except (ValueError, TypeError, KeyError, RuntimeError) as error:
            self.refuse(kind, job, error)

    def advance(self, kind: str) -> None:
        """A piece of a job."""
        pieces, job, end = self.running[kind]
        try:
            header, arrays = next(pieces)
            self.pipe.send_bytes(pack({**header, "job": job}, arrays))
            if time.monotonic() > end:
                raise ValueError(f"the job took {LIMITS['job']:g} s, the most that the page allows.")
        except StopIteration:
            self.end(kind)
        except (ValueError, TypeError, KeyError, RuntimeError) as error:
            self.end(kind)
            self.refuse(kind, job, error)

    def end(self, kind: str) -> None:
        if kind in self.running:
            self.running.pop(kind)[0].close()

    def refuse(self, kind: str, job: Any, error: Exception) -> None:
        if kind == "view":
            return  # the sliders' process says it
        said = str(error.args[0] if error.args else error)
        self.pipe.send_bytes(pack({"kind": "refused", "why": said, "to": kind, "job": job}))


def _newest(pipe: Any) -> Iterator[dict[str, Any]]:
    """Messages as they come; of those that wait together the last of each kind."""
    while True:
        waiting: dict[str, dict[str, Any]] = {}
        try:
            while True:
                message = json.loads(pipe.recv_bytes())
                waiting[str(message.get("kind"))] = message
                if not pipe.poll():
                    break
        except (EOFError, OSError):
            return
        yield from waiting.values()
