"""The six coordinates of the platform: X_EE of [Cheng2023]."""

from __future__ import annotations

from typing import Literal

Coordinate = Literal["X", "Y", "Z", "alpha", "beta", "gamma"]
COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")
