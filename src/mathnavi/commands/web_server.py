"""Server of a page for a browser: on this machine alone, or at another address behind a token.

A request must name the server as its user does: a request that a foreign page makes a browser send to this machine
under another name (DNS rebinding) is refused. At an address other than loopback, a request without the token of the
URL is refused too.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import secrets
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from mathnavi.commands.errors import BadInputError
from mathnavi.interfaces.reading.files import parsed

LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")  # by which a browser on this machine may ask
MOST_POSTED = 65536  # [bytes]
PAGE = "/"
HEADERS = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
Answer = Callable[[Mapping[str, str]], Any]  # plain data for the query's arguments
Change = Callable[[Any], Any]  # plain data for plain data that was posted
Page = Callable[[Mapping[str, str]], str]  # HTML for the query's arguments; ValueError or OSError where there is none


class PageServer(ThreadingHTTPServer):
    """Server of a page at ``/`` and of others at their own paths, which answers in JSON and takes changes."""

    daemon_threads = True
    block_on_close = False

    def __init__(
        self,
        host: str,
        port: int,
        page: Callable[[], str],
        answers: Mapping[str, Answer] | None = None,
        changes: Mapping[str, Change] | None = None,
        pages: Mapping[str, Page] | None = None,
    ) -> None:
        """Bind to an address; port 0 chooses a free one. Raises BadInputError if the address is not available."""
        self.page, self.answers, self.changes, self.pages = page, answers or {}, changes or {}, pages or {}
        self.is_local = _is_loopback(host)
        self.token = "" if self.is_local else secrets.token_urlsafe(24)
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            super().__init__((host, port), _Handler)
        except OSError as error:
            reason = error.strerror or str(error)
            raise BadInputError(
                f"--host = {host}, --port = {port}: {reason}; allowed: an address of this machine, and a port that is "
                "free, or 0 for any"
            ) from error

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing about a browser that has gone, or whose connection has broken, before its answer was sent."""
        if not isinstance(sys.exception(), (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)

    @property
    def url(self) -> str:
        """Return the address of the page, with the token if there is one."""
        host, port = str(self.server_address[0]), int(self.server_address[1])
        name = f"[{host}]" if ":" in host else host
        return f"http://{name}:{port}/" + (f"?token={self.token}" if self.token else "")

    @contextmanager
    def serving(self) -> Iterator[None]:
        """Serve in a separate thread for as long as the block lasts."""
        threading.Thread(target=self.serve_forever, daemon=True).start()
        try:
            yield
        finally:
            self.shutdown()
            self.server_close()

    def refusal(self, host: str, origin: str | None, query: Mapping[str, list[str]]) -> str | None:
        """Return why a request with these headers is refused; None if it is not."""
        own = {f"{name}:{self.server_address[1]}" for name in LOCAL_NAMES}
        if self.is_local and host not in own:
            return f"the request is for {host!r}; allowed: {', '.join(sorted(own))}"
        if self.token and not hmac.compare_digest(query.get("token", [""])[0].encode(), self.token.encode()):
            return "the token is missing or wrong; allowed: the URL that the command printed"
        if origin is not None and origin != f"http://{host}":
            return "the request comes from another page; allowed: this one"
        return None


class _Handler(BaseHTTPRequestHandler):
    """Handler of the requests to a ``PageServer``."""

    server: PageServer
    server_version, sys_version = "mathnavi", ""
    protocol_version = "HTTP/1.1"
    timeout = 30.0  # [s] for which a connection may be idle

    def do_GET(self) -> None:
        path, query = self._asked()
        if path is None:
            return
        arguments = {name: values[0] for name, values in query.items()}
        if path == PAGE:
            self._send_page(self.server.page())
        elif path in self.server.pages:
            try:
                page = self.server.pages[path](arguments)
            except (ValueError, OSError) as error:
                self._refuse(HTTPStatus.BAD_REQUEST, str(error))
            else:
                self._send_page(page)
        elif path in self.server.answers:
            self._send_json(self.server.answers[path](arguments))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")

    do_HEAD = do_GET  # noqa: N815

    def do_POST(self) -> None:
        path, _ = self._asked()
        if path is None:
            return
        if path not in self.server.changes:
            self._refuse(HTTPStatus.NOT_FOUND, "there is nothing to change")
            return
        length = self.headers.get("Content-Length", "")
        if self.headers.get_content_type() != "application/json" or not length.isdecimal():
            self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "allowed: JSON of a stated length")
            return
        if int(length) > MOST_POSTED:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"allowed: at most {MOST_POSTED} bytes")
            return
        try:
            self._send_json(self.server.changes[path](parsed(self.rfile.read(int(length)), "the request", ValueError)))
        except ValueError as error:  # also of the JSON
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing: the terminal is the command's."""

    def _asked(self) -> tuple[str | None, dict[str, list[str]]]:
        """Return path and query; no path if the request is refused."""
        parts = urlsplit(self.path)
        query = parse_qs(parts.query, keep_blank_values=True, max_num_fields=20)
        reason = self.server.refusal(self.headers.get("Host", ""), self.headers.get("Origin"), query)
        if reason is None:
            return parts.path, query
        self._refuse(HTTPStatus.FORBIDDEN, reason)
        return None, query

    def _refuse(self, status: HTTPStatus, reason: str) -> None:
        self.close_connection = True  # what was posted may not have been read
        self._send(status, f"{reason}\n".encode(), "text/plain; charset=utf-8")

    def _send_page(self, page: str) -> None:
        self._send(HTTPStatus.OK, page.encode(), "text/html; charset=utf-8")

    def _send_json(self, data: Any) -> None:
        body = json.dumps(data, separators=(",", ":"), allow_nan=False).encode()
        self._send(HTTPStatus.OK, body, "application/json")

    def _send(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


def _is_loopback(host: str) -> bool:
    """Return True for an address that only this machine can reach."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
