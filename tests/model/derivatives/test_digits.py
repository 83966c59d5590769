"""Derivatives by states, loads, efforts and numbers of the file, against differences in 60 digits
of another text; forward and reverse; what cannot matter."""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpmath import mpf
from oracles.digits import Machine, jet
from support.families import close
from support.machines import model as shared
from support.rubbing import Rubbing, drawn
from support.speeds import few, first

from condyle.errors import InputError
from condyle.model.model import Model

Array = np.ndarray
STEP = mpf(10) ** -18  # central differences are off by its square
DRAWN: dict[str, dict[str, Any]] = {
    "RSS k2 n8": {"chains": 8, "seed": 5},
    "PSS k1 ball": {
        "families": ("PSS",), "contacts": 1, "ball_radius": 3.0, "seed": 6, "surface": "ellipsoid"
    },
    "SPS k1 profile": {"families": ("SPS",), "contacts": 1, "seed": 7, "surface": "profile"},
    "mixed k3 n9": {"families": ("PSS", "SPS"), "contacts": 3, "chains": 9, "seed": 8},
    "cables k2": {"families": ("SPS", "cable"), "chains": 8, "seed": 11, "surface": "cylinder"},
}  # fmt: skip
ON_PLANES = ("RSS k2 n8", "mixed k3 n9")  # numbers of the file beside
INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")


@cache
def case(name: str) -> Rubbing:
    return drawn(**{"count": 1, **DRAWN[name]})


@cache
def model(name: str) -> Model:
    return Model(case(name).mechanism, backend="numpy", distribution="minimum_norm")


def state(name: str) -> dict[str, Array]:
    """q, v, a, wrench and at, one row each."""
    c, m = case(name), model(name)
    order = [c.states["names"].index(n) for n in m.independent]
    given = {k: c.states[s][:, order] for k, s in (("q", "q"), ("v", "qd"), ("a", "qdd"))}
    load = c.packed[3]
    return given | {"wrench": load[:, :6], "at": load[:, 6:]}


def paths_of(name: str) -> list[str]:
    if name not in ON_PLANES:
        return []
    m = model(name).mechanism
    chain, contact = m.chains[0], m.contacts[0].name
    own = {"RSS": "coupler", "PSS": "rod", "SPS": "piston"}[chain.kind]
    keys = ["platform", "base", f"{own}.mass", f"{own}.transverse"]
    keys += ["axis", "crank.inertia"] if chain.kind == "RSS" else []
    found = ["platform.mass", "platform.inertia", "gravity", "chain.*.actuator.viscous"]
    found += [f"chain.{chain.name}.{key}" for key in keys]
    keys = ["point", "surface.slope", "friction.coefficient"]
    return [*found, *(f"contact.{contact}.{key}" for key in keys)]


def moved(name: str, changes: dict[str, Array], sign: int) -> dict[str, Any]:
    """The file with numbers changed by `STEP` times something, SI; home's contacts are kept."""
    raw = deepcopy(case(name).raw)
    scale = {"m": mpf(1), "mm": mpf(1) / 1000}[raw.get("length_unit", "m")]
    raw.setdefault("gravity", [0, 0, -9.81])
    for path, change in changes.items():
        keys, tables = path.split("."), [raw]
        if keys[0] in ("chain", "contact"):
            tables = [t for t in raw[keys[0]] if keys[1] in ("*", t["name"])]
            keys = keys[2:]
        unit = scale if keys[-1] in ("platform", "base", "point") else 1
        for table, own in zip(tables, change.reshape(len(tables), -1).tolist(), strict=True):
            here, last = table, keys[-1]
            for key in keys[:-1]:
                here = here.setdefault(key, {})
            steps = [sign * STEP * mpf(x) / unit for x in own]
            if path == "platform.inertia":
                for key, step in zip(INERTIA, steps, strict=True):
                    here[last][key] = mpf(here[last].get(key, 0)) + step
            elif isinstance(here.get(last), list):
                here[last] = [mpf(x) + s for x, s in zip(here[last], steps, strict=True)]
            else:
                here[last] = mpf(here.get(last, 0)) + steps[0]
    if changes:
        home, names = [jet(0)] * 6, model(name).independent
        before, after = (Machine(r, names).phi(home) for r in (case(name).raw, raw))
        for table, old, new in zip(raw.get("contact", []), before, after, strict=True):
            surface, off = table["surface"], jet(new[0]).x - jet(old[0]).x
            surface["offset"] = mpf(surface.get("offset", 0)) + off / scale
    return raw


