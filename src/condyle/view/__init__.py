"""A mechanism that people can move: a page on this machine, drawn by viser.

condyle.view.serve("masticatory")
"""

from .playback import Playback
from .serve import View, open_view, serve
from .session import Session
from .snapshot import Snapshot

__all__ = ["Playback", "Session", "Snapshot", "View", "open_view", "serve"]
