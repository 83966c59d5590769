"""Forward dynamics of every pattern of friction's signs, by free body diagrams and numpy alone.

The equations of `rubbing.balance` are affine in the accelerations of the independent coordinates,
so their differences over unit accelerations are the columns of the unknown ones:

    sum_j B_j q2_j - sum_k lambda_k (N_k - sigma_k T_k) = C effort - b_0,    b = b_0 + B q2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from .closure import complete_state, independent_coordinates
from .description import COORDINATES, Raw, read
from .rubbing import balance

Array = np.ndarray


@dataclass(frozen=True)
class Pattern:
    """One pattern of signs.

    acceleration: q2, (m,);  force: (k,);  margin: the smallest sigma lambda over the forces that
    add up to the contact forces;  det: of its equations;  gain: d q2 / d effort, (m, n).
    """

    signs: tuple[int, ...]
    acceleration: Array
    force: Array
    margin: float
    det: float
    gain: Array


def patterns_of(
    raw: Raw,
    pose: Array,
    rate: Array,
    effort: Array,
    wrench: Array,
    where: str | Array | None,
) -> list[Pattern]:
    """All patterns, whether or not they hold; the arguments are those of one sample."""
    d = read(raw)
    names = independent_coordinates(d)
    free, m = [COORDINATES.index(name) for name in names], len(names)
    given = pose[free], rate[free]
    states = [complete_state(d, names, *given, q2) for q2 in np.vstack([np.zeros(m), np.eye(m)])]
    still, *unit = (balance(raw, pose, rate, s[2], wrench, where) for s in states)
    B = np.column_stack([one.b - still.b for one in unit])
    right = still.C @ effort - still.b
    rubs, found = still.rubbing(), []
    for signs in product((1, -1), repeat=len(rubs)):
        sigma = np.zeros(len(still.drag))
        sigma[rubs] = signs
        D = still.along(sigma)
        A = np.hstack([B, -D])
        inverse = np.linalg.inv(A)
        x = inverse @ right
        x += inverse @ (right - A @ x)
        terms = np.abs(inverse) @ (np.abs(still.C) @ np.abs(effort) + np.abs(still.b))
        pushed = (sigma * x[m:])[rubs] / terms[m:][rubs].max(initial=0.0)
        margin = float(pushed.min(initial=np.inf))
        gain = inverse[:m] @ still.C
        found.append(Pattern(signs, x[:m], x[m:], margin, float(np.linalg.det(A)), gain))
    return found
