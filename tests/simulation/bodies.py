"""Free bodies for tests of contacts: a platform on six massless cables without effort."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import condyle


def body(
    contacts: Sequence[dict[str, Any]],
    mass: float = 0.2,
    inertia: Sequence[float] = (1e-4, 1e-4, 1e-4),
    com: Sequence[float] = (0.0, 0.0, 0.0),
) -> condyle.Model:
    """A body of six freedoms less those that bilateral contacts hold."""
    chains = []
    for i in range(6):
        angle, up = np.pi * i / 3, 0.3 * (-1) ** i
        turned = angle + 0.4 * (-1) ** i
        base = [2 * np.cos(angle), 2 * np.sin(angle), 2 + up]
        joint = [0.05 * np.cos(turned), 0.05 * np.sin(turned), 0.02 * (-1) ** i]
        chains.append({"name": f"cable_{i}", "kind": "cable", "base": base, "platform": joint})
    xx, yy, zz = inertia
    platform = {"mass": mass, "com": [*com], "inertia": {"xx": xx, "yy": yy, "zz": zz}}
    data = {"name": "body", "platform": platform, "contact": [*contacts], "chain": chains}
    return condyle.derive(condyle.Mechanism.model_validate(data))


def on_plane(point: Sequence[float], radius: float | None = None, **more: Any) -> dict[str, Any]:
    """A unilateral contact above a horizontal plane, or one of another `slope`."""
    slope, name = more.pop("slope", [0.0, 0.0]), more.pop("name", "contact")
    lower = radius * float(np.hypot(1, np.hypot(*slope))) if radius else 0.0
    offset = point[2] - slope[0] * point[0] - slope[1] * point[1] - lower
    found = {"name": name, "point": [*point], "side": "above", "one_sided": True}
    found |= {} if radius is None else {"ball_radius": radius}
    return found | {"surface": {"kind": "plane", "slope": slope, "offset": offset}} | more


def lifted(model: condyle.Model, start: dict[str, float], duration: float, **more: Any) -> Any:
    """A run in which contacts lift and land, its results at 1 kHz unless said otherwise."""
    scenario = {"duration": duration, "rtol": 1e-11, "start": start, "contacts": {"kind": "rigid"}}
    return condyle.simulate(model, scenario | more)


def events(solution: Any, kind: str) -> list[dict[str, Any]]:
    return [event for event in solution.condyle.events if event["kind"] == kind]
