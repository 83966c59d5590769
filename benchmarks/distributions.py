"""Every distribution on every bundled machine that it fits, along the machine's own motion."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from condyle.distribution import OBJECTIVES
from condyle.errors import InputError
from condyle.mechanism.files import load_mechanism
from condyle.mechanism.library import bundled_mechanisms
from condyle.model.model import Model
from condyle.motion.motion_and_load import motion_and_load

from .own import python_probe
from .rows import Probe

SPARSE = 10.0  # Hz, of objectives that are solved one sample after the other


def distribution_probes() -> Iterator[Probe]:
    """`solve` with all outputs, of the bundled motion and load, or of the trial motion."""
    for name in bundled_mechanisms():
        mechanism = load_mechanism(name)
        for label, objective in OBJECTIVES.items():
            if objective.follows:
                continue
            try:
                model = Model(mechanism, backend="compiled", distribution=label)
            except InputError:  # does not fit the mechanism's units or limits
                continue
            rate = SPARSE if objective.term is None else None
            motion, load = motion_and_load(mechanism, rate=rate)
            call = partial(model.solve, motion, load, flag=True)
            yield python_probe(f"{name} along its motion: {label}", call, len(motion.t))
