"""A surface written in Python: in models, in `compare`, in files and on pages of a solution."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import xarray as xr
from support.surfaces import close

import condyle
from condyle.errors import InputError, MechanismError
from condyle.mechanism import Contact, Mechanism, dumps, parse
from condyle.mechanism.files import recall
from condyle.mechanism.surface import Expression, UnknownSurface
from condyle.mechanism.writing import record
from condyle.model.model import Model
from condyle.motion import Motion
from condyle.report.figures import PLOTS
from condyle.report.page import write_report


def wave(p: ca.SX) -> ca.SX:
    return p[2] + 1.1 * p[0] - 0.013215 - 1e-4 * ca.sin(60 * (p[0] + 0.02665))


@pytest.fixture(scope="module")
def machine(reference: Mechanism) -> Mechanism:
    """The left ball in a waved socket, the right one free to lift off its plane."""
    left, right = reference.contacts
    left = left.model_copy(update={"surface": Expression(wave)})
    right = right.model_copy(update={"side": "below", "one_sided": True})
    return reference.replace(contacts=(left, right))


@pytest.fixture(scope="module")
def motion() -> Motion:
    t = np.linspace(0, 1, 25)
    sizes = {"X": 3e-3, "Y": 1e-3, "alpha": 0.01, "beta": 0.05}
    return Motion.from_arrays(t, {k: size * np.sin(2 * np.pi * t) for k, size in sizes.items()})


@pytest.fixture(scope="module")
def solution(machine: Mechanism, motion: Motion) -> xr.Dataset:
    return Model(machine, backend="numpy").solve(motion)


@pytest.fixture(scope="module")
def saved(solution: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    folder = tmp_path_factory.mktemp("saved")
    solution.condyle.save(folder / "s.nc", folder / "s.csv")
    return condyle.open_solution(folder / "s.nc")


@pytest.mark.usefixtures("compiler_command")
def test_every_backend(machine: Mechanism, motion: Motion, solution: xr.Dataset) -> None:
    by_default = condyle.derive(machine).solve(motion)
    close(by_default["effort"].values, solution["effort"].values, 1e-11)


@pytest.mark.filterwarnings("error")
def test_surfaces_that_hold_nothing(reference: Mechanism) -> None:
    for phi, message in (
        (lambda p: 0 * p[2], "cannot hold the platform"),
        (lambda p: ca.log(-1 - p[0] ** 2), "no normal at the contact point"),
        (lambda p: p[2] + 1.1 * p[0], r"\+8\.88937 mm off the surface"),
    ):
        more = {"surface": Expression(phi)}
        held = tuple(contact.model_copy(update=more) for contact in reference.contacts)
        with pytest.raises(MechanismError, match=message):
            condyle.derive(reference.replace(contacts=held))


def test_files_keep_a_note_of_it(machine: Mechanism, saved: xr.Dataset, tmp_path: Path) -> None:
    """Of a solution all but the equation comes back; nothing computes without it."""
    with pytest.raises(InputError, match="the surface of left_condyle is a Python expression"):
        condyle.dump(machine, tmp_path / "m.toml")
    assert not (tmp_path / "m.toml").exists()
    again = saved.condyle.mechanism
    left, right = again.contacts
    assert left == machine.contacts[0].model_copy(update={"surface": UnknownSurface()})
    assert right == machine.contacts[1]
    assert (again.platform, again.chains) == (machine.platform, machine.chains)
    text = saved.attrs["mechanism"]
    assert text.startswith("# The surface of left_condyle was written in Python")
    with pytest.raises(MechanismError, match="the kind 'expression' is unknown"):
        parse(text)
    for compute in (condyle.derive, dumps):
        with pytest.raises(InputError, match="Python"):
            compute(again)
    assert again.replace(contacts=(machine.contacts[0], right)) == machine
    # Whether the surface is closed decides what its sides are called.
    ball = {"surface": Expression(wave, closed=True), "side": "inside", "one_sided": True}
    held = machine.replace(contacts=(left.model_copy(update=ball), right))
    found = recall(record(held), "held").contacts[0]
    assert found.surface == UnknownSurface(closed=True)
    assert (found.side, found.one_sided) == ("inside", True)


def test_unit_normals_are_kept(saved: xr.Dataset) -> None:
    point, normal = (saved[name].values[:, 0] for name in ("contact_point", "contact_normal"))
    slope = 1.1 - 6e-3 * np.cos(60 * (point[:, 0] + 0.02665))
    wanted = np.column_stack([slope, 0 * slope, 1 + 0 * slope]) / np.hypot(slope, 1)[:, None]
    close(normal, wanted, 1e-14)


@pytest.mark.slow
def test_pages_of_a_saved_solution(saved: xr.Dataset, condyle_command, tmp_path: Path) -> None:
    PLOTS["contact_track"](saved)  # which draws surfaces
    page = write_report(saved, tmp_path / "s.html").read_text()
    assert "was written in Python" in page and "contact_vector.left_condyle" in page
    saved.condyle.save(tmp_path / "s.nc")
    viewed = condyle_command("view", "--solution", "s.nc", "--no-browser")
    assert viewed.status == 2 and "written in Python" in viewed.err


def test_a_contact_may_hold_an_unknown_surface() -> None:
    contact = Contact(
        name="c", point=(0.0, 0.0, 0.0), surface=UnknownSurface(closed=True), side="inside"
    )
    for ask in (lambda s: s.phi((0, 0, 0)), lambda s: s.constants(), lambda s: s.form):
        with pytest.raises(InputError, match=r"mechanism\.replace"):
            ask(contact.surface)
