"""What other rooms may draw of a mechanism without knowing this one: see `accessors`."""

from __future__ import annotations

import numpy as np

from ...mechanism import Contact, Mechanism
from ...mechanism.home import characteristic_length
from .colours import LIGHT, styles
from .hull import platform_hull
from .patches import contact_patch


class Look:
    """The shapes and colours of one mechanism at home.

    colours: of its chains, "#rrggbb";  hull: vertices of the platform, (V, 3) [m] in {M}.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        names = mechanism.chain_names
        self.colours = {n: LIGHT[s.colour] for n, s in zip(names, styles(names), strict=True)}
        self.hull = platform_hull(mechanism)[0]
        self._size = characteristic_length(mechanism)

    def patch(self, contact: Contact) -> tuple[np.ndarray, np.ndarray]:
        """The wall within its bounds, or near home: vertices (V, 3) [m] in {S}, faces (F, 3)."""
        patch = contact_patch(contact, np.array([contact.point]), self._size)
        return patch.vertices, patch.faces
