"""A mechanism scaled to a subject: known affine maps, someone else's splines, a body of points."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.mechanism.scaling import SHAPE, named_points, scaled_to

FOUR = ["incisor", "left_condyle", "right_condyle", "chin"]
MANY = [*FOUR, "left_molar", "right_molar", "left_canine", "right_canine"]
A = np.array([[1.08, 0.01, 0.02], [-0.015, 0.94, 0.0], [0.03, -0.01, 1.05]])
SIDES = ("left", "right")
b = np.array([2e-3, -1e-3, 3e-3])
fitted = partial(scaled_to, regularise=False)


@pytest.fixture(scope="module")
def jaw() -> condyle.Mechanism:
    return condyle.load_mechanism("human-jaw")


def moved(jaw: condyle.Mechanism, names: list[str], d: Any = 0.0) -> dict[str, Any]:
    x = named_points(jaw, names)
    return dict(zip(names, x @ A.T + b + np.abs(x[:, 1:2]) * d, strict=True))


def every_point(jaw: condyle.Mechanism) -> np.ndarray:
    ends = [end for chain in jaw.chains for end in (chain.base, chain.platform)]
    contacts = [contact.point for contact in jaw.contacts]
    return np.array([*ends, *contacts, *jaw.platform.points.values(), jaw.platform.com])


def test_an_affine_subject_is_found(jaw: condyle.Mechanism) -> None:
    """Of whom four landmarks, or eight, are known: every point of the file follows."""
    wanted, size = every_point(jaw) @ A.T + b, np.linalg.det(A)
    for kind, names in (("affine", FOUR), ("affine", MANY), ("thin_plate", FOUR)):
        found = fitted(jaw, moved(jaw, names), kind)
        np.testing.assert_allclose(every_point(found.mechanism), wanted, atol=1e-13)
        assert found.volume == pytest.approx(size, rel=1e-11)
        assert found.mechanism.platform.mass == pytest.approx(0.2 * size, rel=1e-11)
        assert max(found.residual.values()) < 1e-13 and not found.warnings
        assert found.stretch == pytest.approx(np.linalg.norm(A, axis=0), rel=1e-11)
    text = str(fitted(jaw, moved(jaw, FOUR)))
    for words in ("4 landmarks (affine)", "24 chains", "2 contacts", "inertia", "greatest forces"):
        assert words in text
    large = {name: 1.3 * p for name, p in moved(jaw, FOUR).items()}
    assert "check the landmarks' places" in fitted(jaw, large).warnings[0]
    for scale in (fitted, scaled_to):
        with pytest.raises(InputError, match=r"would go by X 2\.\d+ ± .*expected 0\.67 to 1\.5"):
            scale(jaw, {name: 2 * p for name, p in moved(jaw, FOUR).items()})


def test_sides_of_their_own(jaw: condyle.Mechanism) -> None:
    """A left side that is wider than the right: one affine map a side, one at the middle."""
    d, x = np.array([0.02, 0.05, -0.03]), every_point(jaw)
    found = fitted(jaw, moved(jaw, MANY, d))
    assert found.kind == "affine by side"
    expected = x @ A.T + b + np.abs(x[:, 1:2]) * d
    np.testing.assert_allclose(every_point(found.mechanism)[:-1], expected[:-1], atol=1e-13)


def test_landmarks_off_an_affine_map(jaw: condyle.Mechanism) -> None:
    """The spline goes through all of them, and elsewhere where SciPy's goes; the affine map does
    not, and says by how much."""
    rng = np.random.default_rng(3)
    places = {n: p + rng.normal(0, 2e-3, 3) for n, p in moved(jaw, MANY).items()}
    bent = fitted(jaw, places, "thin_plate")
    assert max(bent.residual.values()) < 1e-12
    there = np.array([*places.values()])
    theirs = RBFInterpolator(named_points(jaw, MANY), there, kernel="linear", degree=1)
    np.testing.assert_allclose(every_point(bent.mechanism), theirs(every_point(jaw)), atol=1e-9)
    straight = fitted(jaw, places)
    off = np.linalg.norm(named_points(straight.mechanism, MANY) - there, axis=1)
    assert straight.residual == pytest.approx(dict(zip(MANY, off, strict=True)))
    assert max(straight.residual.values()) > 1e-4


def test_inertia_is_that_of_the_moved_body(jaw: condyle.Mechanism) -> None:
    """Six points of mass with the jaw's mass and inertia, each moved by the map."""
    body = jaw.platform
    I = body.inertia.tensor()
    second = np.diag(np.trace(I) / 2 - np.diag(I))  # the jaw's products of inertia are zero
    arms = np.vstack([side * np.sqrt(3 * second / body.mass) for side in (1, -1)]) @ A.T
    mass = body.mass / 6 * np.linalg.det(A)
    made = fitted(jaw, moved(jaw, FOUR)).mechanism.platform
    expected = mass * (np.sum(arms**2) * np.eye(3) - arms.T @ arms)
    np.testing.assert_allclose(made.inertia.tensor(), expected, rtol=1e-11, atol=1e-18)


