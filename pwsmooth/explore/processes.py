"""The two processes behind a page, whatever brings it their frames: a socket, or a widget's comm.

Messages go to the process that answers them, and frames come back as they are made; a process that is late is ended and
started anew, and the page is told.
"""

from __future__ import annotations

import contextlib
import functools
import json
import multiprocessing
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from . import worker
from .describe import LIMITS
from .frames import pack
from .state import UNREAD, decoded
from .subject import Subject

_GRACE = 2.0  # a process that is so many limits late is ended
_OF_MAPS = ("diagram", "basins", "section", "noise", "figure", "stop")
_STATE = ("p", "x0", "t_span", "law", "values")  # what a page that looks only does not choose
SHOWN = (*_STATE, "view", "names", "phase")  # of a page's state, what its owner asks for


class Process:
    """A worker and the thread that reads its pipe; `heard(frame)` is called in that thread."""

    def __init__(self, target: Callable[..., None], subject: Subject, heard: Callable[[bytes], None]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=target, args=(theirs, subject), daemon=True)
        self.process.start()
        theirs.close()
        self.asked: float | None = None  # since when an answer is awaited
        threading.Thread(target=self._read, args=(heard,), daemon=True).start()

    def _read(self, heard: Callable[[bytes], None]) -> None:
        with contextlib.suppress(EOFError, OSError, TypeError):  # TypeError: closed while it was read
            while True:
                frame = self.pipe.recv_bytes()
                self.asked = None
                heard(frame)

    def send(self, message: Mapping[str, Any], awaited: bool = True) -> None:
        if awaited and self.asked is None:
            self.asked = time.monotonic()
        with contextlib.suppress(OSError):
            self.pipe.send_bytes(json.dumps(message).encode())

    def end(self) -> None:
        with contextlib.suppress(OSError):
            self.pipe.close()
        self.process.join(0.2)
        if self.process.is_alive():
            self.process.kill()
            self.process.join(1)


class Workers:
    """The processes of one page; `heard(frame)` is called in their readers' threads."""

    def __init__(self, subject: Subject, heard: Callable[[bytes], None], link: str = "") -> None:
        self.subject, self.heard = subject, heard
        self.ready, self.opening, self.over, told = False, False, False, ""
        self.view: Mapping[str, Any] = {}  # the state, or the message that asked for another law or view
        try:
            self.view = self._allowed({"kind": "view", **decoded(link)}) if link else {}
        except ValueError:  # also of text that is no UTF-8
            told = UNREAD
        self.state: dict[str, Any] = {}  # the last that was asked for
        self.maps: Process | None = None
        self._lock = threading.Lock()
        self._start_live(told)

    def _start_live(self, told: str = "") -> None:
        self.opening = False
        begin = functools.partial(worker.live, asked=self.view, told=told)
        self.live = Process(begin, self.subject, self._from_live)

    def _allowed(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """A message without what a page that looks only does not choose."""
        if self.subject.read_only:
            return {key: value for key, value in message.items() if key not in _STATE}
        return message

    def _from_live(self, frame: bytes) -> None:
        if not self.ready and b'"kind":"ready"' in frame[:100]:
            self.ready = True
            self._start_maps()  # after the first: both would compile the same
        # Another law or view is compiled first, which may take a minute; the page has said so already.
        self.opening = b'"kind":"opening"' in frame[:100]
        if not self.opening:
            self.heard(frame)

    def _start_maps(self) -> Process | None:
        with self._lock:
            if self.maps is None and not self.over:
                self.maps = Process(worker.maps, self.subject, self.heard)
                if self.view:
                    self.maps.send(self.view, awaited=False)
            return self.maps

    def message(self, message: Mapping[str, Any]) -> None:
        """Hand what a page says to the process that answers it."""
        message = self._allowed(message)
        kind = message.get("kind")
        if kind in _OF_MAPS:
            if (maps := self._start_maps()) is not None:
                maps.send(message, awaited=False)
            return
        if kind == "view":
            self.view = message
            if self.maps is not None:
                self.maps.send(message, awaited=False)
        elif kind == "orbit":
            self.state = dict(message)
        self.live.send(message, awaited=kind != "view")

    def watch(self) -> None:
        """End the sliders' process where it is late, and start it anew; to be called a few times a second."""
        asked, limit = self.live.asked, _GRACE * LIMITS["seconds"]
        dead = not self.live.process.is_alive()
        late = self.ready and not self.opening and asked is not None and time.monotonic() - asked > limit
        if self.over or not (dead or late):
            return
        old, self.ready = self.live, False
        old.end()
        why = "ended by itself" if dead else f"did not answer within {limit:g} s, the limit of a picture,"
        said = f"The process of the sliders {why} and was started anew; take a shorter span."
        self.heard(pack({"kind": "killed", "why": said}))
        self._start_live()

    def end(self) -> None:
        """End both."""
        self.over = True
        for process in (self.live, self.maps):
            if process is not None:
                process.end()
