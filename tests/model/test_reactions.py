"""Reactions: what joints, guides and contacts carry, by name, by free bodies, and in datasets."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from oracles.bodies import Body, bodies, cross_matrix
from oracles.closure import contact_normals
from oracles.description import read, rod_angles
from oracles.jets import Jet
from oracles.random_mechanism import off_centre, random_mechanism
from oracles.rotations import platform_motion
from support.families import Case, case, close, of_raw
from support.loads import parts
from support.machines import model as shared
from support.speeds import first

import condyle
from condyle.model.joint_reactions import Reaction, reactions
from condyle.model.model import Model
from condyle.model.model_result import ModelResult
from condyle.motion import read_table, write_table
from condyle.questions.reactions import reaction_places
from condyle.results.inverse_rows import solve_states
from condyle.results.solving import reaction_variables

FAMILIES = ("RSS", "PSS", "SPS")
DRIVEN = {"RSS": "shaft_moment", "PSS": "rail_force", "SPS": "sleeve_force"}
LENGTH = 0.05  # metres: a lever of these mechanisms


@cache
def build(name: str) -> Case:
    if name == "off_centre":
        rng = np.random.default_rng(5)
        return of_raw(off_centre(rng, random_mechanism(rng, families=FAMILIES, contacts=1)))
    if name == "ellipsoids":
        return of_raw(random_mechanism(np.random.default_rng(8), surface="ellipsoid"))
    return case(name)


def asked(
    c: Case, formulation: str = "virtual_power", **given: np.ndarray
) -> tuple[Model, ModelResult, dict[str, Reaction]]:
    model = Model(c.mechanism, formulation=formulation, backend="numpy")
    q, q1, q2 = (c.states[key] for key in ("q", "qd", "qdd"))
    found = model.inverse_dynamics(q, q1, q2, *parts(c.load), **given, outputs="all")
    return model, found, reactions(model, found, **given)


@cache
def evaluated(name: str) -> tuple[Model, ModelResult, dict[str, Reaction]]:
    return asked(build(name))


def directions(c: Case, i: int, evaluation: ModelResult, found: dict[str, Reaction]) -> None:
    """Efforts are in the driven joints, guides act across both swing axes, contacts along normals;
    with the balances of all bodies this leaves one answer."""
    d, motion = read(c.raw), platform_motion(*c.sample(i)[:3])
    for k, chain in enumerate(d.chains):
        driven, P = found[f"{DRIVEN[chain.kind]}_{chain.name}"], motion.point(chain.M)[0]
        assert driven.effort and driven.long_name.endswith("with the actuator's effort")
        line = P - chain.S if chain.kind == "SPS" else chain.axis
        along = driven.array[i] @ line / np.linalg.norm(line)
        close(along, evaluation.effort[i, k], 1e-10)
        guide = found[f"guide_moment_{chain.name}"]
        assert guide.by == "base" and guide.unit == "N m"
        close(found[f"platform_joint_{chain.name}"].point[i], P, 1e-12)
        beta, _ = rod_angles(chain, P - guide.point[i])
        about_gamma = chain.N0 @ [np.sin(beta), 0, np.cos(beta)]
        size = np.linalg.norm(guide.array[i])
        for axis in (chain.N0[:, 1], about_gamma):
            assert abs(guide.array[i] @ axis) < 1e-12 * size
    normals = contact_normals(d, motion)
    for k, contact in enumerate(c.mechanism.contacts):
        r = found[f"contact_{contact.name}"]
        close(r.array[i], evaluation.contact_force[i, k] * normals[k], 1e-12)
        close(r.point[i], evaluation.configuration.contact_point[i, k], 1e-14)
        assert (r.body, r.by, r.unit, r.frame) == ("platform", "surface", "N", "{S}")


def carried(body: Body, base: np.ndarray) -> Body:
    """A body of the moving base in a frame that stands still, which {S} is passing now."""
    a, w, w_rate = base.reshape(3, 3)
    turn = Jet(np.eye(3), cross_matrix(w), cross_matrix(w_rate) + cross_matrix(w) @ cross_matrix(w))
    origin = Jet(np.zeros(3), np.array([1.0, -2.0, 3.0]), a)
    return replace(body, centre=origin + turn @ body.centre, R=turn @ body.R)


BALANCED = ["off_centre", "mixed_k3", "mixed_k1_n7", "sps_along_x", "ellipsoids", "pss_along_x"]


@pytest.mark.parametrize("name", first(BALANCED, 3))
def test_every_body_balances(name: str) -> None:
    """Newton and Euler for every body, from the reactions that act on it and nothing else."""
    c, given, count = build(name), dict[str, np.ndarray](), 4
    if name == "off_centre":  # on a base that moves
        rng = np.random.default_rng(3)
        given = {"gravity": rng.normal(0, 9, (count, 3)), "base": rng.normal(0, 6, (count, 9))}
    _, evaluation, found = asked(c, **given)
    for i in range(count):
        directions(c, i, evaluation, found)
        motion = Jet(*(c.states[key][i] for key in ("pose", "pose_rate", "pose_acceleration")))
        free, gravity = bodies(c.raw, motion), np.array(c.mechanism.gravity)
        if given:
            gravity = given["gravity"][i]
            free = {key: carried(body, given["base"][i]) for key, body in free.items()}
        # What is left of each body's balance: force, and moment about its mass centre.
        left = {key: [-need for need in body.needs(gravity)] for key, body in free.items()}
        largest = dict.fromkeys(free, 0.0)

        def act(
            key: str,
            force: np.ndarray,
            moment: np.ndarray,
            point: np.ndarray,
            free=free,
            left=left,
            largest=largest,
        ) -> None:
            if key in ("base", "surface"):
                return
            moment = moment + np.cross(point - free[key].centre.x, force)
            left[key] = [left[key][0] + force, left[key][1] + moment]
            largest[key] = max(largest[key], np.abs(np.r_[force, moment / LENGTH]).max())

        for r in found.values():
            vector, zero = r.array[i], np.zeros(3)
            force, moment = (vector, zero) if r.unit == "N" else (zero, vector)
            for sign, body in ((1, r.body), (-1, r.by)):
                outside = body in ("platform", "base", "surface")
                act(
                    body if outside else f"{r.owner}.{body}",
                    sign * force,
                    sign * moment,
                    r.point[i],
                )
        where = motion.x[:3] + free["platform"].R.x @ c.load[i, 6:]
        act("platform", c.load[i, :3], c.load[i, 3:6], where)
        for key, size in largest.items():
            assert np.abs(left[key][0]).max() < 1e-9 * size, key
            assert np.abs(left[key][1]).max() < 1e-9 * LENGTH * size, key
    if name == "mixed_k1_n7":  # any formulation gives the same reactions
        got = asked(c, "newton_euler")[2]
        force = max(np.abs(r.array).max() for r in found.values())
        assert list(got) == list(found)
        for key, r in found.items():
            close(got[key].array, r.array, 1e-10, force)


def test_given_efforts_failed_samples_and_nothing_that_weighs() -> None:
    """Efforts along the null space move the joint forces, and each shaft carries its own."""
    c, (model, evaluation, _) = build("rss_k0"), evaluated("rss_k0")
    effort = evaluation.effort + 0.3
    found = reactions(model, evaluation, effort)
    for k, chain in enumerate(read(c.raw).chains):
        close(found[f"shaft_moment_{chain.name}"].array @ chain.axis, effort[:, k], 1e-10)
    model = shared("masticatory")
    q = np.zeros((2, 4))
    q[1, 0] = 0.5
    evaluation = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all")
    assert evaluation.status.tolist() == [0, 1]
    for r in reactions(model, evaluation).values():
        assert np.isfinite(r.array[0]).all() and np.isnan(r.array[1]).all()
    light = Model(c.mechanism.replace(gravity=(0.0, 0.0, 0.0)), backend="numpy")
    q = c.states["q"]
    found = reactions(light, light.inverse_dynamics(q, 0 * q, 0 * q, outputs="all"))
    assert all(np.abs(r.array).max() == 0 for r in found.values())


def test_names_and_variables_of_one_family_and_of_several_without_holes() -> None:
    places = reaction_places(condyle.load_mechanism("masticatory"))
    names = [p.name for p in places]
    assert len(set(names)) == len(names) == 6 * 5 + 2
    quantities = ("platform_joint", "shaft_force", "shaft_moment", "crank_tip", "guide_moment")
    assert names[:5] == [f"{quantity}_temporalis_left" for quantity in quantities]
    assert names[-1] == "contact_right_condyle"
    texts = {p.quantity: p.long_name for p in places}
    assert texts["crank_tip"] == "force on the coupler from the crank, at the crank tip S"
    assert texts["platform_joint"].startswith("force on the platform from the coupler")
    model, _, found = evaluated("rss_k0")
    variables, coordinates = reaction_variables(model.mechanism, found)
    assert not coordinates and set(variables) == {f"reaction_{name}" for name in quantities}
    dims, values, attributes = variables["reaction_crank_tip"]
    assert dims == ("time", "chain", "axis") and values.shape[1:] == (6, 3)
    assert attributes["units"] == "N" and attributes["frame"] == "{S}"
    assert (attributes["body"], attributes["by"]) == ("coupler", "crank")
    model, _, found = evaluated("mixed_k3")
    variables, coordinates = reaction_variables(model.mechanism, found)
    assert variables["contact_force_vector"][0][0] == "time"
    dataset = xr.Dataset(variables, coordinates | {"chain": list(model.mechanism.chain_names)})
    assert all(np.isfinite(v.values).all() for v in dataset.data_vars.values())
    kinds = {c.name: c.kind for c in model.mechanism.chains}
    assert {kinds[name] for name in dataset["chain_PSS"].values} == {"PSS"}
    assert dataset["reaction_rail_force"].dims == ("time", "chain_PSS", "axis")
    assert dataset["reaction_platform_joint"].dims == ("time", "chain", "axis")


def test_columns_of_files_have_the_names_of_the_reactions(tmp_path: Path) -> None:
    """`run` and `solve` write the same columns, contact forces as vectors included."""
    model = evaluated("mixed_k3")[0]
    t = np.linspace(0, 1, 6)
    motion = condyle.Motion.from_arrays(t, {name: 0 * t for name in model.independent})
    columns = model.solve(motion, reactions=True).condyle.columns()
    places = reaction_places(model.mechanism)
    wanted = {f"reaction_{place.name}_{axis}" for place in places for axis in "xyz"}
    assert {name for name in columns if name.startswith("reaction_")} == wanted
    states = {p + name: 0 * t for p in ("", "d", "dd") for name in model.independent}
    write_table(tmp_path / "states.csv", states)
    solve_states(model, tmp_path / "states.csv", tmp_path / "out.csv", reactions=True)
    table = read_table(tmp_path / "out.csv")
    assert {name for name in table.columns if name.startswith("reaction_")} == wanted
    for name in wanted:
        np.testing.assert_array_equal(table.columns[name], columns[name])
