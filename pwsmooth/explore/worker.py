"""The two processes of a page: one answers its sliders, one its maps. Each reads a pipe of JSON and writes frames.

Newest wins: the first drains its pipe and answers the last of each kind; the second looks at its pipe between two
pieces of a job, and a newer message ends it. Both end with their pipe.
"""

from __future__ import annotations

import contextlib
import json
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from .describe import LIMITS, describe
from .frames import pack
from .subject import Subject


def live(pipe: Any, subject: Subject) -> None:
    """Answers "orbit", "layer", "sentence", "code" and "view"."""
    from .code import script
    from .presets import in_view

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server says when it is over
    current = _opened(subject, pipe)
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
                current = _opened(in_view(subject, str(message.get("view", ""))), pipe)
                continue
            else:
                header, arrays = {"kind": "pong"}, {}
        except (ValueError, TypeError, KeyError) as error:
            header, arrays = {"kind": "refused", "why": str(error.args[0] if error.args else error)}, {}
        with contextlib.suppress(BrokenPipeError):  # the page has gone: the next look at the pipe tells it
            pipe.send_bytes(pack({**header, "seq": message.get("seq", 0), "to": kind}, arrays))


def _opened(subject: Subject, pipe: Any) -> Any:
    """Live of a subject, compiled, whose scene the page has been told."""
    from .live import Live

    current, known = Live(subject), describe(subject)
    names = [*known["states"][:8], *known["outputs"][:8], *known["characteristic"]]
    current.orbit({"names": names, "phase": known["phase"]})  # compiles, or loads what was compiled
    for name in known["switches"][:1]:
        current.layer({"switch": name, "t": subject.t_span[0]})
    pipe.send_bytes(pack({"kind": "scene", **describe(subject, current.solution)}))
    return current


def maps(pipe: Any, subject: Subject) -> None:
    """Runs jobs: "diagram", "basins", "section", "figure"; "stop" ends one."""
    from .code import figure
    from .maps import JOBS
    from .presets import in_view

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    own = subject
    if subject.period is not None and not subject.system.model.smoothing:
        for parameter, at in list(subject.system.parameters.items())[:1]:
            asked = {
                "parameter": parameter.name,
                "range": [at, at * (1 + 1e-9) + 1e-9],
                "columns": 2,
                "keep": 2,
            }
            for _ in JOBS["diagram"](subject, asked):
                break
        names = [s.name for s in subject.system.states][:2]
        if len(names) == 2:  # Newton's method, too
            around = [[subject.start[n] - 1e-3, subject.start[n] + 1e-3] for n in names]
            for _ in JOBS["basins"](subject, {"axes": names, "ranges": around, "cells": 2}):
                break
    message: dict[str, Any] | None = None
    while True:
        if message is None:
            try:
                message = json.loads(pipe.recv_bytes())
            except (EOFError, OSError):
                return
        job, message, begun = message, None, time.monotonic()
        head = {"job": job.get("job", 0)}
        try:
            if job.get("kind") == "view":
                subject = in_view(own, str(job.get("view", "")))
            elif job.get("kind") == "figure":
                picture = np.frombuffer(figure(subject, job), np.uint8)
                pipe.send_bytes(
                    pack({"kind": "figure", "format": job.get("format", "png"), **head}, {"file": picture})
                )
            elif job.get("kind") in JOBS:
                for header, arrays in JOBS[job["kind"]](subject, job):
                    pipe.send_bytes(pack({**header, **head}, arrays))
                    if pipe.poll():
                        message = json.loads(pipe.recv_bytes())
                        break
                    if time.monotonic() - begun > LIMITS["job"]:
                        raise ValueError(f"the job took {LIMITS['job']:g} s, the most that the page allows.")
        except (EOFError, OSError):
            return
        except (ValueError, TypeError, KeyError, RuntimeError) as error:
            said = str(error.args[0] if error.args else error)
            pipe.send_bytes(pack({"kind": "refused", "why": said, "to": job.get("kind"), **head}))


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
