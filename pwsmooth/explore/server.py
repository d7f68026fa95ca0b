"""The server: files and one socket, on this machine alone, no arithmetic.

Who may come in. Host must be ours (a name that another site rebinds to this machine is not), a socket's Origin exactly
ours, and its first message has to hold the token, 144 bits that stand in the fragment of the printed address: browsers
send fragments to nobody. No cookie: these ignore ports, so that other servers of this machine would be sent it.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import http
import importlib.resources
import json
import multiprocessing
import secrets
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

from . import worker
from .describe import LIMITS
from .frames import pack
from .subject import Subject

LONGEST = 16_384  # bytes of a message from a page
PAGES = 4
_GRACE = 2.0  # a process that is so many limits late is ended
_FILES = {
    "/": ("index.html", "text/html"), "/main.js": ("main.js", "text/javascript"),
    "/explorer.js": ("explorer.js", "text/javascript"),
    "/plot.js": ("plot.js", "text/javascript"), "/views.js": ("views.js", "text/javascript"),
    "/style.css": ("style.css", "text/css"), "/icon.svg": ("icon.svg", "image/svg+xml"),
}  # fmt: skip
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}  # fmt: skip


def static(name: str) -> bytes:
    """A file of the page."""
    return importlib.resources.files(__package__).joinpath("static", name).read_bytes()


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

    def send(self, message: dict[str, Any], awaited: bool = True) -> None:
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


class Page:
    """One socket with its two processes."""

    def __init__(self, server: Server, socket: Any) -> None:
        self.server, self.socket = server, socket
        self.loop = asyncio.get_running_loop()
        self.out: asyncio.Queue[bytes] = asyncio.Queue()
        self.ready = False
        self.view = ""
        self.live = Process(worker.live, server.subject, self._from_live)
        self.maps: Process | None = None

    def _put(self, frame: bytes) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self.loop.call_soon_threadsafe(self.out.put_nowait, frame)

    def _from_live(self, frame: bytes) -> None:
        if not self.ready and b'"kind":"ready"' in frame[:100]:
            self.ready = True
            self.loop.call_soon_threadsafe(self._start_maps)  # after the first: both would compile the same
        self._put(frame)

    def _start_maps(self) -> None:
        if self.maps is None:
            self.maps = Process(worker.maps, self.server.subject, self._put)
            if self.view:
                self.maps.send({"kind": "view", "view": self.view}, awaited=False)

    async def run(self) -> None:
        sender, dog = (asyncio.create_task(c) for c in (self._send(), self._watch()))
        try:
            async for text in self.socket:
                message = json.loads(text)
                if not isinstance(message, dict):
                    continue
                kind = message.get("kind")
                if kind == "ping":  # an empty round trip, for benchmarks
                    self.live.send(message)
                elif kind in ("diagram", "basins", "section", "figure", "stop"):
                    self._start_maps()
                    self.maps.send(message, awaited=False)  # type: ignore[union-attr]
                else:
                    if kind == "view":
                        self.view = str(message.get("view", ""))
                        if self.maps is not None:
                            self.maps.send(message, awaited=False)
                    if kind == "orbit":
                        self.server.state = message
                    self.live.send(message, awaited=kind != "view")
        except (ValueError, RecursionError):
            await self.socket.close(1003, "not JSON")
        finally:
            sender.cancel()
            dog.cancel()
            await asyncio.to_thread(self.end)

    async def _send(self) -> None:
        while True:
            await self.socket.send(await self.out.get())

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(0.25)
            asked, limit = self.live.asked, _GRACE * LIMITS["seconds"]
            dead = not self.live.process.is_alive()
            if dead or (self.ready and asked is not None and time.monotonic() - asked > limit):
                old, self.ready, self.view = self.live, False, ""
                await asyncio.to_thread(old.end)
                why = "ended by itself" if dead else f"did not answer within {limit:g} s, the limit of a picture,"
                self._put(pack({"kind": "killed", "why": f"The process of the sliders {why} and was started anew; "
                                "take a shorter span."}))  # fmt: skip
                self.live = Process(worker.live, self.server.subject, self._from_live)

    def end(self) -> None:
        for process in (self.live, self.maps):
            if process is not None:
                process.end()


class Server:
    """Serves one subject on 127.0.0.1, and nowhere else."""

    def __init__(self, subject: Subject, port: int = 0) -> None:
        self.subject, self.port = subject, port
        self.token = secrets.token_urlsafe(18)
        self.pages: set[Page] = set()
        self.state: dict[str, Any] = {}  # the last that a page asked for
        self.fragment = ""
        self._stop: asyncio.Event | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self.started = threading.Event()
        self.error: BaseException | None = None

    @property
    def url(self) -> str:
        """With the token; valid while the server runs."""
        return f"http://127.0.0.1:{self.port}/#t={self.token}{self.fragment}"

    async def serve(self, told: Callable[[], None] = lambda: None) -> None:
        """Serve until `stop`."""
        from websockets.asyncio.server import serve

        self._stop, self._loop = asyncio.Event(), asyncio.get_running_loop()
        async with serve(
            self._socket, "127.0.0.1", self.port, process_request=self._request, max_size=LONGEST, compression=None,
            server_header=None, close_timeout=1,
        ) as server:  # fmt: skip
            self.port = next(iter(server.sockets)).getsockname()[1]
            if threading.current_thread() is threading.main_thread():
                for which in (signal.SIGINT, signal.SIGTERM):
                    with contextlib.suppress(NotImplementedError):  # Windows
                        self._loop.add_signal_handler(which, self._stop.set)
            self.started.set()
            told()
            await self._stop.wait()
            await asyncio.gather(*(asyncio.to_thread(page.end) for page in self.pages))

    def start(self) -> None:
        """Serve in a thread of its own; returns when it listens."""

        def run() -> None:
            try:
                asyncio.run(self.serve())
            except BaseException as error:
                self.error = error
                self.started.set()

        threading.Thread(target=run, daemon=True).start()
        self.started.wait()
        if self.error is not None:
            raise self.error

    def stop(self) -> None:
        """End the server and all its processes."""
        if self._loop is not None and self._stop is not None:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._stop.set)

    def _request(self, connection: Any, request: Any) -> Any:
        """Refusals and files; None lets a socket in."""
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        def answer(status: http.HTTPStatus, body: bytes, kind: str = "text/plain") -> Any:
            headers = {"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body)), "Connection": "close"}
            return Response(status.value, status.phrase, Headers(headers | _HEADERS), body)

        hosts = {f"{name}:{self.port}" for name in ("127.0.0.1", "localhost")}
        host, origin = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(host) != 1 or host[0] not in hosts:
            return answer(http.HTTPStatus.FORBIDDEN, b"This is not the address of the explorer.\n")
        path = request.path.partition("?")[0]
        if path == "/socket":
            if origin == [f"http://{host[0]}"]:
                return None
            return answer(http.HTTPStatus.FORBIDDEN, b"Only the explorer's own page may speak to it.\n")
        if path not in _FILES:
            return answer(http.HTTPStatus.NOT_FOUND, b"There is no such file.\n")
        name, kind = _FILES[path]
        return answer(http.HTTPStatus.OK, static(name), kind)

    async def _socket(self, socket: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            first = json.loads(await asyncio.wait_for(socket.recv(), 10))
            token = first.get("token", "") if isinstance(first, dict) else ""
        except (ValueError, RecursionError, TimeoutError, ConnectionClosed):
            token = ""
        if not (isinstance(token, str) and hmac.compare_digest(token.encode(), self.token.encode())):
            await socket.close(4403, "the token is not that of this explorer")
            return
        if len(self.pages) >= PAGES:
            await socket.close(4429, f"{PAGES} pages are open, the most; close one")
            return
        page = Page(self, socket)
        self.pages.add(page)
        try:
            with contextlib.suppress(ConnectionClosed):
                await page.run()
        finally:
            self.pages.discard(page)
