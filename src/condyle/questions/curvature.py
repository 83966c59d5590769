"""How the surfaces curve where the contacts are: what the patches of contacts follow from."""

from __future__ import annotations

import casadi as ca

from ..graph.program import Programs
from ..kinematics.constraints import ContactSymbols, contact_frame
from .builder import Builder
from .numbers import single_contacts
from .platform import given
from .structure import Structure

STEPS = 3  # of Newton, to the surface
ALONG = 0.999  # cosine from which the platform's X is taken to be along the normal


def curvature(structure: Structure) -> Programs:
    """The surfaces of the balls' centres at whole poses, also at some that are a little off them.

    Results: gap (k,) [m]: signed distance from the surface along the normal of the level of phi,
    positive along it.  level (k,) [m] and steepness (k,): phi and |grad phi|.  curvature (k, 3)
    [1/m], where that normal meets the surface: the second fundamental form, -h_xx, -h_yy and -h_xy
    of the height h along the unit normal, over x, the platform's X as far as it is in the tangent
    plane (its Z where X is along the normal), and y = n x X.
    """
    b = Builder(structure)
    platform, contacts = given(b, still=True), single_contacts(structure, b.parameter)
    frame = contact_frame(contacts, platform.position, platform.R)
    columns, gaps, levels, sizes = [ca.SX(0, 3)], [], [], []
    for contact, gradient, lever in zip(contacts, frame.gradients, frame.levers, strict=True):
        at = platform.position + lever
        bent, gap = fundamental_form(contact, at, gradient, platform.R)
        columns.append(bent)
        gaps.append(gap)
        levels.append(contact.phi(at))
        sizes.append(ca.norm_2(gradient))
    k = len(contacts)
    b.output("curvature", ca.vertcat(*columns), "1/m", k, 3)
    for name, values, unit in (
        ("gap", gaps, "m"),
        ("level", levels, "m"),
        ("steepness", sizes, ""),
    ):
        b.output(name, ca.vertcat(ca.SX(0, 1), *values), unit, k)
    return Programs(b.finish(), single=True)


def fundamental_form(
    contact: ContactSymbols, at: ca.SX, gradient: ca.SX, R: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """The second fundamental form (1, 3) [1/m] where the normal through a ball's centre meets the
    surface, as `curvature` has it, and the centre's gap [m].

    Args: at: (3,);  gradient: of phi there, (3,);  R: of the platform, (3, 3).
    """
    forward, up = R[:, 0], R[:, 2]
    gap = normal_gap(contact, at)
    foot = at - gap * gradient / ca.norm_2(gradient)
    slope = contact.gradient(foot)
    steepness = ca.norm_2(slope)
    n = slope / steepness
    x = ca.if_else(ca.fabs(ca.dot(n, forward)) < ALONG, forward, up)
    x = x - n * ca.dot(n, x)
    x = x / ca.norm_2(x)
    y = ca.cross(n, x)
    xx, yy, both = (contact.bending(foot, v) for v in (x, y, x + y))
    return ca.horzcat(xx, yy, (both - xx - yy) / 2) / steepness, gap


def normal_gap(contact: ContactSymbols, at: ca.SX) -> ca.SX:
    """Signed distance [m] of a ball's centre, (3,), from the surface along the normal of the level
    of phi there."""
    gradient = contact.gradient(at)
    size = ca.norm_2(gradient)
    n, gap = gradient / size, contact.phi(at) / size
    for _ in range(STEPS):
        foot = at - gap * n
        gap = gap + contact.phi(foot) / ca.dot(contact.gradient(foot), n)
    return gap
