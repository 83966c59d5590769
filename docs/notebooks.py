"""Pages as notebooks: their own text and code, run when the site is built, to download and go on.

Python blocks are cells, commands are cells that call the shell, all else is text. Nothing is said
twice: the page is the source.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
LECTURES = ("kinematics", "approaches", "models", "comparison", "indices")
PAGES = ("tutorial.md", "tutorial-simulate.md", "how-to/notebooks.md")
PAGES += tuple(f"teaching/{lecture}.md" for lecture in LECTURES)
FILES = tuple(f"{Path(page).stem}.ipynb" for page in PAGES)
BLOCK = re.compile(r"^```(python|console)[^\n]*\n(.*?)^```\n?", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"^!\[[^\n]*generated/[^\n]*\n?", re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)]*)\)")
ATTRIBUTES = re.compile(r"\{[ :][^}\n]*\}")
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
BAR = "━"  # of a command's progress
COMMAND = re.compile(r"^!.*$", re.MULTILINE)
CHECK = "\nassert not _exit_code"  # IPython itself goes on after a command that fails
SECONDS = 300  # a cell


def as_notebook(text: str) -> Any:
    """A page as a notebook that has not been run."""
    from nbformat import v4

    cells, end = [], 0
    for match in BLOCK.finditer(text):
        cells += words(text[end : match.start()])
        end = match.end()
        code = match[2].strip()
        if match[1] == "console":
            lines = [line.removeprefix("$ ") for line in code.splitlines() if line[:2] == "$ "]
            if not all(line.startswith("condyle ") for line in lines):
                cells.append(v4.new_markdown_cell(match[0].strip()))
                continue
            code = "\n".join(f"!{line}" for line in lines)
        cells.append(v4.new_code_cell(code))
    cells += words(text[end:])
    for i, cell in enumerate(cells):
        cell["id"] = f"cell-{i}"
    return v4.new_notebook(cells=cells)


def words(text: str) -> list[Any]:
    """The text between two blocks, without pictures (cells draw them) and links that lead out."""
    from nbformat import v4

    text = LINK.sub("]", PICTURE.sub("", ATTRIBUTES.sub("", text)))
    text = re.sub(r"\[([^\]\n]*)\]", r"\1", text).strip()
    return [v4.new_markdown_cell(text)] if text else []


def run(notebook: Any) -> Any:
    """Run all cells in an empty folder; raises what a cell raises, and if a command fails."""
    from nbclient import NotebookClient

    written = [cell.source for cell in notebook.cells]
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.source = COMMAND.sub(rf"\g<0>{CHECK}", cell.source)
    programs = str(Path(sys.executable).parent)
    before = dict(os.environ)
    with tempfile.TemporaryDirectory() as place:
        os.environ["PATH"] = os.pathsep.join([programs, before.get("PATH", "")])
        for name in ("MPLBACKEND", "CONDYLE_BACKEND"):  # figures go into the notebook
            os.environ.pop(name, None)
        try:
            client = NotebookClient(
                notebook, timeout=SECONDS, resources={"metadata": {"path": place}}
            )
            client.execute()
        finally:
            os.environ.clear()
            os.environ.update(before)
    for cell, source in zip(notebook.cells, written, strict=True):
        cell.source = source
        cell.metadata.pop("execution", None)  # times, which differ from build to build
        if cell.cell_type == "code":
            cell.outputs = plain(cell.outputs)
    return notebook


def plain(outputs: list[Any]) -> list[Any]:
    """Outputs with what was printed in one piece, without colours and overwritten lines."""
    found: list[Any] = []
    for output in outputs:
        if output.output_type == "stream" and found and found[-1].output_type == "stream":
            found[-1].text += output.text
        else:
            found.append(output)
    for output in found:
        if output.output_type == "stream":
            text = ESCAPE.sub("", output.text.replace("\r\n", "\n"))
            lines = [line.rpartition("\r")[2] for line in text.split("\n")]
            output.text = "\n".join(line for line in lines if BAR not in line)
    return [one for one in found if one.output_type != "stream" or one.text.strip()]


def write_notebooks(folder: Path) -> None:
    """Write all of `FILES`, run."""
    import nbformat

    for page, name in zip(PAGES, FILES, strict=True):
        made = run(as_notebook((DOCS / page).read_text(encoding="utf-8")))
        nbformat.write(made, folder / name)


def with_download(markdown: str, page: str) -> str:
    """A page's text, with a line that offers it as a notebook."""
    if page not in PAGES:
        return markdown
    name, up = FILES[PAGES.index(page)], "../" * page.count("/")
    line = f"[This page as a notebook]({up}generated/{name}), with what its cells print and draw.\n"
    title, _, rest = markdown.partition("\n")
    return f"{title}\n\n{line}{rest}"
