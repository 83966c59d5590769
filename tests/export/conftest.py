"""Exported folders that several tests use, written once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from support.families import case

import condyle
from condyle.export import DEFAULT, Exported, export
from condyle.export.c_package import write_package


@dataclass(frozen=True)
class Folder:
    exported: Exported
    path: Path

    @property
    def source(self) -> str:
        return f"{self.exported.prefix}.c"


def written(name: str, path: Path, **options: Any) -> Folder:
    """The package of a bundled mechanism or a test case."""
    if name in condyle.bundled_mechanisms():
        mechanism = condyle.load_mechanism(name)
    else:
        mechanism = CHANGED[name]() if name in CHANGED else case(name).mechanism
    exported = export(mechanism, options.pop("questions", DEFAULT), **options)
    path.mkdir()
    write_package(exported, path)
    return Folder(exported, path)


def limited() -> condyle.Mechanism:
    """The reference mechanism with limits that bind, and a contact that can only push."""
    machine = condyle.load_mechanism("masticatory")
    actuator = machine.chains[0].actuator.model_copy(update={"torque_limit": (-0.35, 0.35)})
    chains = tuple(c.model_copy(update={"actuator": actuator}) for c in machine.chains)
    left, right = machine.contacts
    sided = left.model_copy(update={"one_sided": True, "side": "below"})
    return machine.model_copy(update={"chains": chains, "contacts": (sided, right)})


def weak() -> condyle.Mechanism:
    """The reference mechanism with limits of effort that a chew reaches."""
    machine = condyle.load_mechanism("masticatory")
    actuators = {f"chain.{name}.actuator.torque_limit": 0.03 for name in machine.chain_names}
    return machine.set(actuators)


def rubbing() -> condyle.Mechanism:
    """The reference mechanism with friction at a contact."""
    return condyle.load_mechanism("masticatory").set(
        {"contact.left_condyle.friction": {"coefficient": 0.1}}
    )


CHANGED = {"limited": limited, "weak": weak, "rubbing": rubbing}
FOLDERS: dict[str, tuple[str, dict[str, Any]]] = {
    "jaw": (
        "masticatory",
        {
            "landmark": "incisor",
            "prefix": "jaw",
            "questions": (
                *(*DEFAULT, "closure", "observer", "state", "joints", "impedance", "bite_force"),
                *("kalman", "contact_derivative", "forward_derivative", "derivatives"),
            ),
        },
    ),
    "single": (
        "gough-stewart",
        {"precision": "float", "questions": ("inverse", "pose", "computed_torque")},
    ),
    "curved": (
        "masticatory-curved",
        {"precision": "float", "questions": ("inverse", "motion", "pose", "joint_pd")},
    ),
    "struct": (
        "gough-stewart",
        {"constants": "struct", "prefix": "hexapod", "questions": ("inverse", "motion", "pose")},
    ),
    "limited": ("limited", {"questions": ("bounded",)}),
    "rubbing": ("rubbing", {"questions": ("contact", "forward")}),
    "mixed": ("mixed_k1_n7", {"prefix": "mixed", "questions": ("contact", "forward", "pose")}),
}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Folder]:
    """One of `FOLDERS` by name."""
    found: dict[str, Folder] = {}
    base = tmp_path_factory.mktemp("exported")

    def get(name: str) -> Folder:
        if name not in found:
            mechanism, options = FOLDERS[name]
            found[name] = written(mechanism, base / name, **options)
        return found[name]

    return get
