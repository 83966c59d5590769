"""Exported packages that several tests look at, and their functions as libraries."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.families import case
from support.tools import run

import condyle
from condyle.export import DEFAULT, Exported, export
from condyle.export.c_package import write_package

STRICT = "-Werror -Wshadow -Wstrict-prototypes -Wmissing-prototypes -Wdouble-promotion"
C99 = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", *STRICT.split())
KEPT = 77.0  # what stands in results before a call


def shared(folder: Path, *sources: str) -> ctypes.CDLL:
    """A library of sources in a folder, compiled without a warning."""
    flags = ("-O0", "-ffp-contract=fast", "-shared", "-fPIC")
    run("gcc", *C99, *flags, *sources, "-o", "it.so", "-lm", folder=folder)
    return ctypes.CDLL(str(folder / "it.so"))


class Library:
    """Exported functions on arrays: by question, arguments by name."""

    def __init__(self, exported: Exported, folder: Path) -> None:
        self.exported, self.folder, p = exported, folder, exported.prefix
        (folder / f"{p}.c").write_text(exported.source)
        (folder / f"{p}.h").write_text(exported.header)
        self.library = shared(folder, f"{p}.c")

    def __call__(
        self, question: str, **given: np.ndarray | float
    ) -> tuple[int, dict[str, np.ndarray]]:
        f = self.exported[question]
        real = np.float32 if self.exported.precision == "float" else np.float64
        arrays = {
            a.name: np.full(a.size, 0.0 if a.given else KEPT, dtype=real) for a in f.arguments
        }
        for name, value in given.items():
            arrays[name][:] = value
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays.values()]
        status = getattr(self.library, f.name)(*pointers)
        return status, {a.name: arrays[a.name] for a in f.outputs}


@dataclass(frozen=True)
class Folder:
    exported: Exported
    path: Path

    @property
    def source(self) -> str:
        return f"{self.exported.prefix}.c"


def limited(limit: float = 0.35) -> condyle.Mechanism:
    """The reference mechanism with limits that bind, and a contact that can only push."""
    machine = weak(limit)
    sided = machine.contacts[0].model_copy(update={"one_sided": True, "side": "below"})
    return machine.model_copy(update={"contacts": (sided, machine.contacts[1])})


def weak(limit: float = 0.03) -> condyle.Mechanism:
    """The reference mechanism with limits of effort that a chew reaches."""
    machine = condyle.load_mechanism("masticatory")
    return machine.set({f"chain.{c}.actuator.torque_limit": limit for c in machine.chain_names})


def rubbing() -> condyle.Mechanism:
    """The reference mechanism with friction at a contact."""
    friction = {"contact.left_condyle.friction": {"coefficient": 0.1}}
    return condyle.load_mechanism("masticatory").set(friction)


EVERYTHING = (
    *(*DEFAULT, "closure", "observer", "state", "joints", "kalman", "contact_derivative"),
    *("forward_derivative", "derivatives"),
)
FOLDERS: dict[str, tuple[Callable[[], condyle.Mechanism], dict[str, Any]]] = {
    "jaw": (
        lambda: condyle.load_mechanism("masticatory"),
        {"landmark": "incisor", "prefix": "jaw", "questions": EVERYTHING},
    ),
    "curved": (
        lambda: condyle.load_mechanism("masticatory-curved"),
        {"precision": "float", "questions": ("inverse", "motion", "pose", "joint_pd")},
    ),
    "struct": (
        lambda: condyle.load_mechanism("gough-stewart"),
        {"constants": "struct", "prefix": "hexapod", "questions": ("inverse", "motion", "pose")},
    ),
    "limited": (limited, {"questions": ("bounded",)}),
    "rubbing": (rubbing, {"questions": ("contact", "forward")}),
    "mixed": (
        lambda: case("mixed_k1_n7").mechanism,
        {"prefix": "mixed", "questions": ("contact", "pose")},
    ),
}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Folder]:
    """The package of one of `FOLDERS` by name, written once."""
    base = tmp_path_factory.mktemp("exported")

    @cache
    def get(name: str) -> Folder:
        mechanism, options = FOLDERS[name]
        (path := base / name).mkdir()
        write_package(exported := export(mechanism(), **options), path)
        return Folder(exported, path)

    return get
