"""Every command, in the order of the help page."""

# isort: off
from . import new, check, reference, motion  # noqa: F401
from . import run, solve, forward, pose, map, simulate, compare, sweep  # noqa: F401
from . import export, export_fmu, export_matlab, export_mjcf  # noqa: F401
from . import plot, report, view  # noqa: F401
from . import bench, cache, schema  # noqa: F401
