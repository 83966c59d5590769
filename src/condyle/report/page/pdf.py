"""The report as PDF: printed by a browser's own print, once the page says that it is drawn.

The browser runs without a window, with a profile of its own, and is spoken to by the DevTools
protocol at an address of this machine that only lasts as long.
"""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...extras import require
from ...files.atomic import replacing

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
NAMED_BY = "CHROME_PATH"  # environment variable
OPTIONS = (
    "--headless",
    "--remote-debugging-port=0",
    "--enable-unsafe-swiftshader",  # WebGL where there is no graphics card
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 300.0  # seconds for a page to be drawn and printed
A4 = {"paperWidth": 8.27, "paperHeight": 11.69}  # inch
DRAWN = "document.documentElement.dataset.ready === 'true'"


def find_browser() -> str:
    """The program of a browser that can print.

    Raises: InputError: if there is none;  MissingExtraError: without the package websockets.
    """
    require("websockets", "report")
    named = os.environ.get(NAMED_BY)
    if named and shutil.which(named) is None:
        raise InputError(f"{NAMED_BY}: expected the program of a browser, got {named!r}")
    wanted = [named] if named else [*NAMES, *PLACES]
    browser = next((path for name in wanted if (path := shutil.which(name))), None)
    if browser is None:
        raise InputError(
            "a PDF of the report needs Chromium, Chrome or Edge, and none was found. Install one "
            f"or name its program in {NAMED_BY}; or open the page in any browser and print it."
        )
    return browser


def write_pdf(page: Path, pdf: str | os.PathLike[str]) -> None:
    """Print a report, an HTML file, on A4.

    Raises: InputError: without a browser, or if it does not print the page.
    """
    with _running(find_browser()) as browser:
        target = browser.ask("Target.createTarget", url=page.resolve().as_uri())
        session = browser.ask("Target.attachToTarget", flatten=True, **target)
        browser.session = session["sessionId"]
        while not _is_drawn(browser):
            time.sleep(0.1)
        printed = browser.ask("Page.printToPDF", printBackground=True, **A4)
    with replacing(pdf) as temporary:
        temporary.write_bytes(base64.b64decode(printed["data"]))


def _is_drawn(browser: _Browser) -> bool:
    found = browser.ask("Runtime.evaluate", expression=DRAWN)
    return found["result"].get("value") is True


class _Browser:
    """A connection by the DevTools protocol, until a time."""

    def __init__(self, connection: Any, until: float) -> None:
        self._connection, self._until = connection, until
        self._numbers = itertools.count(1)
        self.session = ""

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a method. Raises: InputError: if it fails or takes too long."""
        number = next(self._numbers)
        call = {"id": number, "method": method, "params": parameters}
        self._connection.send(
            json.dumps(call | {"sessionId": self.session} if self.session else call)
        )
        while True:
            try:
                message = json.loads(
                    self._connection.recv(max(self._until - time.monotonic(), 0.0))
                )
            except TimeoutError:
                raise InputError(f"the browser did not answer within {PATIENCE:g} s") from None
            if message.get("id") != number:
                continue  # an event
            if "error" in message:
                raise InputError(f"the browser refused {method}: {message['error'].get('message')}")
            result: dict[str, Any] = message["result"]
            return result


@contextmanager
def _running(program: str) -> Iterator[_Browser]:
    """A browser without a window, that ends with the block."""
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    until = time.monotonic() + PATIENCE
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        root = hasattr(os, "geteuid") and os.geteuid() == 0
        sandbox = ["--no-sandbox"] if root else []  # it does not start as root with one
        command = [program, *OPTIONS, *sandbox, f"--user-data-dir={profile}", "about:blank"]
        quiet = subprocess.DEVNULL
        try:
            process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
        except OSError as error:
            raise InputError(f"{program} does not start: {error.strerror or error}") from None
        try:
            address = _address(program, Path(profile) / "DevToolsActivePort", process, until)
            with connect(address, max_size=None) as connection:
                yield _Browser(connection, until)
        except (OSError, WebSocketException) as error:
            raise InputError(f"{program} does not answer: {error}") from error
        finally:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(10)
            process.kill()
            process.wait()


def _address(program: str, file: Path, process: subprocess.Popen[bytes], until: float) -> str:
    """Where the browser listens, which it writes into its profile."""
    while time.monotonic() < until and process.poll() is None:
        lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
        if len(lines) == 2:
            return f"ws://127.0.0.1:{lines[0]}{lines[1]}"
        time.sleep(0.05)
    ended = "" if process.returncode is None else f" (it ended with status {process.returncode})"
    raise InputError(f"{program} does not start{ended}")
