"""A ball on a surface, not in a socket: contact is lost where the surface would have to pull."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.mechanism import Mechanism
from condyle.mechanism.surface import Plane, Sphere
from condyle.model.model import Model
from condyle.motion import Motion
from condyle.results.contacts import contact_loss
from condyle.results.summary import summarize


def one_sided(reference: Mechanism, side: str = "below", *names: str) -> Mechanism:
    """The bundled mechanism whose balls can leave their sockets."""
    contacts = tuple(
        c.model_copy(update={"side": side, "one_sided": c.name in names or not names})
        for c in reference.contacts
    )
    return reference.replace(contacts=contacts)


@pytest.fixture(scope="module")
def chewing() -> Motion:
    return condyle.reference_motion()


def solve(mechanism: Mechanism, motion: Motion) -> xr.Dataset:
    model = Model(mechanism, backend="numpy")
    return model.solve(motion, condyle.reference_load())


@pytest.mark.parametrize(
    ("surface", "side", "push"),
    [
        (Plane(slope=(0.0, 0.0), offset=0.0), "below", -1),
        (Plane(slope=(0.0, 0.0), offset=0.0), "above", 1),
        (Sphere(centre=(0.0, 0.0, 0.0), radius=1.0), "inside", -1),
        (Sphere(centre=(0.0, 0.0, 0.0), radius=1.0), "outside", 1),
    ],
)
def test_what_a_push_is(reference: Mechanism, surface, side: str, push: int) -> None:
    """The surface pushes the ball away from itself: along n above and outside, else against."""
    first = reference.contacts[0]
    contact = type(first)(
        name="ball", point=first.point, surface=surface, side=side, one_sided=True
    )
    assert contact.push == push
    machine = reference.derived(contacts=(contact,))
    forces = np.array([[2.0], [-2.0], [0.0], [1e-15]])
    assert contact_loss(machine, forces)[:, 0].tolist() == [push < 0, push > 0, False, False]


def test_flags_and_warnings(reference: Mechanism, chewing: Motion) -> None:
    socket = solve(reference, chewing)
    assert socket["contact_loss"].dims == ("time", "contact") and not socket["contact_loss"].any()
    assert not [w for w in socket.condyle.warnings if "loses contact" in w]

    solution = solve(one_sided(reference, "below", "left_condyle"), chewing)
    force = solution["contact_force"].values
    pulled = force[:, 0] > 0  # the skull is above the ball: a push is negative
    lifted = solution["contact_loss"].values
    assert pulled.any() and not pulled.all() and (force[:, 1] > 0).any()
    assert lifted.dtype == bool and (lifted[:, 0] == pulled).all() and not lifted[:, 1].any()
    first = float(chewing.t[np.argmax(pulled)])
    [warning] = [w for w in solution.condyle.warnings if "loses contact" in w]
    assert f'"left_condyle" loses contact at t = {first:g} s ({pulled.sum()} samples)' in warning
    summary = summarize(solution)
    assert summary.data["contact_loss"] == {
        "left_condyle": {"samples": int(pulled.sum()), "time": first}
    }
    assert f"contact loss: left_condyle in {pulled.sum()} samples" in str(summary)
    # Nothing else changes: the flag says something about the same numbers.
    np.testing.assert_array_equal(solution["effort"], socket["effort"])


def test_the_flag_survives_a_file(reference: Mechanism, chewing: Motion, tmp_path: Path) -> None:
    solution = solve(one_sided(reference), chewing)
    solution.condyle.save(tmp_path / "s.nc")
    again = condyle.open_solution(tmp_path / "s.nc")
    assert again["contact_loss"].dtype == bool
    np.testing.assert_array_equal(again["contact_loss"], solution["contact_loss"])
    assert again.condyle.mechanism == one_sided(reference)


def test_columns_of_contacts_that_can_contact_loss(reference: Mechanism, chewing: Motion) -> None:
    solution = solve(one_sided(reference, "below", "right_condyle"), chewing)
    columns = solution.condyle.columns()
    assert [name for name in columns if name.startswith("contact_loss")] == [
        "contact_loss_right_condyle"
    ]
    np.testing.assert_array_equal(
        columns["contact_loss_right_condyle"], solution["contact_loss"][:, 1]
    )
    assert not any(
        name.startswith("contact_loss") for name in solve(reference, chewing).condyle.columns()
    )


def test_a_file_from_before_there_was_contact_loss(
    reference: Mechanism, chewing: Motion, tmp_path: Path
) -> None:
    solution = solve(one_sided(reference), chewing)
    solution.drop_vars("contact_loss").condyle.save(tmp_path / "old.nc")
    again = condyle.open_solution(tmp_path / "old.nc")
    np.testing.assert_array_equal(again["contact_loss"], solution["contact_loss"])
    assert again["contact_loss"].attrs == solution["contact_loss"].attrs
    assert summarize(again).data == summarize(solution).data


@pytest.mark.usefixtures("compiler_command")
def test_compiled_kernels_flag_the_same_samples(reference: Mechanism, chewing: Motion) -> None:
    machine = one_sided(reference)
    compiled = condyle.derive(machine).solve(chewing, condyle.reference_load())
    np.testing.assert_array_equal(compiled["contact_loss"], solve(machine, chewing)["contact_loss"])


def test_rows_of_a_states_file(reference: Mechanism, condyle_command, tmp_path: Path) -> None:
    condyle.dump(one_sided(reference), tmp_path / "m.toml")
    rows = ["X,Y,alpha,beta,dX,dY,dalpha,dbeta,ddX,ddY,ddalpha,ddbeta,Fx,Fy,Fz"]
    for Fz in (50.0, -50.0, 50.0, -50.0):  # lifted against the skull, pulled from it
        rows.append("0.001,0,0,0.02,0,0,0,0,0,0,0,0,0,0," + str(Fz))
    (tmp_path / "states.csv").write_text("\n".join(rows) + "\n")
    outcome = condyle_command(
        "solve", "m.toml", "--states", "states.csv", "--out", "o.csv", "--flag"
    )
    assert outcome.status == 0, outcome.err
    lines = (tmp_path / "o.csv").read_text().splitlines()
    columns = lines[0].split(",")
    left = [float(line.split(",")[columns.index("contact_left_condyle")]) for line in lines[1:]]
    assert [line.split(",")[columns.index("status")] for line in lines[1:]] == ["ok"] * 4
    pulls = [row for row, force in enumerate(left, 1) if force > 0]
    flags = [line.split(",")[columns.index("contact_loss_left_condyle")] for line in lines[1:]]
    assert flags == ["1" if row in pulls else "0" for row in range(1, 5)]
    lifted = ["contact_loss_left_condyle", "contact_loss_right_condyle"]
    assert columns[-4:] == [*lifted, "status", "cause"]
    assert len(pulls) == 2
    assert f'"left_condyle" loses contact in 2 rows, first in row {pulls[0]}' in outcome.err
