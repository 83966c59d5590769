"""HTML from data: every text is escaped here, and nowhere else is markup put together."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def text(value: Any) -> Markup:
    """Anything as HTML; markup stays as it is."""
    return value if isinstance(value, Markup) else Markup(html.escape(str(value), quote=True))


def tag(name: str, *children: Any, **attributes: Any) -> Markup:
    """An element; a trailing _ of an attribute's name is dropped, None leaves it out."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{name}{written}>{''.join(map(text, children))}</{name}>")


def table(
    header: Sequence[Any],
    rows: Sequence[Sequence[Any]],
    caption: str | None = None,
    notes: Sequence[str] = (),
) -> Markup:
    """A table that scrolls sideways by itself; numbers are set right."""
    head = tag("thead", tag("tr", *(tag("th", cell, scope="col") for cell in header)))
    body = tag("tbody", *(tag("tr", *_cells(row)) for row in rows))
    parts = [tag("caption", caption)] if caption else []
    below = [tag("p", note, class_="note") for note in notes]
    # Focusable, so that the keyboard can scroll it.
    scrolling = tag(
        "div",
        tag("table", *parts, head, body),
        class_="wide",
        tabindex="0",
        role="region",
        aria_label=caption or "table",
    )
    return tag("div", scrolling, *below, class_="table")


def _cells(row: Sequence[Any]) -> list[Markup]:
    first, *rest = row
    return [
        tag("th", first, scope="row"),
        *(tag("td", cell, class_="number" if _is_number(cell) else None) for cell in rest),
    ]


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float) or bool(re.match(r"^[-+−±]?\d", str(cell)))


def json_for_script(data: Any) -> Markup:
    """JSON that cannot end the script element it stands in."""
    written = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        written = written.replace(character, f"\\u{ord(character):04x}")
    return Markup(written)


def fill(template: str, parts: Mapping[str, Markup]) -> str:
    """Put `parts` in the places {{name}} of a template, in one pass."""
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match.group(1)], template)
