"""The two processes behind a page, whatever brings it their frames: a socket, or a widget's comm.

Messages go to the process that answers them, and frames come back as they are made; a process that is late is ended and
started anew, and the page is told.

A process is `python -c`, and none of multiprocessing's: these run the user's script again, which would open another
page in each of them. Only what a script defines itself, such as a function of a sketch, makes a process run it.
"""

from __future__ import annotations

import contextlib
import functools
import json
import multiprocessing
import os
import pickle
import pickletools
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from multiprocessing import connection
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


# SIGINT is the server's: Ctrl-C reaches all processes of a terminal.
_BEGIN = (
    "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    "from pwsmooth.explorer.processes import run; run({})"
)


def packed(what: Any) -> bytes:
    """What a process is given, with the script that defines a part of it; ValueError where no process can have it."""
    try:
        data = pickle.dumps(what)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ValueError(
            f"the page runs in a process of its own, which cannot be given this system: {error}. Define functions and "
            "classes that it needs at the top of a module, not inside of a function."
        ) from None
    path = None
    if any(argument == "__main__" for _, argument, _ in pickletools.genops(data)):
        path = getattr(sys.modules["__main__"], "__file__", None)
        if path is None or not os.path.isfile(path):  # that of a script from the input is "<stdin>"
            raise ValueError(
                "a function or class of the system is defined in this session, where the page's process cannot find "
                "it; define it in a module, a file of its own, and import it from there."
            )
    return pickle.dumps((path and os.path.abspath(path), data))


def run(number: int) -> None:
    """In the process: what comes first through the pipe is called with it."""
    kind = "PipeConnection" if sys.platform == "win32" else "Connection"
    pipe = getattr(connection, kind)(number)
    path, data = pickle.loads(pipe.recv_bytes())
    if path is not None:
        from multiprocessing import spawn

        # As multiprocessing does it: under another name, so that what is guarded is left out.
        process: Any = multiprocessing.current_process()
        process._inheriting = True
        spawn.prepare({"init_main_from_path": path})
        del process._inheriting
    pickle.loads(data)(pipe)


def refuse_in_a_process_that_begins() -> None:
    """RuntimeError where a process runs the user's script again, to have what it defines."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise RuntimeError(
            "explore() is called by a process that another one has started, which runs this script again: put the call "
            'under `if __name__ == "__main__":`, or what the processes need in a module of its own.'
        )


class Process:
    """A worker and the thread that reads its pipe; `heard(frame)` is called in that thread."""

    def __init__(self, target: Callable[..., None], subject: Subject, heard: Callable[[bytes], None]) -> None:
        data = packed(functools.partial(target, subject=subject))
        self.pipe, theirs = multiprocessing.Pipe()
        number = theirs.fileno()
        given: dict[str, Any] = {}
        if sys.platform == "win32":
            os.set_handle_inheritable(number, True)
            given["startupinfo"] = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [number]})
        else:
            given["pass_fds"] = (number,)
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self.process = subprocess.Popen(
            [sys.executable, "-c", _BEGIN.format(number)], stdin=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": paths}, **given,
        )  # fmt: skip
        theirs.close()
        self.asked: float | None = None  # since when an answer is awaited
        with contextlib.suppress(OSError):  # it has ended already
            self.pipe.send_bytes(data)
        threading.Thread(target=self._read, args=(heard,), daemon=True).start()

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

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
        try:
            self.process.wait(0.2)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(1)


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
        self.ends = 0  # of the sliders' process, since it answered last
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
        if b'"kind":"orbit"' in frame[:100]:
            self.ends = 0
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
        dead = not self.live.alive
        late = self.ready and not self.opening and asked is not None and time.monotonic() - asked > limit
        if self.over or not (dead or late):
            return
        if not (self.ready or late):  # it would end again, and again
            self.over = True
            self.heard(
                pack({"kind": "killed", "why": "The page's process could not begin; the terminal says why."})
            )
            return
        old, self.ready, self.ends = self.live, False, self.ends + 1
        old.end()
        what = "ended by itself" if dead else f"did not answer within {limit:g} s, the limit of a picture,"
        said = f"The process of the sliders {what} and was started anew"
        again = self.ends > 1  # the state that it ended at, which the page keeps, is not asked for a third time
        said += ", from the beginning." if again else "." if dead else "; take a shorter span."
        self.heard(pack({"kind": "killed", "why": said, "again": again}))
        self._start_live()

    def end(self) -> None:
        """End both."""
        self.over = True
        for process in (self.live, self.maps):
            if process is not None:
                process.end()
