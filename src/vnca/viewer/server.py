"""A page served to the browser of this machine, and to nobody else.

The server listens on the loopback interface alone, on a port of its own choosing, and answers under
a path that nobody can guess. It answers only what is asked of it by its own address, so that no
other site can lead a browser to it by a name of its own.
"""

import secrets
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TypeAlias

from vnca.viewer import POLICY

Content: TypeAlias = "bytes | Path | Callable[[], bytes]"
"""A file's bytes, its path, or what makes them when they are asked for."""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".webp": "image/webp",
    ".png": "image/png",
}
"""Types by suffix; all else is plain bytes."""
HEADERS = {
    "Content-Security-Policy": f"{POLICY}; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class PageServer:
    """Serves files by name until it is closed."""

    def __init__(self, files: Mapping[str, Content], *, port: int = 0) -> None:
        """Begin to listen.

        Args:
            files: What there is, by name; `index.html` is the page.
            port: The port; any free one unless given.

        Raises:
            OSError: If the port is taken.
        """
        self._token = secrets.token_urlsafe(16)
        handler: type[_Handler] = type(
            "Handler", (_Handler,), {"files": files, "token": self._token}
        )
        self._server = ThreadingHTTPServer(("127.0.0.1", port), handler)
        handler.port = self._server.server_port
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self._server.server_port}/{self._token}/"

    def wait(self) -> None:
        """Until the server is closed, or Ctrl-C."""
        while self._thread.is_alive():
            self._thread.join(0.2)

    def close(self) -> None:
        """Stop answering."""
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    files: Mapping[str, Content]
    token: str
    port: int
    protocol_version = "HTTP/1.1"
    server_version = "vnca"
    sys_version = ""
    timeout = 30

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, *, with_body: bool) -> None:
        content = self._asked()
        if content is None:
            self._send(HTTPStatus.NOT_FOUND, b"", with_body=with_body)
            return
        extent = _range(self.headers.get("Range"), len(content))
        if extent is None:
            self._send(HTTPStatus.OK, content, with_body=with_body)
            return
        first, last = extent
        if first >= len(content):
            more = {"Content-Range": f"bytes */{len(content)}"}
            self._send(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, b"", more, with_body=with_body)
            return
        more = {"Content-Range": f"bytes {first}-{last}/{len(content)}"}
        part = content[first : last + 1]
        self._send(HTTPStatus.PARTIAL_CONTENT, part, more, with_body=with_body)

    def _asked(self) -> bytes | None:
        """What is asked for, if it is asked by the right address and is there."""
        if self.headers.get("Host") not in (f"127.0.0.1:{self.port}", f"localhost:{self.port}"):
            return None
        begin, _, name = self.path.partition("?")[0].removeprefix("/").partition("/")
        if not secrets.compare_digest(begin.encode(), self.token.encode()):
            return None
        content = self.files.get(name or "index.html")
        if isinstance(content, Path):
            try:
                return content.read_bytes()
            except OSError:
                return None
        return content if content is None or isinstance(content, bytes) else content()

    def _send(
        self,
        status: HTTPStatus,
        body: bytes,
        more: Mapping[str, str] | None = None,
        *,
        with_body: bool,
    ) -> None:
        name = self.path.partition("?")[0].rpartition("/")[2] or "index.html"
        self.send_response(status)
        kind = KINDS.get(Path(name).suffix, "application/octet-stream")
        sized = {"Content-Type": kind, "Content-Length": str(len(body)), "Accept-Ranges": "bytes"}
        for header, value in {**HEADERS, **sized, **(more or {})}.items():
            self.send_header(header, value)
        self.end_headers()
        if with_body:
            self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: what the page asks for is of no interest to its user."""


def _range(asked: str | None, size: int) -> tuple[int, int] | None:
    """First and last byte of a range; None for all, as where it is no range of one part."""
    unit, _, extent = (asked or "").partition("=")
    begin, dash, end = extent.partition("-")
    if unit != "bytes" or not dash or not begin.isdecimal() or not (end.isdecimal() or not end):
        return None
    last = min(int(end) if end else size - 1, size - 1)
    return (int(begin), last) if last >= int(begin) or int(begin) >= size else None
