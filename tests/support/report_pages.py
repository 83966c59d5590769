"""What stands on a page of the report: its elements, and the numbers that its script draws."""

from __future__ import annotations

import base64
import json
from html.parser import HTMLParser
from typing import Any

import numpy as np


class Elements(HTMLParser):
    """Every element with its attributes, and the text of scripts and of the rest."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(page)

    def handle_starttag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found.append((name, dict(attributes)))
        self._open.append(name)
        if name == "script":
            self.scripts.append("")

    def handle_endtag(self, name: str) -> None:
        while self._open and self._open.pop() != name:
            pass

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "script":
            self.scripts[-1] += data
        elif "style" not in self._open:
            self.text += data


def payload(page: str) -> dict[str, Any]:
    return json.loads(Elements(page).scripts[0])


def column(data: dict[str, Any], number: int) -> np.ndarray:
    return unpacked(data["columns"]["values"], "<f4").reshape(-1, data["columns"]["samples"])[
        number
    ]


def unpacked(data: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(data), dtype=kind)
