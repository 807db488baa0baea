"""The page's server: for this machine alone, and only for who knows its address."""

import http.client
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from vnca.viewer.server import PageServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[PageServer]:
    (tmp_path / "smoke.bin").write_bytes(bytes(range(100)))
    files = {
        "index.html": b"<p>page",
        "smoke.bin": tmp_path / "smoke.bin",
        "run.json": lambda: b"{}",
        "gone.bin": tmp_path / "gone.bin",
    }
    served = PageServer(files)
    yield served
    served.close()


def ask(
    server: PageServer, name: str, *, method: str = "GET", path: str | None = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    where = urlsplit(server.address)
    link = http.client.HTTPConnection(where.hostname or "", where.port or 0, timeout=5)
    link.request(method, where.path + name if path is None else path, headers=headers)
    answer = link.getresponse()
    body = answer.read()
    link.close()
    return answer.status, body, dict(answer.getheaders())


def test_the_page_and_its_files_are_there(server: PageServer) -> None:
    status, body, headers = ask(server, "")
    assert (status, body) == (200, b"<p>page")
    assert headers["Content-Type"].startswith("text/html")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert ask(server, "run.json")[:2] == (200, b"{}")
    status, body, headers = ask(server, "smoke.bin", method="HEAD")
    assert (status, body, headers["Content-Length"]) == (200, b"", "100")


@pytest.mark.parametrize(
    ("asked", "status", "body"),
    [
        ("bytes=0-9", 206, bytes(range(10))),
        ("bytes=90-", 206, bytes(range(90, 100))),
        ("bytes=90-1000", 206, bytes(range(90, 100))),
        ("bytes=100-120", 416, b""),
        ("bytes=9-3", 200, bytes(range(100))),
        ("bytes=-5", 200, bytes(range(100))),
        ("lines=0-9", 200, bytes(range(100))),
    ],
)
def test_parts_of_files_are_sent(server: PageServer, asked: str, status: int, body: bytes) -> None:
    assert ask(server, "smoke.bin", Range=asked)[:2] == (status, body)


def test_who_does_not_know_the_address_gets_nothing(server: PageServer) -> None:
    assert server.address.startswith("http://127.0.0.1:")
    port = urlsplit(server.address).port
    for path in ("/", "/index.html", "/wrong/index.html", "/../smoke.bin", "//smoke.bin"):
        assert ask(server, "", path=path)[0] == 404, path
    # A name of another site that leads here: what a browser sends then.
    assert ask(server, "", Host="evil.example")[0] == 404
    assert ask(server, "", Host=f"evil.example:{port}")[0] == 404
    assert ask(server, "", Host=f"localhost:{port}")[0] == 200


def test_nothing_but_the_files_is_there(server: PageServer) -> None:
    for name in ("../pyproject.toml", "smoke.bin/..", "%2e%2e/x", "gone.bin", "other"):
        assert ask(server, name)[0] == 404, name
    assert ask(server, "smoke.bin", method="POST")[0] == 501
