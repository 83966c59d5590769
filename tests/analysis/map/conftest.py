"""Models of the bundled mechanisms, by numpy: no kernel is worth its compiler here."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import condyle
from condyle.model.model import Model

Models = Callable[[str], Model]


@pytest.fixture(scope="session")
def model_of() -> Models:
    made: dict[str, Model] = {}

    def model(name: str) -> Model:
        if name not in made:
            made[name] = condyle.derive(condyle.load_mechanism(name), backend="numpy")
        return made[name]

    return model
