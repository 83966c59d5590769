"""Efforts of least norm that release unilateral contacts: complementarity, by its own conditions.

With Q = J^T tau + N lambda, least |tau|^2 under push lambda >= 0 has tau = J mu, and along every
unilateral contact either push N.mu = 0 and the contact pushes, or push N.mu < 0 and it is open.
"""

from __future__ import annotations

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.report.page import report_html
from condyle.results.enclosures import prove

STATES = 1000


def released() -> condyle.Model:
    return model("human-jaw").with_distribution(
        condyle.Distribution("minimum_norm", unilateral="release")
    )


def test_no_contact_is_active_and_pulling_or_open_and_needed() -> None:
    jaw, rng = released(), np.random.default_rng(46)
    q = rng.normal(0, 1, (STATES, 4)) * [1e-3, 1e-3, 0.02, 0.05]
    wrench = rng.normal(0, 1, (STATES, 6)) * [40, 40, 120, 2, 2, 2]
    found = jaw.inverse_dynamics(q, 0 * q, 0 * q, wrench, outputs=("contact_active", "pose"))
    assert not found.status.any()
    still = np.zeros_like(found.pose)
    ports = {"pose": found.pose, "pose_rate": still, "pose_acceleration": still}
    ports |= {"force": wrench[:, :3], "moment": wrench[:, 3:], "point": np.zeros((STATES, 3))}
    system = jaw.kernel("system").run(ports).values
    Q, J, N = (np.moveaxis(system[name], -1, 0) for name in ("Q", "J", "normal"))
    force, push = found.contact_force, np.array([c.push for c in jaw.mechanism.contacts])
    size = np.linalg.norm(Q, axis=1)
    # `J` has rows 6 and columns n.
    left = Q - (J @ found.effort[..., None])[..., 0] - np.einsum("nki,nk->ni", N, force)
    assert (np.linalg.norm(left, axis=1) < 1e-9 * size).all()
    mu = np.linalg.pinv(J.transpose(0, 2, 1)) @ found.effort[..., None]
    effort = np.linalg.norm(found.effort, axis=1, keepdims=True)
    off = (J.transpose(0, 2, 1) @ mu)[..., 0] - found.effort
    assert (np.abs(off) < 1e-9 * effort).all()
    along = push * (N @ mu)[..., 0] / np.linalg.norm(mu[..., 0], axis=1, keepdims=True)
    active = found.contact_active
    assert ((push * force >= 0) & (active | (force == 0))).all()
    assert (np.where(active, np.abs(along), 0) < 1e-9).all()
    assert (np.where(active, -1, along) < 1e-9).all()
    assert {tuple(row) for row in active} == {(a, b) for a in (0, 1) for b in (0, 1)}


def test_a_run_says_where_and_when_contacts_are_open() -> None:
    """Condyles lift where the bite pulls the jaw down: at first, half-way and at last."""
    t = np.linspace(0, 1, 41)
    motion = condyle.Motion.from_arrays(t, {n: 0 * t for n in ("X", "Y", "alpha", "beta")})
    force = np.outer(np.sin(2 * np.pi * t) ** 2 - 0.3, [0, 0, -400])
    load = condyle.Load.from_arrays(t, force, point="incisor")
    solution = released().solve(motion, load)
    is_open = ~solution["contact_active"].values.astype(bool)
    lifts, text = solution.condyle.contact_lifts, str(solution.condyle)
    assert [*lifts] == ["left_condyle", "right_condyle"]
    lift, open_for = lifts["right_condyle"], is_open[:, 1].sum()
    assert (lift["count"], lift["first"], lift["last"]) == (3, 0.0, 1.0)
    assert abs(lift["open"] - (open_for - 3) / 40) < 1e-12 and lift["landing_speed"] is None
    assert lift["point"] == solution["contact_point"].values[0, 1].tolist()
    assert "joint open: right_condyle 3 times" in text
    page = report_html(solution)
    assert "Joints that lift" in page and "right_condyle is open" in page


def test_where_none_is_lost_efforts_are_those_of_least_norm() -> None:
    jaw, kept = released(), model("human-jaw").with_distribution("minimum_norm")
    q, wrench = np.zeros(4), np.array([0, 0, 200.0, 0, 0, 0])
    found, other = (m.inverse_dynamics(q, q, q, wrench) for m in (jaw, kept))
    np.testing.assert_allclose(found.effort, other.effort, rtol=1e-12)
    assert (found.contact_force < 0).all()  # the fossa pushes down


def test_a_map_has_the_largest_load_before_a_contact_is_lost() -> None:
    jaw = model("human-jaw").with_distribution("minimum_norm")
    axis, load = ["X=-1:1:3 mm"], {"Fz": -200.0}
    mapped = condyle.workspace_map(
        jaw, axis, ["lift_load", "contact_force"], load=load, load_point="incisor",
        direction="0,0,1",
    )  # fmt: skip
    most = mapped["lift_load"].values
    assert (mapped["contact_force"].values < 0).all() and (most > 0).all()
    for i, x in enumerate(mapped["X"].values):
        q, wrench = np.array([x, 0, 0, 0]), np.zeros(6)
        for part, lost in ((1 - 1e-9, False), (1 + 1e-9, True)):
            wrench[2] = -200.0 + part * most[i]
            force = jaw.inverse_dynamics(q, 0 * q, 0 * q, wrench, "incisor").contact_force
            assert bool((force > 0).any()) is lost
    up = condyle.workspace_map(jaw, axis, "lift_load", direction="0,0,1")
    assert (up["lift_load"].values == -np.inf).all()  # lost without a further load


def test_what_does_not_fit_is_said() -> None:
    with pytest.raises(InputError, match="unilateral: expected keep or release, got 'open'"):
        condyle.derive("human-jaw", unilateral="open")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="quantity lift_load needs unilateral contacts"):
        condyle.workspace_map("masticatory", quantities="lift_load", direction="0,0,1")
    jaw = released()
    with pytest.raises(UnsupportedError, match="--unilateral keep"):
        prove(jaw, None, 1)  # type: ignore[arg-type]
    assert condyle.derive("masticatory", unilateral="release").distribution.unilateral == "keep"
