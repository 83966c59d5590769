"""How the surfaces curve where the contacts are: what the patches of contacts follow from."""

from __future__ import annotations

import casadi as ca

from ..graph.program import Program
from ..kinematics.constraints import contact_frame
from .builder import Builder
from .numbers import single_contacts
from .platform import given
from .structure import Structure

ALONG = 0.999  # cosine from which the platform's X is taken to be along the normal


def curvature(structure: Structure) -> Program:
    """The second fundamental form of the surface of each ball's centre, at whole poses.

    Result: curvature (k, 3) [1/m]: -h_xx, -h_yy and -h_xy of its height h along the unit normal,
    over x, the platform's X as far as it is in the tangent plane (its Z where X is along the
    normal), and y = n x X. Of poses off the surfaces it is that of the level surface of phi there.
    """
    b = Builder(structure)
    platform, contacts = given(b, still=True), single_contacts(structure, b.parameter)
    frame = contact_frame(contacts, platform.position, platform.R)
    found = [ca.SX(0, 3)]
    for contact, gradient, lever in zip(contacts, frame.gradients, frame.levers, strict=True):
        size = ca.norm_2(gradient)
        n, at = gradient / size, platform.position + lever
        forward, up = platform.R[:, 0], platform.R[:, 2]
        x = ca.if_else(ca.fabs(ca.dot(n, forward)) < ALONG, forward, up)
        x = x - n * ca.dot(n, x)
        x = x / ca.norm_2(x)
        y = ca.cross(n, x)
        xx, yy, both = (contact.bending(at, v) for v in (x, y, x + y))
        found.append(ca.horzcat(xx, yy, (both - xx - yy) / 2) / size)
    b.output("curvature", ca.vertcat(*found), "1/m", len(contacts), 3)
    return b.finish()
