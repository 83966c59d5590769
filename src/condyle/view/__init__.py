"""A mechanism that people can move: a page on this machine, drawn by viser.

condyle.serve_view("masticatory")
"""

from ..extras import require

require("viser", "view")  # which the modules below import

from .playback import Playback  # noqa: E402
from .serve import View, open_view, serve_view  # noqa: E402
from .session import Session  # noqa: E402
from .snapshot import Snapshot  # noqa: E402

__all__ = ["Playback", "Session", "Snapshot", "View", "open_view", "serve_view"]
