"""Runs, and their pages, that several files look at; no test changes one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.machines import model
from support.report_pages import payload

import condyle
from condyle.analysis.comparison import Comparison, compare
from condyle.motion import Load, Motion, bundled_reference
from condyle.report.page import report_html


def chewed(name: str) -> xr.Dataset:
    """The reference motion and load at 20 Hz."""
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    return model(name).solve(motion, condyle.reference_load())


@pytest.fixture(scope="session")
def comparison() -> Comparison:
    """The same by the paper's models."""
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    machine = condyle.load_mechanism("masticatory")
    models = ["momentum", "lagrange"]
    return compare(machine, motion, condyle.reference_load(), formulations=models)


@pytest.fixture(scope="session")
def solution() -> xr.Dataset:
    return chewed("masticatory")


@pytest.fixture(scope="session")
def page(solution: xr.Dataset) -> str:
    return report_html(solution)


@pytest.fixture(scope="session")
def jaw() -> xr.Dataset:
    return chewed("human-jaw")


@pytest.fixture(scope="session")
def jaw_page(jaw: xr.Dataset) -> str:
    return report_html(jaw)


@pytest.fixture(scope="session")
def fewer_contacts() -> dict[int, xr.Dataset]:
    """The stand-in with none and one of its contacts, under a force and a moment."""
    mechanism, t, found = condyle.load_mechanism("masticatory"), np.linspace(0, 1, 30), {}
    for k in (0, 1):
        fewer = mechanism.replace(contacts=mechanism.contacts[:k], dependent=None)
        solver = condyle.derive(fewer, backend="numpy")
        size = {name: 1e-3 if name in "XYZ" else 0.02 for name in solver.independent}
        motion = Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})
        load = Load.constant((0, 0, -10), (0, 0.1, 0), point="right_molar")
        found[k] = solver.solve(motion, load)
    return found


def panels(page: str) -> dict[str, dict[str, Any]]:
    """The panels of a report."""
    return {panel["id"]: panel for panel in payload(page)["panels"]}


def renamed(solution: xr.Dataset, chains: list[str], contacts: Sequence[str] = ()) -> xr.Dataset:
    """With other names of chains, and of contacts."""
    machine = solution.condyle.mechanism
    names = {"chain": chains, "contact": list(contacts or machine.contact_names)}
    parts = {
        f"{kind}s": tuple(
            part.model_copy(update={"name": name})
            for part, name in zip(getattr(machine, f"{kind}s"), given, strict=True)
        )
        for kind, given in names.items()
    }
    changed = solution.assign_coords(names)
    return changed.assign_attrs(mechanism=condyle.dumps(machine.replace(**parts)))
