"""Poses at which the ball of a contact overlaps its surface, of one mechanism or of variants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mechanism.contact import Contact
from ..mechanism.coordinates import rotations
from ..mechanism.surface.overlap import Ends, is_parallel, may_overlap, overlaps
from ..questions.numbers import Layout
from ..questions.structure import Structure
from ..status import Status


@dataclass(frozen=True)
class ContactBall:
    """A contact whose ball may overlap its surface, by the numbers of V mechanisms.

    form, ends: of its surface;  points: (V, 3) [m] in {M};  constants: (V, ...), of the form.
    """

    form: str
    ends: Ends
    points: np.ndarray
    constants: np.ndarray

    def overlaps(self, pose: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Where it does, (N,). Args: pose: (N, 6);  which: numbers of their mechanisms, (N,)."""
        turned = rotations(pose[:, 3:]) @ self.points[which][..., None]
        centres, hit = pose[:, :3] + turned[..., 0], np.zeros(len(pose), dtype=bool)
        distinct, own = np.unique(self.constants, axis=0, return_inverse=True)
        kind = own.ravel()[which]
        for i in np.unique(kind).tolist():
            rows = np.flatnonzero(kind == i)
            hit[rows] = overlaps(self.form, tuple(distinct[i]), centres[rows], self.ends)
        return hit


def balls(
    structure: Structure, parameters: np.ndarray, contacts: Sequence[Contact]
) -> tuple[ContactBall, ...]:
    """Balls of mechanisms of a structure, by their shared numbers, (V, ...)."""
    of_contacts, places = [], Layout.of(structure).parameters
    for i, ((form, _), contact) in enumerate(zip(structure.contacts, contacts, strict=True)):
        if not is_parallel(form):
            continue
        points, constants = (
            parameters[:, start : start + count]
            for start, count in (places[f"contact_point_{i}"], places[f"contact_surface_{i}"])
        )
        if any(may_overlap(form, tuple(own)) for own in np.unique(constants, axis=0)):
            of_contacts.append(ContactBall(form, contact.ends, points, constants))
    return tuple(of_contacts)


def mark(
    contact_balls: Sequence[ContactBall],
    status: np.ndarray,
    pose: np.ndarray,
    which: np.ndarray | None = None,
) -> None:
    """Status `overlap` where a pose, (N, 6), that can be reached has a ball do so, in place."""
    if not contact_balls:
        return
    rows = np.flatnonzero((status != Status.unreachable) & np.isfinite(pose).all(axis=1))
    own = np.zeros(len(rows), dtype=int) if which is None else which[rows]
    for ball in contact_balls:
        status[rows[ball.overlaps(pose[rows], own)]] = Status.overlap
