"""Stiffness against the curvature of the energy in 60 digits, and published machines."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.springs import RODS, SprungMachine

from condyle.errors import InputError
from condyle.mechanism import parse
from condyle.model.model import Model
from condyle.model.screws import eigenscrews
from condyle.status import Status

MIXED = ("RSS", "PSS", "SPS")
# Name -> what the mechanism is, and which of drives and rods give.
CASES: dict[str, tuple[dict[str, Any], str]] = {
    "drives_k0": ({"families": MIXED, "contacts": 0, "chains": 7}, "drives"),
    "drives_k2": ({"families": MIXED}, "drives"),
    "drives_k5": ({"families": MIXED, "contacts": 5, "surface": "mixed"}, "drives"),
    "cables_k1": ({"families": ("cable", "SPS"), "contacts": 1, "chains": 8}, "drives"),
    "rods_k0": ({"families": MIXED, "contacts": 0, "tilted_gravity": True}, "rods"),
    "rods_k3": ({"families": MIXED, "contacts": 3, "surface": "quadratic"}, "rods"),
    "both_k1": ({"families": MIXED, "contacts": 1, "surface": "sphere"}, "both"),
    "both_k4": ({"families": MIXED, "contacts": 4, "surface": "mixed"}, "both"),
}


def sprung(rng: np.random.Generator, raw: dict[str, Any], which: str) -> dict[str, Any]:
    """The same with springs: soft, so that what the load adds is not lost among them."""
    found = deepcopy(raw)
    for chain in found["chain"]:
        turns = chain["kind"] == "RSS"
        if which != "rods" or chain["kind"] == "cable":
            stiffness = float(rng.uniform(2, 9)) * (1.0 if turns else 2e3)
            chain["actuator"] = {"stiffness": stiffness, "damping": 0.01 * stiffness}
        if which != "drives" and chain["kind"] in RODS:
            rod = chain.setdefault(RODS[chain["kind"]], {})
            rod["stiffness"] = float(rng.uniform(2e3, 9e3))
    return found


def sample(name: str, seed: int = 1) -> tuple[dict[str, Any], Model, dict[str, Any], np.ndarray]:
    options, which = CASES[name]
    rng = np.random.default_rng([seed, *map(ord, name)])
    raw = sprung(rng, random_mechanism(rng, **options), which)
    state = random_state(rng, raw)
    model = Model(parse(toml_text(raw)), backend="numpy")
    return raw, model, state, rng.uniform(0.5, 3.0, len(raw["chain"]))


LENGTHS = np.repeat([1.0, 0.1], 3)
LONG = ("drives_k5", "rods_k3", "both_k4")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ci if name in LONG else ()) for name in CASES]
)
def test_is_the_curvature_of_the_energy(name: str) -> None:
    raw, model, state, effort = sample(name)
    point = model.mechanism.platform.points[state["load_point"]]
    found = model.stiffness(state["q"][0], effort, state["wrench"][0], state["load_point"])
    machine = SprungMachine(
        raw, model.independent, state["pose"][0], effort, state["wrench"][0], point
    )
    size = np.where(np.isin(model.independent, ("X", "Y", "Z")), model.characteristic_length, 1.0)
    u, v = np.random.default_rng(2).normal(size=(2, model.mechanism.degrees_of_freedom)) * size
    error = abs(u @ found.K @ v - float(machine.curvature(u, v)))
    error /= np.abs(np.outer(u, v) * found.K).max()
    assert error < 1e-10
    assert error <= found.bound * u.size < 1e-6


def stewart(drive: float | None = 20e6, leg: float | None = None) -> str:
    """The platform of Simscape's example, in metres: its frame {M}, {S} where that is at home."""
    base, top = (
        np.radians(a) for a in ((-10, 10, 110, 130, 230, 250), (-50, 50, 70, 170, 190, -70))
    )
    body = f"{{ mass = 0.1, com = 0.025, transverse = {0.1 * (3 * 5e-3**2 + 0.05**2) / 12}, "
    body += f"axial = {0.1 * 5e-3**2 / 2} }}"
    across, along = (3 * 0.1**2 + 0.01**2) / 12, 0.1**2 / 2
    lines = [
        'name = "stewart"\ngravity = [0, 0, 0]\n[platform]\nmass = 1.0\ncom = [0, 0, -0.005]',
        f"inertia = {{ xx = {across}, yy = {across}, zz = {along} }}",
        "points = { tip = [0, 0, 0.045] }",
    ]
    for i, (a, b) in enumerate(zip(base, top, strict=True)):
        lines += [
            f'[[chain]]\nname = "leg_{i}"\nkind = "SPS"',
            f"base = [{0.115 * np.cos(a)}, {0.115 * np.sin(a)}, -0.075]",
            f"platform = [{0.09 * np.cos(b)}, {0.09 * np.sin(b)}, -0.015]",
            f"cylinder = {body}\npiston = {body}",
        ]
        lines += [] if drive is None else [f"actuator = {{ stiffness = {drive} }}"]
        lines += [] if leg is None else [f"leg = {{ stiffness = {leg} }}"]
    return "\n".join(lines)


