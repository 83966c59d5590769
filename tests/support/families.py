"""Random mechanisms of every family, and states to try them at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from oracles.description import Raw
from oracles.random_mechanism import random_mechanism, random_state, toml_text

from condyle.mechanism import Mechanism, parse
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from support.loads import parts

MIXED = ("RSS", "PSS", "SPS")
MECHANISMS: dict[str, dict[str, Any]] = {
    "rss": {},
    "rss_k0": {"contacts": 0},
    "rss_k3_n7": {"contacts": 3, "chains": 7},
    "pss": {"families": ("PSS",), "tilted_gravity": True},
    "pss_k0": {"families": ("PSS",), "contacts": 0},
    "pss_k1": {"families": ("PSS",), "contacts": 1},
    "pss_k3_n8": {"families": ("PSS",), "contacts": 3, "chains": 8},
    "pss_along_x": {"families": ("PSS",), "rod_along_x": True},
    "sps_k0": {"families": ("SPS",), "contacts": 0, "tilted_gravity": True},
    "sps_k1": {"families": ("SPS",), "contacts": 1},
    "sps_k2_n7": {"families": ("SPS",), "chains": 7},
    "sps_k3": {"families": ("SPS",), "contacts": 3},
    "sps_along_x": {"families": ("SPS",), "rod_along_x": True},
    "mixed": {"families": MIXED},
    "mixed_k0_n8": {"families": MIXED, "chains": 8, "contacts": 0},
    "mixed_k1_n7": {"families": MIXED, "chains": 7, "contacts": 1, "tilted_gravity": True},
    "mixed_k3": {"families": MIXED, "contacts": 3},
}
# Other engines know no cables, and the default distribution refuses mixed units with cables.
WITH_CABLES: dict[str, dict[str, Any]] = {
    "cable_k0": {"families": ("cable",), "contacts": 0},
    "muscle_k0": {"families": ("muscle",), "contacts": 0},
    "every_family": {"families": (*MIXED, "cable"), "chains": 8},
}
LINES: dict[str, dict[str, Any]] = {
    "k0": {"families": ("cable",), "contacts": 0},
    "k2_n9": {"families": ("cable",), "chains": 9, "tilted_gravity": True},
    "k3_curved": {"families": ("cable",), "contacts": 3, "surface": "quadratic"},
    "along_x": {"families": ("cable",), "rod_along_x": True},
    "mixed_k1": {"families": ("cable", "SPS", "PSS"), "contacts": 1, "chains": 8},
    "mixed_k2": {"families": ("cable", "PSS"), "contacts": 2, "chains": 7},
}
# Cables and motors: the default distribution refuses to add squares of N and N m.
TWO_UNITS = {"k2_two_units": {"families": ("cable", "RSS"), "contacts": 2, "chains": 8}}
ALL = MECHANISMS | WITH_CABLES | LINES | TWO_UNITS
SCALES = (0.0, 0.05, 1.0, 1.0)  # home, near it, and far


@dataclass(frozen=True, eq=False)
class Case:
    """A mechanism and N states of it; load is (N, 9) wrench and point."""

    raw: Raw
    mechanism: Mechanism
    states: dict[str, Any]
    load: np.ndarray

    @lru_cache(maxsize=64)  # noqa: B019 - cases are kept
    def model(self, *choices: str, backend: str = "numpy", **options: Any) -> Model:
        """Always the same object, which no test changes.

        Args: choices: formulation and route.
        """
        chosen = dict(zip(("formulation", "route"), choices, strict=False))
        model = Model(self.mechanism, **chosen, backend=backend, **options)
        assert model.independent == tuple(self.states["names"])
        return model

    def evaluate(self, *choices: str, backend: str = "numpy", **options: Any) -> ModelResult:
        q = (self.states[key] for key in ("q", "qd", "qdd"))
        model = self.model(*choices, backend=backend, **options)
        return model.inverse_dynamics(*q, *parts(self.load), outputs="all")

    def sample(self, i: int) -> tuple[Any, ...]:
        """Pose, its rate and acceleration, wrench and load point, as the oracles take them."""
        keys = ("pose", "pose_rate", "pose_acceleration", "wrench")
        return (*(self.states[key][i] for key in keys), self.states["load_point"])


@cache
def case(name: str) -> Case:
    """One of `ALL`, at home, near it and away from it."""
    return of_raw(random_mechanism(np.random.default_rng(sum(map(ord, name))), **ALL[name]))


def of_raw(raw: Raw) -> Case:
    rng = np.random.default_rng(11)
    found = [random_state(rng, raw, 1, scale) for scale in SCALES]
    states = {
        key: np.concatenate([s[key] for s in found]) if isinstance(value, np.ndarray) else value
        for key, value in found[0].items()
    }
    mechanism = parse(toml_text(raw))
    name = states["load_point"]
    point = mechanism.platform.points[name] if name else np.zeros(3)
    wrench = states["wrench"]
    return Case(raw, mechanism, states, np.hstack([wrench, np.tile(point, (len(wrench), 1))]))


def close(got: Any, wanted: Any, tolerance: float, floor: float = 0.0) -> None:
    """Equal relative to the largest component (or `floor`)."""
    got, wanted = np.asarray(got), np.asarray(wanted)
    scale = max(np.abs(wanted).max(initial=0), floor)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * scale)


def same(ours: ModelResult, wanted: ModelResult, tolerance: float) -> None:
    assert (ours.status == 0).all() and (wanted.status == 0).all()
    # Shares cancel in the effort; parts are compared with the largest of them.
    for name in ("effort", "share", "joint_rate", "joint_acceleration"):
        close(getattr(ours, name), getattr(wanted, name), tolerance)
    close(ours.contact_force, wanted.contact_force, 10 * tolerance)
