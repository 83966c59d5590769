"""No controller: efforts are those of `[efforts]`, or none."""

from __future__ import annotations

from typing import Literal

from ...mechanism.table import Table


class Nothing(Table):
    """Open loop."""

    kind: Literal["none"]
