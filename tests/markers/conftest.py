"""Contacts of a mechanism are derived once in a process, not once a recording."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import pytest

from condyle.motion import nearest_pose


@pytest.fixture(scope="session", autouse=True)
def contacts_once() -> Iterator[None]:
    """A frozen mechanism has one answer; deriving it is 0.1 s of the 0.13 s of a recording."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nearest_pose, "_contacts", cache(nearest_pose._contacts))
        yield
