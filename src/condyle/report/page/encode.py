"""Arrays as text for the page."""

from __future__ import annotations

import base64

import numpy as np


def packed(values: np.ndarray, kind: str) -> str:
    """An array in base64, of numpy's type `kind`."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
