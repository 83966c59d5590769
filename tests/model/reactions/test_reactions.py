"""Reactions by name, by engine, by direction, and as variables of a dataset."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from oracles import newton_euler
from oracles.closure import contact_normals
from oracles.description import read, rod_angles
from oracles.rotations import platform_motion
from support.families import MECHANISMS, Case, case, close
from support.loads import parts
from support.speeds import few

import condyle
from condyle.mechanism import Mechanism
from condyle.model.joint_reactions import reactions
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from condyle.motion import read_table, write_table
from condyle.questions.reactions import reaction_places
from condyle.results.inverse_rows import solve_states
from condyle.results.solving import reaction_variables

# Our joint -> the oracle's link and whether it is its force or its moment.
JOINTS = {
    "RSS": {"crank_tip": ("S", 0), "platform_joint": ("M", 0), "shaft_force": ("bearing", 0)},
    "PSS": {"slider_joint": ("S", 0), "platform_joint": ("M", 0)},
    "SPS": {"base_joint": ("S", 0), "platform_joint": ("M", 0), "sleeve_moment": ("sleeve", 1)},
}
DRIVEN = {"RSS": "shaft_moment", "PSS": "rail_force", "SPS": "sleeve_force"}


def evaluated(c: Case) -> tuple[Model, ModelResult]:
    model = Model(c.mechanism, backend="numpy")
    q, q1, q2 = (c.states[key] for key in ("q", "qd", "qdd"))
    return model, model.inverse_dynamics(q, q1, q2, *parts(c.load), outputs="all")


@pytest.mark.parametrize("name", few(MECHANISMS, "rss_k0", "pss_k1", "mixed_k3"))
def test_against_free_bodies_solved_at_once(name: str) -> None:
    c = case(name)
    found = reactions(*evaluated(c))
    for i in range(len(c.load)):
        theirs = newton_euler.inverse_dynamics(c.raw, *c.sample(i))["reactions"]
        for chain in c.mechanism.chains:
            force = np.abs(theirs[f"{chain.name}.M"][0]).max()
            for quantity, (link, which) in JOINTS[chain.kind].items():
                wanted = theirs[f"{chain.name}.{link}"][which]
                got = found[f"{quantity}_{chain.name}"].array[i]
                close(got, wanted, 1e-9, floor=force * (0.05 if which else 1))
        for contact in c.mechanism.contacts:
            wanted = theirs[contact.name][0]
            close(found[f"contact_{contact.name}"].array[i], wanted, 1e-9)


@pytest.mark.parametrize("name", ["rss", "pss", "sps_k1", "mixed_k0_n8"])
def test_the_effort_is_in_the_driven_joint(name: str) -> None:
    c = case(name)
    model, evaluation = evaluated(c)
    found = reactions(model, evaluation)
    d = read(c.raw)
    for k, chain in enumerate(d.chains):
        r = found[f"{DRIVEN[chain.kind]}_{chain.name}"]
        assert r.effort and r.long_name.endswith("with the actuator's effort")
        for i in range(len(c.load)):
            axis = chain.axis
            if chain.kind == "SPS":
                P = platform_motion(*c.sample(i)[:3]).point(chain.M)[0]
                axis = (P - chain.S) / np.linalg.norm(P - chain.S)
            close(r.array[i] @ axis, evaluation.effort[i, k], 1e-10)


def test_the_guide_acts_across_both_swing_axes() -> None:
    c = case("mixed")
    found = reactions(*evaluated(c))
    for chain in read(c.raw).chains:
        r = found[f"guide_moment_{chain.name}"]
        assert r.by == "base" and r.unit == "N m"
        for i in range(len(c.load)):
            P = platform_motion(*c.sample(i)[:3]).point(chain.M)[0]
            start = found[f"platform_joint_{chain.name}"].point[i]
            close(start, P, 1e-12)
            rod = P - r.point[i]
            beta, _ = rod_angles(chain, rod)
            about_gamma = chain.N0 @ [np.sin(beta), 0, np.cos(beta)]
            size = np.linalg.norm(r.array[i])
            assert abs(r.array[i] @ chain.N0[:, 1]) < 1e-12 * size
            assert abs(r.array[i] @ about_gamma) < 1e-12 * size


def test_contact_forces_along_the_normals() -> None:
    c = case("mixed_k3")
    model, evaluation = evaluated(c)
    found = reactions(model, evaluation)
    d = read(c.raw)
    for i in range(len(c.load)):
        normals = contact_normals(d, platform_motion(c.sample(i)[0]))
        for k, contact in enumerate(c.mechanism.contacts):
            r = found[f"contact_{contact.name}"]
            close(r.array[i], evaluation.contact_force[i, k] * normals[k], 1e-12)
            close(r.point[i], evaluation.configuration.contact_point[i, k], 1e-14)
            assert (r.body, r.by, r.unit, r.frame) == ("platform", "surface", "N", "{S}")


def test_names() -> None:
    places = reaction_places(condyle.load_mechanism("masticatory"))
    names = [p.name for p in places]
    assert len(set(names)) == len(names) == 6 * 5 + 2
    assert names[:5] == [
        f"{quantity}_temporalis_left"
        for quantity in (
            "platform_joint",
            "shaft_force",
            "shaft_moment",
            "crank_tip",
            "guide_moment",
        )
    ]
    assert names[-1] == "contact_right_condyle"
    texts = {p.quantity: p.long_name for p in places}
    assert texts["crank_tip"] == "force on the coupler from the crank, at the crank tip S"
    assert texts["platform_joint"].startswith("force on the platform from the coupler")


def test_given_efforts() -> None:
    """Efforts along the null space move the joint forces, and each shaft carries its own."""
    c = case("rss")
    model, evaluation = evaluated(c)
    effort = evaluation.effort + 0.3
    found = reactions(model, evaluation, effort)
    for k, chain in enumerate(read(c.raw).chains):
        moment = found[f"shaft_moment_{chain.name}"].array
        close(moment @ chain.axis, effort[:, k], 1e-10)


def test_failed_samples_are_empty(reference: Mechanism) -> None:
    model = Model(reference, backend="numpy")
    q = np.zeros((2, 4))
    q[1, 0] = 0.5
    evaluation = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    assert evaluation.status.tolist() == [0, 1]
    for r in reactions(model, evaluation).values():
        assert np.isfinite(r.array[0]).all() and np.isnan(r.array[1]).all()


def test_variables_of_one_family() -> None:
    c = case("rss")
    model, evaluation = evaluated(c)
    variables, coordinates = reaction_variables(model.mechanism, reactions(model, evaluation))
    assert not coordinates
    assert set(variables) == {
        "reaction_platform_joint",
        "reaction_shaft_force",
        "reaction_shaft_moment",
        "reaction_crank_tip",
        "reaction_guide_moment",
        "contact_force_vector",
    }
    dims, values, attributes = variables["reaction_crank_tip"]
    assert dims == ("time", "chain", "axis") and values.shape == (len(c.load), 6, 3)
    assert attributes["units"] == "N" and attributes["frame"] == "{S}"
    assert (attributes["body"], attributes["by"]) == ("coupler", "crank")


def test_variables_of_mixed_families_have_no_holes() -> None:
    c = case("mixed_k0_n8")
    model, evaluation = evaluated(c)
    variables, coordinates = reaction_variables(model.mechanism, reactions(model, evaluation))
    coordinates |= {"chain": list(c.mechanism.chain_names)}
    dataset = xr.Dataset(variables, coordinates)
    assert all(np.isfinite(v.values).all() for v in dataset.data_vars.values())
    kinds = {c.name: c.kind for c in c.mechanism.chains}
    assert [kinds[name] for name in dataset["chain_PSS"].values] == ["PSS"] * 3
    assert dataset["reaction_rail_force"].dims == ("time", "chain_PSS", "axis")
    assert dataset["reaction_platform_joint"].dims == ("time", "chain", "axis")


def test_columns_of_files_have_the_names_of_the_reactions(tmp_path: Path) -> None:
    """`run` and `solve` write the same columns, contact forces as vectors included."""
    machine = case("mixed_k3").mechanism
    model = Model(machine, backend="numpy")
    t = np.linspace(0, 1, 6)
    motion = condyle.Motion.from_arrays(t, {name: 0 * t for name in model.independent})
    columns = model.solve(motion, reactions=True).condyle.columns()
    places = reaction_places(machine)
    wanted = {f"reaction_{place.name}_{axis}" for place in places for axis in "xyz"}
    assert {name for name in columns if name.startswith("reaction_")} == wanted
    states = {p + name: 0 * t for p in ("", "d", "dd") for name in model.independent}
    write_table(tmp_path / "states.csv", states)
    solve_states(model, tmp_path / "states.csv", tmp_path / "out.csv", reactions=True)
    table = read_table(tmp_path / "out.csv")
    assert {name for name in table.columns if name.startswith("reaction_")} == wanted
    for name in wanted:
        np.testing.assert_array_equal(table.columns[name], columns[name])


@pytest.mark.parametrize("name", ["rss", "pss", "sps_k0"])
def test_nothing_moves_nothing_weighs(name: str) -> None:
    c = case(name)
    mechanism = c.mechanism.replace(gravity=(0.0, 0.0, 0.0))
    model = Model(mechanism, backend="numpy")
    q = c.states["q"]
    found = reactions(model, model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all"))
    assert all(np.abs(r.array).max() == 0 for r in found.values())
