"""Chain families: one file each, found here by the `kind` of the mechanism file."""

from .family import Constants, Family, Law, Link, Loop
from .rss import RSSFamily

FAMILIES: dict[str, Family] = {family.kind: family for family in (RSSFamily(),)}

__all__ = ["FAMILIES", "Constants", "Family", "Law", "Link", "Loop"]
