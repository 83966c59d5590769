"""Mechanisms with states of them, and how results are compared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from oracles import description
from oracles.random_mechanism import random_mechanism, random_state, toml_text

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.kernel import results_of
from condyle.mechanism import Mechanism, load_mechanism, parse

Array = np.ndarray
BUNDLED = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
MIXED = ("PSS", "SPS")  # efforts of one unit, which least norm asks for
RANDOM: dict[str, dict[str, Any]] = {
    "rss_k0_n9": {"contacts": 0, "chains": 9, "tilted_gravity": True},
    "rss_k1_n8_quadratic": {"contacts": 1, "chains": 8, "surface": "quadratic"},
    "rss_k2_n6_sphere": {"surface": "sphere"},
    "rss_k2_n6_profile": {"surface": "profile"},
    "rss_k1_n6_ball": {"contacts": 1, "surface": "quadratic", "ball_radius": 3.0},
    "pss_k2_n6_cylinder": {"families": ("PSS",), "surface": "cylinder"},
    "sps_k2_n6_ellipsoid": {"families": ("SPS",), "surface": "ellipsoid"},
    "mixed_k0_n7": {"families": MIXED, "contacts": 0, "chains": 7},
    "mixed_k2_n8": {"families": MIXED, "chains": 8},
    "all_kinds": {"families": ("RSS", *MIXED), "chains": 8},  # no least norm: two units
    "mixed_k3_n9_curved": {"families": MIXED, "contacts": 3, "chains": 9, "surface": "quadratic"},
    "mixed_k4_n6": {"families": MIXED, "contacts": 4},
    "mixed_k5_n6": {"families": MIXED, "contacts": 5},
}
BUNDLED_FOLDER = description.Path(description.__file__).parents[2] / "src/condyle/mechanism/bundled"
SCALES = (0.0, 0.05, 1.0, 1.0)  # home, near it, and far


@dataclass(frozen=True)
class Case:
    """A mechanism and N of its states; load: (N, 9) as `Model.evaluate` takes it."""

    mechanism: Mechanism
    q: Array
    q1: Array
    q2: Array
    load: Array

    @property
    def arguments(self) -> tuple[Array, Array, Array, Array, Array]:
        """Of inverse dynamics: q, v, a, wrench and point."""
        q, q1, q2, load = self.packed
        return q, q1, q2, load[:, :6], load[:, 6:]

    @property
    def packed(self) -> tuple[Array, Array, Array, Array]:
        """With wrench and point in one array, (N, 9)."""
        return self.q, self.q1, self.q2, self.load

    @property
    def inputs(self) -> dict[str, Array]:
        """What the question `inverse` takes."""
        force, moment, point = np.hsplit(self.load, 3)
        parts = {"force": force, "moment": moment, "point": point}
        return {"q": self.q, "q1": self.q1, "q2": self.q2, **parts}

    @property
    def point(self) -> Array:
        return self.load[0, 6:]

    @property
    def samples(self) -> Array:
        """A row of the inputs' columns a sample, (N, 3 m + 9)."""
        return np.hstack([self.q, self.q1, self.q2, self.load])

    def repeated(self, count: int) -> Case:
        """`count` states, all different: those of the case, drawn together by a common factor."""
        rows = np.arange(count) % len(self.q)
        near = np.linspace(1.0, 0.5, count)[:, None]
        scaled = (a[rows] * near for a in (self.q, self.q1, self.q2))
        return Case(self.mechanism, *scaled, self.load[rows])


@cache
def case(name: str) -> Case:
    """A bundled mechanism, or one of `RANDOM`, at home, near it and away from it."""
    if name in BUNDLED:
        raw, mechanism = description.load(BUNDLED_FOLDER / f"{name}.toml"), load_mechanism(name)
    else:
        rng = np.random.default_rng(sum(map(ord, name)))
        raw = random_mechanism(rng, condition=100.0, **RANDOM[name])
        mechanism = parse(toml_text(raw))
    rng = np.random.default_rng(3)
    found = [random_state(rng, raw, 3, scale) for scale in SCALES]
    q, q1, q2, wrench = (
        np.concatenate([state[key] for state in found]) for key in ("q", "qd", "qdd", "wrench")
    )
    point = mechanism.platform.points.get(found[0]["load_point"], (0.0, 0.0, 0.0))
    return Case(mechanism, q, q1, q2, np.hstack([wrench, np.tile(point, (len(wrench), 1))]))


def error(got: Any, wanted: Any) -> float:
    """Largest difference over the largest component; inf where only one of them is finite."""
    got, wanted = np.asarray(got, dtype=float), np.asarray(wanted, dtype=float)
    assert got.shape == wanted.shape
    if not wanted.size:
        return 0.0
    if (np.isfinite(got) != np.isfinite(wanted)).any():
        return np.inf
    scale = np.nanmax(np.abs(wanted))
    return float(np.nanmax(np.abs(got - wanted)) / (scale or 1.0))


NAMES = (
    "effort",
    "share",
    "contact_force",
    "joint_rate",
    "joint_acceleration",
    "pose",
    "pose_rate",
    "pose_acceleration",
)


def errors(got: Any, wanted: Any) -> dict[str, float]:
    """Relative errors of the results of inverse dynamics."""
    return {name: error(getattr(got, name), getattr(wanted, name)) for name in NAMES}


def ones(kernel: CompiledKernel, samples: Array) -> tuple[dict[str, Array], Array]:
    """What `one` says of samples, one after the other, as `run` returns it."""
    found = [kernel.evaluate(sample) for sample in samples]
    columns = np.array([row for row, _ in found]).T
    values = results_of(kernel.interface, columns, kernel.order)
    return values, np.array([status for _, status in found])
