"""Every command, in the order of the help page."""

# isort: off
from . import start, dynamics, analyse, studies, export, show, upkeep  # noqa: F401
