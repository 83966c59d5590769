"""Chain families: one file each, found here by the `kind` of the mechanism file."""

from ...mechanism.chain import CHAINS, ChainTable
from .cable import CableFamily
from .family import ChainDynamics, ChainLoop, Constants, Family, GivingChain, Joint, Link
from .muscle import MuscleFamily
from .pss import PSSFamily
from .rss import RSSFamily
from .sps import SPSFamily

FAMILIES: dict[str, Family] = {
    family.kind: family
    for family in (RSSFamily(), PSSFamily(), SPSFamily(), CableFamily(), MuscleFamily())
}


def register(family: Family, table: type[ChainTable]) -> None:
    """Add a family with its table, whose `kind` is the family's.

    Raises: InputError: if the table is of another kind.
    """
    CHAINS[family.kind] = table
    FAMILIES[family.kind] = family


__all__ = [
    "FAMILIES",
    "ChainDynamics",
    "ChainLoop",
    "Constants",
    "Family",
    "GivingChain",
    "Joint",
    "Link",
    "register",
]
