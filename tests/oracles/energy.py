"""Kinetic and potential energy of platforms on RSS chains, written by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from .description import Description, joint, rod_angles, swing_axes
from .rotations import Motion


def rod_energy(d: Description, chain: Any, P: np.ndarray, V: np.ndarray) -> tuple[float, float]:
    """Kinetic and potential energy of crank and coupler, from the motion of M."""
    _, S = joint(chain, P)
    e, t = P - S, np.cross(chain.axis, S - chain.G)
    rate = e @ V / (e @ t)  # the rod keeps its length
    S_rate = t * rate
    axes = np.column_stack(swing_axes(chain, rod_angles(chain, e)[0]))
    angles = np.linalg.lstsq(np.cross(axes.T, e).T, V - S_rate, rcond=None)[0]
    omega, n, rod = axes @ angles, e / chain.length, chain.rods[0]
    part = rod.com / chain.length
    v, spin = S_rate + part * (V - S_rate), (omega @ n) ** 2
    kinetic = chain.drive * rate**2 + rod.mass * v @ v
    kinetic += rod.transverse * (omega @ omega - spin) + rod.axial * spin
    return kinetic / 2, -rod.mass * d.gravity @ (S + part * e)


def energy(d: Description, motion: Motion) -> tuple[float, float]:
    """Of all bodies [J]."""
    spin = motion.R.T @ motion.omega
    kinetic = (d.mass * motion.velocity @ motion.velocity + spin @ d.inertia @ spin) / 2
    potential = -d.mass * d.gravity @ motion.origin
    for chain in d.chains:
        more = rod_energy(d, chain, *motion.point(chain.M)[:2])
        kinetic, potential = kinetic + more[0], potential + more[1]
    return kinetic, potential
