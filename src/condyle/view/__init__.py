"""A mechanism that people can move: a page on this machine, drawn by viser.

condyle.serve_view("masticatory")
"""

from .playback import Playback
from .serve import View, open_view, serve_view
from .session import Session
from .snapshot import Snapshot

__all__ = ["Playback", "Session", "Snapshot", "View", "open_view", "serve_view"]