@pytest.mark.slow
@pytest.mark.parametrize("name", few(DRAWN, "RSS k2 n8"))
def test_against_sixty_digits(name: str) -> None:
    """Along one direction of all arguments and numbers, in which each counts as much as others."""
    m, given, paths = model(name), state(name), paths_of(name)
    found = m.inverse_dynamics(**given, outputs=("pose",))
    near, signs = found.pose[0], found.contact_force[0]
    signs = np.where(np.abs(signs) < 1e-9, 0, signs)
    rng = np.random.default_rng(2)
    forced = {k: a for k, a in given.items() if k != "a"}
    forced["effort"] = found.effort * rng.uniform(0.9, 1.1, found.effort.shape)
    ahead = m.forward_dynamics(**forced).contact_force[0]
    results = ("effort", "contact_force"), ("acceleration", "contact_force")
    d = [
        m.derivatives(of, (*arguments, *paths), **arguments)
        for of, arguments in zip(results, (given, forced), strict=True)
    ]
    assert not any(x.status.any() for x in d)
    for by in given:  # as the kernel computes them, where there is no friction
        same(m.derivatives("effort", by, **given)["effort", by], d[0]["effort", by])
    along: dict[str, Array] = {}
    for by in (*given, "effort", *paths):
        columns = d[1]["acceleration", by] if by == "effort" else d[0]["effort", by]
        size = np.abs(columns[0]).max(axis=0) if by not in paths else np.abs(columns).max()
        assert np.all(size > 0) and (by == "a" or np.abs(d[1]["acceleration", by]).max() > 0)
        shape = columns.shape[2:]
        along[by] = rng.choice([-1.0, 1.0], shape) * rng.uniform(0.5, 1.0, shape) / size
    ends = []
    for sign in (1, -1):
        machine = Machine(moved(name, {p: along[p] for p in paths}, sign), m.independent)
        q, v, a, w, at, tau = (
            [
                mpf(x) + sign * STEP * mpf(t)
                for x, t in zip((given | forced)[by][0].tolist(), along[by].tolist(), strict=True)
            ]
            for by in (*given, "effort")
        )
        inverse = machine.inverse(near, q, v, a, w, at, signs)
        ends.append([*inverse, *machine.forward(near, q, v, tau, w, at, ahead)])
    for i, arguments in enumerate((given, forced)):
        for of, right, left in zip(
            results[i], *(end[2 * i : 2 * i + 2] for end in ends), strict=True
        ):
            columns = [
                d[i][of, by][0].reshape(len(right), -1) * np.ravel(along[by])
                for by in (*arguments, *paths)
            ]
            wanted = [float((x - y) / (2 * STEP)) for x, y in zip(right, left, strict=True)]
            terms = np.concatenate(columns, axis=1)
            close(terms.sum(axis=1), wanted, 1e-9, np.abs(terms).max())


def same(got: Array, wanted: Array) -> None:
    assert got.shape == wanted.shape
    close(got, wanted, 1e-9)


def of_masticatory(seed: int, rows: int = 2) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    given = {n: s * rng.normal(0, 1, (rows, 4)) for n, s in (("q", 2e-3), ("v", 0.1), ("a", 1.0))}
    return given | {"wrench": rng.normal(0, 1, (rows, 6)), "at": "right_molar"}


HOW = [("lagrange", "direct"), ("momentum", "core"), ("virtual_power", "direct")]


@pytest.mark.parametrize(("formulation", "route"), first(HOW))
def test_every_formulation_has_the_same(formulation: str, route: str) -> None:
    other = Model("masticatory", backend="numpy", formulation=formulation, route=route)
    given, of, by = of_masticatory(4), ("effort", "contact_force"), ("q", "v", "a", "wrench")
    wanted = shared("masticatory").derivatives(of, by, **given)
    assert not wanted.status.any()
    for results in ("effort", of):
        found = other.derivatives(results, by, **given)
        for key in found:
            same(found[key], wanted[key])


