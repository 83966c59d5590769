"""The live page answers to its own address alone, and bad messages end one connection quietly."""

from __future__ import annotations

import http.client
import socket
import sys
import time
from collections.abc import Iterator
from types import SimpleNamespace
from urllib.parse import urlsplit

import msgspec
import pytest
import viser
from viser.infra import _infra
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Request
from websockets.sync.client import ClientConnection, connect

from condyle.view import View, open_view
from condyle.view.controls import note_html
from condyle.view.gate import Gate, guarded

PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    running = open_view("masticatory", port=0)
    yield running
    running.close()


def status(view: View, path: str, **headers: str) -> int:
    """Of a plain request, with headers in place of a browser's."""
    connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=30)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    found = connection.getresponse().status
    connection.close()
    return found


def shake(view: View, origin: str | None = None, host: str | None = None, path: str = "") -> int:
    """Status of a websocket's handshake; 101 if it is taken."""
    place = urlsplit(view.url)
    uri = f"ws://{host or place.netloc}{path or place.path}"
    with socket.create_connection(("127.0.0.1", view.port)) as raw:
        try:
            with connect(uri, sock=raw, origin=origin, subprotocols=[PROTOCOL]) as live:
                live.recv(timeout=30)
                return 101
        except InvalidStatus as refused:
            return refused.response.status_code


def test_the_printed_address_is_the_only_key(view: View) -> None:
    place = urlsplit(view.url)
    assert status(view, place.path) == 200
    for path in ("/", "/index.html", "/wrong/", place.path[:-2] + "/", f"/x{place.path}"):
        assert status(view, path) == 403, path
    assert shake(view, f"http://{place.netloc}") == 101
    assert shake(view, f"http://{place.netloc}", path="/") == 403
    assert len(place.path) > 20
    other = open_view("masticatory", port=0)
    assert urlsplit(other.url).path != place.path
    other.close()


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://127.0.0.1", "http://127.0.0.1.evil.example:{port}"],
)
def test_a_page_from_elsewhere_is_refused(view: View, origin: str) -> None:
    origin = origin.format(port=view.port)
    assert shake(view, origin) == 403
    assert status(view, urlsplit(view.url).path, Origin=origin) == 403


def test_a_name_that_was_made_to_lead_here_is_refused(view: View) -> None:
    """DNS rebinding: the page and its Origin agree, but the name is a stranger's."""
    path = urlsplit(view.url).path
    for host in ("evil.example", f"evil.example:{view.port}", "127.0.0.1.evil.example", "", "["):
        assert status(view, path, Host=host) == 403, host
    host = f"evil.example:{view.port}"
    assert shake(view, f"http://{host}", host) == 403
    for host in ("localhost", f"localhost:{view.port}", f"127.0.0.1:{view.port}", "[::1]:9"):
        assert status(view, path, Host=host) == 200, host
    assert shake(view, f"http://localhost:{view.port}", f"localhost:{view.port}") == 101


def test_bound_to_every_address_it_answers_to_numbers() -> None:
    gate = Gate("0.0.0.0")
    for host, fine in (("192.168.0.7:8080", True), ("[fe80::1]:80", True), ("evil.example", False)):
        request = Request(f"/{gate.token}/", _infra.websockets.datastructures.Headers(Host=host))
        assert (gate.objection(request) is None) == fine, host


def test_the_page_cannot_be_framed_or_kept(view: View) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=30)
    connection.request("GET", urlsplit(view.url).path, headers={"Accept-Encoding": "gzip"})
    answer = connection.getresponse()
    assert "frame-ancestors 'none'" in (answer.getheader("Content-Security-Policy") or "")
    assert answer.getheader("Cache-Control") == "no-store"
    assert len(answer.read()) == int(answer.getheader("Content-Length") or 0)


def live(view: View) -> ClientConnection:
    place = urlsplit(view.url)
    found = connect(f"ws://{place.netloc}{place.path}", subprotocols=[PROTOCOL])
    found.recv(timeout=30)
    return found


BAD = {
    "text": "hello",
    "no msgpack": b"\xc1\xff\x00",
    "empty": b"",
    "number": msgspec.msgpack.encode(3),
    "unknown kind": msgspec.msgpack.encode({"type": "NoSuchMessage"}),
    "fields missing": msgspec.msgpack.encode({"type": "GuiUpdateMessage"}),
    "fields of other kinds": msgspec.msgpack.encode(
        {"type": "GuiUpdateMessage", "uuid": [1], "updates": "x"}
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_message_ends_its_connection_and_says_nothing(
    view: View, kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    stranger, friend = live(view), live(view)
    stranger.send(BAD[kind])
    end = time.monotonic() + 30
    with pytest.raises(ConnectionClosed) as closed:
        while time.monotonic() < end:
            stranger.recv(timeout=30)
    assert closed.value.rcvd is not None and closed.value.rcvd.code in (1002, 1003, 1007)
    friend.ping().wait(30)
    friend.close()
    told = capfd.readouterr()
    assert "Traceback" not in told.out + told.err


def test_noise_on_the_port_says_nothing(view: View, capfd: pytest.CaptureFixture[str]) -> None:
    for noise in (
        b"\x00\xff\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
    ):
        with socket.create_connection(("127.0.0.1", view.port)) as raw:
            raw.sendall(noise)
            raw.settimeout(30)
            assert b" 200 " not in raw.recv(4096)
    assert status(view, urlsplit(view.url).path) == 200
    told = capfd.readouterr()
    assert told.out + told.err == ""


def test_no_server_without_the_gate() -> None:
    with pytest.raises(RuntimeError, match="gate"), guarded(Gate("127.0.0.1")):
        pass  # viser starts nothing here
    import websockets

    assert _infra.websockets is websockets


def test_a_busy_port_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(_: float) -> None:
        raise KeyboardInterrupt

    clock = SimpleNamespace(sleep=stop, monotonic=time.monotonic)
    monkeypatch.setattr(sys.modules[View.__module__], "time", clock)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        sys.modules[View.__module__].serve_view("masticatory", port=port)
        told = capsys.readouterr().out
        assert f"port {port} is in use; took " in told
        took = int(told.split("took ")[1].split()[0])
        assert took != port and f"http://127.0.0.1:{took}/" in told


def test_the_page_loads_nothing_from_elsewhere(view: View) -> None:
    """Text of strangers' files stands on it; it holds the key."""
    connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=30)
    connection.request("GET", urlsplit(view.url).path)
    policy = connection.getresponse().getheader("Content-Security-Policy") or ""
    rules = dict(rule.split(maxsplit=1) for rule in policy.split("; "))
    assert rules["default-src"].startswith("'self'") and rules["frame-src"] == "'none'"
    assert not any("http" in rule or "*" in rule for rule in rules.values())


def test_words_of_a_file_format_nothing() -> None:
    assert "<img" not in note_html("<img src=http://example.org/x.png>")
