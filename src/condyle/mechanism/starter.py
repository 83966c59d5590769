"""The starter file of `condyle new`: small, commented, and it works."""

from __future__ import annotations

_STARTER = """\
# {name}: a platform held by two contacts and driven by four crank-coupler chains.
# Every number is an example; change one at a time and run: condyle check {name}.toml
# Frames: {{S}} is fixed, X forward, Y left, Z up. {{M}} is at the platform's mass centre and equals
# {{S}} at home, where all joint coordinates are zero.

name = "{name}"
length_unit = "mm"              # "m" or "mm": every length in this file; all else is SI
gravity = [0, 0, -9.81]         # m/s^2, in {{S}}

[platform]
mass = 0.2                                                   # kg
inertia = {{ xx = 120e-6, yy = 90e-6, zz = 180e-6 }}           # kg m^2, about the mass centre

[platform.points]               # landmarks, in {{M}}; loads act at one of them
tip = [50, 0, 0]

# A contact keeps a platform point (the centre of a ball) on a surface fixed in {{S}}.
# "plane": z = slope[0] x + slope[1] y + offset. The point must be on it at home.
# Optional: side = "below", one_sided = true (it can lift off), friction = {{ coefficient = 0.1 }}
[[contact]]
name = "left"
point = [-20, 60, 30]
surface = {{ kind = "plane", slope = [-0.5, 0], offset = 20 }}
bounds = {{ x = [-35, -5], y = [50, 70] }}                     # optional: where the surface ends

[[contact]]
name = "right"
point = [-20, -60, 30]
surface = {{ kind = "plane", slope = [-0.5, 0], offset = 20 }}
bounds = {{ x = [-35, -5], y = [-70, -50] }}

# An RSS chain: crank pivot `base`, shaft direction `axis`, crank tip at home, all in {{S}};
# `platform` is where the coupler meets the platform, in {{M}}. Lengths follow from the points.
# Two contacts leave four freedoms, so four chains at least.
[[chain]]
name = "front_left"
kind = "RSS"
base = [50, 40, 60]
axis = [0, 1, 0]                # perpendicular to the crank (base to crank_tip)
crank_tip = [30, 40, 60]
platform = [30, 40, 0]
crank = {{ inertia = 6e-5 }}                                   # kg m^2, about the shaft
coupler = {{ mass = 0.004, com = 0.5, transverse = 1e-6, axial = 7e-9 }}
actuator = {{ torque_limit = 3, speed_limit = 6 }}             # optional: N m, rad/s
# Also optional in it: rotor_inertia [kg m^2], gear, viscous [N m s/rad], coulomb [N m];
# torque_limit = [-1, 3] for limits that differ by direction.
# Other kinds of chain: PSS (slider on a rail), SPS (telescopic leg), cable (it only pulls).

[[chain]]
name = "front_right"
kind = "RSS"
base = [50, -40, 60]
axis = [0, 1, 0]
crank_tip = [30, -40, 60]
platform = [30, -40, 0]
crank = {{ inertia = 6e-5 }}
coupler = {{ mass = 0.004, com = 0.5, transverse = 1e-6, axial = 7e-9 }}

[[chain]]
name = "rear_left"
kind = "RSS"
base = [-60, 50, 0]
axis = [0, 1, 0]
crank_tip = [-60, 50, 20]
platform = [-10, 45, 10]
crank = {{ inertia = 6e-5 }}
coupler = {{ mass = 0.004, com = 0.5, transverse = 1e-6, axial = 7e-9 }}

[[chain]]
name = "side"
kind = "RSS"
base = [0, -70, -25]
axis = [1, 0, 0]
crank_tip = [0, -70, -5]
platform = [0, -20, -5]
crank = {{ inertia = 6e-5 }}
coupler = {{ mass = 0.004, com = 0.5, transverse = 1e-6, axial = 7e-9 }}
"""


def starter_text(name: str) -> str:
    """A complete mechanism file for a mechanism called `name`."""
    return _STARTER.format(name=name)
