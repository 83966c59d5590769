"""Derivatives by numbers of the file against differences in 60 digits of another text."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from mpmath import mpf
from oracles.digits import Machine, jet

from condyle.errors import InputError
from condyle.model.model import Model

from .test_states import STEP, case, model, same, state

Array = np.ndarray
INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
NAMES = [
    "RSS k2 n8",
    *(pytest.param(n, marks=pytest.mark.ci) for n in ("RSS k1 n8 quadratic", "mixed k3 n9")),
]


def paths_of(name: str) -> list[str]:
    m = model(name).mechanism
    chain, contact = m.chains[0], m.contacts[0].name
    own = {"RSS": "coupler", "PSS": "rod", "SPS": "piston"}[chain.kind]
    keys = ["platform", "base", f"{own}.mass", f"{own}.transverse"]
    keys += ["axis", "crank.inertia"] if chain.kind == "RSS" else []
    found = ["platform.mass", "platform.inertia", "gravity", "chain.*.actuator.viscous"]
    found += [f"chain.{chain.name}.{key}" for key in keys]
    found += [f"contact.{contact}.{key}" for key in ("point", "surface.slope")]
    return [*found, f"contact.{contact}.friction.coefficient"]


def tables_of(raw: dict[str, Any], keys: list[str]) -> tuple[list[Any], list[str]]:
    """The tables of the file that a path names, and the keys within each."""
    if keys[0] in ("chain", "contact"):
        return [t for t in raw[keys[0]] if keys[1] in ("*", t["name"])], keys[2:]
    return [raw], keys


def moved(name: str, changes: dict[str, Array], sign: int) -> dict[str, Any]:
    """The file with numbers changed by `STEP` times something, SI; home's contacts are kept."""
    raw = deepcopy(case(name).raw)
    scale = {"m": mpf(1), "mm": mpf(1) / 1000}[raw.get("length_unit", "m")]
    raw.setdefault("gravity", [0, 0, -9.81])
    for path, change in changes.items():
        tables, keys = tables_of(raw, path.split("."))
        *above, last = keys
        unit = scale if last in ("platform", "base", "point") else 1
        for table, own in zip(tables, change.reshape(len(tables), -1).tolist(), strict=True):
            here = table
            for key in above:
                here = here.setdefault(key, {})
            steps = [sign * STEP * mpf(x) / unit for x in own]
            if path == "platform.inertia":
                for key, step in zip(INERTIA, steps, strict=True):
                    here[last][key] = mpf(here[last].get(key, 0)) + step
            elif isinstance(here.get(last), list):
                here[last] = [mpf(x) + s for x, s in zip(here[last], steps, strict=True)]
            else:
                here[last] = mpf(here.get(last, 0)) + steps[0]
    home, names = [jet(0)] * 6, model(name).independent
    before, after = (Machine(r, names).phi(home) for r in (case(name).raw, raw))
    for table, old, new in zip(raw.get("contact", []), before, after, strict=True):
        surface, off = table["surface"], jet(new[0]).x - jet(old[0]).x
        surface["offset"] = mpf(surface.get("offset", 0)) + off / scale
    return raw


@pytest.mark.parametrize("name", NAMES)
def test_efforts_accelerations_and_joints(name: str) -> None:
    m, given, paths = model(name), state(name), paths_of(name)
    found = m.inverse_dynamics(**given, outputs=("pose",))
    near, signs = found.pose[0], found.contact_force[0]
    signs = np.where(np.abs(signs) < 1e-9, 0, signs)
    forced = {k: a for k, a in given.items() if k != "a"} | {"effort": 1.05 * found.effort}
    ahead = m.forward_dynamics(**forced).contact_force[0]
    d = [
        m.derivatives(("effort", "contact_force"), paths, **given),
        m.derivatives(("acceleration", "contact_force"), paths, **forced),
    ]
    assert not any(x.status.any() for x in d)
    rng, along = np.random.default_rng(3), dict[str, Array]()
    for path in paths:
        size = np.abs(d[0]["effort", path]).max()
        assert size > 0 and np.abs(d[1]["acceleration", path]).max() > 0
        shape = d[0]["effort", path].shape[2:]
        along[path] = np.asarray(rng.choice([-1.0, 1.0], shape) / size)
    ends = []
    for sign in (1, -1):
        machine = Machine(moved(name, along, sign), m.independent)
        q, v, a, w, at, tau = (
            [mpf(x) for x in (given | forced)[n][0].tolist()]
            for n in ("q", "v", "a", "wrench", "at", "effort")
        )
        inverse = machine.inverse(near, q, v, a, w, at, signs)
        ends.append([*inverse, *machine.forward(near, q, v, tau, w, at, ahead)])
    for (i, of), right, left in zip(
        [(0, "effort"), (0, "contact_force"), (1, "acceleration"), (1, "contact_force")],
        *ends,
        strict=True,
    ):
        wanted = [float((x - y) / (2 * STEP)) for x, y in zip(right, left, strict=True)]
        parts = [
            (d[i][of, path][0].reshape(len(wanted), -1) * np.ravel(along[path])).sum(axis=1)
            for path in paths
        ]
        np.testing.assert_allclose(
            np.sum(parts, axis=0), wanted, rtol=0, atol=1e-9 * np.abs(parts).max()
        )