def test_contacts_stay_on_their_surfaces(jaw: condyle.Mechanism) -> None:
    for machine in (jaw, condyle.load_mechanism("human-jaw-curved")):
        made = fitted(machine, moved(machine, FOUR)).mechanism
        for old, new in zip(machine.contacts, made.contacts, strict=True):
            assert abs(new.gradient()[0] - old.gradient()[0]) < 1e-12
            for axis, bound in old.bounds:
                if bound is not None:
                    shift = np.subtract(new.point, old.point)["xyz".index(axis)]
                    assert getattr(new.bounds, axis) == pytest.approx(np.add(bound, shift))


def test_muscles_keep_their_strain(jaw: condyle.Mechanism) -> None:
    """Fibres and tendon grow with the line over its via points; the force stays."""
    ends = {
        "base": (0.0, 0.05, 0.06),
        "platform": (-0.01, 0.04, -0.02),
        "via": [(0.002, 0.05, 0.02)],
    }
    fibres = {"max_force": 80.0, "optimal_length": 0.03, "tendon_length": 0.05}
    muscle = {"name": "masseter", "kind": "muscle", "muscle": fibres} | ends
    chains = [*(chain.entries() for chain in jaw.chains), muscle]
    machine = jaw.checked({**jaw.entries(), "chain": chains}, "jaw")
    found = fitted(machine, moved(jaw, FOUR))
    old, new = machine.chains[-1], found.mechanism.chains[-1]
    assert new.via[0] == pytest.approx(np.array(old.via[0]) @ A.T + b)
    for key in ("optimal_length", "tendon_length"):
        ratio = getattr(new.muscle, key) / getattr(old.muscle, key)
        assert ratio == pytest.approx(new.lengths["line"] / old.lengths["line"], rel=1e-12)
    assert new.muscle.max_force == 80.0
    assert "1 muscles' fibre and tendon lengths" in str(found)


def test_landmarks_that_determine_nothing(jaw: condyle.Mechanism) -> None:
    right = moved(jaw, FOUR)
    flat = jaw.set({f"platform.points.{n}[0]": 0.03 for n in MANY if "condyle" not in n})
    in_plane = moved(flat, ["incisor", "chin", "left_molar", "right_molar"])
    swapped = right | {f"{a}_condyle": right[f"{b}_condyle"] for a, b in (SIDES, SIDES[::-1])}
    wrong: list[tuple[condyle.Mechanism, dict[str, Any], str]] = [
        (jaw, moved(jaw, FOUR[:3]), "got 3, expected 4 or more"),
        (jaw, right | {"nose": np.zeros(3)}, 'has no point or contact "nose"'),
        (flat, in_plane, "are in one plane"),
        (jaw, swapped, "inside out"),
    ]
    for machine, landmarks, said in wrong:
        with pytest.raises(InputError, match=said):
            fitted(machine, landmarks)
    with pytest.raises(InputError, match="thin_plate"):
        fitted(jaw, right, "rubber")
    with pytest.raises(UnsupportedError, match="bodies of its own"):
        fitted(condyle.load_mechanism("masticatory"), right)


