"""Mechanisms of every kind of number, and the paths of these in a file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from oracles.random_mechanism import random_mechanism

import condyle
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.mechanism.home import dependent_coordinates
from condyle.mechanism.paths import written
from condyle.mechanism.surface import Expression
from condyle.questions.number_paths import FileNumbers
from condyle.questions.structure import Structure, structure_of, walls_of
from support.families import ALL as FAMILIES
from support.families import case as families

UNBALANCED = {"mass": 0.02, "com": -0.004}  # cranks
SURFACES: dict[str, dict[str, Any]] = {
    "every_kind": {"surface": "mixed", "contacts": 5, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic", "plane"), "contacts": 3, "ball_radius": 4.0},
    "balls_round": {"surface": ("sphere", "cylinder"), "ball_radius": 4.0},
    "balls_profile": {"surface": "profile"},
    "balls_written": {"surface": "plane"},
}


def wide(mechanism: Mechanism) -> Structure:
    """With every number of the file."""
    every = tuple(range(len(mechanism.contacts)))
    found = structure_of(mechanism)
    return replace(found, parallel=False, losses=True, friction=every)


def numbers(mechanism: Mechanism) -> FileNumbers:
    structure = wide(mechanism)
    return FileNumbers(mechanism, structure, walls_of(mechanism, structure))


def every_path(of: FileNumbers) -> list[str]:
    """Paths of all numbers and vectors of a mechanism's file."""
    parts = [("gravity",), *(("contact", n) for n in of.mechanism.contact_names)]
    parts += [("chain", n) for n in of.mechanism.chain_names]
    return [written(leaf) for part in parts for leaf in of.leaves if leaf[: len(part)] == part]


def rubbing(machine: Mechanism) -> Mechanism:
    """With losses and friction, `dependent` held."""
    losses = {"rotor_inertia": 1e-5, "gear": 3.0, "viscous": 0.02, "coulomb": 0.03}
    changes: dict[str, object] = {
        f"chain.{chain.name}.actuator.{key}": value
        for chain in machine.chains
        for key, value in (losses | {"smoothing_speed": 2e-3}).items()
    }
    for chain in machine.chains:
        if chain.kind == "RSS":
            changes |= {f"chain.{chain.name}.crank.{k}": v for k, v in UNBALANCED.items()}
    for contact in machine.contacts:
        changes[f"contact.{contact.name}.friction"] = {"coefficient": 0.1}
    return machine.set({**changes, "dependent": dependent_coordinates(machine) or None})


def machine_of(name: str) -> Mechanism:
    if name in condyle.bundled_mechanisms():
        return rubbing(condyle.load_mechanism(name))
    if name in FAMILIES:
        return rubbing(families(name).mechanism)
    rng = np.random.default_rng(sum(map(ord, name)))
    machine = from_data(random_mechanism(rng, **SURFACES[name]))
    for contact in machine.contacts:
        at = f"contact.{contact.name}"
        if name == "balls_written":  # the plane, and waves on it
            a, b = contact.surface.slope
            waves = lambda p, a=a, b=b: p[2] - a * p[0] - b * p[1] - 2e-4 * ca.sin(90 * p[0])  # noqa: E731
            off = float(waves(contact.point))
            machine = machine.set(f"{at}.surface", Expression(waves, offset=off))
        if name in ("balls_profile", "balls_written"):
            ball = {f"{at}.ball_radius": 0.002, f"{at}.side": "above"}
            machine = machine.set(ball, keep="home")
    return rubbing(machine)


def one_each(machine: Mechanism) -> list[str]:
    """Every path, of one chain of a family."""
    found = {}
    for path in every_path(numbers(machine)):
        head, name, *rest = [*path.split(".", 2), ""]
        kind = machine.get(f"chain.{name}.kind") if head == "chain" else name
        found.setdefault((head, kind, *rest), path)
    return list(found.values())
