"""A ball on a surface, not in a socket: contact is lost where the surface would have to pull."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.mechanism import Mechanism
from condyle.mechanism.surface import Plane, Sphere
from condyle.model.model import Model
from condyle.motion import Motion
from condyle.results.contacts import contact_loss
from condyle.results.summary import summarize


@pytest.fixture(scope="module")
def left_free(reference: Mechanism) -> Mechanism:
    """The bundled mechanism whose left ball can leave its socket."""
    contacts = (
        c.model_copy(update={"side": "below", "one_sided": c.name == "left_condyle"})
        for c in reference.contacts
    )
    return reference.replace(contacts=tuple(contacts))


@pytest.fixture(scope="module")
def chewing() -> Motion:
    whole = condyle.reference_motion()
    path = dict(zip("xyz", whole.value[::100].T, strict=True))
    return Motion.from_arrays(whole.t[::100], path, landmark="incisor")


@pytest.fixture(scope="module")
def socket(chewing: Motion) -> xr.Dataset:
    return model("masticatory").solve(chewing, condyle.reference_load())


@pytest.fixture(scope="module")
def solution(left_free: Mechanism, chewing: Motion) -> xr.Dataset:
    return Model(left_free, backend="numpy").solve(chewing, condyle.reference_load())


PLANE, SPHERE = Plane(slope=(0, 0), offset=0.0), Sphere(centre=(0, 0, 0), radius=1.0)


def test_what_a_push_is(reference: Mechanism) -> None:
    """The surface pushes the ball away from itself: along n above and outside, else against."""
    ways = (
        (PLANE, "below", -1),
        (PLANE, "above", 1),
        (SPHERE, "inside", -1),
        (SPHERE, "outside", 1),
    )
    for surface, side, push in ways:
        options = {"surface": surface, "side": side, "one_sided": True}
        contact = reference.contacts[0].model_copy(update=options)
        assert contact.push == push
        machine = reference.derived(contacts=(contact,))
        forces = np.array([[2.0], [-2.0], [0.0], [1e-15]])
        assert contact_loss(machine, forces)[:, 0].tolist() == [push < 0, push > 0, False, False]


def test_flags_warnings_and_columns(
    socket: xr.Dataset, solution: xr.Dataset, chewing: Motion
) -> None:
    assert socket["contact_loss"].dims == ("time", "contact") and not socket["contact_loss"].any()
    assert not [w for w in socket.condyle.warnings if "loses contact" in w]
    force, lifted = solution["contact_force"].values, solution["contact_loss"].values
    pulled = force[:, 0] > 0  # the skull is above the ball: a push is negative
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
    columns = {k: v for k, v in solution.condyle.columns().items() if "contact_loss" in k}
    assert [*columns] == ["contact_loss_left_condyle"]
    np.testing.assert_array_equal(columns["contact_loss_left_condyle"], pulled)
    assert not any("contact_loss" in name for name in socket.condyle.columns())


def test_the_flag_of_a_file(solution: xr.Dataset, left_free: Mechanism, tmp_path: Path) -> None:
    """Kept, and computed where a file is older than the flag."""
    for saved in (solution, solution.drop_vars("contact_loss")):
        saved.condyle.save(tmp_path / "s.nc")
        again = condyle.open_solution(tmp_path / "s.nc")
        assert again["contact_loss"].dtype == bool and again.condyle.mechanism == left_free
        np.testing.assert_array_equal(again["contact_loss"], solution["contact_loss"])
        assert again["contact_loss"].attrs == solution["contact_loss"].attrs
        assert summarize(again).data == summarize(solution).data


def test_rows_of_a_states_file(left_free: Mechanism, condyle_command, tmp_path: Path) -> None:
    condyle.dump(left_free, tmp_path / "m.toml")
    rows = ["X,Y,alpha,beta,dX,dY,dalpha,dbeta,ddX,ddY,ddalpha,ddbeta,Fx,Fy,Fz"]
    for Fz in (50.0, -50.0, 50.0, -50.0):  # lifted against the skull, pulled from it
        rows.append("0.001,0,0,0.02,0,0,0,0,0,0,0,0,0,0," + str(Fz))
    (tmp_path / "states.csv").write_text("\n".join(rows) + "\n")
    outcome = condyle_command("solve", "m.toml", "--states", "states.csv", "--out=o.csv", "--flag")
    assert outcome.status == 0, outcome.err
    columns, *lines = (line.split(",") for line in (tmp_path / "o.csv").read_text().splitlines())
    found = {name: [line[i] for line in lines] for i, name in enumerate(columns)}
    assert found["status"] == ["ok"] * 4
    pulls = [float(force) > 0 for force in found["contact_left_condyle"]]
    assert found["contact_loss_left_condyle"] == [str(int(pull)) for pull in pulls]
    assert columns[-3:] == ["contact_loss_left_condyle", "status", "cause"] and sum(pulls) == 2
    said = f'"left_condyle" loses contact in 2 rows, first in row {pulls.index(True) + 1}'
    assert said in outcome.err
