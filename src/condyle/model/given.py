"""The door of everything that takes a model."""

from __future__ import annotations

import os
from typing import Any

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from .model import Model, derive


def as_model(given: Any) -> Model:
    """The model given, or that of a mechanism, of its file or of its bundled name.

    Raises: InputError: for anything else; errors of `load_mechanism` and `derive`.
    """
    if isinstance(given, Model):
        return given
    if isinstance(given, Mechanism | str | os.PathLike):
        return derive(given)
    raise InputError(
        "model: expected a model, a mechanism, the path of a mechanism file or the name of a "
        f"bundled mechanism; got {type(given).__name__}"
    )
