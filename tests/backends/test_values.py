"""Every way to run a question gives the numbers of the witness: one evaluation, batches, numpy."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from support.cases import NAMES, case, error, errors, ones
from support.interpreter import Found, Interpreter
from support.loads import parts
from support.speeds import few

from benchmarks.casadi_function import casadi_function
from condyle.backends.kernel import Answer, results_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.dynamics import FORMULATIONS
from condyle.graph.program import Variants
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.inverse import OUTPUTS

TOLERANCE = 1e-12
LEAN = ("contact", "motion", "joint")  # virtual_power then folds masses together
WIDTHS = ("2", "4", "8")

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
ALL = [*REFERENCE, *BUNDLED, *RANDOM]
# Each formulation, route, family and kind of surface once; the others in make ci.
SOME = few(
    ALL,
    *(case for case in REFERENCE if case[2] == "core"),
    *(("gough-stewart", "lagrange", "direct"), ("hexaglide", "newton_euler", "direct")),
    *(("mixed_k2_n8", "momentum", "direct"), ("masticatory-curved", "virtual_power", "core")),
    *(case for case in RANDOM if case[0] in ("rss_k2_n6_profile", "sps_k2_n6_ellipsoid")),
    *(case for case in RANDOM if case[0] in ("rss_k1_n6_ball", "mixed_k5_n6")),
)


@cache
def wanted(name: str) -> Found:
    """What the witness says, by the paper's first formulation."""
    c = case(name)
    found = Interpreter(c.mechanism, "momentum").solve(*c.packed)
    assert found.reached.all()
    return found


def model(name: str, formulation: str, route: str, backend: str = "compiled") -> Model:
    found = Model(case(name).mechanism, formulation=formulation, route=route, backend=backend)
    assert found.backend.name == backend
    return found


def right(values: Mapping[str, np.ndarray], good: np.ndarray, name: str) -> dict[str, float]:
    """Errors of a kernel's results against the witness, over the good samples."""
    assert good.sum() > len(good) / 2
    found = {}
    for result in set(values) & {*NAMES}:
        truth = np.moveaxis(getattr(wanted(name), result), 0, -1)
        found[result] = error(values[result][..., good], truth[..., good])
    found["effort"] = error(values["effort"][:, good], wanted(name).effort.T[:, good])
    return found


def check(answer: Answer, name: str) -> None:
    off = right(answer.values, answer.status == 0, name)
    assert max(off.values()) < TOLERANCE, off


@pytest.mark.parametrize(("name", "formulation", "route"), SOME)
def test_numpy(name: str, formulation: str, route: str) -> None:
    c = case(name)
    got = model(name, formulation, route, "numpy").inverse_dynamics(*c.arguments, outputs="all")
    assert not got.status.any()
    off = errors(got, wanted(name))
    assert max(off.values()) < TOLERANCE, off


