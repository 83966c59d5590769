"""Pages of help are there at once: they take nothing that computes."""

import subprocess
import sys

HELP = """
import contextlib, io, re, sys
from condyle.cli import main
from condyle.cli.app import commands
from condyle.cli.command import registered
works = {name: getattr(one.callback, "__wrapped__", one.callback) for name, one in registered()}
texts = {"": ""} | {name: work.__doc__ for name, work in works.items()}
for words, text in texts.items():
    sys.argv = ["condyle", *words.split(), "--help"]
    with contextlib.redirect_stdout(io.StringIO()) as page, contextlib.suppress(SystemExit):
        main()
    assert "Usage" in page.getvalue(), words
    assert all(part in page.getvalue() for part in re.findall(r"\\[[a-z]\\w*\\]", text)), words
    print(words, *{"numpy", "casadi", "xarray"} & {*sys.modules})
"""


def test_no_page_of_help_imports_what_computes() -> None:
    """In a process of its own, since this one has it all. Pages show [s] and [controller], too."""
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)
    rows = [row.strip() for row in done.stdout.splitlines()]
    assert len(rows) > 30
    assert not [row for row in rows if "numpy" in row or "casadi" in row or "xarray" in row]
