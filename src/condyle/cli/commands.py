"""Every command, in the order of the help page."""

from . import run, solve, compare, check, schema, new, reference, cache  # noqa: F401, I001