@pytest.mark.parametrize(("name", "formulation", "route"), SOME)
@pytest.mark.usefixtures("compiler_command")
def test_compiled(name: str, formulation: str, route: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All results; and in a row with the others, at another width from case to case."""
    number = ALL.index((name, formulation, route))
    monkeypatch.setenv("CONDYLE_LANES", WIDTHS[number % 3])
    c = case(name)
    got = model(name, formulation, route).inverse_dynamics(*c.arguments, outputs="all")
    assert not got.status.any()
    off = errors(got, wanted(name))
    assert max(off.values()) < TOLERANCE, off

    monkeypatch.setenv("CONDYLE_LANES", WIDTHS[(number + 1) % 3])
    kernel = model(name, formulation, route).kernel("inverse", LEAN)
    check(kernel.run(c.inputs), name)
    check(Answer(*ones(kernel, c.samples)), name)


@pytest.mark.parametrize("name", ["masticatory", "mixed_k0_n7", "mixed_k2_n8", "gough-stewart"])
@pytest.mark.usefixtures("compiler_command")
def test_every_width(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups of 1 to 6 chains in vectors of 2, 4 and 8: full, and filled up."""
    c = case(name)
    for width in WIDTHS:
        monkeypatch.setenv("CONDYLE_LANES", width)
        kernel = model(name, "virtual_power", "core").kernel("inverse", LEAN)
        assert kernel.facts["lanes"] == int(width)
        check(kernel.run(c.inputs), name)
        check(Answer(*ones(kernel, c.samples)), name)


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved"])
def test_optimised(name: str) -> None:
    c = case(name)
    kernel = model(name, "virtual_power", "core").kernel("inverse", LEAN)
    check(kernel.run(c.inputs), name)
    check(Answer(*ones(kernel, c.samples)), name)


@pytest.mark.parametrize("name", ["masticatory", "mixed_k2_n8", "mixed_k3_n9_curved"])
@pytest.mark.usefixtures("compiler_command")
def test_whole_answers(name: str) -> None:
    """Every output and check of every variant: compiled, numpy and CasADi's interpreter."""
    c = case(name)
    compiled, numpy = (model(name, "virtual_power", "core", b) for b in ("compiled", "numpy"))
    kernel = compiled.kernel("inverse", OUTPUTS)
    got = kernel.run(c.inputs)
    reference = numpy.kernel("inverse", OUTPUTS).run(c.inputs)
    np.testing.assert_array_equal(got.status, reference.status)
    variants = questions_of(numpy, OUTPUTS)
    function = casadi_function(variants.main, numpy.system.numbers)
    columns = np.hstack([np.asarray(part).T for part in function.map(len(c.q))(c.samples.T)[:-1]])
    truth = results_of(variants.main.interface, columns.T, numpy.system.numbers.order)
    for name, right in truth.items():
        for values in (got.values, reference.values):
            if name in ("bound", "data_error"):  # what rounding leaves is in it
                np.testing.assert_array_less(abs(np.log10(values[name] / right)), 1.5)
                continue
            assert error(values[name], right) < TOLERANCE, name


def questions_of(evaluator: Model, *details: Any) -> Variants:
    return Question.about(evaluator.system.structure, "inverse", *details).variants()


@pytest.mark.parametrize("name", ["masticatory", "hexaglide", "mixed_k2_n8", "mixed_k4_n6"])
def test_variants_agree(name: str) -> None:
    """Quick, robust and of low latency: the same numbers where none is in doubt.

    With joints of two units A is too far from columns of one length for the quick one.
    """
    c, evaluator = case(name), model(name, "virtual_power", "core", "numpy")
    variants = questions_of(evaluator, LEAN)
    mixed = len({chain.kind for chain in c.mechanism.chains}) > 1 and variants.robust is not None
    programs = [*([] if mixed else [variants.main, variants.latency]), variants.robust]
    answers = [
        NumpyKernel(Variants(p), evaluator.system.numbers).run(c.inputs)
        for p in programs
        if p is not None
    ]
    for answer in answers:
        check(answer, name)


@pytest.mark.usefixtures("compiler_command")
def test_asking_for_less_changes_nothing() -> None:
    c = case("masticatory")
    evaluator = model("masticatory", "virtual_power", "core")
    full = evaluator.inverse_dynamics(*c.arguments, outputs=("pose", "joint_rate"))
    bare = evaluator.inverse_dynamics(*c.arguments)
    assert error(bare.effort, full.effort) < 1e-13
    with pytest.raises(AttributeError, match="pose was not asked for"):
        _ = bare.pose


@pytest.mark.usefixtures("compiler_command")
def test_chains_in_the_mechanisms_order() -> None:
    """Families run one after the other inside; outside, chains stay where the file has them."""
    c = case("mixed_k2_n8")
    kinds = [chain.kind for chain in c.mechanism.chains]
    kernel = model("mixed_k2_n8", "virtual_power", "core").kernel("inverse", LEAN)
    inside = [kinds[k] for k in kernel.order]
    assert inside == [kind for family in dict.fromkeys(kinds) for kind in kinds if kind == family]
    assert inside != kinds  # interleaved, or this shows nothing
    check(kernel.run(c.inputs), "mixed_k2_n8")


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_a_load_point_for_each_sample(backend: str) -> None:
    c = case("masticatory")
    load = c.load.copy()
    load[:, 6:] += np.random.default_rng(0).normal(0, 0.02, (len(load), 3))
    truth = Interpreter(c.mechanism).solve(c.q, c.q1, c.q2, load)
    evaluator = model("masticatory", "virtual_power", "core", backend)
    got = evaluator.inverse_dynamics(c.q, c.q1, c.q2, *parts(load))
    assert error(got.effort, truth.effort) < TOLERANCE
    assert error(got.contact_force, truth.contact_force) < TOLERANCE
    assert error(got.effort, wanted("masticatory").effort) > 1e-3  # the points are felt
    for i in range(3):  # each as in a batch of its own point
        alone = evaluator.inverse_dynamics(*(a[i] for a in (c.q, c.q1, c.q2, *parts(load))))
        assert error(alone.effort, got.effort[i]) < TOLERANCE
    if backend == "compiled":
        samples = np.hstack([c.q, c.q1, c.q2, load])
        values, status = ones(evaluator.kernel("inverse", LEAN), samples)
        assert not status.any()
        assert error(values["effort"].T, truth.effort) < TOLERANCE


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_witness_agrees_with_itself(formulation: str) -> None:
    """By every formulation, in twists and in rates."""
    c = case("mixed_k2_n8")
    off = errors(Interpreter(c.mechanism, formulation).solve(*c.packed), wanted("mixed_k2_n8"))
    assert max(off.values()) < TOLERANCE, off
