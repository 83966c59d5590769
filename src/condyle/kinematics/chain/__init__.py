"""Chain families: one file each, found here by the `kind` of the mechanism file."""

from .cable import CableFamily
from .family import ChainDynamics, ChainLoop, Constants, Family, Joint, Link
from .muscle import MuscleFamily
from .pss import PSSFamily
from .rss import RSSFamily
from .sps import SPSFamily

FAMILIES: dict[str, Family] = {
    family.kind: family
    for family in (RSSFamily(), PSSFamily(), SPSFamily(), CableFamily(), MuscleFamily())
}

__all__ = ["FAMILIES", "ChainDynamics", "ChainLoop", "Constants", "Family", "Joint", "Link"]
