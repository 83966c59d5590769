"""What a mechanism is: freedoms, dependent coordinates, residuals, singularity at home."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..kinematics.chain import FAMILIES
from ..kinematics.singularity import KINDS
from ..mechanism.home import home_residuals
from ..mechanism.mechanism import Mechanism
from ..model.evaluator import Evaluator


@dataclass(frozen=True)
class Description:
    """A mechanism at home; `data` for programs, `str` for people."""

    data: dict[str, Any]

    def __str__(self) -> str:
        d, s = self.data, self.data["singularity"]
        width = max(len(name) for name in [*d["chains"], *d["contacts"]])
        lines = [
            f"{d['name']}: {_count(d['chains'], 'chain')}, {_count(d['contacts'], 'contact')}, "
            f"{d['degrees_of_freedom']} degrees of freedom, "
            f"actuation redundancy {d['redundancy']}",
            f"independent coordinates: {', '.join(d['independent'])}",
            f"dependent coordinates:   {', '.join(d['dependent']) or 'none'}",
            f"characteristic length:   {d['characteristic_length'] * 1e3:.3f} mm "
            "(mean distance of platform joints and contact points from O_M)",
            "chains",
        ]
        for name, chain in d["chains"].items():
            lines.append(
                f"  {name:<{width}}  {chain['kind']}, joint [{chain['joint_unit']}], effort "
                f"[{chain['effort_unit']}], transmission at home {chain['transmission']:+.4f}"
            )
        if d["contacts"]:
            lines.append("contacts")
        for name, contact in d["contacts"].items():
            ball = contact["ball_radius"]
            options = [f", {contact['side']}"] if contact["side"] else []
            options += [f", ball of radius {ball * 1e3:g} mm"] if ball is not None else []
            options += [", one-sided"] if contact["one_sided"] else []
            lines.append(
                f"  {name:<{width}}  {contact['kind']}{''.join(options)}, "
                f"{contact['residual'] * 1e3:+.2g} mm off its surface at home"
            )
        sigma = ", ".join(f"{v:.4g}" for v in s["J_W_sigma"])
        lines += [
            "singularity at home (dimensionless)",
            f"  J_W: rank {s['J_W_rank']} of {d['degrees_of_freedom']}, singular values {sigma}, "
            f"condition {s['J_W_condition']:.4g}",
            f"  J_A: smallest over largest {s['J_A_ratio']:.4g}",
            f"  near: {s['near']}",
        ]
        return "\n".join(lines)


def _count(items: Sized, word: str) -> str:
    return f"{len(items)} {word}" + "s" * (len(items) != 1)


def describe(mechanism: Mechanism) -> Description:
    """Describe a mechanism at home."""
    model = Evaluator(mechanism, backend="numpy")  # one pose: building a kernel takes longer
    s = model.configuration(np.zeros((1, 6))).singularity
    m = mechanism.degrees_of_freedom
    return Description(
        {
            "name": mechanism.name,
            "degrees_of_freedom": m,
            "redundancy": len(mechanism.chains) - m,
            "independent": list(model.independent),
            "dependent": list(model.dependent),
            "characteristic_length": s.length,
            "chains": {
                chain.name: {
                    "kind": chain.kind,
                    "joint_unit": FAMILIES[chain.kind].joint_unit,
                    "effort_unit": FAMILIES[chain.kind].effort_unit,
                    "transmission": float(s.transmission[0, i]),
                }
                for i, chain in enumerate(mechanism.chains)
            },
            "contacts": {
                contact.name: {
                    "kind": contact.surface.kind,
                    "side": contact.side,
                    "ball_radius": contact.ball_radius,
                    "one_sided": contact.one_sided,
                    "residual": float(residual),
                }
                for contact, residual in zip(
                    mechanism.contacts, home_residuals(mechanism), strict=True
                )
            },
            "singularity": {
                "J_W_sigma": [float(v) for v in s.J_W_sigma[0]],
                "J_W_rank": int(s.rank[0]),
                "J_W_condition": float(min(s.condition[0], 1e300)),
                "J_A_ratio": float(s.inverse_ratio[0]),
                "near": KINDS[int(s.kind()[0])],
            },
        }
    )
