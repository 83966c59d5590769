"""Derivatives by states, loads and efforts against differences in 60 digits of another text."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from mpmath import mpf
from oracles.digits import Machine, plain
from support.rubbing import Rubbing, drawn

from condyle.model.model import Model

Array = np.ndarray
STEP = mpf(10) ** -18  # central differences are off by its square
DRAWN: dict[str, dict[str, Any]] = {
    "RSS k0 n8": {"contacts": 0, "chains": 8, "seed": 2, "mu": 0.0},
    "RSS k1 n8 quadratic": {"contacts": 1, "chains": 8, "seed": 3, "surface": "quadratic"},
    "RSS k2 n8": {"chains": 8, "seed": 5},
    "RSS k2 sphere": {"surface": "sphere", "seed": 12, "mu": 0.0, "lossy": False},
    "PSS k2 balls": {"families": ("PSS",), "ball_radius": 3.0, "seed": 6, "surface": "ellipsoid"},
    "SPS k2 cylinder": {"families": ("SPS",), "seed": 7, "surface": "cylinder"},
    "SPS k1 profile": {"families": ("SPS",), "contacts": 1, "seed": 7, "surface": "profile"},
    "mixed k3 n9": {"families": ("PSS", "SPS"), "contacts": 3, "chains": 9, "seed": 8},
    "cables k2": {"families": ("SPS", "cable"), "chains": 8, "seed": 11},
    "PSS k4 quadratic": {"families": ("PSS",), "contacts": 4, "seed": 9, "surface": "quadratic"},
    "RSS k5": {"contacts": 5, "seed": 10, "mu": 0.0},
}
FEW = ("RSS k2 n8",)
CASES = [pytest.param(n, marks=() if n in FEW else pytest.mark.ci) for n in DRAWN]


@cache
def case(name: str) -> Rubbing:
    return drawn(**{"count": 1, **DRAWN[name]})


@cache
def model(name: str) -> Model:
    return Model(case(name).mechanism, backend="numpy", distribution="minimum_norm")


@cache
def machine(name: str) -> Machine:
    return Machine(case(name).raw, model(name).independent)


def state(name: str) -> dict[str, Array]:
    """q, v, a, wrench, at and an effort, one row each."""
    c, m = case(name), model(name)
    order = [c.states["names"].index(n) for n in m.independent]
    given = {k: c.states[s][:, order] for k, s in (("q", "q"), ("v", "qd"), ("a", "qdd"))}
    _, _, _, load = c.packed
    return given | {"wrench": load[:, :6], "at": load[:, 6:]}


def compared(d: Any, given: dict[str, Array], function: Any, *of: str) -> None:
    """Along one direction of all arguments, in which every column counts as much as the others.

    Args: function: of the arguments' digits, gives every result of `of`.
    """
    rng, ends, parts = np.random.default_rng(1), [], {name: [] for name in of}
    along: dict[str, Array] = {}
    for by, a in given.items():
        sizes = np.abs(d[of[0], by][0]).reshape(-1, a.shape[1]).max(axis=0)
        assert (sizes > 0).all()
        along[by] = rng.choice([-1.0, 1.0], len(sizes)) * rng.uniform(0.5, 1.0, len(sizes)) / sizes
        for name in of:
            parts[name].append(d[name, by][0].reshape(-1, len(sizes)) * along[by])
    for sign in (1, -1):
        moved = {
            by: [
                mpf(x) + sign * STEP * mpf(t)
                for x, t in zip(a[0].tolist(), along[by].tolist(), strict=True)
            ]
            for by, a in given.items()
        }
        ends.append(function(moved))
    for name, right, left in zip(of, *ends, strict=True):
        wanted = [float((x - y) / (2 * STEP)) for x, y in zip(right, left, strict=True)]
        found = np.concatenate(parts[name], axis=1)
        np.testing.assert_allclose(
            found.sum(axis=1), wanted, rtol=0, atol=1e-9 * np.abs(found).max(initial=0.0)
        )


@pytest.mark.parametrize("name", CASES)
def test_efforts_and_contact_forces(name: str) -> None:
    given = state(name)
    d = model(name).derivatives(("effort", "contact_force"), tuple(given), **given)
    assert d.status[0] == 0
    found = model(name).inverse_dynamics(**given, outputs=("pose",))
    near, signs = (
        found.pose[0],
        np.where(np.abs(found.contact_force[0]) < 1e-9, 0, found.contact_force[0]),
    )

    def solved(g: dict[str, Any]) -> tuple[Any, Any]:
        return machine(name).inverse(near, g["q"], g["v"], g["a"], g["wrench"], g["at"], signs)

    compared(d, given, solved, "effort", "contact_force")
    alone = model(name).derivatives("effort", tuple(given), **given)
    for by in given:  # as the kernel computes them, where there is no friction
        same(alone["effort", by], d["effort", by])


def same(got: Array, wanted: Array) -> None:
    assert got.shape == wanted.shape
    atol = 1e-9 * np.abs(wanted).max(initial=0.0)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=atol)


@pytest.mark.parametrize(
    "how",
    [
        ("lagrange", "direct"),
        *(
            pytest.param(how, marks=pytest.mark.ci)
            for how in (("lagrange", "core"), ("momentum", "core"), ("virtual_power", "direct"))
        ),
    ],
)
def test_every_formulation_has_the_same(how: tuple[str, str]) -> None:
    formulation, route = how
    usual = Model("masticatory", backend="numpy")
    other = Model("masticatory", backend="numpy", formulation=formulation, route=route)
    rng = np.random.default_rng(4)
    given = {n: s * rng.normal(0, 1, (3, 4)) for n, s in (("q", 2e-3), ("v", 0.1), ("a", 1.0))}
    given["wrench"] = rng.normal(0, 1, (3, 6))
    wanted = usual.derivatives(("effort", "contact_force"), tuple(given), **given)
    assert not wanted.status.any()
    for of in ("effort", ("effort", "contact_force")):
        found = other.derivatives(of, tuple(given), **given)
        for key in found:
            same(found[key], wanted[key])


@pytest.mark.parametrize("name", ["RSS k2 n8", "RSS k0 n8"])
def test_forward_and_reverse_are_the_matrix(name: str) -> None:
    m, given = model(name), state(name)
    rng = np.random.default_rng(5)
    for of in ("effort", ("effort", "contact_force")):
        d = m.derivatives(of, tuple(given), **given)
        names = (of,) if isinstance(of, str) else of
        way = {by: rng.normal(0, 1, np.shape(a)) for by, a in given.items()}
        along = m.jvp(of, way, **given)
        for name in names:
            total = sum((d[name, by] @ x[..., None])[..., 0] for by, x in way.items())
            same(along[name], np.asarray(total))
        weights = {name: rng.normal(0, 1, along[name].shape) for name in names}
        back = m.vjp(of, weights, tuple(given), **given)
        for by in given:
            total = sum((w[:, None] @ d[name, by])[:, 0] for name, w in weights.items())
            same(back[by], np.asarray(total))


@pytest.mark.parametrize("name", CASES)
def test_accelerations(name: str) -> None:
    given, m = state(name), model(name)
    rng = np.random.default_rng(2)
    given["effort"] = m.inverse_dynamics(**given).effort * rng.uniform(
        0.9, 1.1, len(m.mechanism.chains)
    )
    del given["a"]
    d = m.derivatives(("acceleration", "contact_force"), tuple(given), **given)
    assert d.status[0] == 0
    found = m.forward_dynamics(**given, outputs=("pose",))
    near, signs = found.pose[0], found.contact_force[0]

    def solved(g: dict[str, Any]) -> tuple[Any, Any]:
        return machine(name).forward(near, g["q"], g["v"], g["effort"], g["wrench"], g["at"], signs)

    compared(d, given, solved, "acceleration", "contact_force")


@pytest.mark.parametrize("name", CASES)
def test_poses_joints_and_contacts(name: str) -> None:
    m, given = model(name), {"q": state(name)["q"]}
    k = len(m.mechanism.contacts)
    of = ("pose", "joint", *(("contact_point",) if k else ()))
    d = m.derivatives(of, "q", **given)
    assert d.status[0] == 0
    near, still, digits = (
        m.inverse_kinematics(given["q"]).pose[0],
        np.zeros(len(m.independent)),
        machine(name),
    )

    def solved(g: dict[str, Any]) -> Any:
        p = digits.closed(near, g["q"], still, still)[0][0]
        R, joints = digits.rotation(p), [x.x for x in digits._kinetics(p)[0]]
        centres = [
            p[i] + sum(R[i][j] * c.point[j] for j in range(3))
            for c in digits.contacts
            for i in range(3)
        ]
        return [plain(p), joints, *([plain(centres)] if k else [])]

    compared(d, given, solved, *of)
