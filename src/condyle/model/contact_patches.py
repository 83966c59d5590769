"""Indentation, area and pressure of contacts under their forces, at poses."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..graph.program import Programs
from ..mechanism.compliance import ContactPatch
from ..mechanism.contact import Contact
from ..mechanism.mechanism import Mechanism
from ..questions import Question
from ..questions.file_numbers import numbers_of
from ..questions.structure import Structure, structure_of

Array = np.ndarray


def compliant(mechanism: Mechanism) -> bool:
    """Whether a contact has a law by which it gives."""
    return any(contact.compliance is not None for contact in mechanism.contacts)


def contact_patches(mechanism: Mechanism, pose: Array, force: Array) -> ContactPatch:
    """The contacts at N poses, (N, k) each; NaN of contacts without `compliance`.

    A unilateral contact that would have to pull has no patch: 0. The stiffness of a contact
    without compliance is infinite, of a lost one 0.

    Args: pose: X_EE, (N, 6);  force: of the contacts on the platform along the unit normals,
          (N, k) [N].
    """
    curvature = surfaces_at(mechanism, pose)["curvature"]
    names = ContactPatch.__dataclass_fields__
    columns = {name: np.full(force.shape, np.nan) for name in names}
    for i, contact in enumerate(mechanism.contacts):
        if (law := contact.compliance) is None:
            columns["stiffness"][:, i] = np.inf
            continue
        push = np.where(force[:, i] < 0, -1.0, 1.0)
        size = np.abs(force[:, i])
        lost = (push != contact.push) & contact.one_sided
        size = np.where(lost, 0.0, size)
        patch = law.patch(size, relative_curvature(contact, curvature[i], push))
        for name in names:
            columns[name][:, i] = getattr(patch, name)
        columns["stiffness"][lost, i] = 0.0
    return ContactPatch(**columns)


def relative_curvature(contact: Contact, curvature: Array, push: Array) -> Array:
    """Principal relative curvatures of a contact with compliance, (N, 2), rising [1/m].

    Args: curvature: (3, N), of `surfaces_at`;  push: signs of the force on the ball, (N,).
    """
    law: Any = contact.compliance
    if not law.curved:
        return np.zeros((len(push), 2))
    wall = _parallel_curvature(curvature, push * ((contact.ball_radius or 0.0) + contact.clearance))
    relative: Array = law.relative_curvature(-push * wall, contact.ball_radius)
    return relative


def surfaces_at(mechanism: Mechanism, pose: Array) -> dict[str, Array]:
    """Results of the question `curvature` at poses, (N, 6), samples last."""
    return _kernel(mechanism).run({"pose": pose}).values


def _parallel_curvature(curvature: Array, distance: Array) -> Array:
    """Curvature (xx, yy, xy) of the surface that lies by a distance (N,) [m] against the normal of
    one of curvature (3, N): S (1 - distance S)^-1."""
    xx, yy, xy = curvature
    det, trace = xx * yy - xy**2, xx + yy
    with np.errstate(divide="ignore", invalid="ignore"):
        along = distance * det
        return np.stack([xx - along, yy - along, xy]) / (1 - distance * (trace - along))


@lru_cache(maxsize=32)
def _kernel(mechanism: Mechanism) -> NumpyKernel:
    structure = structure_of(mechanism)
    return NumpyKernel(_programs(structure), numbers_of(structure, mechanism))


@lru_cache(maxsize=8)
def _programs(structure: Structure) -> Programs:
    return Question.about(structure, "curvature").variants()
