"""Scenarios that are allowed and look like a slip: of units, or of what belongs together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..mechanism.home import characteristic_length
from .plan import ClosedLoop, Plan

COARSE = 0.05  # rad or m: a coarser encoder hardly resolves a motion
THICK = 0.5  # food over the mechanism's size
AWAY = 0.02  # start to path, in the mechanism's size and radians


def odd_things(plan: Plan) -> Iterator[str]:
    """A line for each thing to look at."""
    size = characteristic_length(plan.model.mechanism)
    for load in plan.loads:
        if (thickness := float(load.numbers.get("thickness", 0.0))) > THICK * size:
            yield (
                f'load "{load.name}": {thickness * 1e3:.4g} mm of food in a mechanism of '
                f'{size * 1e3:.4g} mm; lengths are in metres, or length_unit = "mm"'
            )
    if not isinstance(plan.drive, ClosedLoop):
        return
    drive = plan.drive
    names = plan.model.independent
    begin = drive.path.states(np.zeros(1))[0][0]
    scale = np.array([size if n in "XYZ" else 1.0 for n in names])
    if (off := np.abs(begin - plan.q) / scale).max() > AWAY:
        name = names[int(off.argmax())]
        yield (
            f"the path begins elsewhere than the mechanism, mostly in {name}; "
            "start.on_motion = true begins there"
        )
    end = float(drive.path.times[-1])
    if plan.duration > end + 1e-9:
        yield f"the motion ends at {end:g} s of {plan.duration:g} s; after that the path stays"
    if drive.sensing is not None and (coarse := drive.sensing.numbers["resolution"].max()) > COARSE:
        yield f"sensors.encoder_resolution: {coarse:g} rad (or m) a count; is it in degrees?"
