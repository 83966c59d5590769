"""A force from analogue channels, turned with the head into the mechanism's frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from condyle.errors import InputError
from condyle.motion.load import Load
from condyle.motion.markers.bodies import Bodies
from condyle.motion.markers.labels import find_label
from condyle.motion.markers.recording import Recording
from condyle.motion.markers.registration import Registration
from condyle.motion.units import unit_factor
from condyle.motion.words import short


def force_channels(
    recording: Recording,
    bodies: Bodies,
    registration: Registration,
    channels: Sequence[str],
) -> Load:
    """The force on the platform whose components along the laboratory's axes are three channels.

    Every frame's is the mean of its samples, turned by the base's rotation and the registration;
    where the base is not seen there is none, and the load is linear between its neighbours.

    Raises: InputError: for channels that are not there, or are no forces.
    """
    if len(channels) != 3:
        raise InputError(f"force: got {len(channels)} channels, expected three: along X, Y, Z")
    columns = []
    for name in channels:
        i = find_label(name, recording.channels, recording.source, "channel")
        unit = recording.channel_units[i]
        try:
            factor = unit_factor(unit or "N", ("force", 0))
        except InputError:
            raise InputError(
                f'{recording.source}: channel "{short(name)}" is in {short(unit)}; a force is in '
                "N, kN or mN. Scale the channel, or write the load as a table"
            ) from None
        columns.append(recording.analog[:, i] * factor)
    turn = bodies.fixed.fit.rotation
    force = np.column_stack(columns)
    in_base = np.einsum("fji,fj->fi", turn, force) @ registration.rotation.T
    known = np.isfinite(in_base).all(axis=1)
    return Load.from_arrays(recording.t[known], in_base[known], source=recording.source)
