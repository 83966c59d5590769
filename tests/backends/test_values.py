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
from condyle.backends.kernel import KernelValues, results_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.dynamics import FORMULATIONS
from condyle.graph.program import Programs
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.inverse import OUTPUTS

TOLERANCE = 1e-12
LEAN = ("contact", "motion", "joint")  # virtual_power then folds masses together
# Each formulation, route, family and kind of surface; those of `COMPILED` as kernels, too, of a
# width that shows something: groups of chains fill vectors or do not.
COMPILED = [
    ("masticatory", "virtual_power", "core", 8, (OUTPUTS, LEAN)),
    ("masticatory-curved", "virtual_power", "core", 2, (LEAN,)),
    ("gough-stewart", "lagrange", "direct", 4, (OUTPUTS,)),
    ("mixed_k2_n8", "momentum", "direct", 4, (OUTPUTS, LEAN)),
    ("mixed_k3_n9_curved", "virtual_power", "core", 8, (OUTPUTS,)),
]
DEAR = [
    ("rss_k1_n6_ball", "virtual_power", "core"),
    ("sps_k2_n6_ellipsoid", "virtual_power", "core"),
    ("mixed_k5_n6", "virtual_power", "core"),
]
NUMPY = [
    *(("masticatory", f, "core") for f in FORMULATIONS if f != "virtual_power"),
    ("hexaglide", "newton_euler", "direct"),
    ("pss_k2_n6_cylinder", "lagrange", "core"),
    ("rss_k2_n6_profile", "virtual_power", "core"),
    *DEAR,
]


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


def require_right(values: Mapping[str, np.ndarray], status: np.ndarray, name: str) -> None:
    """Results of a kernel against the witness, over the good samples."""
    good = status == 0
    assert good.sum() > len(good) / 2
    for result in {"effort", *values} & {*NAMES}:
        truth = np.moveaxis(getattr(wanted(name), result), 0, -1)
        assert error(values[result][..., good], truth[..., good]) < TOLERANCE, result


def require_model(of: Model, name: str) -> None:
    """All results of the model."""
    got = of.inverse_dynamics(*case(name).arguments, outputs="all")
    off = errors(got, wanted(name))
    assert not got.status.any() and max(off.values()) < TOLERANCE, off


def variants_of(evaluator: Model, *details: Any) -> Programs:
    return Question.about(evaluator.system.structure, "inverse", *details).variants()


@pytest.mark.parametrize(("name", "formulation", "route"), few(NUMPY, *NUMPY[: -len(DEAR)]))
def test_numpy(name: str, formulation: str, route: str) -> None:
    require_model(model(name, formulation, route, "numpy"), name)


@pytest.mark.parametrize(
    ("name", "formulation", "route", "width", "asked"), few(COMPILED, *COMPILED[:-1])
)
@pytest.mark.usefixtures("compiler_command")
def test_compiled(
    name: str,
    formulation: str,
    route: str,
    width: int,
    asked: tuple[tuple[str, ...], ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By numpy, in a kernel, in a batch and one by one, and by CasADi's interpreter.

    Several families run one after the other, whatever their order in the file.
    """
    monkeypatch.setenv("CONDYLE_LANES", str(width))
    c, plain = case(name), model(name, formulation, route, "numpy")
    require_model(plain, name)
    variants, numbers = variants_of(plain, OUTPUTS), plain.system.numbers
    function = casadi_function(variants.main, numbers)
    columns = np.vstack([np.asarray(part) for part in function.map(len(c.q))(c.samples.T)[:-1]])
    truth = results_of(variants.main.interface, columns, numbers.order)
    kinds = [chain.kind for chain in c.mechanism.chains]
    by_family = [kind for family in dict.fromkeys(kinds) for kind in kinds if kind == family]
    assert (kinds != by_family) == (len({*kinds}) > 1)  # interleaved, or this shows nothing
    found = [plain.kernel("inverse", OUTPUTS).run(c.inputs)]
    for details in asked:
        kernel = model(name, formulation, route).kernel("inverse", details)
        assert kernel.facts["lanes"] == width and [kinds[k] for k in kernel.order] == by_family
        found.append(kernel.run(c.inputs))
        np.testing.assert_array_equal(found[0].status, found[-1].status)
        require_right(found[-1].values, found[-1].status, name)
        if details == LEAN:  # kernels of all results have no single evaluation
            values, status = ones(kernel, c.samples)
            require_right(values, status, name)
    for got in found:
        for result, value in got.values.items():
            if result in ("bound", "data_error"):  # what rounding leaves is in it
                assert (abs(np.log10(value / truth[result])) < 1.5).all()
            else:
                assert error(value, truth[result]) < TOLERANCE, result


@pytest.mark.parametrize("name", few(["masticatory", "mixed_k2_n8"], "masticatory"))
@pytest.mark.usefixtures("optimised")
def test_optimised(name: str) -> None:
    """Code as people get it."""
    c = case(name)
    kernel = model(name, "virtual_power", "core").kernel("inverse", LEAN)
    assert "-O0" not in kernel.facts["flags"] and "unoptimised" not in str(kernel.facts["compiler"])
    for answer in (kernel.run(c.inputs), KernelValues(*ones(kernel, c.samples))):
        require_right(answer.values, answer.status, name)


@pytest.mark.parametrize(
    "name",
    few(["masticatory", "hexaglide", "mixed_k2_n8", "mixed_k4_n6"], "masticatory", "mixed_k2_n8"),
)
def test_variants_agree(name: str) -> None:
    """Quick, robust and of low latency: the same numbers where none is in doubt.

    With joints of two units A is too far from columns of one length for the quick one.
    """
    c, evaluator = case(name), model(name, "virtual_power", "core", "numpy")
    variants = variants_of(evaluator, LEAN)
    mixed = len({chain.kind for chain in c.mechanism.chains}) > 1 and variants.robust is not None
    programs = [*([] if mixed else [variants.main, variants.latency]), variants.robust]
    for program in filter(None, programs):
        answer = NumpyKernel(Programs(program), evaluator.system.numbers).run(c.inputs)
        require_right(answer.values, answer.status, name)


@pytest.mark.usefixtures("compiler_command")
def test_a_load_point_for_each_sample() -> None:
    """In both backends; each as in a batch of its own point."""
    c = case("masticatory")
    load = c.load.copy()
    load[:, 6:] += np.random.default_rng(0).normal(0, 0.02, (len(load), 3))
    truth = Interpreter(c.mechanism).solve(c.q, c.q1, c.q2, load)
    assert error(truth.effort, wanted("masticatory").effort) > 1e-3  # the points are felt
    for backend in ("compiled", "numpy"):
        evaluator = model("masticatory", "virtual_power", "core", backend)
        got = evaluator.inverse_dynamics(c.q, c.q1, c.q2, *parts(load))
        assert error(got.effort, truth.effort) < TOLERANCE
        assert error(got.contact_force, truth.contact_force) < TOLERANCE
        for i in range(3):
            alone = evaluator.inverse_dynamics(*(a[i] for a in (c.q, c.q1, c.q2, *parts(load))))
            assert error(alone.effort, got.effort[i]) < TOLERANCE
        with pytest.raises(AttributeError, match="pose was not requested"):
            _ = got.pose


def test_the_witness_agrees_with_itself() -> None:
    """By every formulation, in twists and in rates."""
    c = case("mixed_k2_n8")
    for formulation in FORMULATIONS:
        off = errors(Interpreter(c.mechanism, formulation).solve(*c.packed), wanted("mixed_k2_n8"))
        assert max(off.values()) < TOLERANCE, off