NUMBERS = ("platform.mass", "chain.*.base", "q", "platform.points.right_molar")


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("masticatory", ["effort"]),  # as the kernel computes them
        ("masticatory", ["effort", "contact_force"]),  # by the implicit function theorem
        ("RSS k2 n8", ["effort", "contact_force"]),  # with friction
    ],
)
def test_forward_and_reverse_are_the_matrix(name: str, of: list[str]) -> None:
    rng = np.random.default_rng(5)
    if name == "masticatory":
        m, given, paths = shared(name), of_masticatory(5), NUMBERS
    else:
        m, given = model(name), state(name)
        paths = (*given, "platform.mass")
    d = m.derivatives(of, paths, **given)
    if name == "masticatory":
        assert d["effort", "chain.*.base"].shape == (2, 6, 6, 3)
        assert d["effort", "platform.mass"].shape == (2, 6)
        same(d["effort", NUMBERS[3]], m.derivatives("effort", "at", **given)["effort", "at"])
    rows = len(given["q"])
    way = {by: rng.normal(0, 1, (rows, *d[of[0], by].shape[2:])) for by in paths}
    along = m.jvp(of, way, **given)
    flat = {(r, by): d[r, by].reshape(*d[r, by].shape[:2], -1) for r in of for by in paths}
    for r in of:
        total = sum((flat[r, by] @ x.reshape(rows, -1, 1))[..., 0] for by, x in way.items())
        same(along[r], np.asarray(total))
    weights = {r: rng.normal(0, 1, along[r].shape) for r in of}
    back = m.vjp(of, weights, paths, **given)
    for by in paths:
        total = sum((w[:, None] @ flat[r, by])[:, 0] for r, w in weights.items())
        same(back[by].reshape(rows, -1), np.asarray(total))


def test_one_state_and_one_number() -> None:
    """No leading shape, and none of the number: what is left is that of the result.

    A number at its default of zero counts: the paper's mechanism has no friction, and its
    derivative in the coefficient is none of zero.
    """
    m, by = shared("masticatory"), "platform.mass"
    given = {k: a[0] if k != "at" else a for k, a in of_masticatory(6).items()}
    d = m.derivatives(("effort", "contact_force"), by, **given)["effort", by]
    assert d.shape == (6,)
    same(m.jvp("effort", {by: 2.0}, **given)["effort"], 2 * d)
    same(m.vjp("effort", np.ones(6), by, **given)[by], np.asarray(d.sum()))
    point = "contact.left_condyle.point"
    ratio = m.derivatives("singularity_ratio", (point, by), q=given["q"], zeros=True)
    assert ratio["singularity_ratio", point].shape == (3,)
    assert ratio["singularity_ratio", by].shape == () and ratio["singularity_ratio", by] == 0
    by = "contact.left_condyle.friction.coefficient"
    found, ends = m.derivatives("effort", by, **given)["effort", by], []
    for h in (1e-5, 2e-5):
        other = Model(m.mechanism.set({by: h}), backend="numpy")
        ends.append(other.inverse_dynamics(**given).effort - m.inverse_dynamics(**given).effort)
    close(found, (4 * ends[0] - ends[1]) / 2e-5, 1e-6)


WRONG = [
    ("effort", "chain.masseter_left.actuator.speed_limit", "effort cannot depend on chain"),
    ("effort", "joint", "effort cannot depend on joint, only on q, v, a"),
    ("pose", "platform.mass", "pose cannot depend on platform.mass"),
    ("joint", "gravity", "joint cannot depend on gravity"),
    ("effort", "platform.points.incisor", "cannot depend on platform.points.incisor"),
    ("effort", "platform.mas", 'platform has no "mas"'),
    ("effort", "mass", "unknown variable 'mass'"),
]


def test_what_cannot_matter_is_an_error() -> None:
    m, zero = shared("masticatory"), np.zeros(4)
    given = {"q": zero, "v": zero, "a": zero, "at": "right_molar"}
    for of, by, message in WRONG:
        with pytest.raises(InputError, match=message):
            m.derivatives(of, by, **given)
        if "cannot depend" in message:
            assert not m.derivatives(of, by, **given, zeros=True)[of, by].any()
