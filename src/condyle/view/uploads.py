"""Uploads that never end: viser keeps their parts until the last, or until the client leaves."""

from __future__ import annotations

import viser

PATIENCE = 60.0  # seconds in which an upload must go on


class UploadWatch:
    """Drops uploads that stand still."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._states = server.gui._current_file_upload_states
        self._seen: dict[str, tuple[int, float]] = {}

    def look(self, now: float) -> None:
        """Args: now: of a clock that never goes back [s]."""
        states = dict(self._states)
        self._seen = {name: seen for name, seen in self._seen.items() if name in states}
        for name, state in states.items():
            size, since = self._seen.get(name, (-1, now))
            got = state["transferred_bytes"]
            if got > size:
                size, since = got, now
            self._seen[name] = size, since
            if now - since > PATIENCE:
                self._states.pop(name, None)
