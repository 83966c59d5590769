"""Bites with contacts that lift and land: the chewing robot on every bundled food, under the
controllers of the guide, its balls held up to their sockets by the preload alone:

    python -m benchmarks.bites

Forces, overshoot, how the contacts were open, and seconds of a processor a second of motion.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import xarray as xr

import condyle
from condyle.questions.load.food import FOODS

FORCE = 20.0  # newtons, that `bite_force` asks for
LAWS: dict[str, dict[str, Any]] = {
    "computed_torque": {"stiffness": 10000.0},
    "bite_force": {"stiffness": 2500.0, "force": FORCE, "point": "right_molar"},
}
PRELOADS = (0.0, 2.0)


def robot() -> condyle.Model:
    """The bundled chewing robot, whose sockets only push: its file lets them hold both ways."""
    machine = condyle.load_mechanism("masticatory")
    sides = {"side": "below", "one_sided": True, "restitution": 0.3}
    contacts = machine.contact_names
    return condyle.derive(
        machine.set({f"contact.{n}.{key}": x for n in contacts for key, x in sides.items()})
    )


def bitten(model: condyle.Model, law: str, food: str, preload: float) -> xr.Dataset:
    """The scenarios `chew.toml` and `bite.toml` of the examples until the path opens again."""
    how = {"distribution": "bounded", "preload": preload}
    return condyle.simulate(
        model,
        {
            "duration": 1.9,
            "rate": 500.0,
            "method": "rk4",
            "step": 1e-4,
            "contacts": {"kind": "rigid"},
            "controller": {"kind": law, "rate": 1000.0, "delay": 1} | LAWS[law] | how,
            "sensors": {"encoder_resolution": 1e-5, "velocity_cutoff": 200.0},
            "load": [{"kind": "food", "food": food, "point": "right_molar"}],
        },
    )


def bites(model: condyle.Model) -> None:
    """Print a line for each."""
    for law in LAWS:
        for food in FOODS:
            for preload in PRELOADS:
                start = time.process_time()
                run = bitten(model, law, food, preload)
                seconds = (time.process_time() - start) / float(run["time"][-1])
                force = np.linalg.norm(run["load_force"].values[:, 0], axis=1).max()
                over = f", {force / FORCE - 1:+.1%}" if law == "bite_force" else ""
                lifts = run.condyle.contact_lifts
                opened = "; ".join(
                    f"{name} open {one['count']} times, {one['open']:.3g} s"
                    for name, one in lifts.items()
                )
                print(
                    f"{law}, {food}, preload {preload:g} N: {force:.1f} N{over}; "
                    f"{opened or 'no contact lifts'}; {seconds:.2f} s a second of motion"
                )


if __name__ == "__main__":
    model = robot()
    bitten(model, "bite_force", "bolus", 0.0)  # kernels
    bitten(model, "computed_torque", "bolus", 0.0)
    bites(model)