def test_forward_and_reverse_are_the_matrix() -> None:
    """For the efforts as their kernel computes them, and by the implicit function theorem."""
    m = Model("masticatory", backend="numpy")
    rng, paths = np.random.default_rng(5), ("platform.mass", "chain.*.base", "q")
    given = {n: s * rng.normal(0, 1, (2, 4)) for n, s in (("q", 2e-3), ("v", 0.1), ("a", 1.0))}
    given |= {"wrench": rng.normal(0, 1, (2, 6)), "at": "right_molar"}
    paths = (*paths, "platform.points.right_molar")
    for of in ("effort", ("effort", "contact_force")):
        d = m.derivatives(of, paths, **given)
        assert d["effort", "chain.*.base"].shape == (2, 6, 6, 3)
        assert d["effort", "platform.mass"].shape == (2, 6)
        same(
            d["effort", "platform.points.right_molar"],
            m.derivatives("effort", "at", **given)["effort", "at"],
        )
        flat = {by: d["effort", by].reshape(2, 6, -1) for by in paths}
        way = {by: rng.normal(0, 1, (2, *d["effort", by].shape[2:])) for by in paths}
        total = sum((flat[by] @ way[by].reshape(2, -1, 1))[..., 0] for by in paths)
        same(m.jvp("effort", way, **given)["effort"], np.asarray(total))
        weights = rng.normal(0, 1, (2, 6))
        back = m.vjp("effort", weights, paths, **given)
        for by in paths:
            same(back[by].reshape(2, -1), (weights[:, None] @ flat[by])[:, 0])


def test_one_state_and_one_number() -> None:
    """No leading shape, and none of the number: what is left is that of the result."""
    m, one = Model("masticatory", backend="numpy"), np.full(4, 1e-3)
    given = {"q": one, "v": one, "a": one, "at": "right_molar"}
    by = "platform.mass"
    d = m.derivatives(("effort", "contact_force"), by, **given)["effort", by]
    assert d.shape == (6,)
    same(m.jvp("effort", {by: 2.0}, **given)["effort"], 2 * d)
    same(m.vjp("effort", np.ones(6), by, **given)[by], np.asarray(d.sum()))
    point = "contact.left_condyle.point"
    assert m.derivatives("singularity_ratio", point, q=one)["singularity_ratio", point].shape == (
        3,
    )
    mass = m.derivatives("singularity_ratio", by, q=one, zeros=True)["singularity_ratio", by]
    assert mass.shape == () and mass == 0


@pytest.mark.parametrize(
    ("of", "by", "message"),
    [
        ("effort", "chain.masseter_left.actuator.speed_limit", "effort cannot depend on chain"),
        ("effort", "joint", "effort cannot depend on joint, only on q, v, a"),
        ("pose", "platform.mass", "pose cannot depend on platform.mass"),
        ("joint", "gravity", "joint cannot depend on gravity"),
        ("effort", "platform.mas", 'platform has no "mas"'),
        ("effort", "platform.points.incisor", "cannot depend on platform.points.incisor"),
        ("effort", "mass", "there is no 'mass'"),
    ],
)
def test_what_cannot_matter_is_an_error(of: str, by: str, message: str) -> None:
    m = Model("masticatory", backend="numpy")
    zero = np.zeros(4)
    given = {"q": zero, "v": zero, "a": zero, "at": "right_molar"}
    with pytest.raises(InputError, match=message):
        m.derivatives(of, by, **given)
    if "cannot depend" in message:
        assert not m.derivatives(of, by, **given, zeros=True)[of, by].any()


def test_a_number_at_its_default_of_zero_counts() -> None:
    """The paper's mechanism has no friction: its derivative in the coefficient is none of zero."""
    m, rng = Model("masticatory", backend="numpy"), np.random.default_rng(6)
    given = {n: s * rng.normal(0, 1, 4) for n, s in (("q", 2e-3), ("v", 0.1), ("a", 1.0))}
    by = "contact.left_condyle.friction.coefficient"
    found = m.derivatives("effort", by, **given)["effort", by]
    ends = []
    for h in (1e-5, 2e-5):
        other = Model(m.mechanism.set({by: h}), backend="numpy")
        ends.append(other.inverse_dynamics(**given).effort - m.inverse_dynamics(**given).effort)
    wanted = (4 * ends[0] - ends[1]) / 2e-5
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())