# With drives of 40e6 N/m and legs of the same, each strut gives as one of 20e6 N/m; its rod moves
# with the platform either way, since bodies of a leg follow its ends.
@pytest.mark.parametrize("springs", [(20e6, None), (None, 20e6), (40e6, 40e6)])
def test_stewart_platform_of_simscape(springs: tuple[float | None, float | None]) -> None:
    """Published compliance about a point above the platform, and frequencies."""
    model = Model(parse(stewart(*springs)), backend="numpy")
    found, home = model.stiffness(np.zeros(6), at="tip"), np.diag_indices(6)
    published = [4.75e-8, 4.75e-8, 2.10e-8, 5.19e-6, 5.19e-6, 1.71e-6]
    np.testing.assert_allclose(found.compliance[home], published, rtol=2e-3)
    np.testing.assert_allclose(found.compliance[[0, 1], [4, 3]], [3.21e-7, -3.21e-7], rtol=2e-3)
    np.testing.assert_allclose(found.translation, [4.75e-8, 4.75e-8, 2.1e-8], rtol=2e-3)
    assert not found.geometric.any() or np.abs(found.geometric).max() < 1e-6
    modes = model.modes(np.zeros(6))
    hertz = [780.6, 780.6, 903.9, 1061.4, 1061.4, 1269.7]
    np.testing.assert_allclose(modes.frequency, hertz, rtol=1e-3)


def test_cubic_configuration() -> None:
    """Struts along six edges of a cube: stiffness 2 k, and 0.5 k s^2, 2 k s^2 about its centre."""
    side, k = 0.1 * np.sqrt(3), 1.0
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * side
    axis = np.ones(3) / np.sqrt(3)
    top = [c for c in corners if np.isclose(c @ axis * np.sqrt(3), 2 * side)]
    low = [c for c in corners if np.isclose(c @ axis * np.sqrt(3), side)]
    pairs = [(a, b) for a in top for b in low if np.isclose(np.linalg.norm(a - b), side)]
    assert len(pairs) == 6
    up = np.linalg.svd(axis[None])[2][[1, 2, 0]]
    up[2] = axis
    centre, head = np.full(3, side / 2), Model(parse(stewart()), backend="numpy").mechanism
    chains = [
        chain.model_copy(
            update={
                "base": tuple(up @ (b - centre)),
                "platform": tuple(up @ (a - centre)),
                "actuator": chain.actuator.model_copy(update={"stiffness": k}),
            }
        )
        for chain, (a, b) in zip(head.chains, pairs, strict=True)
    ]
    made = head.model_copy(update={"chain": tuple(chains)})
    found = Model(made, backend="numpy").stiffness(np.zeros(6))
    np.testing.assert_allclose(found.K, np.diag([2, 2, 2, 0.015, 0.015, 0.06]), atol=1e-12)


