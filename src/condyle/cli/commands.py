"""Every command, in the order of the help page."""

# isort: off
from . import run, solve, compare, pose  # noqa: F401
from . import check, plot, report, view, bench  # noqa: F401
from . import new, schema, reference, cache  # noqa: F401
