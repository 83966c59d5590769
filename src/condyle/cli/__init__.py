"""The command line: thin commands; errors on stderr, with exit status 2."""

from __future__ import annotations

import sys


def main() -> None:
    """Entry point of the `condyle` command."""
    try:
        from .app import run  # takes a moment, in which a person may press Ctrl-C

        run()
    except KeyboardInterrupt as stop:
        print(f"condyle: {str(stop) or 'stopped'}", file=sys.stderr)
        sys.exit(130)
