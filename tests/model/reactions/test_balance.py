"""Newton and Euler for every body, from the reactions that act on it and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.bodies import Body, bodies, cross_matrix
from oracles.jets import Jet
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import MECHANISMS, Case, case, of_raw
from support.loads import parts
from support.speeds import few

from condyle.model.joint_reactions import Reaction, reactions
from condyle.model.model import Model

SURFACES = {
    "curved_k3": {"surface": "mixed", "contacts": 3, "families": ("RSS", "PSS", "SPS")},
    "ellipsoids": {"surface": "ellipsoid"},
}


OFF_CENTRE = "off_centre"
LENGTH = 0.05  # metres: a lever of these mechanisms


def build(name: str) -> Case:
    if name == OFF_CENTRE:
        rng = np.random.default_rng(5)
        raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), contacts=1)
        return of_raw(off_centre(rng, raw))
    if name not in SURFACES:
        return case(name)
    return of_raw(random_mechanism(np.random.default_rng(8), **SURFACES[name]))


def found_reactions(
    c: Case, formulation: str = "virtual_power", **given: np.ndarray
) -> dict[str, Reaction]:
    model = Model(c.mechanism, formulation=formulation, backend="numpy")
    q, q1, q2 = (c.states[key] for key in ("q", "qd", "qdd"))
    found = model.inverse_dynamics(q, q1, q2, *parts(c.load), **given, outputs="all")
    return reactions(model, found, **given)


class Ledger:
    """What is left of each body's balance: force, and moment about its mass centre."""

    def __init__(self, free: dict[str, Body], gravity: np.ndarray) -> None:
        self.free = free
        needs = {key: body.needs(gravity) for key, body in free.items()}
        self.force = {key: -need[0] for key, need in needs.items()}
        self.moment = {key: -need[1] for key, need in needs.items()}
        self.largest = dict.fromkeys(free, 0.0)

    def act(self, key: str, force: np.ndarray, moment: np.ndarray, point: np.ndarray) -> None:
        if key not in self.free:
            assert key in ("base", "surface")
            return
        self.force[key] = self.force[key] + force
        arm = point - self.free[key].centre.x
        self.moment[key] = self.moment[key] + moment + np.cross(arm, force)
        size = max(np.abs(force).max(), np.abs(moment).max() / LENGTH)
        self.largest[key] = max(self.largest[key], size)


def body_of(reaction: Reaction, name: str) -> str:
    """The free body that a reaction calls `name`."""
    return name if name in ("platform", "base", "surface") else f"{reaction.owner}.{name}"


EVERY = [*MECHANISMS, *SURFACES, OFF_CENTRE]


BALANCED = few(EVERY, OFF_CENTRE, "rss", "pss_k0", "sps_k3", "mixed_k1_n7")


def carried(body: Body, base: np.ndarray) -> Body:
    """A body of the moving base in a frame that stands still, which {S} is passing now."""
    a, w, w_rate = base.reshape(3, 3)
    turn = Jet(np.eye(3), cross_matrix(w), cross_matrix(w_rate) + cross_matrix(w) @ cross_matrix(w))
    origin = Jet(np.zeros(3), np.array([1.0, -2.0, 3.0]), a)
    return replace(body, centre=origin + turn @ body.centre, R=turn @ body.R)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", BALANCED)
def test_every_body_balances(name: str, moving: bool) -> None:
    c, given = build(name), dict[str, np.ndarray]()
    if moving:
        rng, count = np.random.default_rng(3), len(c.load)
        given = {"gravity": rng.normal(0, 9, (count, 3)), "base": rng.normal(0, 6, (count, 9))}
    found = found_reactions(c, **given)
    for i in range(len(c.load)):
        motion = Jet(*(c.states[key][i] for key in ("pose", "pose_rate", "pose_acceleration")))
        free = bodies(c.raw, motion)
        gravity = np.array(c.mechanism.gravity)
        if given:
            gravity = given["gravity"][i]
            free = {key: carried(body, given["base"][i]) for key, body in free.items()}
        ledger = Ledger(free, gravity)
        for r in found.values():
            vector, zero = r.array[i], np.zeros(3)
            force, moment = (vector, zero) if r.unit == "N" else (zero, vector)
            ledger.act(body_of(r, r.body), force, moment, r.point[i])
            ledger.act(body_of(r, r.by), -force, -moment, r.point[i])
        top = free["platform"]
        where = motion.x[:3] + top.R.x @ c.load[i, 6:]
        ledger.act("platform", c.load[i, :3], c.load[i, 3:6], where)
        for key, largest in ledger.largest.items():
            assert np.abs(ledger.force[key]).max() < 1e-9 * largest, key
            assert np.abs(ledger.moment[key]).max() < 1e-9 * LENGTH * largest, key


@pytest.mark.parametrize("formulation", ["momentum", "newton_euler"])
def test_any_formulation_gives_the_same_reactions(formulation: str) -> None:
    c = case("mixed")
    wanted, got = found_reactions(c), found_reactions(c, formulation)
    assert list(wanted) == list(got)
    force = max(np.abs(r.array).max() for r in wanted.values())
    for name, r in wanted.items():
        np.testing.assert_allclose(got[name].array, r.array, rtol=0, atol=1e-10 * force)
