"""Rules of the whole that can be seen before its parts are valid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from ..errors import shortened


def structural_problems(data: Mapping[str, Any]) -> Iterator[str]:
    """Names that stand twice, too few chains, a wrong number of dependent coordinates.

    Args: data: the file's top level, as TOML gives it. What is no list of tables is not counted:
          that is another problem.
    """
    counts: dict[str, int | None] = {}
    for kind in ("contact", "chain"):
        tables = data.get(kind, ())
        if not isinstance(tables, list | tuple) or not all(isinstance(t, Mapping) for t in tables):
            counts[kind] = None
            continue
        counts[kind] = len(tables)
        names = Counter(t["name"] for t in tables if isinstance(t.get("name"), str))
        for name, count in names.items():
            if count > 1:
                yield (
                    f'{kind}: the name "{shortened(name, 40)}" stands {count} times; every {kind} '
                    "needs its own"
                )
    contacts, chains = counts["contact"], counts["chain"]
    if contacts is None:
        return
    freedoms = 6 - contacts
    if chains and chains < freedoms:
        yield (
            f"chain: {chains} actuators cannot drive {freedoms} degrees of freedom "
            f"(6 less {contacts} contacts); at least {freedoms} chains are needed"
        )
    dependent = data.get("dependent")
    if isinstance(dependent, list | tuple) and len(dependent) != contacts:
        yield (
            f"dependent: names {len(dependent)} coordinates, but there are {contacts} "
            "contacts; each contact determines one"
        )
