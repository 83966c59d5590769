"""Forward dynamics on the cut-open tree: joint-space matrices of an engine, loops as constraints.

    [M  -L^T  -D] [a     ]   [S^T (effort - losses) + load - h]
    [L   0     0] [mu    ] = [- L' v                          ]
    [C   0     0] [lambda]   [- C' X'                         ]

with all coordinates of the tree in a, the loops' closing forces mu and the contacts' lambda; D is
the wrench of the contacts under a pattern of friction's signs. Nothing is eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .closure import complete_state, contact_normals, contact_rows, independent_coordinates
from .cut_tree import CutTree
from .description import COORDINATES, Raw, read
from .rotations import platform_motion
from .rubbing import losses, patterns, touching

Array = np.ndarray


@dataclass(frozen=True)
class Found:
    """X_EE'', (6,), and the contact forces, (k,), of a consistent pattern."""

    acceleration: Array
    force: Array


def forward_dynamics(
    engine: CutTree,
    raw: Raw,
    pose: Array,
    rate: Array,
    effort: Array,
    wrench: Array,
    load_point: str | Array | None,
) -> list[Found]:
    """The motion of every consistent pattern: one, unless the mechanism jams.

    Args: wrench: force and moment on the platform at `load_point`, (6,) in {S}.
    """
    d, j = read(raw), engine.joints(pose, rate)
    motion = platform_motion(pose, rate)
    nv, rows, k = len(j.v), len(j.L), len(d.contacts)
    M, right = j.M.copy(), -j.h
    rotor = losses(raw, np.zeros(len(effort)), np.ones(len(effort)))
    right[engine.drives] += effort - losses(raw, j.v[engine.drives], np.zeros(len(effort)))
    M[engine.drives, engine.drives] += rotor
    right[:6] += motion.jacobian(d.load_point(load_point)).T @ wrench[:3]
    right[3:6] += motion.axes.T @ wrench[3:]
    C = contact_rows(d, motion)
    # C X'' + C' X' = 0 of any motion on the contacts gives C' X'.
    names = independent_coordinates(d)
    free = [COORDINATES.index(name) for name in names]
    bias = -C @ complete_state(d, names, pose[free], rate[free], np.zeros(len(free)))[2]
    touch, _, drag = touching(d, raw, pose, rate)
    N, T = np.zeros((2, nv, k))
    for i, (contact, n) in enumerate(zip(d.contacts, contact_normals(d, motion), strict=True)):
        N[:6, i] = motion.jacobian(contact.point).T @ n
        T[:3, i], T[3:6, i] = drag[i], motion.axes.T @ np.cross(touch[i], drag[i])
    found = []
    for sigma in np.array(patterns(drag), float):
        A = np.zeros((nv + rows + k, nv + rows + k))
        A[:nv, :nv], A[:nv, nv : nv + rows], A[:nv, nv + rows :] = M, -j.L.T, T * sigma - N
        A[nv : nv + rows, :nv], A[nv + rows :, :6] = j.L, C
        x = _solved(A, np.concatenate([right, -j.drift, -bias]))
        force = x[nv + rows :]
        if (sigma * force >= 0).all():
            found.append(Found(x[:6], force))
    return found


def _solved(A: Array, b: Array) -> Array:
    """A^-1 b; rows and columns are first made of one size, and one step refines."""
    columns = np.abs(A).max(axis=0)
    A = A / columns
    rows = np.abs(A).max(axis=1)
    A, b = A / rows[:, None], b / rows
    x = np.linalg.solve(A, b)
    return (x + np.linalg.solve(A, b - A @ x)) / columns
