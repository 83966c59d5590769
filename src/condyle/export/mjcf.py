"""A mechanism for MuJoCo: one file of MJCF, its home the mechanism's and its controls our efforts.

Loops are closed by `connect`, contacts by what carries the platform (`mjcf_platform`). Joints and
actuators are called as their chains, so that `data.actuator("masseter_left").ctrl` is an effort
in N m or N, and joint coordinates are zero at home.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from ..atomic import write_text
from ..errors import CondyleError
from ..mechanism import Mechanism
from ..model.model import Model
from .mjcf_chains import write_chain
from .mjcf_platform import write_platform
from .mjcf_xml import Document


@dataclass(frozen=True)
class Mjcf:
    """text: the document;  notes: what of the mechanism is approximate in it, or left out."""

    text: str
    notes: tuple[str, ...]


def write_mjcf(mechanism: Mechanism, path: str | os.PathLike[str]) -> Mjcf:
    """Write the document, whole or not at all.

    Raises: InputError: if the file cannot be written;  as of `mjcf`.
    """
    made = mjcf(mechanism)
    write_text(path, made.text)
    return made


def mjcf(mechanism: Mechanism) -> Mjcf:
    """A mechanism as MJCF.

    Raises: UnsupportedError: where a surface cannot be followed, or names would meet.
    """
    document = Document(mechanism)
    write_platform(document)
    for chain in mechanism.chains:
        write_chain(document, chain)
    _home(document)
    return Mjcf(document.text(), tuple(document.notes))


def _home(document: Document) -> None:
    """A keyframe with the efforts that hold the mechanism at home, if there are such."""
    try:
        model = Model(document.mechanism, backend="numpy")
        rest = np.zeros((1, document.mechanism.degrees_of_freedom))
        efforts = model.torques(rest, rest, rest, np.zeros((1, 9)))
        if efforts.status[0]:
            raise CondyleError
        document.add("keyframe", "key", name="home", ctrl=efforts.effort[0])
    except CondyleError:
        document.note("no efforts hold it at home, so there is no keyframe with them")
