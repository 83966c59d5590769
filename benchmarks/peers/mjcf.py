"""The cut mechanism as a MuJoCo model: platform, cranks and couplers, each a tree of its own."""

from __future__ import annotations

import numpy as np

from .mechanism import Array, Chain, Mechanism

TINY_MASS = 1e-9  # MuJoCo wants mass on a moving body; at the shaft it does no work


def mjcf(mechanism: Mechanism, couplers: str) -> str:
    """MJCF text; joints in the order platform, cranks, couplers.

    Args: couplers: "tree": three slides to the platform joint and two hinges, in and about the axes
        of N_i0; "free": one free joint at the platform joint, and no platform and no cranks, whose
        forces are products that need no engine.
    """
    bodies = [_coupler(i, c, couplers) for i, c in enumerate(mechanism.chains)]
    if couplers == "tree":
        bodies = [_platform(mechanism), *map(_crank, range(6), mechanism.chains), *bodies]
    return f"""<mujoco model="cut mechanism">
  <compiler angle="radian" inertiafromgeom="false" autolimits="true"/>
  <option gravity="{_row(mechanism.gravity)}" jacobian="dense">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
{"".join(bodies)}  </worldbody>
</mujoco>
"""


def _row(values: Array | list[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _axes(x: Array, y: Array) -> str:
    return f'xyaxes="{_row(np.concatenate([x, y]))}"'


def _platform(mechanism: Mechanism) -> str:
    i = mechanism.inertia
    entries = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return f"""    <body name="platform">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mechanism.mass!r}" fullinertia="{_row(entries)}"/>
    </body>
"""


def _crank(index: int, chain: Chain) -> str:
    return f"""    <body name="crank{index}" pos="{_row(chain.base)}" {_axes(chain.u, chain.w)}>
      <joint type="hinge" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="{TINY_MASS}" diaginertia="{_row([chain.crank_inertia] * 3)}"/>
    </body>
"""


def _coupler(index: int, chain: Chain, couplers: str) -> str:
    slides = "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1"))
    hinges = '<joint type="hinge" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
    lever = (chain.com - 1) * chain.coupler
    moments = [chain.axial, chain.transverse, chain.transverse]
    return f"""    <body name="coupler{index}" {_axes(chain.N[:, 0], chain.N[:, 1])}>
      {slides + hinges if couplers == "tree" else "<freejoint/>"}
      <inertial pos="{lever!r} 0 0" mass="{chain.mass!r}" diaginertia="{_row(moments)}"/>
    </body>
"""
