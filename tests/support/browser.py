"""A system Chromium without a window, through Playwright. Skips say why; CI lets none skip."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import numpy as np
import pytest

CHROMIUM = ("/usr/bin/chromium", "chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 120_000  # milliseconds; software rendering on a busy machine is slow


def _missing(what: str) -> None:
    if os.environ.get("CONDYLE_BROWSER") == "required":
        pytest.fail(f"CONDYLE_BROWSER=required, but {what}")
    pytest.skip(f"browser tests need Playwright and Chromium: {what}")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        _missing("Playwright is not installed (pip install playwright)")
    path = next((found for name in CHROMIUM if (found := shutil.which(name))), None)
    if path is None:
        _missing("there is no Chromium (apt-get install chromium)")
    with sync_playwright() as playwright:
        try:
            running = playwright.chromium.launch(executable_path=path, args=list(OPTIONS))
        except Error as error:
            _missing(f"{path} does not start: {error}")
        yield running
        running.close()


class Tab:
    """A page with what it complained of and what it asked the network for."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.errors: list[str] = []
        self.requests: list[str] = []
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._heard)
        page.on("request", lambda request: self.requests.append(request.url))

    def _heard(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def picture(self, selector: str) -> np.ndarray:
        """Pixels of an element, (height, width, 3)."""
        from PIL import Image

        shot = self.page.locator(selector).first.screenshot()
        return np.asarray(Image.open(BytesIO(shot)).convert("RGB")).astype(int)

    def picture_where(
        self, selector: str, holds: Callable[[np.ndarray], bool], what: str
    ) -> np.ndarray:
        """Pixels of an element once `holds` is true of them and they have come to rest.

        Raises: AssertionError: saying `what` was waited for, at the limit.
        """
        last = np.zeros((0, 0, 3), dtype=int)
        end = time.monotonic() + PATIENCE / 1000
        while time.monotonic() < end:
            now = self.picture(selector)
            if np.array_equal(now, last) and holds(now):
                return now
            last = now
        raise AssertionError(f"{selector} never showed this: {what}")

    def changed_picture(self, selector: str, before: np.ndarray) -> np.ndarray:
        """Pixels once they clearly differ from those before and have come to rest."""
        return self.picture_where(
            selector,
            lambda now: now.shape != before.shape or np.abs(now - before).max() > 50,
            "a change",
        )

    def until(self, holds: Callable[[], bool], what: str) -> None:
        """Until `holds`, which looks at this side of the connection."""
        end = time.monotonic() + PATIENCE / 1000
        while not holds():
            assert time.monotonic() < end, f"never came true: {what}"
            self.page.wait_for_timeout(20)  # lets the page go on

    def wait(self, script: str, argument: Any = None) -> None:
        """Until a JavaScript function of `argument` returns true."""
        self.page.wait_for_function(script, arg=argument)


@contextmanager
def tabs(browser: Any) -> Iterator[Callable[..., Tab]]:
    """Opens pages in windows of a size; afterwards they must have had no complaint."""
    opened: list[Tab] = []

    def open_one(url: str, width: int = 1440, height: int = 900, **options: Any) -> Tab:
        page = browser.new_page(viewport={"width": width, "height": height}, **options)
        tab = Tab(page)
        opened.append(tab)
        page.goto(url)
        return tab

    yield open_one
    for tab in opened:
        tab.page.close()
        assert tab.errors == []


@pytest.fixture
def open_tab(browser: Any) -> Iterator[Callable[..., Tab]]:
    """`tabs` of one test."""
    with tabs(browser) as open_one:
        yield open_one
