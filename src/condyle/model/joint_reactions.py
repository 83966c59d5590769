"""Reactions at the states of a result: what every joint, guide and contact carries."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..questions.reactions import POINT, ReactionPlace, reaction_places
from ..status import Status
from .arguments import given_of
from .model import Model
from .model_result import ModelResult


@dataclass(frozen=True)
class Reaction(ReactionPlace):
    """A reaction at N samples: components in {S}, (N, 3), and its place in {S}, (N, 3) [m]."""

    frame: ClassVar[str] = "{S}"
    array: np.ndarray = field(kw_only=True)
    point: np.ndarray = field(kw_only=True)


def reactions(
    model: Model,
    result: ModelResult,
    effort: np.ndarray | None = None,
    gravity: np.ndarray | None = None,
    base: np.ndarray | None = None,
) -> dict[str, Reaction]:
    """Reactions at N states, (N, ...); NaN where a sample failed.

    Args:    result: of inverse dynamics, with pose and rates.
             effort: (N, n), the efforts to balance if not those of the result. The contact
             forces are the result's in any case.
             gravity, base: (N, 3) and (N, 9), as the result was given them.
    Returns: by name: <joint>_<chain>, <joint>_force_<chain>, <joint>_moment_<chain>,
             guide_moment_<chain>, contact_<contact>.
    """
    inputs = {
        "pose": result.pose,
        "pose_rate": result.pose_rate,
        "pose_acceleration": result.pose_acceleration,
        "effort": result.effort if effort is None else effort,
        "contact_force": result.contact_force,
    }
    given = given_of(gravity, base)
    values = (
        model.system.with_inputs(tuple(given)).kernel("reactions").run({**inputs, **given}).values
    )
    failed = result.status != Status.ok
    by_place = {}
    seen: dict[str, int] = {}
    for place in reaction_places(model.mechanism):
        at = seen.get(place.quantity, 0)  # chains that have it stand in the mechanism's order
        seen[place.quantity] = at + 1
        contact = place.quantity == "contact"
        array, point = (
            values[name][at].T.copy() if contact else values[name][:, at].T.copy()
            for name in (place.quantity, POINT + place.quantity)
        )
        array[failed] = np.nan
        by_place[place.name] = Reaction(**vars(place), array=array, point=point)
    return by_place
