"""Mechanisms with states of them, for forward dynamics."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from oracles.description import load as raw_file
from oracles.random_mechanism import random_state
from support.cases import BUNDLED_FOLDER
from support.rubbing import Rubbing, drawn

from condyle.model.model import Model

Array = np.ndarray
# Of `drawn`: friction at every contact and losses in every actuator, unless it says otherwise.
DRAWN: dict[str, dict[str, Any]] = {
    "RSS k0 n8": {"contacts": 0, "chains": 8, "seed": 2},
    "RSS k1 n8": {"contacts": 1, "chains": 8, "seed": 3},
    "RSS k2 n8 quadratic": {"surface": "quadratic", "chains": 8, "seed": 4},
    "RSS k2 plain": {"mu": 0.0, "lossy": False, "seed": 5},
    "PSS k2 balls": {"families": ("PSS",), "ball_radius": 3.0, "seed": 6},
    "SPS k1": {"families": ("SPS",), "contacts": 1, "seed": 7, "tilted_gravity": True},
    "mixed k3 quadratic": {
        "families": ("RSS", "PSS", "SPS"), "contacts": 3, "surface": "quadratic", "seed": 8
    },
    "PSS k4": {"families": ("PSS",), "contacts": 4, "seed": 9},
    "RSS k5": {"contacts": 5, "seed": 10},
    "every family": {
        "families": ("RSS", "PSS", "SPS", "cable"), "chains": 8, "limit": 1.0, "seed": 11
    },
}  # fmt: skip
BUNDLED = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
CABLES = ("every family",)  # which other engines do not know
CASES = tuple(name for name in (*DRAWN, *BUNDLED) if name not in CABLES)
COUNT = 3


@cache
def case(name: str) -> Rubbing:
    if name in BUNDLED:
        raw = raw_file(BUNDLED_FOLDER / f"{name}.toml")
        return Rubbing(raw, random_state(np.random.default_rng(7), raw, COUNT))
    return drawn(**{"count": COUNT, **DRAWN[name]})


@cache
def by_numpy(name: str) -> Model:
    distribution = "minimax" if name in CABLES else None  # other efforts of mixed units have none
    return Model(case(name).mechanism, distribution=distribution, backend="numpy")


def load_of(c: Rubbing) -> tuple[Array, Array]:
    """Wrench and point, as models take them."""
    wrench, where = c.states["wrench"], c.states["load_point"]
    points = c.mechanism.platform.points
    point = points[where] if where else (0.0, 0.0, 0.0)
    return wrench, np.tile(point, (len(wrench), 1))


def efforts(c: Rubbing) -> Array:
    """Efforts of sizes that the joints know, (N, n)."""
    rng = np.random.default_rng(1)
    sizes = [0.2 if chain["kind"] == "RSS" else 10.0 for chain in c.raw["chain"]]
    return rng.normal(0, 1, (len(c.states["q"]), len(sizes))) * sizes


def state(c: Rubbing, m: Model) -> tuple[Array, Array]:
    """q and q' in the order of the model."""
    order = [c.states["names"].index(name) for name in m.independent]
    return c.states["q"][:, order], c.states["qd"][:, order]


def close(got: Any, wanted: Any, tolerance: float, floor: float = 0.0) -> None:
    """Equal relative to the largest component (or `floor`)."""
    got, wanted = np.asarray(got), np.asarray(wanted)
    scale = max(np.abs(wanted).max(initial=0.0), floor)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * scale)