def test_ligaments_and_walls_go_with_their_points() -> None:
    """Lengths all by 1.1: so are slack lengths; gaps stay."""
    jaw = condyle.load_mechanism("human-jaw-muscles")
    points = {c.name: c.point for c in jaw.contacts} | dict(jaw.platform.points)
    larger = {name: 1.1 * np.array(point) for name, point in points.items()}
    found = scaled_to(jaw, larger)
    for old, new in zip(jaw.ligaments, found.mechanism.ligaments, strict=True):
        assert new.slack_length == pytest.approx(1.1 * old.slack_length, rel=1e-9)
        assert new.length == pytest.approx(1.1 * old.length, rel=1e-9)
        assert new.stiffness == old.stiffness
    for old, new in zip(jaw.walls, found.mechanism.walls, strict=True):
        np.testing.assert_allclose(new.point, 1.1 * np.array(old.point), rtol=1e-9)
        assert new.gap == pytest.approx(old.gap, abs=1e-12)
    assert "4 walls' points" in str(found) and "6 ligaments" in str(found)


@pytest.mark.parametrize("names", [FOUR, [*FOUR, "left_molar", "right_molar"]])
def test_deviations_of_factors_are_those_of_people_and_landmarks(
    jaw: condyle.Mechanism, names: list[str]
) -> None:
    """People drawn at random, whose landmarks are seen with the stated error: the factors are off
    by the deviations that are stated, and by less than those of a plain fit."""
    rng, x, off, plain = np.random.default_rng(1), named_points(jaw, names), [], []
    for _ in range(150):
        person = rng.uniform(0.95, 1.05) * np.eye(3) + rng.normal(0, SHAPE, (3, 3))
        seen = x @ person.T + rng.normal(0, 2e-3, x.shape)
        wanted, places = np.linalg.norm(person, axis=0), dict(zip(names, seen, strict=True))
        try:
            found, other = (scale(jaw, places, error=2e-3) for scale in (scaled_to, fitted))
        except InputError:  # beyond what people differ by
            continue
        off.append((found.stretch - wanted) / found.deviation)
        plain.append((other.stretch - wanted) / found.deviation)
    spread, unfit = np.sqrt(np.mean(np.square(off), axis=0)), np.std(plain, axis=0)
    assert len(off) > 120 and ((spread > 0.75) & (spread < 1.2)).all()
    assert (unfit[[0, 2]] > spread[[0, 2]]).all() and found.condition > 5


def test_a_similar_jaw_is_found_whatever_the_error(jaw: condyle.Mechanism) -> None:
    """It is what the map is drawn towards; a thin plate bends as far as the error allows."""
    x = named_points(jaw, MANY)
    similar = dict(zip(MANY, 1.08 * x + b, strict=True))
    rng = np.random.default_rng(2)
    bent = {name: place + rng.normal(0, 2e-3, 3) for name, place in similar.items()}
    for kind in ("affine", "thin_plate"):
        found = scaled_to(jaw, similar, kind, error=0.01)
        np.testing.assert_allclose(
            every_point(found.mechanism), every_point(jaw) * 1.08 + b, atol=1e-12
        )
        assert "drawn towards a similarity" in str(found) and not found.warnings
    exact, loose = (
        max(scaled_to(jaw, bent, "thin_plate", error=error).residual.values())
        for error in (1e-6, 3e-3)
    )
    assert exact < 1e-7 and 1e-4 < loose < 6e-3
