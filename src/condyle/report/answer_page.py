"""What a study came to, as one page that needs no network: text, tables and figures of its kind."""

from __future__ import annotations

import os
from io import StringIO
from typing import TYPE_CHECKING

from ..analysis.studies import studies
from ..extras import require
from ..files.atomic import write_text
from .page.html import Markup, table, tag, text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..results.study_answer import StudyAnswer

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem;
  color: #222; background: #fff }
table { border-collapse: collapse; width: 100% } .wide, pre { overflow-x: auto }
td, th { padding: .25rem .75rem; text-align: right; border-bottom: 1px solid #ddd }
td:first-child, th:first-child { text-align: left }
caption { text-align: left; font-weight: bold } svg { max-width: 100%; height: auto }
@media (prefers-color-scheme: dark) { body { color: #ddd; background: #181818 }
  td, th { border-color: #444 } svg { background: #fff; border-radius: 4px } }
"""


def write_page(answer: StudyAnswer, path: str | os.PathLike[str]) -> None:
    """As `StudyAnswer.write_report`."""
    study = studies().get(answer.kind)
    if study is not None and study.figures:
        require("matplotlib", "figures")
    figures = study.drawn if study is not None else {}
    title = f"{answer.data.get('mechanism', 'condyle')}: {answer.kind or 'answer'}"
    body = tag(
        "body",
        tag("h1", title),
        *(tag("p", tag("b", words)) for words in answer.warnings),
        tag("pre", answer),
        *(
            table([*columns], [*map(_cells, zip(*columns.values(), strict=True))], caption)
            for caption, columns in answer.tables.items()
        ),
        *(_picture(draw(answer), caption) for caption, draw in figures.items()),
    )
    head = (
        Markup('<meta charset="utf-8"><meta name="viewport" content="width=device-width">'),
        tag("title", title),
        tag("style", Markup(STYLE)),
    )
    write_text(path, f"<!doctype html>{tag('html', tag('head', *head), body, lang='en')}")


def _cells(row: tuple[object, ...]) -> list[object]:
    return [f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row]


def _picture(figure: Figure, alt: str) -> Markup:
    from .figures.style import names_as_text

    names_as_text(figure)
    out = StringIO()
    figure.savefig(out, format="svg", bbox_inches="tight", metadata={"Date": None})
    drawn = out.getvalue()
    svg = drawn[drawn.index("<svg") :].replace(
        "<svg", f'<svg role="img" aria-label="{text(alt)}"', 1
    )
    return tag("figure", tag("figcaption", alt), Markup(svg))
