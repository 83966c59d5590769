"""Contacts of a run that give: forces by their laws of compliance, with damping.

    p = max(N(d) (1 + damping d'), 0)

at the indentation d = -gap [K. H. Hunt and F. R. E. Crossley, J. Applied Mechanics 42, 440 (1975)].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.contact_patches import relative_curvature, surfaces_at
from .columns import KernelColumns
from .plan import FreedContacts

INDENTED = ("gap", "gap_rate", "pose")  # results of the question `rate` that forces follow from


@dataclass(frozen=True)
class ContactForces:
    """force: magnitudes p, (N, c) [N];  elastic: N(d) of these [N];  energy: (N, c) [J]."""

    force: np.ndarray
    elastic: np.ndarray
    energy: np.ndarray


class ContactLaws:
    """The laws of the faces of a run's contacts."""

    def __init__(self, contacts: FreedContacts) -> None:
        self._contacts = contacts
        self._surfaces: KernelColumns | None = None  # at one pose
        self._laws: list[Any] = [table.compliance for table in contacts.tables]
        self._curved = [
            i
            for i, (table, law) in enumerate(zip(contacts.tables, self._laws, strict=True))
            if law.curved and not table.offset_surface.flat
        ]

    def _curvature(self, pose: np.ndarray) -> np.ndarray:
        """(k, 3, N), of all contacts."""
        model = self._contacts.kept.model
        if len(pose) > 1:
            return surfaces_at(model.mechanism, pose)["curvature"]
        if self._surfaces is None:
            self._surfaces = KernelColumns.of([model], "curvature")
        self._surfaces.give("pose", pose[0])
        self._surfaces.run()
        return self._surfaces["curvature"].reshape(-1, 3, 1)

    def forces(self, gap: np.ndarray, gap_rate: np.ndarray, pose: np.ndarray) -> ContactForces:
        """Args: gap, gap_rate: (N, c);  pose: X_EE, (N, 6)."""
        own, count = self._contacts, len(gap)
        curvature = np.zeros((len(own.kept.model.mechanism.contacts), 3, count))
        if (gap[:, self._curved] < 0).any():
            curvature = self._curvature(pose)
        elastic, energy = np.zeros((2, count, len(own.names)))
        damping = np.array([law.damping for law in self._laws])
        for i, (number, table) in enumerate(zip(own.contacts, own.tables, strict=True)):
            if not (gap[:, i] < 0).any():
                continue
            push = np.full(count, own.push[i])
            relative = relative_curvature(table, curvature[number], push)
            elastic[:, i], energy[:, i] = self._laws[i].pressed(-gap[:, i], relative)
        force = elastic * np.maximum(1 - damping * gap_rate, 0.0)
        return ContactForces(force, elastic, energy)
