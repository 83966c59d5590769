"""Every command, in the order of the help page."""

# isort: off
from . import start, states, analyse, simulate, studies, export, show, upkeep  # noqa: F401
