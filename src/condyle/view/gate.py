"""Who may use the live page: whoever has its address, from a page of its own, by its own name.

Any page that a browser shows can ask 127.0.0.1 for something, and a name of its own can be made to
lead there (DNS rebinding). So a request must bear the token of the printed address, the name of
this machine as Host and, where a browser states an Origin, the page's own. viser has no place for
such a question; it asks `websockets.serve`, and that call is where `guarded` stands in.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from ipaddress import ip_address
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import viser.infra._infra as infra
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

LOCAL = ("localhost", "127.0.0.1", "::1")
ANYWHERE = ("", "0.0.0.0", "::")
# The page loads nothing from elsewhere, whatever text a file brings into it; it is shown in no
# other page's frame, and tells no other page its address.
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        # viser's page unpacks itself and draws by WebAssembly; all of it comes from this server.
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
        "frame-src 'none'; object-src 'none'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
# Keys that a slider or a field has a use for must not turn the camera, which listens at `document`.
SCRIPT = b"""<script>
document.documentElement.addEventListener("keydown", (event) => {
  if (event.target.closest?.('[role="slider"], [role="tab"], [role="radio"], input, textarea'))
    event.stopPropagation();
});
</script>"""

_connection: ContextVar[ServerConnection | None] = ContextVar("connection", default=None)
_log = logging.getLogger("condyle.view.server")
_log.addHandler(logging.NullHandler())
_log.propagate = False  # what strangers send is no news for the console


class Gate:
    """Decides on requests to a page that listens at `host`.

    Attributes: token: first part of the path of every request;  closed: whether it stands there.
    """

    def __init__(self, host: str) -> None:
        self.host = host
        self.token: str = secrets.token_urlsafe(16)
        self.closed = False

    def objection(self, request: Request) -> str | None:
        """Why a request is refused, or None."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return "this page answers to the address that condyle view printed, and no other name"
        if any(urlsplit(origin).netloc != hosts[0] for origin in origins):
            return "this page answers to no other page"
        first = request.path.partition("?")[0].split("/")[1:2]
        if not first or not hmac.compare_digest(first[0].encode(), self.token.encode()):
            return "open the whole address that condyle view printed; its last part is a key"
        return None

    def _is_ours(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in (*LOCAL, self.host):
            return True
        # Rebinding needs a name; a number leads where it says.
        return self.host in ANYWHERE and _is_number(name)

    def answer(self, inner: Callable[..., Any], connection: Any, request: Request) -> Any:
        """The response to a request, or None to go on with a websocket."""
        if (why := self.objection(request)) is not None:
            return refusal(why)
        path = request.path.removeprefix(f"/{self.token}") or "/"
        response = inner(connection, replace(request, path=path))
        if isinstance(response, Response):
            return for_the_page(response)
        return response


def refusal(why: str) -> Response:
    body = f"condyle view: {why}.\n".encode()
    headers = Headers(HEADERS | {"Content-Type": "text/plain", "Content-Length": str(len(body))})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)


def for_the_page(response: Response) -> Response:
    """viser's page with our headers, and with our script in it."""
    headers, body = Headers(response.headers), response.body or b""
    for name, value in HEADERS.items():
        headers[name] = value
    if headers.get("Content-Type", "").startswith("text/html"):
        body = bytes(body).replace(b"<head>", b"<head>" + SCRIPT, 1)
        del headers["Content-Length"]
        headers["Content-Length"] = str(len(body))
    return Response(response.status_code, response.reason_phrase, headers, body)


@contextmanager
def guarded(gate: Gate) -> Iterator[None]:
    """Let the server that viser starts in here stand behind a gate.

    Raises: RuntimeError: if viser did not take it, so that it never serves without one.
    """

    def behind(handler: Any, *address: Any, process_request: Any, **options: Any) -> serve:
        def decide(connection: Any, request: Request) -> Any:
            request.headers.pop("Accept-Encoding", None)  # the page is read on its way
            return gate.answer(process_request, connection, request)

        asyncio.get_running_loop().set_task_factory(_task)
        found = serve(_patient(handler), *address, process_request=decide, logger=_log, **options)
        gate.closed = True
        return found

    real = infra.websockets
    stand_in = SimpleNamespace(**vars(real))
    stand_in.asyncio = SimpleNamespace(server=SimpleNamespace(serve=behind))
    stand_in.exceptions, stand_in.datastructures = real.exceptions, real.datastructures
    infra.websockets = stand_in  # type: ignore[assignment]
    try:
        yield
    finally:
        infra.websockets = real
    if not gate.closed:
        raise RuntimeError("viser did not start its server behind the gate")


def _patient(handler: Callable[..., Any]) -> Callable[..., Any]:
    """A handler whose connection ends with a word where a message cannot be read."""

    async def handle(connection: ServerConnection) -> None:
        _connection.set(connection)
        try:
            await handler(connection)
        except ConnectionClosed:
            raise
        except Exception as error:
            await _end(connection, error)

    return handle


def _task(loop: asyncio.AbstractEventLoop, coroutine: Any, **options: Any) -> asyncio.Task[Any]:
    """A task; where one fails that a connection began, the connection ends, and nothing else."""
    task = asyncio.Task(coroutine, loop=loop, **options)
    if (connection := _connection.get()) is not None:

        def ended(task: asyncio.Task[Any]) -> None:
            error = None if task.cancelled() else task.exception()
            if error is not None and not isinstance(error, ConnectionClosed):
                _connection.set(None)
                loop.create_task(_end(connection, error))

        task.add_done_callback(ended)
    return task


async def _end(connection: ServerConnection, error: BaseException) -> None:
    _log.debug("a message that cannot be read: %r", error)
    await connection.close(CloseCode.INVALID_DATA, "a message that cannot be read")


def _is_number(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True