def test_eigenscrews() -> None:
    """Wrenches under which the platform moves along their own screws, whose axes, pitches and sizes
    are the same of any point; by a closed form on the diagonal."""
    _, model, state, effort = sample("both_k1")
    q, swapped = state["q"][0], np.roll(np.eye(6), 3, axis=0)
    there = []
    for at in ("incisor", None):
        found = model.stiffness(q, effort, None, at)
        C, turn, screw = found.compliance, found.eigenscrew_compliance, found.eigenscrew
        known = np.isfinite(turn)
        assert known.sum() == 4 and (np.diff(turn[known]) < 0).all()
        wanted = turn[known, None] * screw[known] @ swapped
        np.testing.assert_allclose(screw[known] @ C, wanted, atol=1e-9 * np.abs(wanted).max())
        force, moment = screw[known, :3], screw[known, 3:]
        np.testing.assert_allclose(np.linalg.norm(force, axis=1), 1.0)
        pitch = (force * moment).sum(axis=1)
        axis = np.cross(force, moment)  # the nearest point of the axis to the one that C is of
        there.append((turn[known], pitch, axis))
    np.testing.assert_allclose(there[0][0], there[1][0], rtol=1e-7)
    np.testing.assert_allclose(there[0][1], there[1][1], atol=1e-9)
    cubic = np.diag([2.0, 3.0, 5.0, 0.4, 0.3, 0.2])
    turn, screw = eigenscrews(cubic[None], np.array(0.1))
    np.testing.assert_allclose(turn[0], [1, 0.9**0.5, 0.8**0.5, -(0.8**0.5), -(0.9**0.5), -1])
    np.testing.assert_allclose(np.abs(screw[0, 0]), [0, 0, 1, 0, 0, 5], atol=1e-12)


def test_rigid_chains_hold() -> None:
    """As very stiff ones do, but exactly: C has no part along them, and K is infinite there."""
    free = parse(stewart())
    path = "chain.leg_2.actuator.stiffness"
    held, stiff = (Model(free.set(path, x), backend="numpy") for x in (None, 1e12))
    q = np.array([1, 2, -1, 0.02, 0.01, -0.03]) * 1e-3
    load = np.array([2e3, -1e3, 4e3, 20, 30, -10])
    one, other = (model.stiffness(q, wrench=load, at="tip") for model in (held, stiff))
    size = np.abs(other.compliance).max()
    np.testing.assert_allclose(one.compliance, other.compliance, atol=1e-4 * size)
    assert np.isinf(one.K).any() and one.status == 0
    sizes = np.linalg.svd(one.compliance * np.outer(LENGTHS, LENGTHS), compute_uv=False)
    assert np.count_nonzero(sizes > 1e-9 * sizes[0]) == 5
    modes, near = held.modes(q, wrench=load), stiff.modes(q, wrench=load)
    np.testing.assert_allclose(modes.frequency[:5], near.frequency[:5], rtol=1e-4)
    assert np.isinf(modes.frequency[5]) and np.isnan(modes.shape[5]).all()


def test_says_where_it_buckles() -> None:
    """Legs that are pressed ever more."""
    model = Model(parse(stewart()), backend="numpy")
    efforts = np.linspace(0, 6e6, 7)[:, None] * np.ones(6)
    found, modes = model.stiffness(np.zeros(6), efforts), model.modes(np.zeros(6), efforts)
    least = np.linalg.eigvalsh(found.K)[:, 0]
    assert least[0] > 0 > least[-1]
    np.testing.assert_array_equal(found.status, np.where(least > 0, Status.ok, Status.unstable))
    np.testing.assert_array_equal(modes.status, found.status)
    np.testing.assert_array_equal(modes.frequency[:, 0] > 0, least > 0)
    assert np.isfinite(found.compliance).all()
    grows = modes.eigenvalue.real.max(axis=1) > 1.0
    np.testing.assert_array_equal(grows, least <= 0)


def test_a_rigid_mechanism_says_what_to_state() -> None:
    with pytest.raises(InputError, match=r"actuator\.stiffness"):
        Model(parse(stewart(None)), backend="numpy").stiffness(np.zeros(6))


def test_variants_have_their_own_stiffness() -> None:
    model, path = Model(parse(stewart()), backend="numpy"), "chain.*.actuator.stiffness"
    values = np.array([5e6, 20e6, 80e6])[:, None] * np.ones(6)
    variants = model.variants({path: values})
    (group,) = variants.groups
    found = group.model.modes(np.zeros((3, 1, 6))).frequency[:, 0]
    wanted = model.modes(np.zeros(6)).frequency
    np.testing.assert_allclose(found, np.array([0.5, 1, 2])[:, None] * wanted, rtol=1e-12)
    refused = model.variants({path: np.full((1, 6), -1.0)})
    assert refused.status[0] == Status.refused
