"""Reactions as variables of a dataset."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mechanism.mechanism import Mechanism
from ..model.reactions import Reaction


def reaction_variables(
    mechanism: Mechanism, found: dict[str, Reaction]
) -> tuple[dict[str, tuple[Any, ...]], dict[str, list[str]]]:
    """Variables and coordinates of a dataset, as xarray takes them.

    `reaction_<quantity>` has dimensions (time, chain, axis), or, where only chains of some
    families have it, (time, chain_<families>, axis) with those chains alone; contact forces are
    `contact_force_vector` (time, contact, axis).
    """
    variables: dict[str, tuple[Any, ...]] = {}
    coordinates: dict[str, list[str]] = {}
    groups: dict[str, list[Reaction]] = {}
    for reaction in found.values():
        groups.setdefault(reaction.quantity, []).append(reaction)
    for quantity, group in groups.items():
        owners = [reaction.owner for reaction in group]
        name, dimension = f"reaction_{quantity}", "chain"
        if quantity == "contact":
            name, dimension = "contact_force_vector", "contact"
        elif len(owners) < len(mechanism.chains):
            kinds = {c.kind: None for c in mechanism.chains if c.name in owners}
            dimension = "_".join(("chain", *kinds))
            coordinates[dimension] = owners
        values = np.stack([reaction.array for reaction in group], axis=1)
        variables[name] = (("time", dimension, "axis"), values, _attributes(group))
    return variables, coordinates


def _attributes(group: list[Reaction]) -> dict[str, str]:
    def joined(key: str) -> str:
        return ", ".join(dict.fromkeys(getattr(reaction, key) for reaction in group))

    keys = ("long_name", "body", "by", "place")
    return {"units": joined("unit"), **{key: joined(key) for key in keys}, "frame": Reaction.frame}
