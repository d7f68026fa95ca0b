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
import json
import secrets
import signal
import threading
from collections.abc import Callable
from typing import Any

from .bundle import static
from .processes import Workers
from .subject import Subject

LONGEST = 16_384  # bytes of a message from a page
PAGES = 4
_FILES = {
    "/": ("index.html", "text/html"), "/style.css": ("style.css", "text/css"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    **{f"/{name}": (name, "text/javascript") for name in ("main.js", "explorer.js", "views.js", "plot.js")},
}  # fmt: skip
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
}  # fmt: skip


class Page:
    """One socket with its two processes."""

    def __init__(self, server: Server, socket: Any, link: str) -> None:
        self.server, self.socket = server, socket
        self.loop = asyncio.get_running_loop()
        self.out: asyncio.Queue[bytes] = asyncio.Queue()
        self.workers = Workers(server.subject, self._put, link)

    def _put(self, frame: bytes) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self.loop.call_soon_threadsafe(self.out.put_nowait, frame)

    async def run(self) -> None:
        sender, dog = (asyncio.create_task(c) for c in (self._send(), self._watch()))
        try:
            async for text in self.socket:
                message = json.loads(text)
                if isinstance(message, dict):
                    self.workers.message(message)
                    self.server.state = self.workers.state
        except (ValueError, RecursionError):
            await self.socket.close(1003, "not JSON")
        finally:
            sender.cancel()
            dog.cancel()
            await asyncio.to_thread(self.workers.end)

    async def _send(self) -> None:
        while True:
            await self.socket.send(await self.out.get())

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(0.25)
            await asyncio.to_thread(self.workers.watch)


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
            await asyncio.gather(*(asyncio.to_thread(page.workers.end) for page in self.pages))

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
            headers = {
                "Content-Type": f"{kind}; charset=utf-8",
                "Content-Length": str(len(body)),
                "Connection": "close",
            }
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
            token, link = (
                (first.get(key, "") for key in ("token", "state")) if isinstance(first, dict) else ("", "")
            )
        except (ValueError, RecursionError, TimeoutError, ConnectionClosed):
            token = link = ""
        if not (isinstance(token, str) and hmac.compare_digest(token.encode(), self.token.encode())):
            await socket.close(
                4403, "the token of this address is missing or old; open the address that the terminal prints"
            )
            return
        if len(self.pages) >= PAGES:
            await socket.close(4429, f"{PAGES} pages are open, the most; close one")
            return
        page = Page(self, socket, link if isinstance(link, str) else "")
        self.pages.add(page)
        try:
            with contextlib.suppress(ConnectionClosed):
                await page.run()
        finally:
            self.pages.discard(page)
