"""Every command, in the order of the help page."""

# isort: off
from . import new, check, reference, motion, session  # noqa: F401
from . import run, states, map, bite, literature, simulate, compare, sweep  # noqa: F401
from . import design, optimise, plan, identify, export  # noqa: F401
from . import plot, report, video, view, cite  # noqa: F401
from . import upkeep  # noqa: F401
