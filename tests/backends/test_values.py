"""Compiled kernels give the interpreter's numbers: every output, one evaluation and batch."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.dynamics import FORMULATIONS
from condyle.kernels.compiled import Compiled
from condyle.model import Model
from condyle.questions.spec import OUTPUTS
from support.cases import Case, case, error, errors, ones

BATCH, ONE = 1e-11, 1e-12
WITHOUT_SHARE = ("contact", "motion", "joint")  # virtual_power then folds masses together

REFERENCE = [("masticatory", f, route) for f in FORMULATIONS for route in ("core", "direct")]
BUNDLED = [
    *(("gough-stewart", f, "core") for f in ("momentum", "hessian")),
    ("gough-stewart", "lagrange", "direct"),
    ("hexaglide", "virtual_power", "core"),
    ("hexaglide", "newton_euler", "direct"),
    *(("masticatory-curved", f, "core") for f in ("virtual_power", "momentum")),
]
RANDOM = [
    ("rss_k0_n9", "virtual_power", "core"),
    ("rss_k1_n8_quadratic", "virtual_power", "core"),
    ("rss_k2_n6_sphere", "virtual_power", "core"),
    ("rss_k2_n6_profile", "virtual_power", "core"),
    ("rss_k1_n6_ball", "virtual_power", "core"),
    ("pss_k2_n6_cylinder", "lagrange", "core"),
    ("sps_k2_n6_ellipsoid", "virtual_power", "core"),
    ("mixed_k0_n7", "lagrange", "core"),
    ("mixed_k2_n8", "virtual_power", "direct"),
    ("mixed_k2_n8", "momentum", "direct"),
    ("mixed_k3_n9_curved", "virtual_power", "core"),
    ("mixed_k4_n6", "newton_euler", "core"),
    ("mixed_k5_n6", "virtual_power", "core"),
]


def check(c: Case, formulation: str, route: str, outputs: tuple[str, ...] = OUTPUTS) -> Compiled:
    """All results of a batch, and of one evaluation after the other."""
    compiled = Model(c.mechanism, formulation, route, "compiled").kernel
    interpreted = Model(c.mechanism, formulation, route, "numpy").kernel
    wanted = interpreted.solve(*c.arguments)
    got = compiled.solve(*c.arguments, outputs=outputs)
    assert compiled.name == "compiled"
    assert got.reached.all()
    assert max((found := errors(got, wanted)).values()) < BATCH, found

    kernel = compiled.kernel(c.point, outputs, moment=True)
    batch, status = kernel.run(c.samples)
    single = ones(kernel, c.samples)
    good = status == 0
    assert good.sum() > len(good) / 2  # the others are for the interpreter to decide
    for name in set(batch) - {"quality", "margin"}:
        assert error(single[name][good], batch[name][good]) < ONE, name
    lanes = kernel.in_order(single["torque"])
    assert error(lanes[good], wanted.torque[good]) < ONE
    return compiled


@pytest.mark.parametrize(("name", "formulation", "route"), [*REFERENCE, *BUNDLED, *RANDOM])
@pytest.mark.usefixtures("quick")
def test_every_formulation(name: str, formulation: str, route: str) -> None:
    check(case(name), formulation, route)


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide", "mixed_k2_n8"])
@pytest.mark.usefixtures("quick")
def test_masses_folded_together(name: str) -> None:
    check(case(name), "virtual_power", "core", WITHOUT_SHARE)


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved"])
def test_optimised(name: str) -> None:
    check(case(name), "virtual_power", "core", WITHOUT_SHARE)


@pytest.mark.usefixtures("quick")
def test_asking_for_less_changes_nothing() -> None:
    c = case("masticatory")
    compiled = Model(c.mechanism, backend="compiled").kernel
    full = compiled.solve(*c.arguments, outputs=WITHOUT_SHARE)
    bare = compiled.solve(*c.arguments, outputs=())
    assert error(bare.torque, full.torque) < 1e-13
    assert [bare.share, bare.contact_force, bare.rate, bare.acceleration, bare.poses] == [None] * 5


@pytest.mark.usefixtures("quick")
def test_without_moments() -> None:
    c = case("masticatory")
    pushed = c.load * np.repeat([1, 0, 1], 3)
    wanted = Model(c.mechanism, backend="numpy").kernel.solve(c.q, c.q1, c.q2, pushed)
    compiled = Model(c.mechanism, backend="compiled").kernel
    with_zeros = compiled.solve(c.q, c.q1, c.q2, pushed, outputs=())
    kernel = compiled.kernel(c.point, (), moment=False)
    without = kernel.run(np.hstack([c.q, c.q1, c.q2, pushed[:, :3]]))[0]["torque"]
    assert error(with_zeros.torque, wanted.torque) < BATCH
    assert error(kernel.in_order(without), wanted.torque) < BATCH


@pytest.mark.usefixtures("quick")
def test_chains_in_the_mechanisms_order() -> None:
    """Families run one after the other inside; outside, chains stay where the file has them."""
    c = case("mixed_k2_n8")
    kinds = [chain.kind for chain in c.mechanism.chains]
    kernel = Model(c.mechanism, backend="compiled").kernel.kernel(c.point, WITHOUT_SHARE, True)
    lanes = [kind for family in dict.fromkeys(kinds) for kind in kinds if kind == family]
    assert lanes != kinds  # interleaved, or this shows nothing
    assert kernel.in_order(np.array([lanes])).tolist() == [kinds]


@pytest.mark.parametrize("name", ["masticatory", "mixed_k0_n7"])
@pytest.mark.usefixtures("quick")
def test_every_width(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Vectors of 2, 4 and 8 lanes agree, one evaluation and batch."""
    c = case(name)
    found = {}
    for width in ("2", "4", "8"):
        monkeypatch.setenv("CONDYLE_LANES", width)
        kernel = Model(c.mechanism, backend="compiled").kernel.kernel(c.point, ("contact",), True)
        assert kernel.facts["lanes"] == int(width)
        batch, status = kernel.run(c.samples)
        assert not status.any()
        found[width] = batch, ones(kernel, c.samples)
    for width in ("2", "4"):
        for got, wanted in zip(found[width], found["8"], strict=True):
            for key in ("torque", *(["contact"] if "contact" in wanted else [])):
                assert error(got[key], wanted[key]) < 1e-13, (width, key)


@pytest.mark.usefixtures("quick")
def test_a_point_for_each_sample() -> None:
    """Loads at different points are beyond one kernel, not beyond the model."""
    c = case("masticatory")
    load = c.load.copy()
    load[:, 6] += np.linspace(0, 0.01, len(load))
    compiled, interpreted = (Model(c.mechanism, backend=b) for b in ("compiled", "numpy"))
    got, wanted = (m.evaluate(c.q, c.q1, c.q2, load) for m in (compiled, interpreted))
    assert error(got.effort, wanted.effort) < 1e-14
