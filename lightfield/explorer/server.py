"""The server: this machine alone, one browser that knows a secret, and nothing but the page's own files."""

from __future__ import annotations

import asyncio
import secrets
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

from lightfield.explorer.documents import DOCUMENTS
from lightfield.explorer.hub import Hub
from lightfield.explorer.protocol import MOST_FILE_BYTES
from lightfield.explorer.session import Session
from lightfield.explorer.state import History

_PAGE = Path(__file__).parent / "page"
#: Files of the page, by the name under which they are asked for: nothing else is served.
_FILES = {
    "explorer.css": "text/css",
    "values.js": "text/javascript",
    "plots.js": "text/javascript",
    "maps.js": "text/javascript",
    "panels.js": "text/javascript",
    "live.js": "text/javascript",
}
_ADDRESS = "127.0.0.1"
#: Seconds between signs of life on a connection, and bytes of a request that is no file at most.
_PING_S, _MOST_BODY = 20, 1000
#: Escapes in a dropped file's JSON: at most so many bytes for one.
_ESCAPED = 2


class Gate:
    """Who may in: whoever brings the token, once; then the browser that it was given to.

    Parameters
    ----------
    port : int
        Where the server listens.
    """

    def __init__(self, port: int) -> None:
        self.hosts = {f"{_ADDRESS}:{port}", f"localhost:{port}"}
        self.token: str | None = secrets.token_urlsafe(24)
        self._key, self.cookie = secrets.token_urlsafe(24), f"lightfield-{port}"
        self.address = f"http://{_ADDRESS}:{port}/?token={self.token}"

    def exchange(self, token: str) -> str | None:
        """What the cookie holds, for the right token; it is worth nothing afterwards."""
        if self.token is None or not secrets.compare_digest(token.encode(), self.token.encode()):
            return None
        self.token = None
        return self._key

    def admits(self, cookie: str | None) -> bool:
        """Is this the browser that brought the token?"""
        return cookie is not None and secrets.compare_digest(cookie.encode(), self._key.encode())

    @property
    def policy(self) -> str:
        """Content-Security-Policy of the page."""
        sockets = " ".join(f"ws://{host}" for host in sorted(self.hosts))
        return (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
            f"connect-src 'self' {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )


class _Guarded(tornado.web.RequestHandler):
    """Refuses whoever is not admitted."""

    def initialize(self, gate: Gate, hub: Hub) -> None:
        self.gate, self.hub = gate, hub

    def set_default_headers(self) -> None:
        self.clear_header("Server")
        for name, value in {
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
        }.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        self.set_header("Content-Security-Policy", self.gate.policy)
        if self.request.host not in self.gate.hosts:
            raise tornado.web.HTTPError(403, reason="Another host")
        origin = self.request.headers.get("Origin")
        if origin is not None and origin not in {f"http://{host}" for host in self.gate.hosts}:
            raise tornado.web.HTTPError(403, reason="Another origin")
        if not self.gate.admits(self.get_cookie(self.gate.cookie)):
            self.refused()

    def refused(self) -> None:
        """Nobody who is not admitted gets farther than here."""
        raise tornado.web.HTTPError(403, reason="Not admitted")

    def write_error(self, status_code: int, **_: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        more = ""
        if status_code == 403:
            more = (
                ". The address that the explorer says at its start opens the page once, in one browser; "
                "start it again for another."
            )
        self.finish(f"{status_code} {self._reason}{more}\n")


class _Page(_Guarded):
    def refused(self) -> None:
        key = self.gate.exchange(self.get_query_argument("token", ""))
        if key is None:
            super().refused()
            return
        self.set_cookie(self.gate.cookie, key, httponly=True, samesite="Strict", path="/")
        self.redirect("/", status=303)

    def get(self) -> None:
        if self.get_query_arguments("token"):
            self.redirect("/", status=303)  # the token does not stay in the address
            return
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish((_PAGE / "index.html").read_bytes())


class _File(_Guarded):
    def get(self, name: str) -> None:
        if name not in _FILES:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", f"{_FILES[name]}; charset=utf-8")
        self.finish((_PAGE / name).read_bytes())


class _Document(_Guarded):
    async def get(self, name: str) -> None:
        if name not in DOCUMENTS or not self.hub.ready:
            raise tornado.web.HTTPError(404)
        kind, make = DOCUMENTS[name]
        text = await self.hub.make(make)
        if text is None:
            raise tornado.web.HTTPError(404, reason="Not there yet")
        self.set_header("Content-Type", f"{kind}; charset=utf-8")
        self.set_header("Content-Disposition", f'attachment; filename="{name}"')
        self.finish(text)


class _Socket(tornado.websocket.WebSocketHandler):
    """A page that is connected."""

    def initialize(self, gate: Gate, hub: Hub) -> None:
        self.gate, self.hub = gate, hub

    def prepare(self) -> None:
        if self.request.host not in self.gate.hosts:
            raise tornado.web.HTTPError(403, reason="Another host")
        if not self.gate.admits(self.get_cookie(self.gate.cookie)):
            raise tornado.web.HTTPError(403, reason="Not admitted")

    def check_origin(self, origin: str) -> bool:
        return origin in {f"http://{host}" for host in self.gate.hosts}

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self.hub.connect(self)

    def on_message(self, message: str | bytes) -> None:
        self.hub.receive(self, message)

    def on_close(self) -> None:
        self.hub.disconnect(self)

    def send(self, message: str | bytes) -> None:
        try:
            self.write_message(message, binary=isinstance(message, bytes))
        except tornado.websocket.WebSocketClosedError:
            self.hub.disconnect(self)


async def serve(
    session: Session, history: History | None = None, opened: Callable[[str], None] = print
) -> None:
    """Serve an exploration until Ctrl-C.

    Parameters
    ----------
    session : Session
        Not begun yet.
    history : History, optional
        To go on with.
    opened : callable
        Gets the address, once it can be opened, and not where scene and readings do not go together.
    """
    sockets = tornado.netutil.bind_sockets(0, _ADDRESS)
    gate, hub = Gate(sockets[0].getsockname()[1]), Hub(session, history)
    given = {"gate": gate, "hub": hub}
    app = tornado.web.Application(
        [
            (r"/", _Page, given),
            (r"/page/([\w.]+)", _File, given),
            (r"/save/([\w.-]+)", _Document, given),
            (r"/socket", _Socket, given),
        ],
        websocket_max_message_size=_ESCAPED * MOST_FILE_BYTES,
        websocket_ping_interval=_PING_S,
        log_function=lambda handler: None,
        default_handler_class=_Nothing,
        default_handler_args=given,
    )
    server = tornado.httpserver.HTTPServer(app, max_body_size=_MOST_BODY)
    server.add_sockets(sockets)
    loop, interrupted = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGINT, interrupted.set)
    running = [asyncio.ensure_future(x) for x in (hub.run(), interrupted.wait())]
    begun = asyncio.ensure_future(hub.begun.wait())
    try:
        await asyncio.wait([begun, *running], return_when=asyncio.FIRST_COMPLETED)
        if begun.done():
            opened(gate.address)
        done, _ = await asyncio.wait(running, return_when=asyncio.FIRST_COMPLETED)
        for one in done:
            one.result()
    finally:
        loop.remove_signal_handler(signal.SIGINT)
        for one in (begun, *running):
            one.cancel()
        hub.end_job()
        server.stop()
        await server.close_all_connections()


class _Nothing(_Guarded):
    def get(self) -> None:
        raise tornado.web.HTTPError(404)
