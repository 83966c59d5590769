"""Newton and Euler for every body, from the reactions that act on it and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.dynamics.reactions import Reaction, reactions
from condyle.model import Model
from families.bodies import bodies
from families.cases import MECHANISMS, Case, case, of_raw
from families.jets import Jet
from oracles.random_mechanism import random_mechanism

SURFACES = {
    "curved_k3": {"surface": "mixed", "contacts": 3, "families": ("RSS", "PSS", "SPS")},
    "ellipsoids": {"surface": "ellipsoid"},
}


def build(name: str) -> Case:
    if name not in SURFACES:
        return case(name)
    return of_raw(random_mechanism(np.random.default_rng(8), **SURFACES[name]))


def found_reactions(c: Case, formulation: str = "virtual_power") -> dict[str, Reaction]:
    model = Model(c.mechanism, formulation, backend="interpreted")
    q, q1, q2 = (c.states[key] for key in ("q", "qd", "qdd"))
    return reactions(model, model.evaluate(q, q1, q2, c.load))


def body_of(reaction: Reaction, name: str) -> str:
    """The free body that a reaction calls `name`."""
    return name if name in ("platform", "base", "surface") else f"{reaction.owner}.{name}"


@pytest.mark.parametrize("name", [*MECHANISMS, *SURFACES])
def test_every_body_balances(name: str) -> None:
    c = build(name)
    found = found_reactions(c)
    gravity = np.array(c.mechanism.gravity)
    for i in range(len(c.load)):
        motion = Jet(*(c.states[key][i] for key in ("pose", "pose_rate", "pose_acceleration")))
        free = bodies(c.raw, motion)
        needs = {key: body.needs(gravity) for key, body in free.items()}
        force = {key: -need[0] for key, need in needs.items()}
        moment = {key: -need[1] for key, need in needs.items()}
        largest = dict.fromkeys(free, 0.0)

        def act(key: str, push: np.ndarray, couple: np.ndarray, point: np.ndarray) -> None:
            if key not in free:
                assert key in ("base", "surface")
                return
            force[key] = force[key] + push
            moment[key] = moment[key] + couple + np.cross(point - free[key].centre.x, push)
            largest[key] = max(largest[key], np.abs(push).max(), np.abs(couple).max() / 0.05)

        for r in found.values():
            vector, zero = r.array[i], np.zeros(3)
            push, couple = (vector, zero) if r.unit == "N" else (zero, vector)
            act(body_of(r, r.body), push, couple, r.point[i])
            act(body_of(r, r.by), -push, -couple, r.point[i])
        arm = free["platform"].R.x @ c.load[i, 6:]
        where = free["platform"].centre.x + arm
        act("platform", c.load[i, :3], c.load[i, 3:6], where)
        for key in free:
            assert np.abs(force[key]).max() < 1e-9 * largest[key], key
            assert np.abs(moment[key]).max() < 1e-9 * 0.05 * largest[key], key


@pytest.mark.parametrize("formulation", ["momentum", "newton_euler"])
def test_any_formulation_gives_the_same_reactions(formulation: str) -> None:
    c = case("mixed")
    wanted, got = found_reactions(c), found_reactions(c, formulation)
    assert list(wanted) == list(got)
    force = max(np.abs(r.array).max() for r in wanted.values())
    for name, r in wanted.items():
        np.testing.assert_allclose(got[name].array, r.array, rtol=0, atol=1e-10 * force)
