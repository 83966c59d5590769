"""A body on a rail: five planar contacts leave it X, along which a massless leg pushes."""

from __future__ import annotations

from typing import Any

import condyle

NO_MASS = {"mass": 0.0, "com": 0.0, "transverse": 0.0, "axial": 0.0}
FLAT = [(0.1, 0.0, 0.0), (-0.1, 0.0, 0.0)]  # they bear the weight
STEEP = [(0.1, 0.1, 0.1), (-0.1, 0.1, 0.1), (0.0, 0.3, 0.3)]


def rail(mass: float, actuator: dict[str, Any] | None = None, **more: Any) -> condyle.Model:
    """Args: more: `gravity`;  friction: of the contacts that bear the weight."""
    friction = {"friction": more.pop("friction")} if "friction" in more else {}
    contacts = [
        {"name": f"contact_{i}", "point": [*point]}
        | {"surface": {"kind": "plane", "slope": [0.0, slope], "offset": 0.0}}
        | (friction if point in FLAT else {})
        for i, (point, slope) in enumerate([*((p, 0.0) for p in FLAT), *((p, 1.0) for p in STEEP)])
    ]
    leg = {"name": "leg", "kind": "SPS", "base": [-1.0, 0.0, 0.0], "platform": [0.0, 0.0, 0.0]}
    leg |= {"cylinder": NO_MASS, "piston": NO_MASS, "actuator": actuator or {}}
    platform: dict[str, Any] = {
        "mass": mass,
        "points": {"centre": [0, 0, 0]},
        "com": [0, 0, 0],
        "inertia": {"xx": 0.1, "yy": 0.1, "zz": 0.1},
    }
    data = {"name": "rail", "platform": platform, "contact": contacts, "chain": [leg], **more}
    return condyle.derive(condyle.Mechanism.model_validate(data))
