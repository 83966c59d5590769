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
from condyle.view.uploads import UploadWatch

PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def view() -> Iterator[View]:
    running = open_view("masticatory", port=0)
    yield running
    running.close()


def answer(view: View, path: str, **headers: str) -> http.client.HTTPResponse:
    """To a plain request, with headers in place of a browser's."""
    connection = http.client.HTTPConnection("127.0.0.1", view.port, timeout=30)
    connection.putrequest("GET", path, "Host" in headers, skip_accept_encoding=True)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    return connection.getresponse()


def status(view: View, path: str, **headers: str) -> int:
    with answer(view, path, **headers) as found:
        return found.status


def live(view: View, path: str = "", host: str = "", **how: object) -> ClientConnection:
    """A websocket that has heard the page's first message."""
    place = urlsplit(view.url)
    uri = f"ws://{host or place.netloc}{path or place.path}"
    raw = socket.create_connection(("127.0.0.1", view.port))
    found = connect(uri, sock=raw, subprotocols=[PROTOCOL], **how)
    found.recv(timeout=30)
    return found


def shake(view: View, origin: str, host: str = "", path: str = "") -> int:
    """Status of a websocket's handshake; 101 if it is taken."""
    try:
        live(view, path, host, origin=origin).close()
    except InvalidStatus as refused:
        return refused.response.status_code
    return 101


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


def test_strangers_are_refused(view: View) -> None:
    """A page from elsewhere; and DNS rebinding, where the page and its Origin agree, but the name
    is a stranger's.
    """
    path, port = urlsplit(view.url).path, view.port
    local = "http://127.0.0.1"
    for origin in ("http://evil.example", "null", local, f"{local}.evil.example:{port}"):
        assert shake(view, origin) == 403
        assert status(view, path, Origin=origin) == 403
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "", "["):
        assert status(view, path, Host=host) == 403, host
    host = f"evil.example:{port}"
    assert shake(view, f"http://{host}", host) == 403
    for host in ("localhost", f"localhost:{port}", f"127.0.0.1:{port}", "[::1]:9"):
        assert status(view, path, Host=host) == 200, host
    assert shake(view, f"http://localhost:{port}", f"localhost:{port}") == 101
    # Bound to every address it answers to numbers.
    gate = Gate("0.0.0.0")
    for host, fine in (("192.168.0.7:8080", True), ("[fe80::1]:80", True), ("evil.example", False)):
        request = Request(f"/{gate.token}/", _infra.websockets.datastructures.Headers(Host=host))
        assert (gate.objection(request) is None) == fine, host
    with pytest.raises(RuntimeError, match="gate"), guarded(Gate("127.0.0.1")):
        pass  # viser starts nothing here, so that the gate has not been put in
    import websockets

    assert _infra.websockets is websockets


def test_the_page_cannot_be_framed_or_kept_and_loads_nothing_from_elsewhere(view: View) -> None:
    """Text of strangers' files stands on it; it holds the key."""
    page = answer(view, urlsplit(view.url).path, Accept_Encoding="gzip")
    policy = page.getheader("Content-Security-Policy") or ""
    assert page.getheader("Cache-Control") == "no-store"
    assert len(page.read()) == int(page.getheader("Content-Length") or 0)
    rules = dict(rule.split(maxsplit=1) for rule in policy.split("; "))
    assert rules["frame-ancestors"] == rules["frame-src"] == "'none'"
    assert rules["default-src"].startswith("'self'")
    assert not any("http" in rule or "*" in rule for rule in rules.values())
    assert "<img" not in note_html("<img src=http://example.org/x.png>")


MESSAGES = [
    3,
    {"type": "NoSuchMessage"},
    {"type": "GuiUpdateMessage"},  # fields are missing, and of other kinds
    {"type": "GuiUpdateMessage", "uuid": [1], "updates": "x"},
]
BAD = ["hello", b"\xc1\xff\x00", b"", *map(msgspec.msgpack.encode, MESSAGES)]
NOISE = [
    b"\x00\xff\r\n\r\n",
    b"GET\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
]


def test_bad_messages_and_noise_end_a_connection_and_say_nothing(
    view: View, capfd: pytest.CaptureFixture[str]
) -> None:
    friend = live(view)
    for message in BAD:
        stranger = live(view)
        stranger.send(message)
        end = time.monotonic() + 30
        with pytest.raises(ConnectionClosed) as closed:
            while time.monotonic() < end:
                stranger.recv(timeout=30)
        assert closed.value.rcvd is not None and closed.value.rcvd.code in (1002, 1003, 1007)
    friend.ping().wait(30)
    friend.close()
    told = capfd.readouterr()
    assert "Traceback" not in told.out + told.err
    for noise in NOISE:
        with socket.create_connection(("127.0.0.1", view.port)) as raw:
            raw.sendall(noise)
            raw.settimeout(30)
            assert b" 200 " not in raw.recv(4096)
    assert status(view, urlsplit(view.url).path) == 200
    told = capfd.readouterr()
    assert told.out + told.err == ""


def test_uploads_that_stand_still_are_dropped(view: View) -> None:
    """After a minute without a part; one that goes on stays."""
    states = view._server.gui._current_file_upload_states
    watch = UploadWatch(view._server)
    common = {"client_id": 7, "filename": "x.nc", "mime_type": "", "part_count": 9, "parts": {}}
    for name in ("still", "going"):
        states[name] = common | {"total_bytes": 900, "transferred_bytes": 100}  # type: ignore[assignment]
    for now in (0.0, 50.0, 100.0):
        states["going"]["transferred_bytes"] += 100
        watch.look(now)
    assert "going" in states and "still" not in states
    del states["going"]


def test_a_busy_port_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(_: float) -> None:
        raise KeyboardInterrupt

    module = sys.modules[View.__module__]
    monkeypatch.setattr(module, "time", SimpleNamespace(sleep=stop, monotonic=time.monotonic))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        module.serve_view("masticatory", port=port)
        told = capsys.readouterr().out
        assert f"port {port} is in use; took " in told
        took = int(told.split("took ")[1].split()[0])
        assert took != port and f"http://127.0.0.1:{took}/" in told
